//! `/v1/changes`

use super::App;
use super::access::Caller;
use super::error::Error;
use super::extract::{Query, query_number};
use super::fairness::FairPlaces;
use super::list::{ListQuery, encode};
use super::problems::CommonProblems;
use super::reply::Document;
use super::types::Change;
use axum::extract::State;
use serde::{Deserialize, Serialize};
use std::time::{Duration, Instant};
use tokio::time::timeout;
use viola_storage::{Changes, ChangesCursor, StorageError, Tenant};

const MAX_WAIT_S: u64 = 30;

/// Number of requests of a process and of a tenant that wait for changes at once: each change of the tenant wakes them all.
const WAITS: usize = 1024;
const WAITS_OF_TENANT: usize = 64;

/// The timeout for changes.
#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
pub(super) struct WaitQuery {
    /// Seconds to wait for a change if there is none yet; default 0.
    #[param(value_type = Option<u64>, minimum = 0, maximum = 30)]
    wait: Option<String>,
}

/// A part of the feed.
#[derive(Debug, Serialize, utoipa::ToSchema)]
pub(super) struct ChangesPage {
    items: Vec<Change>,
    /// Cursor for `after` in the next request; it is also valid if there is nothing more now.
    #[schema(example = "NDcxMS4xNzczNTAwOTY2NTM1")]
    next: String,
    /// True if there are further changes already.
    more: bool,
}

/// List the changes of all homes, in commit order
///
/// To keep a copy: begin without `after`, apply the items in order, store `next` with them, and send it as
/// `after` in the next request; at the end of the feed, add `wait`. The feed has the newest change of every
/// home, LiDAR map, clip, fused map and of its objects. An empty copy is therefore complete after its first
/// reading; a later reading may repeat a change that the copy has. A clip may come before its home, because a renamed home
/// gets a new change. An item only says that something changed; GET the resource for its present state.
///
/// Removed resources stay in the feed for 30 days, with `deleted`; a home comes after everything that was in
/// it. A client that has not reached the end of the feed for 30 days gets `cursor-expired`, as does one whose
/// newest change was lost by a restore of the database. It must begin again without `after`, and then delete
/// from its copy everything that the new reading does not name.
#[utoipa::path(get, path = "/v1/changes", tag = "changes", params(ListQuery, WaitQuery),
    responses(
        (status = 200, description = "The changes after the cursor, perhaps none", body = ChangesPage),
        (status = 410, description = "The cursor is too old, or its change was lost by a restore: `cursor-expired`"),
        CommonProblems))]
pub(super) async fn list_changes(
    State(app): State<App>,
    caller: Caller,
    Query(query): Query<ListQuery>,
    Query(wait): Query<WaitQuery>,
) -> Result<Document<ChangesPage>, Error> {
    let (after, limit, wait) = (query.position()?, query.limit()?, wait.seconds()?);
    let tenant = caller.for_all_homes()?;
    let changes = tokio::select! {
        changes = changes_within(&app, tenant, after, limit, wait) => changes?,
        // A stopping server does not wait.
        () = app.stop.cancelled() => app.queue.changes(tenant, after, limit, Duration::ZERO).await?,
    };
    let next = encode(&changes.next.to_string());
    Ok(Document(ChangesPage {
        items: changes.items.into_iter().map(Change::from).collect(),
        next,
        more: changes.more,
    }))
}

/// Returns the places of requests that wait for changes.
pub(super) fn waits() -> FairPlaces {
    FairPlaces::new(WAITS, WAITS_OF_TENANT)
}

/// Returns changes after a cursor; if there is none, waits for one. A request without a place waits, too, but only sees at
/// the end of its wait what changed.
async fn changes_within(
    app: &App,
    tenant: &Tenant,
    after: Option<ChangesCursor>,
    limit: u32,
    wait: Duration,
) -> Result<Changes, StorageError> {
    let begun = Instant::now();
    let changes = app.queue.changes(tenant, after, limit, Duration::ZERO).await?;
    if wait.is_zero() || !changes.items.is_empty() {
        return Ok(changes);
    }
    let _place = timeout(wait, app.waits.take(tenant.name())).await;
    app.queue.changes(tenant, after, limit, wait.saturating_sub(begun.elapsed())).await
}

impl WaitQuery {
    fn seconds(&self) -> Result<Duration, Error> {
        let what = format!("a number of seconds from 0 to {MAX_WAIT_S}");
        let seconds = query_number("wait", self.wait.as_deref(), |seconds| *seconds <= MAX_WAIT_S, &what)?;
        Ok(Duration::from_secs(seconds.unwrap_or_default()))
    }
}
