//! Clips as members of a home's map, as the service passes them on.

use std::convert::Infallible;
use uuid::Uuid;
use viola_home::{ClipContribution, LoadClips, Member, Verdict};
use viola_reconstruct::Feature;

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

/// The files of a clip that a map is fused from.
pub(super) struct Share {
    pub contribution: ClipContribution,
    pub features: Vec<Feature>,
}

/// The files of all clips, by their numbers.
pub(super) struct Shares<'a>(pub Vec<&'a Share>);

impl Shares<'_> {
    pub fn of(&self, name: &str) -> Option<&Share> {
        self.0.get(name.parse::<usize>().ok()?).copied()
    }
}

impl LoadClips<Infallible> for Shares<'_> {
    fn contribution(&mut self, member: &Member) -> Result<ClipContribution, Infallible> {
        Ok(self.of(&member.share).map_or_else(ClipContribution::default, |share| share.contribution.clone()))
    }

    fn features(&mut self, member: &Member) -> Result<Vec<Feature>, Infallible> {
        Ok(self.of(&member.share).map_or_else(Vec::new, |share| share.features.clone()))
    }
}
