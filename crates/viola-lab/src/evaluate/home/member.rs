//! Clips as members of a home's map, as the service passes them on.

use nalgebra::Matrix3;
use uuid::Uuid;
use viola_align::{Alignment, AlignmentState};
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

/// Returns a clip's own alignment; none if it failed.
pub(super) fn own_verdict(alignment: &Alignment) -> Option<Verdict> {
    match alignment.state {
        AlignmentState::Aligned => Some(Verdict::Aligned {
            map_from_clip: alignment.map_from_clip?,
            covariance: Matrix3::from_fn(|r, c| alignment.covariance.map_or(0.0, |rows| rows[r][c])),
            probability: alignment.probability,
        }),
        AlignmentState::Ambiguous => {
            let alternatives = alignment.alternatives.iter();
            let alternatives =
                alternatives.map(|one| (one.map_from_clip, one.probability.unwrap_or(0.0))).collect();
            Some(Verdict::Ambiguous { alternatives })
        }
        AlignmentState::Failed => None,
    }
}
