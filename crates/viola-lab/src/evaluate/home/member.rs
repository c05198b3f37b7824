//! Clips as members of a home's map, as the service passes them on.

use uuid::Uuid;
use viola_geometry::progress::Cancelled;
use viola_home::{ClipContribution, LoadClips, Member, Verdict};
use viola_reconstruct::Feature;

/// Returns clip `number`, whose contribution is named by the number.
pub(super) fn member(number: usize, verdict: Verdict) -> Member {
    Member {
        clip: Uuid::from_u128(number as u128),
        recorded_at_ms: None,
        sha256: format!("{number:06}"),
        contribution: number.to_string(),
        verdict,
    }
}

/// The files of a clip that a map is fused from.
pub(super) struct ClipFiles {
    pub contribution: ClipContribution,
    pub features: Vec<Feature>,
}

/// The files of all clips, by their numbers.
pub(super) struct FilesOfClips<'a>(pub Vec<&'a ClipFiles>);

impl FilesOfClips<'_> {
    pub fn of(&self, name: &str) -> Option<&ClipFiles> {
        self.0.get(name.parse::<usize>().ok()?).copied()
    }
}

impl LoadClips<Cancelled> for FilesOfClips<'_> {
    fn contributions(&mut self, members: &[&Member]) -> Result<Vec<ClipContribution>, Cancelled> {
        let files = members.iter().map(|member| self.of(&member.contribution));
        let contribution = |files: &ClipFiles| files.contribution.clone();
        Ok(files.map(|files| files.map_or_else(ClipContribution::default, contribution)).collect())
    }

    fn features(&mut self, members: &[&Member]) -> Result<Vec<Vec<Feature>>, Cancelled> {
        let files = members.iter().map(|member| self.of(&member.contribution));
        Ok(files.map(|files| files.map_or_else(Vec::new, |files| files.features.clone())).collect())
    }
}
