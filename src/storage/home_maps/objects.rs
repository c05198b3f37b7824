//! The objects of all homes, as their current maps have them.

use crate::storage::columns::Columns;
use crate::storage::database::{Row, Transaction};
use crate::storage::{HomeId, Page, Storage, StorageError};

/// An object and its home.
#[derive(Debug, Clone, PartialEq)]
pub struct HomeObject {
    pub home: HomeId,
    pub id: String,
    /// What the map says of it.
    pub document: serde_json::Value,
}

/// Which objects are asked for; all when nothing is named.
#[derive(Debug, Clone, Default)]
pub struct ObjectFilter {
    pub class: Option<String>,
    pub home: Option<HomeId>,
}

impl Storage {
    /// By home and id. The cursor is `home` and `id` with a space between them, which no home's id has.
    pub async fn objects(
        &self,
        filter: &ObjectFilter,
        page: &Page<String>,
    ) -> Result<Vec<HomeObject>, StorageError> {
        let (home, id) = page.after.as_deref().and_then(|after| after.split_once(' ')).unwrap_or_default();
        let rows = sqlx::query(
            "SELECT home_id, object_id, document FROM home_objects
            WHERE ($1 IS NULL OR class = $1) AND ($2 IS NULL OR home_id = $2)
                AND (home_id > $3 OR (home_id = $3 AND object_id > $4))
            ORDER BY home_id, object_id LIMIT $5",
        )
        .bind(filter.class.as_deref())
        .bind(filter.home.as_ref().map(HomeId::as_str))
        .bind(home)
        .bind(id)
        .bind(i64::from(page.limit))
        .fetch_all(self.database.reader())
        .await?;
        let object = |row: &Row| {
            Ok(HomeObject { home: row.home("home_id")?, id: row.text("object_id")?, document: row.json("document")? })
        };
        rows.iter().map(object).collect()
    }
}

/// The objects of a home's new revision in place of those of the one before.
pub(super) async fn replace(
    transaction: &mut Transaction,
    home: &HomeId,
    objects: &[(String, String, serde_json::Value)],
) -> Result<(), StorageError> {
    sqlx::query("DELETE FROM home_objects WHERE home_id = $1")
        .bind(home.as_str())
        .execute(&mut **transaction)
        .await?;
    for (id, class, document) in objects {
        sqlx::query("INSERT INTO home_objects (home_id, object_id, class, document) VALUES ($1, $2, $3, $4)")
            .bind(home.as_str())
            .bind(id)
            .bind(class)
            .bind(document.to_string())
            .execute(&mut **transaction)
            .await?;
    }
    Ok(())
}
