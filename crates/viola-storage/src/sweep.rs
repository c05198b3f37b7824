//! Blobs that no row names: leftovers of killed processes, or of a lost database.

use super::columns::to_json;
use super::database::{Connection, listed, query};
use super::{Storage, StorageError};
use jiff::Timestamp;
use std::collections::{HashMap, HashSet};

/// Statements that find rows by the common part of their blobs' keys.
const NAMED: [&str; 5] = [
    concat!("SELECT id AS name FROM clips WHERE id IN ", listed!("$1")),
    concat!(
        "SELECT result_key AS name FROM clips WHERE result_key IN ",
        listed!("$1"),
        " UNION ALL SELECT last_result_key FROM clips WHERE last_result_key IN ",
        listed!("$1")
    ),
    concat!("SELECT id AS name FROM lidar_maps WHERE id IN ", listed!("$1")),
    concat!("SELECT blob_key AS name FROM home_map_files WHERE blob_key IN ", listed!("$1")),
    concat!("SELECT blob_key AS name FROM upload_pieces WHERE blob_key IN ", listed!("$1")),
];

/// Finds pending deletes. The deletion removes those blobs, and a sweep leaves them alone.
const DOOMED: &str = concat!(
    "SELECT gone.value AS name FROM doomed_blobs, jsonb_array_elements_text(CAST(blob_keys AS JSONB)) AS gone
    WHERE gone.value IN ",
    listed!("$1")
);

/// Returns the index of the statement in [`NAMED`] and the name that find a key; `None` for a foreign file.
fn name_of(key: &str) -> Option<(usize, &str)> {
    let parts: Vec<&str> = key.split('/').collect();
    match parts.as_slice() {
        ["clips", id, "file"] => Some((0, id)),
        ["clips", _, "results", _, name] => Some((1, &key[..key.len() - name.len() - 1])),
        ["lidar-maps", id, _] => Some((2, id)),
        ["home-maps", _] => Some((3, key)),
        ["uploads", _] => Some((4, key)),
        _ => None,
    }
}

/// Owner of an unnamed blob.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
enum Owner<'a> {
    /// A recording, a LiDAR map or an upload, which only its client has. All pieces of an upload are one.
    Sent(&'a str),
    /// A result or a home map, which can be computed again.
    Made(&'a str),
}

fn owner_of(key: &str) -> Owner<'_> {
    match name_of(key) {
        Some((1 | 3, name)) => Owner::Made(name),
        // `uploads/UPLOAD-PIECE`, two UUIDs.
        Some((4, name)) => Owner::Sent(name.get(.."uploads/".len() + 36).unwrap_or(name)),
        Some((_, name)) => Owner::Sent(name),
        None => Owner::Sent(key),
    }
}

/// A sweep removes at most one blob per this many named ones, or the numbers below if they are larger. A
/// killed process leaves far less: more means that the database is older than its blobs, or another one's.
const NAMED_FOR_ONE_REMOVED: u64 = 100;

/// A client's file lacks its row only between its last fsync and the commit: one for each request cut off
/// there.
const MAX_SENT: u64 = 16;

/// A killed worker leaves the results of its jobs and the tiles of its merges.
const MAX_MADE: u64 = 1000;

/// Limit of a sweep.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SweepLimit {
    /// Leftovers of killed processes. Nothing is removed if there is more.
    Leftovers,
    /// All blobs that no row names.
    Everything,
}

impl Storage {
    /// Removes blobs without a row and files that never became blobs, if written before `older_than`; returns
    /// their number. A row follows its blob within seconds, and that of a job or a merge within an hour. Removes nothing of a
    /// store that is not this database's.
    pub async fn sweep(&self, older_than: Timestamp, limit: SweepLimit) -> Result<u64, StorageError> {
        self.check_store().await?;
        let mut removed = 0;
        loop {
            let unnamed = self.blobs.unnamed(older_than, |keys| self.named(keys)).await?;
            if limit == SweepLimit::Leftovers {
                check(&unnamed.keys, unnamed.more, unnamed.named)?;
            }
            self.blobs.sweep(&unnamed).await?;
            removed += unnamed.leftovers + unnamed.keys.len() as u64;
            if unnamed.more == 0 {
                return Ok(removed);
            }
        }
    }

    /// Returns the keys among these that rows name.
    pub(super) async fn named(&self, keys: Vec<String>) -> Result<HashSet<String>, StorageError> {
        named(&mut self.database.reader().await?, &keys).await
    }
}

/// Refuses more unnamed blobs than killed processes leave. `more` is their number beyond `keys`.
fn check(keys: &[String], more: u64, named: u64) -> Result<(), StorageError> {
    let owners: HashSet<Owner> = keys.iter().map(|key| owner_of(key)).collect();
    let sent = owners.iter().filter(|owner| matches!(owner, Owner::Sent(_))).count() as u64;
    let made = owners.len() as u64 - sent;
    let fraction = named / NAMED_FOR_ONE_REMOVED;
    // A database that names no blob at all may be a new one.
    let max_sent = if named == 0 { 0 } else { fraction.max(MAX_SENT) };
    if sent > max_sent || made + more > fraction.max(MAX_MADE) {
        return Err(StorageError::TooMuchToSweep { sent, made: made + more, named });
    }
    Ok(())
}

async fn named(connection: &mut Connection, keys: &[String]) -> Result<HashSet<String>, StorageError> {
    let mut asked: HashMap<usize, HashSet<&str>> = HashMap::new();
    for (statement, name) in keys.iter().filter_map(|key| name_of(key)) {
        asked.entry(statement).or_default().insert(name);
    }
    let mut found: HashSet<(usize, String)> = HashSet::new();
    for (statement, names) in asked {
        for name in names_among(connection, NAMED[statement], &names).await? {
            found.insert((statement, name));
        }
    }
    let doomed = names_among(connection, DOOMED, &keys.iter().map(String::as_str).collect()).await?;
    let is_named = |key: &&String| {
        let is_of_row =
            name_of(key).is_some_and(|(statement, name)| found.contains(&(statement, name.to_owned())));
        is_of_row || doomed.contains(*key)
    };
    Ok(keys.iter().filter(is_named).cloned().collect())
}

async fn names_among(
    connection: &mut Connection,
    statement: &'static str,
    names: &HashSet<&str>,
) -> Result<HashSet<String>, StorageError> {
    let rows = query(statement).bind(to_json(names)).fetch_all(connection).await?;
    rows.iter().map(|row| row.text("name")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use uuid::Uuid;

    fn recordings(number: usize) -> Vec<String> {
        (0..number).map(|_| format!("clips/{}/file", Uuid::now_v7())).collect()
    }

    fn tiles(number: usize) -> Vec<String> {
        (0..number).map(|_| format!("home-maps/{}", Uuid::now_v7())).collect()
    }

    #[test]
    fn a_small_part_may_go_and_a_large_one_not() {
        assert!(check(&recordings(16), 0, 1).is_ok());
        assert!(check(&recordings(17), 0, 1).is_err());
        assert!(check(&recordings(17), 0, 1700).is_ok(), "one in a hundred");
        assert!(check(&recordings(1), 0, 0).is_err(), "nothing is named");
        assert!(check(&tiles(1000), 0, 0).is_ok());
        assert!(check(&tiles(1001), 0, 1000).is_err());
        assert!(check(&tiles(1000), 1, 1000).is_err(), "and one that is not in memory");
        let foreign: Vec<String> = (0..17).map(|number| format!("backup/{number}")).collect();
        assert!(check(&foreign, 0, 100).is_err(), "files of somebody else");
    }

    #[test]
    fn an_upload_counts_once() {
        let upload = Uuid::now_v7();
        let pieces: Vec<String> = (0..500).map(|_| format!("uploads/{upload}-{}", Uuid::now_v7())).collect();
        assert!(check(&pieces, 0, 1).is_ok());
    }
}
