//! Blobs that no row names any more, or that never had one: what a killed process leaves.

use super::columns::Columns;
use super::database::{Connection, query};
use super::{Storage, StorageError};
use jiff::Timestamp;
use std::collections::{HashMap, HashSet};

/// The rows of a statement whose value is among some, which are bound as a JSON list.
macro_rules! among {
    ($statement:literal) => {
        [
            concat!($statement, " IN (SELECT value FROM json_each($1))"),
            concat!($statement, " IN (SELECT jsonb_array_elements_text(CAST($1 AS JSONB)))"),
        ]
    };
}

/// What rows name: by what the keys of their blobs have in common.
const NAMED: [[&str; 2]; 5] = [
    among!("SELECT id AS name FROM clips WHERE id"),
    among!("SELECT result_key AS name FROM clips WHERE result_key"),
    among!("SELECT id AS name FROM lidar_maps WHERE id"),
    among!("SELECT blob_key AS name FROM home_map_files WHERE blob_key"),
    among!("SELECT blob_key AS name FROM upload_pieces WHERE blob_key"),
];

/// Which of the statements a key is found by, and under which name. None for what is not ours; that is removed.
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

impl Storage {
    /// Removes blobs that were written before `older_than` and that no row names, and files of then that were never
    /// kept; tells how many. A row follows its blob within seconds, and a job or a merge within an hour.
    pub async fn sweep(&self, older_than: Timestamp) -> Result<u64, StorageError> {
        let look = |keys: Vec<String>| async move { named(&mut self.database.reader().await?, &keys).await };
        self.blobs.sweep(older_than, look).await
    }
}

async fn named(connection: &mut Connection, keys: &[String]) -> Result<HashSet<String>, StorageError> {
    let mut asked: HashMap<usize, HashSet<&str>> = HashMap::new();
    for (statement, name) in keys.iter().filter_map(|key| name_of(key)) {
        asked.entry(statement).or_default().insert(name);
    }
    let mut found: HashSet<(usize, String)> = HashSet::new();
    for (statement, names) in asked {
        let [sqlite, postgres] = NAMED[statement];
        let names = serde_json::to_string(&names).unwrap_or_default();
        let rows = query(connection.either(sqlite, postgres)).bind(names).fetch_all(connection).await?;
        for row in &rows {
            found.insert((statement, row.text("name")?));
        }
    }
    let is_named = |key: &&String| {
        name_of(key).is_some_and(|(statement, name)| found.contains(&(statement, name.to_owned())))
    };
    Ok(keys.iter().filter(is_named).cloned().collect())
}
