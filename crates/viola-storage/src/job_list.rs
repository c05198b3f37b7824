//! Lists of jobs.

use super::database::query;
use super::jobs::{self, Job, JobState};
use super::{Page, Storage, StorageError, Tenant};
use uuid::Uuid;

/// Selects a page of ids of one state, so that an index finds the few failed jobs among millions of others.
macro_rules! newest {
    ($state:literal) => {
        concat!(
            "SELECT id FROM (SELECT id FROM jobs WHERE tenant = $1 AND state = ",
            $state,
            " AND id < $2 ORDER BY id DESC LIMIT $3) AS newest"
        )
    };
}

/// Selects a page of a tenant's jobs. The page has its limit before its ids are joined with the jobs: PostgreSQL's generic plan
/// read the jobs of all tenants in the order of their ids until it had found those of the page.
pub(super) const OF_TENANT: &str = jobs::select_jobs!(
    "WHERE jobs.id IN (SELECT id FROM (",
    newest!("$4"),
    " UNION ALL ",
    newest!("$5"),
    " UNION ALL ",
    newest!("$6"),
    " UNION ALL ",
    newest!("$7"),
    " UNION ALL ",
    newest!("$8"),
    ") AS found ORDER BY id DESC LIMIT $3) ORDER BY jobs.id DESC"
);

impl Storage {
    /// Returns a page of a tenant's jobs in some states, by default in any, newest first.
    pub async fn jobs(
        &self,
        tenant: &Tenant,
        states: &[JobState],
        page: &Page<Uuid>,
    ) -> Result<Vec<Job>, StorageError> {
        // Sorts after every id.
        let before = page.after.map_or("~".to_owned(), |id| id.to_string());
        let mut rows = query(OF_TENANT).bind(tenant.name()).bind(before).bind(i64::from(page.limit));
        for state in JobState::ALL {
            let wanted = states.is_empty() || states.contains(&state);
            // NULL matches none.
            rows = rows.bind(wanted.then(|| state.name()));
        }
        let rows = rows.fetch_all(&mut self.database.reader().await?).await?;
        rows.iter().map(jobs::from_row).collect()
    }
}
