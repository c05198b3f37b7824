//! One row: its values, of which only the wanted ones are read.

use super::super::ClipError;
use super::Database;
use std::cell::RefCell;

/// Maximum bytes of a record's header: a thousand columns.
const MAX_HEADER_BYTES: u64 = 4 << 10;

/// A row's record on its page: the first bytes, and the first overflow page of the others.
pub(super) struct Cell<'a> {
    number: i64,
    bytes: u64,
    pub local: &'a [u8],
    overflow: Option<u32>,
}

impl<'a> Cell<'a> {
    /// Parses a cell of a leaf page; `usable` is the page's size.
    pub fn parse(cell: &'a [u8], usable: usize) -> Option<Cell<'a>> {
        let (bytes, rest) = varint(cell)?;
        let (number, rest) = varint(rest)?;
        let longest = usable - 35;
        if bytes <= longest as u64 {
            let local = rest.get(..bytes as usize)?;
            return Some(Cell { number: number as i64, bytes, local, overflow: None });
        }
        let shortest = (usable - 12) * 32 / 255 - 23;
        let fitting = shortest + ((bytes - shortest as u64) % (usable as u64 - 4)) as usize;
        let local = rest.get(..if fitting <= longest { fitting } else { shortest })?;
        let overflow = rest.get(local.len()..)?.first_chunk()?;
        Some(Cell { number: number as i64, bytes, local, overflow: Some(u32::from_be_bytes(*overflow)) })
    }
}

/// A row of a table.
pub(in crate::clip) struct Row<'a> {
    database: &'a Database<'a>,
    cell: Cell<'a>,
    /// Type and offset of each value.
    values: Vec<(u64, u64)>,
    /// The overflow pages as far as they are known.
    chain: RefCell<Vec<u32>>,
}

impl<'a> Row<'a> {
    pub(super) fn new(database: &'a Database<'a>, cell: Cell<'a>) -> Result<Row<'a>, ClipError> {
        let damaged = || database.bad(format!("row {} is damaged", cell.number));
        if cell.bytes > database.region.bytes {
            return Err(damaged());
        }
        let (header_bytes, _) = varint(cell.local).ok_or_else(damaged)?;
        if header_bytes > MAX_HEADER_BYTES {
            return Err(damaged());
        }
        let header = cell.local.get(..header_bytes as usize).ok_or_else(damaged)?;
        let (_, mut types) = varint(header).ok_or_else(damaged)?;
        let (mut values, mut at) = (Vec::new(), header_bytes);
        while !types.is_empty() {
            let (kind, rest) = varint(types).ok_or_else(damaged)?;
            values.push((kind, at));
            at = at.checked_add(bytes_of(kind)).filter(|end| *end <= cell.bytes).ok_or_else(damaged)?;
            types = rest;
        }
        let chain = RefCell::new(cell.overflow.into_iter().collect());
        Ok(Row { database, cell, values, chain })
    }

    /// Returns a whole number; `None` for any other value.
    pub fn integer(&self, column: usize) -> Result<Option<i64>, ClipError> {
        let Some(&(kind, at)) = self.values.get(column) else { return Ok(None) };
        match kind {
            1..=6 => {
                let bytes = self.read(at, bytes_of(kind) as usize)?;
                let sign = if bytes.first().is_some_and(|first| first & 0x80 != 0) { -1 } else { 0 };
                Ok(Some(bytes.iter().fold(sign, |value, byte| (value << 8) | i64::from(*byte))))
            }
            8 => Ok(Some(0)),
            9 => Ok(Some(1)),
            _ => Ok(None),
        }
    }

    /// Returns the value of an `INTEGER PRIMARY KEY`, which is the row's number and not stored.
    pub fn id(&self, column: usize) -> Result<i64, ClipError> {
        Ok(self.integer(column)?.unwrap_or(self.cell.number))
    }

    /// Returns a number; `None` for any other value.
    pub fn real(&self, column: usize) -> Result<Option<f64>, ClipError> {
        match self.values.get(column) {
            Some(&(7, at)) => {
                let bytes = self.read(at, 8)?;
                Ok(bytes.first_chunk().map(|bytes| f64::from_be_bytes(*bytes)))
            }
            // SQLite stores whole numbers of a FLOAT column as integers.
            _ => Ok(self.integer(column)?.map(|value| value as f64)),
        }
    }

    /// Returns a blob; `None` for any other value. More than `max_bytes` are refused.
    pub fn blob(&self, column: usize, max_bytes: u64) -> Result<Option<Vec<u8>>, ClipError> {
        match self.values.get(column) {
            Some(&(kind, at)) if kind >= 12 && kind % 2 == 0 => self.bytes(kind, at, max_bytes).map(Some),
            _ => Ok(None),
        }
    }

    /// Returns a text; `None` for any other value. More than `max_bytes` are refused.
    pub fn text(&self, column: usize, max_bytes: u64) -> Result<Option<String>, ClipError> {
        match self.values.get(column) {
            Some(&(kind, at)) if kind >= 13 && kind % 2 == 1 => {
                Ok(String::from_utf8(self.bytes(kind, at, max_bytes)?).ok())
            }
            _ => Ok(None),
        }
    }

    fn bytes(&self, kind: u64, at: u64, max_bytes: u64) -> Result<Vec<u8>, ClipError> {
        let bytes = bytes_of(kind);
        if bytes > max_bytes {
            let number = self.cell.number;
            return Err(self.database.bad(format!("row {number} has a value of {bytes} bytes")));
        }
        self.read(at, bytes as usize)
    }

    /// Reads a part of the record; both numbers lie within it.
    fn read(&self, at: u64, bytes: usize) -> Result<Vec<u8>, ClipError> {
        let local = self.cell.local;
        let from = usize::try_from(at).unwrap_or(usize::MAX).min(local.len());
        let mut value = local[from..local.len().min(from.saturating_add(bytes))].to_vec();
        // The rest is on overflow pages: four bytes of the next page's number, then content.
        let per_page = self.database.usable as u64 - 4;
        while value.len() < bytes {
            let place = at + value.len() as u64 - local.len() as u64;
            let page = self.overflow((place / per_page) as usize)?;
            let content = &page[4 + (place % per_page) as usize..];
            value.extend_from_slice(&content[..content.len().min(bytes - value.len())]);
        }
        Ok(value)
    }

    /// Reads an overflow page, counted from 0.
    fn overflow(&self, index: usize) -> Result<Vec<u8>, ClipError> {
        let mut chain = self.chain.borrow_mut();
        loop {
            let known = chain.len().saturating_sub(1);
            let number = *chain.get(index.min(known)).unwrap_or(&0);
            let page = self.database.page(number)?;
            if index <= known {
                // The next page is known from now on: values are read in order.
                if index == known
                    && let Some(next) = page.first_chunk()
                {
                    chain.push(u32::from_be_bytes(*next));
                }
                return Ok(page);
            }
            let next = page.first_chunk().map_or(0, |next| u32::from_be_bytes(*next));
            chain.push(next);
        }
    }
}

/// Returns the bytes of a value of this type.
fn bytes_of(kind: u64) -> u64 {
    match kind {
        0 | 8 | 9 => 0,
        1..=4 => kind,
        5 => 6,
        6 | 7 => 8,
        // 10 and 11 are reserved and never stored.
        10 | 11 => 0,
        _ => (kind - 12) / 2,
    }
}

/// Splits a number of one to nine bytes from the bytes after it.
fn varint(bytes: &[u8]) -> Option<(u64, &[u8])> {
    let mut value = 0;
    for (index, &byte) in bytes.iter().take(9).enumerate() {
        if index == 8 {
            return Some(((value << 8) | u64::from(byte), &bytes[9..]));
        }
        value = (value << 7) | u64::from(byte & 0x7f);
        if byte < 0x80 {
            return Some((value, &bytes[index + 1..]));
        }
    }
    None
}
