//! The state of a home's newest map.

use crate::database::{Row, query};
use crate::{HomeId, Storage, StorageError};

/// Failed merges in a row from which a map is failing. The first failure may have a cause that passes.
pub(crate) const FAILING_MERGES: u32 = 2;

/// State of a home's newest map.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MapState {
    /// It has every change of the home.
    Current,
    /// Changes of the home wait for the next merge.
    Due,
    /// The same, and at least [`FAILING_MERGES`] merges in a row have failed.
    Failing,
}

impl MapState {
    /// Returns the state by the row of a home.
    pub(crate) fn of(home: &Row) -> Result<MapState, StorageError> {
        if home.number("map_made")? >= home.number("map_wanted")? {
            return Ok(MapState::Current);
        }
        let failed: u32 = home.count("map_faults")?;
        Ok(if failed < FAILING_MERGES { MapState::Due } else { MapState::Failing })
    }
}

impl Storage {
    /// Returns the state of a home's newest map.
    pub async fn map_state(&self, home: &HomeId) -> Result<MapState, StorageError> {
        let row = query("SELECT map_wanted, map_made, map_faults FROM homes WHERE id = $1").bind(home.key());
        let row = row.fetch_optional(&mut self.database.reader().await?).await?;
        MapState::of(&row.ok_or(StorageError::NoSuchHome)?)
    }
}
