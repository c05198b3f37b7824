//! Lists of clips.

use super::columns::Columns;
use super::database::{Query, Row, query};
use super::{Clip, ClipState, HomeId, Page, Storage, StorageError, clips, homes, jobs};
use jiff::Timestamp;
use std::collections::HashMap;
use uuid::Uuid;

/// Filter of a list of clips.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct ClipFilter {
    /// States of the clips; empty for any.
    pub states: Vec<ClipState>,
    /// Only clips that changed later than this.
    pub updated_after: Option<Timestamp>,
}

/// Selects one page of a home's clips; [`bind_page`] binds the values.
macro_rules! page_of_clips {
    ($($columns:tt)+) => {
        concat!(
            "SELECT ",
            $($columns)+,
            " FROM clips
            WHERE home_id = $1 AND id > $2 AND updated_at > $3 AND state IN ($4, $5, $6, $7, $8, $9)
            ORDER BY id LIMIT $10"
        )
    };
}

fn bind_page(query: Query, home: &HomeId, filter: &ClipFilter, page: &Page<Uuid>) -> Query {
    let after = page.after.map(|id| id.to_string()).unwrap_or_default();
    let updated_after = filter.updated_after.map_or(i64::MIN, Timestamp::as_millisecond);
    let query = query.bind(home.key().to_owned()).bind(after).bind(updated_after);
    // One parameter for each state; NULL matches none.
    let wanted = |state: &ClipState| filter.states.is_empty() || filter.states.contains(state);
    let states = ClipState::ALL.iter().map(|state| wanted(state).then(|| state.name()));
    states.fold(query, Query::bind).bind(i64::from(page.limit))
}

impl Storage {
    /// Returns the clips that match a filter, oldest first.
    pub async fn clips(
        &self,
        home: &HomeId,
        filter: &ClipFilter,
        page: &Page<Uuid>,
    ) -> Result<Vec<Clip>, StorageError> {
        let mut snapshot = self.database.snapshot().await?;
        if !homes::exists(&mut snapshot, home).await? {
            return Err(StorageError::NoSuchHome);
        }
        let jobs = query(jobs::select_jobs!("WHERE jobs.id IN (", page_of_clips!("job_id"), ")"));
        let jobs = bind_page(jobs, home, filter, page).fetch_all(&mut snapshot).await?;
        let mut jobs = jobs::by_id(&jobs)?;
        let rows = bind_page(query(page_of_clips!(clips::clip_columns!())), home, filter, page);
        let rows = rows.fetch_all(&mut snapshot).await?;
        let clip = |row: &Row| clips::from_row(row, row.maybe_id("job_id")?.and_then(|id| jobs.remove(&id)));
        rows.iter().map(clip).collect()
    }

    /// Returns the keys of the results of a home's clips by clip. The same key has the same files.
    pub async fn result_keys(&self, home: &HomeId) -> Result<HashMap<Uuid, String>, StorageError> {
        let rows = query("SELECT id, result_key FROM clips WHERE home_id = $1 AND result_key IS NOT NULL");
        let rows = rows.bind(home.key()).fetch_all(&mut self.database.reader().await?).await?;
        rows.iter().map(|row| Ok((row.id("id")?, row.text("result_key")?))).collect()
    }
}
