//! The text in which searches find a home: its id and its name in lower case.
//!
//! Rust lowers every letter. The databases lower those of ASCII only, and processes from before the column leave it empty.

use super::HomeId;
use crate::database::query;
use crate::{Storage, StorageError};

/// Homes that are filled in one transaction.
const AT_ONCE: i64 = 1000;

/// Returns the text of a home.
pub(super) fn search_text(id: &HomeId, name: Option<&str>) -> String {
    format!("{id} {}", name.unwrap_or_default()).to_lowercase()
}

impl Storage {
    /// Writes the text of the homes without one.
    pub(crate) async fn fill_searches(&self) -> Result<(), StorageError> {
        loop {
            let rows =
                query("SELECT id, name FROM homes WHERE search = '' ORDER BY id LIMIT $1").bind(AT_ONCE);
            let rows = rows.fetch_all(&mut self.database.reader().await?).await?;
            if rows.is_empty() {
                return Ok(());
            }
            let mut transaction = self.database.begin().await?;
            for row in &rows {
                let (id, name) = (row.home("id")?, row.maybe_text("name")?);
                query("UPDATE homes SET search = $2 WHERE id = $1 AND search = '' AND name IS NOT DISTINCT FROM $3")
                    .bind(id.key())
                    .bind(search_text(&id, name.as_deref()))
                    .bind(&name)
                    .execute(&mut transaction)
                    .await?;
            }
            transaction.commit().await?;
        }
    }
}
