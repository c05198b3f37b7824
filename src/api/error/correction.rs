//! Refusals of corrections.

use axum::http::StatusCode;
use viola_storage::CorrectionError;

/// Returns the status, the code and the title.
pub(super) fn mapping(error: &CorrectionError) -> (StatusCode, &'static str, &'static str) {
    use StatusCode as S;
    match error {
        CorrectionError::NotFound { kind: "room", .. } => {
            (S::NOT_FOUND, "room_not_found", "The map has no such room")
        }
        CorrectionError::NotFound { .. } => (S::NOT_FOUND, "object_not_found", "The map has no such object"),
        CorrectionError::Changed { .. } => {
            (S::PRECONDITION_FAILED, "changed_meanwhile", "It was changed since it was read")
        }
        CorrectionError::TooMany => {
            (S::CONFLICT, "too_many_corrections", "The home has as many corrections as it may have")
        }
        CorrectionError::Impossible { .. } => {
            (S::UNPROCESSABLE_ENTITY, "invalid_body", "The body does not have the expected members")
        }
        CorrectionError::NoMap | CorrectionError::Storage(_) => {
            (S::NOT_FOUND, "map_not_found", "The home has no such map")
        }
    }
}
