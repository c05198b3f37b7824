//! Tables of SQLite databases, row after row (sqlite.org/fileformat2.html). There is no SQL: a file from a stranger
//! is read by position, with limits, like every other format. Indices, views and tables WITHOUT ROWID are not read.

mod row;
mod schema;

pub(super) use row::Row;

use super::ClipError;
use crate::container::{ContainerError, Region};
use row::Cell;
use std::cell::Cell as Counter;

const MAGIC: &[u8; 16] = b"SQLite format 3\0";
/// Depth of a tree of 2^31 pages with four children each.
const MAX_DEPTH: u32 = 16;
/// Maximum reads of the average page. A sound file needs two: pages that hold the ends of two values.
const READS_PER_PAGE: u64 = 6;
const MAX_TABLES: usize = 1000;
const MAX_SQL_BYTES: u64 = 64 << 10;
/// Bytes of a tree page's header with and without a last child.
const INTERIOR_HEADER: usize = 12;
const LEAF_HEADER: usize = 8;

/// An open database.
pub(super) struct Database<'a> {
    region: &'a Region,
    name: &'a str,
    page_bytes: usize,
    /// Page size without the bytes that extensions reserve.
    usable: usize,
    pages: u64,
    /// Pages that may still be read.
    reads_left: Counter<u64>,
    tables: Vec<Table>,
}

/// A table's place and the names of its columns.
pub(super) struct Table {
    name: String,
    columns: Vec<String>,
    root: u32,
}

impl Table {
    /// Returns the position of a column.
    pub fn column(&self, name: &str) -> Option<usize> {
        self.columns.iter().position(|column| column.eq_ignore_ascii_case(name))
    }
}

impl<'a> Database<'a> {
    /// Reads the list of the tables; returns `None` if the file is not a database.
    pub fn open(region: &'a Region, name: &'a str) -> Result<Option<Database<'a>>, ClipError> {
        let head = region.head::<100>();
        let head = head.map_err(|source| ContainerError::Unreadable { name: name.to_string(), source })?;
        let Some(header) = head.filter(|header| header.starts_with(MAGIC)) else { return Ok(None) };
        let page_bytes = match u16::from_be_bytes([header[16], header[17]]) {
            1 => 65_536,
            bytes => usize::from(bytes),
        };
        let usable = page_bytes.saturating_sub(usize::from(header[20]));
        let pages = region.bytes / page_bytes.max(1) as u64;
        let reads_left = Counter::new(pages.saturating_mul(READS_PER_PAGE).saturating_add(64));
        let mut database =
            Database { region, name, page_bytes, usable, pages, reads_left, tables: Vec::new() };
        if !page_bytes.is_power_of_two() || page_bytes < 512 || usable < 480 {
            return Err(database.bad(format!("its pages cannot have {page_bytes} bytes")));
        }
        // Texts in UTF-16 are not expected: no recorder writes them.
        if !matches!(header[59], 0 | 1) {
            return Err(database.bad("its texts are not in UTF-8".into()));
        }
        let mut tables = Vec::new();
        database.walk(1, 0, &mut |row| {
            if row.text(0, MAX_SQL_BYTES)?.as_deref() == Some("table") && tables.len() < MAX_TABLES {
                tables.extend(schema::table(row)?);
            }
            Ok(())
        })?;
        database.tables = tables;
        Ok(Some(database))
    }

    pub fn table(&self, name: &str) -> Option<&Table> {
        self.tables.iter().find(|table| table.name.eq_ignore_ascii_case(name))
    }

    /// Visits the rows of a table in the order of their numbers.
    pub fn rows(
        &self,
        table: &Table,
        visit: &mut dyn FnMut(&Row) -> Result<(), ClipError>,
    ) -> Result<(), ClipError> {
        self.walk(table.root, 0, visit)
    }

    fn walk(
        &self,
        number: u32,
        depth: u32,
        visit: &mut dyn FnMut(&Row) -> Result<(), ClipError>,
    ) -> Result<(), ClipError> {
        if depth > MAX_DEPTH {
            return Err(self.bad(format!("page {number} is too deep in its tree")));
        }
        let page = self.page(number)?;
        let damaged = || self.bad(format!("page {number} is damaged"));
        // The first page begins with the file's header.
        let tree = page.get(if number == 1 { 100 } else { 0 }..).ok_or_else(damaged)?;
        let header_bytes = match tree.first() {
            Some(5) => INTERIOR_HEADER,
            Some(13) => LEAF_HEADER,
            _ => return Err(self.bad(format!("page {number} is not part of a table"))),
        };
        let (header, pointers) = tree.split_at_checked(header_bytes).ok_or_else(damaged)?;
        let cells = usize::from(u16::from_be_bytes([header[3], header[4]]));
        let mut room = page.len();
        for pointer in pointers.as_chunks().0.get(..cells).ok_or_else(damaged)? {
            let cell = page.get(usize::from(u16::from_be_bytes(*pointer))..).ok_or_else(damaged)?;
            if header_bytes == INTERIOR_HEADER {
                let child = cell.first_chunk().ok_or_else(damaged)?;
                self.walk(u32::from_be_bytes(*child), depth + 1, visit)?;
            } else {
                let cell = Cell::parse(cell, self.usable).ok_or_else(damaged)?;
                // Cells that overlap would repeat the work for one of them thousands of times.
                room = room.checked_sub(cell.local.len()).ok_or_else(damaged)?;
                visit(&Row::new(self, cell)?)?;
            }
        }
        if let Some(last) = header.get(LEAF_HEADER..).and_then(<[u8]>::first_chunk) {
            self.walk(u32::from_be_bytes(*last), depth + 1, visit)?;
        }
        Ok(())
    }

    /// Reads a page, counted from 1.
    fn page(&self, number: u32) -> Result<Vec<u8>, ClipError> {
        if number == 0 || u64::from(number) > self.pages {
            return Err(self.bad(format!("it has no page {number}; send the whole file")));
        }
        let left = self.reads_left.get().checked_sub(1);
        self.reads_left.set(left.ok_or_else(|| self.bad("its pages refer to each other in circles".into()))?);
        let mut page = vec![0; self.page_bytes];
        let at = (u64::from(number) - 1) * self.page_bytes as u64;
        let read = self.region.read_exact_at(at, &mut page);
        read.map_err(|source| ContainerError::Unreadable { name: self.name.to_string(), source })?;
        page.truncate(self.usable);
        Ok(page)
    }

    /// Returns the size of the file.
    pub fn bytes(&self) -> u64 {
        self.region.bytes
    }

    fn bad(&self, reason: String) -> ClipError {
        ClipError::BadMetadata { name: self.name.to_string(), reason }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns a database of one page, whose rows are all in one place.
    fn with_rows(count: u8) -> Region {
        const AT: u16 = 400;
        let mut page = [0; 512];
        page[..16].copy_from_slice(MAGIC);
        page[16] = 2;
        page[100] = 13;
        page[104] = count;
        for pointer in page[108..].as_chunks_mut().0.iter_mut().take(count.into()) {
            *pointer = AT.to_be_bytes();
        }
        // A record of eight bytes with one column, which is empty.
        page[usize::from(AT)..][..4].copy_from_slice(&[8, 1, 2, 0]);
        let mut file = tempfile::tempfile().unwrap();
        std::io::Write::write_all(&mut file, &page).unwrap();
        Region::whole(file).unwrap()
    }

    #[test]
    fn rows_that_have_no_room_on_their_page_are_refused() {
        for (count, is_read) in [(0, true), (64, true), (65, false), (140, false)] {
            let region = with_rows(count);
            let opened = Database::open(&region, "a.db").map(|database| database.is_some());
            match opened {
                Ok(opened) => assert!(opened && is_read, "{count}"),
                Err(error) => assert!(!is_read && error.to_string().contains("page 1 is damaged"), "{error}"),
            }
        }
    }
}
