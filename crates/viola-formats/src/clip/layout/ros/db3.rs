//! Bags of rosbag2's SQLite storage: `topics` and `messages` (ros2/rosbag2, sqlite_storage.cpp).

use super::message::{Kind, MAX_MESSAGE_BYTES, MAX_TOPICS, Visit};
use crate::clip::ClipError;
use crate::clip::sqlite::{Database, Table};
use std::collections::BTreeMap;

const MAX_TEXT_BYTES: u64 = 4 << 10;

/// Returns the tables of topics and messages; `None` if the database is not a bag.
pub(super) fn tables<'a>(database: &'a Database) -> Option<(&'a Table, &'a Table)> {
    Some((database.table("topics")?, database.table("messages")?))
}

/// Visits the messages of a bag.
pub(super) fn read(database: &Database, name: &str, visit: Visit) -> Result<(), ClipError> {
    let bad = |reason: String| ClipError::BadMetadata { name: name.to_string(), reason };
    let (topics, messages) = tables(database).ok_or_else(|| bad("it is no bag of rosbag2".into()))?;
    let column = |table: &Table, column: &str| {
        table.column(column).ok_or_else(|| bad(format!("a table has no column {column}")))
    };
    let (id, topic, kind) = (column(topics, "id")?, column(topics, "name")?, column(topics, "type")?);
    let format = column(topics, "serialization_format")?;
    let mut wanted = BTreeMap::new();
    database.rows(topics, &mut |row| {
        let text = |column| Ok::<_, ClipError>(row.text(column, MAX_TEXT_BYTES)?.unwrap_or_default());
        if let Some(kind) =
            Kind::of(&text(kind)?).filter(|_| text(format).is_ok_and(|format| format == "cdr"))
        {
            wanted.insert(row.id(id)?, (text(topic)?, kind));
        }
        if wanted.len() > MAX_TOPICS {
            return Err(bad(format!("it has more than {MAX_TOPICS} topics")));
        }
        Ok(())
    })?;
    let (topic, data) = (column(messages, "topic_id")?, column(messages, "data")?);
    database.rows(messages, &mut |row| {
        let topic = row.integer(topic)?.and_then(|topic| wanted.get(&topic));
        let Some((topic, kind)) = topic else { return Ok(()) };
        match row.blob(data, MAX_MESSAGE_BYTES)? {
            Some(message) => visit(topic, *kind, &message),
            None => Ok(()),
        }
    })
}
