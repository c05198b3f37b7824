//! The video track of a file: its coding, its samples, and their presentation order.

use super::boxes::{self, Box};
use super::parameters::Format;
use super::samples::{self, Sample};
use super::{Codec, VideoError, VideoInfo};
use crate::container::Region;
use mp4_atom::{Atom, Avcc, Colr, Elst, Hvcc, Mdhd, Mvhd, Tkhd};

/// Length of the fields before the boxes in a picture's sample entry (ISO/IEC 14496-12, section 12.1.3).
const VISUAL_ENTRY_BYTES: usize = 78;
/// Maximum number of pictures that wait for one shown before them, by the standards.
const MAX_REORDER: usize = 16;

/// All data for decoding.
#[derive(Debug)]
pub struct Track {
    pub codec: Codec,
    pub format: Format,
    /// Bytes of the length before each unit of a sample.
    pub length_bytes: u8,
    /// The track's one sequence parameter set.
    pub sps: Vec<u8>,
    /// Other parameter sets, in a decoder's order: `vps` before the sequence's, `pps` after.
    pub vps: Vec<Vec<u8>>,
    pub pps: Vec<Vec<u8>>,
    /// In decoding order.
    pub samples: Vec<Sample>,
    /// Sample of each frame, in presentation order; samples cut by the edit list have no frame.
    pub shown: Vec<usize>,
    /// Maximum number of decoded samples that wait for one shown before them.
    pub reorder: usize,
    rotation_deg: u16,
    ticks_per_s: u32,
}

impl Track {
    pub fn read(region: &Region) -> Result<Track, VideoError> {
        let moov = boxes::read_moov(region)?;
        let top = boxes::children(&moov)?;
        let movie: Mvhd = boxes::read(&top, "mvhd")?.ok_or(VideoError::malformed("no movie header"))?;
        let fragmented = boxes::find(&top, b"mvex").is_some();
        let mut first = None;
        for track in top.iter().filter(|found| &found.kind == b"trak") {
            let Ok(parts) = boxes::children(track.body) else { continue };
            let Ok(media) = boxes::inside(&parts, b"mdia", "mdia") else { continue };
            // The handler's kind comes after its version, flags and a reserved number.
            let handler = boxes::find(&media, b"hdlr").and_then(|found| found.body.get(8..12));
            if handler == Some(&b"vide"[..]) {
                first = Some((parts, media));
                break;
            }
        }
        let (parts, media) = first.ok_or(VideoError::NoVideoTrack)?;
        let tables = boxes::inside(&boxes::inside(&media, b"minf", "minf")?, b"stbl", "stbl")?;
        let entry = Entry::read(&tables)?;
        if fragmented && boxes::find(&tables, b"stsz").is_none_or(|found| found.body.ends_with(&[0; 8])) {
            return Err(VideoError::Fragmented);
        }
        let header: Tkhd = boxes::read(&parts, "tkhd")?.ok_or(VideoError::malformed("no track header"))?;
        let clock: Mdhd = boxes::read(&media, "mdhd")?.ok_or(VideoError::malformed("no media header"))?;
        if clock.timescale == 0 || movie.timescale == 0 {
            return Err(VideoError::malformed("a time scale of zero"));
        }
        let samples = samples::read(&tables, region.bytes)?;
        let edits = match boxes::find(&parts, b"edts") {
            Some(found) => boxes::read::<Elst>(&boxes::children(found.body)?, "the edit list")?,
            None => None,
        };
        let cut = cut(edits.as_ref(), clock.timescale, movie.timescale)?;
        let shown = shown(&samples, cut);
        if shown.is_empty() {
            return Err(VideoError::malformed("a track that shows nothing"));
        }
        let reorder = reorder(&samples);
        if reorder > MAX_REORDER {
            return Err(VideoError::malformed("pictures shown long after they are decoded"));
        }
        let Entry { codec, format, length_bytes, sps, vps, pps } = entry;
        let (rotation_deg, ticks_per_s) = (rotation_deg(&header), clock.timescale);
        Ok(Track {
            codec,
            format,
            length_bytes,
            sps,
            vps,
            pps,
            samples,
            shown,
            reorder,
            rotation_deg,
            ticks_per_s,
        })
    }

    pub fn info(&self) -> VideoInfo {
        let at = |sample: &usize| self.samples[*sample].shown_at;
        let first = self.shown.first().map_or(0, at);
        let seconds = |sample| (at(sample) - first) as f64 / f64::from(self.ticks_per_s);
        VideoInfo {
            codec: self.codec,
            width: self.format.width,
            height: self.format.height,
            rotation_deg: self.rotation_deg,
            time_s: self.shown.iter().map(seconds).collect(),
        }
    }
}

/// The sample description: the coding of the pictures.
struct Entry {
    codec: Codec,
    format: Format,
    length_bytes: u8,
    sps: Vec<u8>,
    vps: Vec<Vec<u8>>,
    pps: Vec<Vec<u8>>,
}

impl Entry {
    fn read(tables: &[Box<'_>]) -> Result<Entry, VideoError> {
        const DAMAGED: &str = "the sample description";
        let table = boxes::find(tables, b"stsd").ok_or(VideoError::malformed(DAMAGED))?;
        let entries = boxes::children(table.body.get(8..).ok_or(VideoError::malformed(DAMAGED))?)?;
        let entry = match entries.as_slice() {
            [] => return Err(VideoError::malformed(DAMAGED)),
            [entry] => entry,
            _ => return Err(VideoError::SeveralDescriptions),
        };
        let codec = match &entry.kind {
            b"avc1" | b"avc3" => Codec::H264,
            b"hvc1" | b"hev1" => Codec::Hevc,
            b"encv" => return Err(VideoError::Encrypted),
            other => {
                let found = other.iter().map(|letter| char::from(*letter)).filter(|c| c.is_ascii_graphic());
                return Err(VideoError::Codec { found: found.collect() });
            }
        };
        let parts = entry.body.get(VISUAL_ENTRY_BYTES..).ok_or(VideoError::malformed(DAMAGED))?;
        let parts = boxes::children(parts)?;
        if boxes::find(&parts, b"sinf").is_some() {
            return Err(VideoError::Encrypted);
        }
        let colour =
            boxes::find(&parts, b"colr").and_then(|found| Colr::decode_body(&mut &found.body[..]).ok());
        let (length_bytes, sps, vps, pps) = match codec {
            Codec::H264 => h264(boxes::read(&parts, DAMAGED)?)?,
            Codec::Hevc => hevc(boxes::read(&parts, DAMAGED)?)?,
        };
        let sps = one(sps)?;
        let format = Format::read(codec, &sps, colour.as_ref())?;
        Ok(Entry { codec, format, length_bytes, sps, vps, pps })
    }
}

type Sets = (u8, Vec<Vec<u8>>, Vec<Vec<u8>>, Vec<Vec<u8>>);

fn h264(record: Option<Avcc>) -> Result<Sets, VideoError> {
    let record = record.ok_or(VideoError::malformed("no avcC"))?;
    // Three bytes are not allowed (ISO/IEC 14496-15, section 5.3.3.1.2).
    if record.length_size == 3 {
        return Err(VideoError::malformed("avcC"));
    }
    Ok((record.length_size, record.sequence_parameter_sets, Vec::new(), record.picture_parameter_sets))
}

fn hevc(record: Option<Hvcc>) -> Result<Sets, VideoError> {
    let record = record.ok_or(VideoError::malformed("no hvcC"))?;
    let of = |kind: u8| -> Vec<Vec<u8>> {
        let arrays = record.arrays.iter().filter(|array| array.nal_unit_type == kind);
        arrays.flat_map(|array| array.nalus.iter().cloned()).collect()
    };
    Ok((record.length_size_minus_one + 1, of(33), of(32), of(34)))
}

/// Returns the one set of the whole track: decoding restarts with each group of pictures.
fn one(mut sets: Vec<Vec<u8>>) -> Result<Vec<u8>, VideoError> {
    sets.dedup();
    match <[Vec<u8>; 1]>::try_from(sets) {
        Ok([set]) => Ok(set),
        Err(sets) if sets.is_empty() => {
            Err(VideoError::Unsupported { what: "no sequence parameters in its head" })
        }
        Err(_) => Err(VideoError::SeveralDescriptions),
    }
}

/// Returns the first time that is shown, and the end of the shown part, in units of the track's clock.
fn cut(edits: Option<&Elst>, track_per_s: u32, movie_per_s: u32) -> Result<(i64, i64), VideoError> {
    let entries = edits.map(|list| list.entries.as_slice()).unwrap_or_default();
    let wait = entries.iter().take_while(|entry| entry.media_time.is_none()).count();
    let edit = match &entries[wait..] {
        [] if wait > 0 => return Err(VideoError::EditList { what: "it shows nothing" }),
        [] => return Ok((i64::MIN, i64::MAX)),
        [edit] => edit,
        _ => return Err(VideoError::EditList { what: "several parts" }),
    };
    if edit.media_rate.integer() != 1 || edit.media_rate.decimal() != 0 {
        return Err(VideoError::EditList { what: "another speed" });
    }
    let start = i64::try_from(edit.media_time.unwrap_or(0)).unwrap_or(i64::MAX);
    // The duration is in the movie's clock. A duration of 0 is up to the end.
    let scaled = |d: u64| {
        (u128::from(d) * u128::from(track_per_s) + u128::from(movie_per_s / 2)) / u128::from(movie_per_s)
    };
    let end = match edit.segment_duration {
        0 => i64::MAX,
        duration => start.saturating_add(i64::try_from(scaled(duration)).unwrap_or(i64::MAX)),
    };
    Ok((start, end))
}

/// Returns the samples in presentation order; those shown at the same time stay in decoding order.
fn shown(samples: &[Sample], (start, end): (i64, i64)) -> Vec<usize> {
    let inside = |sample: &usize| (start..end).contains(&samples[*sample].shown_at);
    let mut shown: Vec<usize> = (0..samples.len()).filter(inside).collect();
    shown.sort_by_key(|sample| samples[*sample].shown_at);
    shown
}

/// Returns the maximum number of samples decoded before, but shown after, another: the reorder depth.
fn reorder(samples: &[Sample]) -> usize {
    let mut waiting = std::collections::BTreeSet::new();
    let mut most = 0;
    let mut order: Vec<usize> = (0..samples.len()).collect();
    order.sort_by_key(|sample| samples[*sample].shown_at);
    let mut turn = order.into_iter().peekable();
    for sample in 0..samples.len() {
        waiting.insert(sample);
        while turn.next_if(|next| waiting.contains(next)).map(|next| waiting.remove(&next)).is_some() {}
        most = most.max(waiting.len());
    }
    most
}

/// Returns the quarter turn nearest to the track's matrix.
fn rotation_deg(header: &Tkhd) -> u16 {
    let degrees = f64::from(header.matrix.b).atan2(f64::from(header.matrix.a)).to_degrees();
    ((degrees / 90.0).round() as i32 * 90).rem_euclid(360) as u16
}
