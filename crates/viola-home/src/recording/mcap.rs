//! MCAP files (mcap.dev, version 0): chunks without compression, and an index at the end.
//!
//! The `mcap` crate would bring nine further crates, one of them no longer maintained, for the nine kinds of records
//! that are written here.

use super::schema::Kind;
use flate2::Crc;
use prost::Message;
use std::collections::BTreeMap;
use std::io::{self, Write};

const MAGIC: &[u8; 8] = b"\x89MCAP0\r\n";
/// Size from which a chunk is written.
const CHUNK_BYTES: usize = 1 << 20;

/// Kinds of records.
mod op {
    pub const HEADER: u8 = 0x01;
    pub const FOOTER: u8 = 0x02;
    pub const SCHEMA: u8 = 0x03;
    pub const CHANNEL: u8 = 0x04;
    pub const MESSAGE: u8 = 0x05;
    pub const CHUNK: u8 = 0x06;
    pub const MESSAGE_INDEX: u8 = 0x07;
    pub const CHUNK_INDEX: u8 = 0x08;
    pub const STATISTICS: u8 = 0x0b;
    pub const METADATA: u8 = 0x0c;
    pub const METADATA_INDEX: u8 = 0x0d;
    pub const SUMMARY_OFFSET: u8 = 0x0e;
    pub const DATA_END: u8 = 0x0f;
}

/// The contents of a record.
#[derive(Default)]
struct Fields(Vec<u8>);

impl Fields {
    fn u16(mut self, value: u16) -> Fields {
        self.0.extend_from_slice(&value.to_le_bytes());
        self
    }

    fn u32(mut self, value: u32) -> Fields {
        self.0.extend_from_slice(&value.to_le_bytes());
        self
    }

    fn u64(mut self, value: u64) -> Fields {
        self.0.extend_from_slice(&value.to_le_bytes());
        self
    }

    fn raw(mut self, bytes: &[u8]) -> Fields {
        self.0.extend_from_slice(bytes);
        self
    }

    /// Appends bytes after their length.
    fn bytes(self, bytes: &[u8]) -> Fields {
        self.u32(bytes.len() as u32).raw(bytes)
    }

    fn text(self, text: &str) -> Fields {
        self.bytes(text.as_bytes())
    }

    /// Returns the record: its kind and length, then its contents.
    fn record(self, kind: u8) -> Vec<u8> {
        let length = self.0.len() as u64;
        [&[kind][..], &length.to_le_bytes(), &self.0].concat()
    }
}

/// Records that are not written yet, and where the messages are among them.
#[derive(Default)]
struct Chunk {
    records: Vec<u8>,
    /// The channel and the offset of each message.
    messages: Vec<(u16, u64)>,
}

/// Writer of a file whose messages have one time, and whose topics have one message each.
pub struct Mcap<W: Write> {
    out: W,
    time_ns: u64,
    /// The schemas of all messages.
    descriptors: Vec<u8>,
    /// Bytes written, and their sum.
    end: u64,
    sum: Crc,
    chunk: Chunk,
    /// Names of the schemas; the place of a name is the schema's id less 1.
    schemas: Vec<&'static str>,
    messages: u16,
    chunks: u32,
    metadata: u32,
    /// Records of the index by kind, in the order of the file.
    index: BTreeMap<u8, Vec<u8>>,
}

impl<W: Write> Mcap<W> {
    pub fn new(out: W, time_ns: u64, descriptors: Vec<u8>) -> io::Result<Mcap<W>> {
        let mut file = Mcap {
            out,
            time_ns,
            descriptors,
            end: 0,
            sum: Crc::new(),
            chunk: Chunk::default(),
            schemas: Vec::new(),
            messages: 0,
            chunks: 0,
            metadata: 0,
            index: BTreeMap::new(),
        };
        file.write(MAGIC)?;
        let library = concat!("viola ", env!("CARGO_PKG_VERSION"));
        file.write(&Fields::default().text("").text(library).record(op::HEADER))?;
        Ok(file)
    }

    /// Writes the only message of a topic.
    pub fn message<M: Message + Kind>(&mut self, topic: &str, message: &M) -> io::Result<()> {
        // Channels are numbered as their messages are.
        let channel = self.messages;
        let count =
            channel.checked_add(1).ok_or_else(|| io::Error::other("a recording has at most 65535 topics"))?;
        let schema_id = self.schema(M::MESSAGE);
        let record = Fields::default().u16(channel).u16(schema_id).text(topic).text("protobuf").bytes(&[]);
        self.definition(op::CHANNEL, &record.record(op::CHANNEL));
        self.chunk.messages.push((channel, self.chunk.records.len() as u64));
        let record = Fields::default().u16(channel).u32(0).u64(self.time_ns).u64(self.time_ns);
        let record = record.raw(&message.encode_to_vec());
        self.chunk.records.extend_from_slice(&record.record(op::MESSAGE));
        self.messages = count;
        if self.chunk.records.len() >= CHUNK_BYTES { self.write_chunk() } else { Ok(()) }
    }

    /// Writes named notes.
    pub fn metadata(&mut self, name: &str, notes: &[(&str, String)]) -> io::Result<()> {
        self.write_chunk()?;
        let notes = notes.iter().fold(Fields::default(), |notes, (key, value)| notes.text(key).text(value));
        let record = Fields::default().text(name).bytes(&notes.0).record(op::METADATA);
        let index = Fields::default().u64(self.end).u64(record.len() as u64).text(name);
        self.index.entry(op::METADATA_INDEX).or_default().extend(index.record(op::METADATA_INDEX));
        self.metadata += 1;
        self.write(&record)
    }

    /// Writes the index.
    pub fn finish(mut self) -> io::Result<()> {
        self.write_chunk()?;
        let data_sum = self.sum.sum();
        self.write(&Fields::default().u32(data_sum).record(op::DATA_END))?;
        self.sum = Crc::new();
        let statistics = self.statistics();
        self.index.insert(op::STATISTICS, statistics);
        let summary_at = self.end;
        let mut offsets = Vec::new();
        for (kind, records) in std::mem::take(&mut self.index) {
            let offset = Fields::default().raw(&[kind]).u64(self.end).u64(records.len() as u64);
            offsets.extend(offset.record(op::SUMMARY_OFFSET));
            self.write(&records)?;
        }
        let offsets_at = self.end;
        self.write(&offsets)?;
        // The sum covers the footer up to itself.
        let footer = Fields::default().u64(summary_at).u64(offsets_at).u32(0).record(op::FOOTER);
        let (head, _) = footer.split_at(footer.len() - 4);
        self.write(head)?;
        let summary_sum = self.sum.sum();
        self.write(&summary_sum.to_le_bytes())?;
        self.write(MAGIC)?;
        self.out.flush()
    }

    fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.out.write_all(bytes)?;
        self.sum.update(bytes);
        self.end += bytes.len() as u64;
        Ok(())
    }

    /// Returns the id of a schema, which is defined by its first use.
    fn schema(&mut self, name: &'static str) -> u16 {
        if let Some(place) = self.schemas.iter().position(|known| *known == name) {
            return place as u16 + 1;
        }
        self.schemas.push(name);
        let id = self.schemas.len() as u16;
        let record = Fields::default().u16(id).text(name).text("protobuf").bytes(&self.descriptors);
        self.definition(op::SCHEMA, &record.record(op::SCHEMA));
        id
    }

    /// Adds a definition to the chunk and to the index.
    fn definition(&mut self, kind: u8, record: &[u8]) {
        self.chunk.records.extend_from_slice(record);
        self.index.entry(kind).or_default().extend_from_slice(record);
    }

    fn write_chunk(&mut self) -> io::Result<()> {
        let Chunk { records, messages } = std::mem::take(&mut self.chunk);
        if records.is_empty() {
            return Ok(());
        }
        let (time_ns, bytes) = (self.time_ns, records.len() as u64);
        let mut sum = Crc::new();
        sum.update(&records);
        let at = self.end;
        let chunk = Fields::default().u64(time_ns).u64(time_ns).u64(bytes).u32(sum.sum()).text("");
        self.write(&chunk.u64(bytes).raw(&records).record(op::CHUNK))?;
        let length = self.end - at;
        let mut places = Fields::default();
        for (channel, offset) in messages {
            places = places.u16(channel).u64(self.end);
            let message = Fields::default().u64(time_ns).u64(offset);
            self.write(&Fields::default().u16(channel).bytes(&message.0).record(op::MESSAGE_INDEX))?;
        }
        let index = Fields::default().u64(time_ns).u64(time_ns).u64(at).u64(length).bytes(&places.0);
        let index = index.u64(self.end - at - length).text("").u64(bytes).u64(bytes);
        self.index.entry(op::CHUNK_INDEX).or_default().extend(index.record(op::CHUNK_INDEX));
        self.chunks += 1;
        Ok(())
    }

    fn statistics(&self) -> Vec<u8> {
        let counts = (0..self.messages).fold(Fields::default(), |counts, channel| counts.u16(channel).u64(1));
        let messages = self.messages;
        Fields::default()
            .u64(u64::from(messages))
            .u16(self.schemas.len() as u16)
            .u32(u32::from(messages))
            // Attachments.
            .u32(0)
            .u32(self.metadata)
            .u32(self.chunks)
            .u64(self.time_ns)
            .u64(self.time_ns)
            .bytes(&counts.0)
            .record(op::STATISTICS)
    }
}
