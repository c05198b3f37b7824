//! `/v1/jobs`

use super::App;
use super::access::{self, Caller};
use super::digits::json;
use super::error::Error;
use super::extract::{JobPath, Query};
use super::list::{List, ListPage, ListQuery, states};
use super::problems::CommonProblems;
use super::reply::{Document, Resource, event_stream};
use super::types::{Job, JobState};
use axum::extract::State;
use axum::http::{HeaderMap, StatusCode};
use axum::response::sse::Event;
use axum::response::{IntoResponse, Response};
use futures::{Stream, StreamExt};
use serde::Deserialize;
use uuid::Uuid;
use viola_storage::Tenant;

/// The filter of a list of jobs.
#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
pub(super) struct JobsQuery {
    /// Only jobs in one of these states, separated by commas. Send it with the request of every page.
    #[param(value_type = Option<Vec<JobState>>, style = Form, explode = false, min_items = 1, example = json!(["failed"]))]
    state: Option<String>,
}

/// List the jobs of all homes, newest first
///
/// `state=failed` selects the jobs without an answer; `error` has the reason. To retry a clip, use
/// `POST /v1/homes/{home}/clips/{clip}/align`.
#[utoipa::path(get, path = "/v1/jobs", tag = "jobs", params(JobsQuery, ListQuery),
    responses((status = 200, description = "One page", body = List<Job>), CommonProblems))]
pub(super) async fn list_jobs(
    State(app): State<App>,
    caller: Caller,
    Query(asked): Query<JobsQuery>,
    query: ListPage,
) -> Result<Document<List<Job>>, Error> {
    let states =
        states(asked.state.as_deref(), &viola_storage::JobState::ALL, viola_storage::JobState::name)?;
    let jobs = app.storage.jobs(caller.for_all_homes()?, &states, &query.page()?).await?;
    Ok(Document(query.list(jobs, |job| job.id)?))
}

/// Get a job
#[utoipa::path(get, path = "/v1/jobs/{job}", tag = "jobs", params(JobPath),
    responses((status = 200, description = "The job", body = Job), CommonProblems))]
pub(super) async fn get_job(
    State(app): State<App>,
    JobPath { job: id }: JobPath,
) -> Result<Document<Job>, Error> {
    Ok(Document(app.storage.job(id).await?.ok_or(Error::NoSuchJob)?.into()))
}

/// Watch a job by server-sent events
///
/// Every `job` event has the whole job, and its `id` is the job's version. The last event is `end`: with the
/// job in its final state, or with `null` if the job was removed with its clip. A client that reconnects with
/// the `Last-Event-ID` of the final state gets 204, which ends an EventSource.
#[utoipa::path(get, path = "/v1/jobs/{job}/events", tag = "jobs",
    params(JobPath,
        ("Last-Event-ID" = Option<String>, Header, description = "The last version that the client has seen")),
    responses(
        (status = 200, description = "The events", body = String, content_type = "text/event-stream"),
        (status = 204, description = "The client has seen the final state"),
        CommonProblems))]
pub(super) async fn watch_job(
    State(app): State<App>,
    caller: Caller,
    JobPath { job: id }: JobPath,
    headers: HeaderMap,
) -> Result<Response, Error> {
    let job = app.storage.job(id).await?.ok_or(Error::NoSuchJob)?;
    let seen = headers.get("last-event-id").and_then(|value| value.to_str().ok()?.parse().ok()).unwrap_or(0);
    if job.state.is_final() && job.version == seen {
        return Ok(StatusCode::NO_CONTENT.into_response());
    }
    let events = events(app.clone(), &caller.tenant, id, seen).take_until(access::expiry(app, caller));
    Ok(event_stream(events))
}

fn events(
    app: App,
    tenant: &Tenant,
    id: Uuid,
    seen: i64,
) -> impl Stream<Item = Result<Event, axum::Error>> + use<> {
    let changes = app.queue.clone().watch(id, seen, app.turns.of(tenant)).map(move |job| match job {
        Ok(Some(job)) => {
            let name = if job.state.is_final() { "end" } else { "job" };
            let event = Event::default().event(name).id(job.version.to_string());
            Ok(event.data(String::from_utf8_lossy(&json(&Job::from(job)))))
        }
        Ok(None) => Ok(Event::default().event("end").data("null")),
        Err(error) => {
            tracing::error!(job = %id, %error, "a job could not be watched on");
            Err(axum::Error::new(error))
        }
    });
    changes.take_until(app.stop.clone().cancelled_owned())
}

/// Cancel a job
///
/// Its `error` and the reason of its clip, which is then `uploaded`, have the code `cancelled`. A job that a newer one of its
/// clip replaced has the code `superseded`. Cancelling it again changes nothing.
#[utoipa::path(post, path = "/v1/jobs/{job}/cancel", tag = "jobs", params(JobPath),
    responses(
        (status = 200, description = "The job is cancelled", body = Job,
            headers(("ETag" = String, description = "Names the state of the job"))),
        (status = 409, description = "The job has ended in another state: `job-ended`"),
        CommonProblems))]
pub(super) async fn cancel_job(
    State(app): State<App>,
    JobPath { job: id }: JobPath,
) -> Result<Resource<Job>, Error> {
    let job = app.queue.cancel(id).await?.ok_or(Error::NoSuchJob)?;
    if job.state != viola_storage::JobState::Cancelled {
        return Err(Error::JobEnded(job.state.name()));
    }
    Ok(Resource(job.into()))
}
