//! `/v1/changes`

use super::App;
use super::access::Caller;
use super::error::{Error, Problem};
use super::extract::Query;
use super::list::{ListQuery, encode};
use super::problems::CommonProblems;
use crate::storage::Change;
use axum::Json;
use axum::extract::State;
use serde::{Deserialize, Serialize};
use std::time::Duration;

const MAX_WAIT_S: u64 = 30;

/// How long to wait for changes.
#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
pub(super) struct WaitQuery {
    /// When there is no change, wait this many seconds for one before answering with none; 0 when not given.
    #[param(value_type = Option<u64>, minimum = 0, maximum = 30)]
    wait: Option<String>,
}

/// A part of the feed.
#[derive(Debug, Serialize, utoipa::ToSchema)]
pub(super) struct ChangesPage {
    items: Vec<Change>,
    /// Goes into `after` for what follows, also when there is nothing more now.
    #[schema(example = "NDcxMS4xNzczNTAwOTY2NTM1")]
    next: String,
    /// Whether there are further changes already.
    more: bool,
}

/// What changed in all homes, in the order in which it was committed
///
/// For whoever keeps a copy: begin without `after`, apply the items in their order, keep `next` with them, and go on
/// with it, at the end with `wait`. The feed has the newest change of every home, LiDAR map, clip and fused map, so a
/// copy that begins with nothing is whole at the end of its first reading, and one that goes on may be told of a thing
/// that it has in its newest form already. A clip may come before its home, since a home is told again when it is
/// renamed. An item says that something changed; its present form is under the thing's own path.
///
/// What was removed is told with `deleted` for 30 days, a home after everything that was in it. Whoever did not come to
/// the end of the feed for 30 days is refused with `cursor-expired` and begins again without `after`: what the new
/// reading does not name is gone.
#[utoipa::path(get, path = "/v1/changes", tag = "changes", params(ListQuery, WaitQuery),
    responses(
        (status = 200, description = "The changes after the cursor, perhaps none", body = ChangesPage),
        (status = 410, description = "The cursor is too old to go on from: `cursor-expired`", body = Problem,
            content_type = "application/problem+json"),
        CommonProblems))]
pub(super) async fn list_changes(
    State(app): State<App>,
    caller: Caller,
    Query(query): Query<ListQuery>,
    Query(wait): Query<WaitQuery>,
) -> Result<Json<ChangesPage>, Error> {
    let (after, limit, wait) = (query.after()?, query.limit()?, wait.seconds()?);
    let tenant = caller.for_all_homes()?;
    let changes = tokio::select! {
        changes = app.queue.changes(tenant, after, limit, wait) => changes?,
        // A server that stops waits for nobody.
        () = app.stop.cancelled() => app.queue.changes(tenant, after, limit, Duration::ZERO).await?,
    };
    let next = encode(&changes.next.to_string());
    Ok(Json(ChangesPage { items: changes.items, next, more: changes.more }))
}

impl WaitQuery {
    fn seconds(&self) -> Result<Duration, Error> {
        let Some(text) = &self.wait else { return Ok(Duration::ZERO) };
        let seconds = text.parse().ok().filter(|seconds| *seconds <= MAX_WAIT_S);
        seconds.map(Duration::from_secs).ok_or_else(|| Error::InvalidQuery {
            field: Some("wait"),
            detail: format!("wait is a number of seconds from 0 to {MAX_WAIT_S}"),
        })
    }
}
