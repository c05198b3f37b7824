//! Access to the files of the clips and of the last map.

use super::members::Member;
use super::tile::TileKey;
use crate::contribution::ClipContribution;
use viola_reconstruct::Feature;

/// Loads what clips contribute to their home's map, of several at once: a store may be far away. The results are in the
/// order of the arguments.
pub trait LoadClips<E> {
    fn contributions(&mut self, members: &[&Member]) -> Result<Vec<ClipContribution>, E>;

    /// Returns the features of clips; none of a clip that was aligned before features were stored.
    fn features(&mut self, members: &[&Member]) -> Result<Vec<Vec<Feature>>, E>;

    /// Returns the sums of tiles that the last map keeps; none without a last map.
    fn sums(&mut self, tiles: &[TileKey]) -> Result<Vec<Option<Vec<u8>>>, E> {
        Ok(vec![None; tiles.len()])
    }
}

/// Contributions of clips without features.
impl<E, F: FnMut(&Member) -> Result<ClipContribution, E>> LoadClips<E> for F {
    fn contributions(&mut self, members: &[&Member]) -> Result<Vec<ClipContribution>, E> {
        members.iter().map(|member| self(member)).collect()
    }

    fn features(&mut self, members: &[&Member]) -> Result<Vec<Vec<Feature>>, E> {
        Ok(vec![Vec::new(); members.len()])
    }
}
