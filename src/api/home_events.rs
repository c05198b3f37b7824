//! `/v1/homes/{home}/events`

use super::App;
use super::access::{self, Caller};
use super::error::Error;
use super::extract::HomePath;
use super::problems::CommonProblems;
use super::reply::event_stream;
use super::types::Change;
use axum::extract::State;
use axum::http::HeaderMap;
use axum::response::Response;
use axum::response::sse::Event;
use futures::{StreamExt, future, stream};

/// Watch a home by server-sent events
///
/// Every `change` event has a change as in `GET /v1/changes`: of the home, its LiDAR map, a clip, the fused map or
/// its objects. The `id` of an event is the change's place in the feed; a client that reconnects with it as
/// `Last-Event-ID` misses nothing. If a restore of the database lost that change, the newest change of everything in the
/// home comes again. The stream begins with the next change, so open it first and read the home then. Before it comes an `id`
/// without an event: a client that loses the stream before the first change reconnects with it.
/// It ends when the home is removed, or when the key or session is no longer valid.
#[utoipa::path(get, path = "/v1/homes/{home}/events", tag = "homes",
    params(HomePath,
        ("Last-Event-ID" = Option<String>, Header, description = "The `id` of the last event that the client has seen")),
    responses(
        (status = 200, description = "The events", body = String, content_type = "text/event-stream"),
        CommonProblems))]
pub(super) async fn watch_home(
    State(app): State<App>,
    caller: Caller,
    HomePath { home }: HomePath,
    headers: HeaderMap,
) -> Result<Response, Error> {
    let seen = headers.get("last-event-id").map(|value| value.to_str().ok()?.parse().ok());
    let seen = seen.map(|position| {
        let detail =
            "the header is the id of an event that this stream sent; without it the stream begins now";
        position.ok_or_else(|| Error::InvalidHeader { field: "Last-Event-ID", detail: detail.to_owned() })
    });
    let seen = seen.transpose()?;
    // Before the home is looked up: then its removal comes after the position, and ends the stream.
    let after = app.storage.home_position(seen).await?;
    app.storage.home(&home).await?;
    // An EventSource keeps the id and sees no event, because it has no data.
    let begin = Event::default().id(after.to_string());
    let stop = app.stop.clone();
    let turn = app.turns.of(&caller.tenant);
    let events =
        app.queue.clone().watch_home(home.clone(), after.seq, turn).map(move |change| match change {
            Ok(change) => {
                let position = after.at(change.seq);
                Event::default().event("change").id(position.to_string()).json_data(Change::from(change))
            }
            Err(error) => {
                tracing::error!(%home, %error, "the events of a home end");
                Err(axum::Error::new(error))
            }
        });
    let events = stream::once(future::ready(Ok(begin))).chain(events);
    let events = events.take_until(stop.cancelled_owned()).take_until(access::expiry(app, caller));
    Ok(event_stream(events))
}
