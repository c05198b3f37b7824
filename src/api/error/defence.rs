//! Refusals that protect the service and its other callers.

use axum::http::StatusCode;
use std::time::Duration;
use viola_storage::HomeId;

/// Time after which there may be a place again.
const BUSY_RETRY_AFTER: Duration = Duration::from_secs(10);

/// The reason why a request is refused to protect others.
#[derive(Debug, thiserror::Error)]
pub(in crate::api) enum Defence {
    #[error(
        "the request names the host `{0}`; without keys this service answers only to localhost, 127.0.0.1 and [::1]. Use one \
         of these names, or create a key with `viola keys create`"
    )]
    ForeignHost(String),
    #[error(
        "the request comes from a page of another origin ({0}); without keys only the service's own pages may call it. Allow \
         the origin with --cors-origin, or create a key with `viola keys create`"
    )]
    ForeignOrigin(String),
    #[error(
        "the request comes from a page of another origin ({0}) with the session of a browser; send the key as `Authorization: \
         Bearer`, or allow the origin with --cors-origin"
    )]
    ForeignSession(String),
    #[error("the session has ended; sign in again")]
    SessionEnded,
    /// The same words for a home that exists and for one that does not.
    #[error(
        "this key is for the home `{0}` only; for another home, send a key of that home, or one for all homes"
    )]
    OtherHome(HomeId),
    #[error("too many keys from this address were not valid; wait {} s", .wait.as_secs() + 1)]
    TooManyFailures { wait: Duration },
    #[error("other files are being read, and none of them ended within {} s; send the file again later", .wait.as_secs_f64())]
    ReadersBusy { wait: Duration },
    #[error("other files are being made or sent, and none of them ended within {} s; ask again later", .wait.as_secs_f64())]
    MakersBusy { wait: Duration },
    #[error("as many bytes of files arrive as may at once; send the file again later")]
    ArrivalsFull,
    #[error(
        "reading the file took longer than {} s; split a recording into several clips, or send a LiDAR map with fewer points",
        .limit.as_secs_f64()
    )]
    TookTooLong { limit: Duration },
}

impl Defence {
    /// Returns the status, the code and the title.
    pub(super) fn mapping(&self) -> (StatusCode, &'static str, &'static str) {
        use StatusCode as S;
        match self {
            Defence::ForeignHost(_) => (S::FORBIDDEN, "foreign_host", "The host name is not the service's"),
            Defence::ForeignOrigin(_) | Defence::ForeignSession(_) => {
                (S::FORBIDDEN, "foreign_origin", "Pages of other origins may not call the service")
            }
            Defence::SessionEnded => (S::UNAUTHORIZED, "session_ended", "The session has ended"),
            Defence::OtherHome(_) => (S::NOT_FOUND, "home_not_found", "There is no such home"),
            Defence::TooManyFailures { .. } => {
                (S::TOO_MANY_REQUESTS, "too_many_failed_keys", "Too many keys were not valid")
            }
            Defence::ReadersBusy { .. } => {
                (S::SERVICE_UNAVAILABLE, "readers_busy", "Too many files are being read")
            }
            Defence::MakersBusy { .. } => {
                (S::SERVICE_UNAVAILABLE, "makers_busy", "Too many files are being made")
            }
            Defence::ArrivalsFull => {
                (S::SERVICE_UNAVAILABLE, "unavailable", "The service cannot do this at this moment")
            }
            Defence::TookTooLong { .. } => {
                (S::UNPROCESSABLE_ENTITY, "took_too_long", "The file takes too long to read")
            }
        }
    }

    pub(super) fn field(&self) -> Option<&'static str> {
        match self {
            Defence::ForeignHost(_) => Some("Host"),
            Defence::ForeignOrigin(_) | Defence::ForeignSession(_) => Some("Origin"),
            Defence::SessionEnded => Some("Cookie"),
            Defence::OtherHome(_)
            | Defence::TooManyFailures { .. }
            | Defence::ReadersBusy { .. }
            | Defence::MakersBusy { .. }
            | Defence::ArrivalsFull
            | Defence::TookTooLong { .. } => None,
        }
    }

    /// Returns the time after which a retry may succeed.
    pub(super) fn retry_after(&self) -> Option<Duration> {
        match self {
            Defence::TooManyFailures { wait } => Some(*wait),
            Defence::ReadersBusy { .. } | Defence::MakersBusy { .. } | Defence::ArrivalsFull => {
                Some(BUSY_RETRY_AFTER)
            }
            _ => None,
        }
    }
}
