//! Clips as members of a home's map, as the service passes them on.

use uuid::Uuid;
use viola_home::{Member, Verdict};

/// Returns clip `number`, whose contribution is named by the number.
pub(super) fn member(number: usize, verdict: Verdict) -> Member {
    Member {
        clip: Uuid::from_u128(number as u128),
        recorded_at_ms: None,
        sha256: format!("{number:06}"),
        share: number.to_string(),
        verdict,
    }
}
