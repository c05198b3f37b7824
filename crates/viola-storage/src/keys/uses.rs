//! The last use of keys. It is noted beside the request, which must not wait for a writer of the database.

use super::super::database::{Database, query};
use jiff::Timestamp;
use std::collections::HashSet;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use tracing::warn;
use uuid::Uuid;

/// The keys whose use is being noted.
#[derive(Clone, Default)]
pub(crate) struct KeyUses(Arc<Mutex<HashSet<Uuid>>>);

impl KeyUses {
    /// Notes the use of a key in a task of its own: one at a time for each key, since a writer may be busy for long.
    pub fn note(&self, database: &Database, key: Uuid, now: Timestamp) {
        if !self.being_noted().insert(key) {
            return;
        }
        let (uses, database) = (self.clone(), database.clone());
        tokio::spawn(async move {
            let note = query("UPDATE api_keys SET last_used_at = $2 WHERE id = $1");
            let note = note.bind(key.to_string()).bind(now.as_millisecond());
            if let Err(error) = database.execute(note).await {
                warn!(%key, %error, "the use of a key could not be noted");
            }
            uses.being_noted().remove(&key);
        });
    }

    /// Returns the number of keys whose use is being noted.
    #[cfg(test)]
    pub fn len(&self) -> usize {
        self.being_noted().len()
    }

    fn being_noted(&self) -> MutexGuard<'_, HashSet<Uuid>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
