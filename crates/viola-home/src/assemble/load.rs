//! Access to the files of the clips.

use super::members::Member;
use crate::contribution::ClipContribution;
use viola_reconstruct::Feature;

/// Loads what clips contribute to their home's map.
pub trait LoadClips<E> {
    fn contribution(&mut self, member: &Member) -> Result<ClipContribution, E>;

    /// Returns the features of a clip; none of a clip that was aligned before features were stored.
    fn features(&mut self, member: &Member) -> Result<Vec<Feature>, E>;
}

/// Contributions of clips without features.
impl<E, F: FnMut(&Member) -> Result<ClipContribution, E>> LoadClips<E> for F {
    fn contribution(&mut self, member: &Member) -> Result<ClipContribution, E> {
        self(member)
    }

    fn features(&mut self, _: &Member) -> Result<Vec<Feature>, E> {
        Ok(Vec::new())
    }
}
