//! Refusals of bodies that are not as their headers say, or not as the service takes them.

use axum::http::StatusCode;

/// The reason why a body is refused, whatever is in it.
#[derive(Debug, thiserror::Error)]
pub(in crate::api) enum BodyRefusal {
    #[error(
        "the body is encoded (Content-Encoding: {0}); the service decodes none, so send it as it is, without this header"
    )]
    Encoded(String),
    #[error(
        "the body does not have the SHA-256 of {field}: it was damaged on its way and not kept; send it again"
    )]
    Digest { field: &'static str },
}

impl BodyRefusal {
    /// Returns the status, the code and the title.
    pub(super) fn mapping(&self) -> (StatusCode, &'static str, &'static str) {
        use StatusCode as S;
        match self {
            BodyRefusal::Encoded(_) => {
                (S::UNSUPPORTED_MEDIA_TYPE, "unsupported_media_type", "This kind of body is not understood")
            }
            BodyRefusal::Digest { .. } => {
                (S::BAD_REQUEST, "digest_mismatch", "The body was damaged on its way")
            }
        }
    }

    pub(super) fn field(&self) -> &'static str {
        match self {
            BodyRefusal::Encoded(_) => "Content-Encoding",
            BodyRefusal::Digest { field } => field,
        }
    }
}
