//! Lists of clips.

use super::columns::to_json;
use super::database::{Connection, Query, Row, listed, query};
use super::{Clip, ClipState, HomeId, Job, Page, Storage, StorageError, Tenant, clips, homes, jobs};
use jiff::Timestamp;
use std::collections::HashMap;
use uuid::Uuid;

/// Filter of a list of clips.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct ClipFilter {
    /// States of the clips; empty for any.
    pub states: Vec<ClipState>,
    /// Codes of reasons, of which a clip has at least one; empty for any. Only the first [`ClipFilter::MAX_CODES`] count.
    pub codes: Vec<String>,
    /// Only clips that changed later than this.
    pub updated_after: Option<Timestamp>,
}

impl ClipFilter {
    /// Maximum number of codes.
    pub const MAX_CODES: usize = 4;
}

/// The conditions of a filter except the states; [`bind_page`] binds the values.
macro_rules! filtered {
    () => {
        "updated_at > $3 AND (reasons LIKE $11 ESCAPE '!' OR reasons LIKE $12 ESCAPE '!'
            OR reasons LIKE $13 ESCAPE '!' OR reasons LIKE $14 ESCAPE '!')"
    };
}

/// Selects a page of the clips of a home.
const OF_HOME: &str = concat!(
    "SELECT ",
    clips::clip_columns!(),
    " FROM clips WHERE home_id = $1 AND id > $2 AND state IN ($4, $5, $6, $7, $8, $9) AND ",
    filtered!(),
    " ORDER BY id LIMIT $10"
);

/// Selects a page of ids of a tenant's clips in one state, so that an index finds the few failed clips among millions of
/// others. RTRIM leaves the [`Tenant::key_prefix`] of a home's key. With the order by state, PostgreSQL cannot choose the index
/// of the ids, which has the clips of all tenants.
macro_rules! oldest {
    ($state:literal) => {
        concat!(
            "SELECT id FROM (SELECT id FROM clips
            WHERE RTRIM(home_id, 'ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789._-') = $1
                AND (state, id) > (",
            $state,
            ", $2) AND (state, id) < (",
            $state,
            ", '~') AND ",
            filtered!(),
            " ORDER BY state, id LIMIT $10) AS oldest"
        )
    };
}

/// Selects a page of the clips of a tenant.
pub(super) const OF_TENANT: &str = concat!(
    "SELECT ",
    clips::clip_columns!(),
    " FROM clips WHERE id IN (",
    oldest!("$4"),
    " UNION ALL ",
    oldest!("$5"),
    " UNION ALL ",
    oldest!("$6"),
    " UNION ALL ",
    oldest!("$7"),
    " UNION ALL ",
    oldest!("$8"),
    " UNION ALL ",
    oldest!("$9"),
    ") ORDER BY id LIMIT $10"
);

fn bind_page(query: Query, of: &str, filter: &ClipFilter, page: &Page<Uuid>) -> Query {
    let after = page.after.map(|id| id.to_string()).unwrap_or_default();
    let updated_after = filter.updated_after.map_or(i64::MIN, Timestamp::as_millisecond);
    let query = query.bind(of.to_owned()).bind(after).bind(updated_after);
    // One parameter for each state; NULL matches none.
    let wanted = |state: &ClipState| filter.states.is_empty() || filter.states.contains(state);
    let states = ClipState::ALL.iter().map(|state| wanted(state).then(|| state.name()));
    let query = states.fold(query, Query::bind).bind(i64::from(page.limit));
    let mut patterns: Vec<Option<String>> = filter.codes.iter().map(|code| Some(having(code))).collect();
    if patterns.is_empty() {
        patterns.push(Some("%".to_owned()));
    }
    patterns.resize(ClipFilter::MAX_CODES, None);
    patterns.into_iter().fold(query, Query::bind)
}

/// Returns the pattern of reasons with a code, as they are stored. Quotes within a detail have a backslash.
fn having(code: &str) -> String {
    let code = code.replace('!', "!!").replace('%', "!%").replace('_', "!_");
    format!("%\"code\":\"{code}\"%")
}

impl Storage {
    /// Returns the clips of a home that match a filter, oldest first.
    pub async fn clips(
        &self,
        home: &HomeId,
        filter: &ClipFilter,
        page: &Page<Uuid>,
    ) -> Result<Vec<Clip>, StorageError> {
        let mut snapshot = self.database.snapshot().await?;
        homes::require(&mut snapshot, home).await?;
        let rows = bind_page(query(OF_HOME), home.key(), filter, page);
        let rows = rows.fetch_all(&mut snapshot).await?;
        with_jobs(&mut snapshot, &rows).await
    }

    /// Returns the clips of all homes of a tenant that match a filter, oldest first.
    pub async fn clips_of_tenant(
        &self,
        tenant: &Tenant,
        filter: &ClipFilter,
        page: &Page<Uuid>,
    ) -> Result<Vec<Clip>, StorageError> {
        let mut snapshot = self.database.snapshot().await?;
        let rows = bind_page(query(OF_TENANT), &tenant.key_prefix(), filter, page);
        let rows = rows.fetch_all(&mut snapshot).await?;
        with_jobs(&mut snapshot, &rows).await
    }

    /// Returns the keys of the newest answers of a home's clips by clip. The same key has the same files.
    pub async fn result_keys(&self, home: &HomeId) -> Result<HashMap<Uuid, String>, StorageError> {
        let rows = query(
            "SELECT id, COALESCE(result_key, last_result_key) AS newest FROM clips
            WHERE home_id = $1 AND (result_key IS NOT NULL OR last_result_key IS NOT NULL)",
        );
        let rows = rows.bind(home.key()).fetch_all(&mut self.database.reader().await?).await?;
        rows.iter().map(|row| Ok((row.id("id")?, row.text("newest")?))).collect()
    }
}

/// Returns the clips of rows with their newest jobs.
async fn with_jobs(connection: &mut Connection, rows: &[Row]) -> Result<Vec<Clip>, StorageError> {
    let ids = rows.iter().map(|row| row.maybe_text("job_id")).collect::<Result<Vec<_>, _>>()?;
    let ids: Vec<String> = ids.into_iter().flatten().collect();
    let jobs = query(jobs::select_jobs!("WHERE jobs.id IN ", listed!("$1")));
    let jobs = jobs.bind(to_json(&ids)).fetch_all(connection).await?;
    let mut jobs: HashMap<Uuid, Job> = jobs::by_id(&jobs)?;
    let clip = |row: &Row| clips::from_row(row, row.maybe_id("job_id")?.and_then(|id| jobs.remove(&id)));
    rows.iter().map(clip).collect()
}
