//! Access to the files of the clips and of the last map.

use super::members::Member;
use super::tile::TileKey;
use crate::contribution::ClipContribution;
use viola_reconstruct::Feature;

/// Loads what clips contribute to their home's map.
pub trait LoadClips<E> {
    fn contribution(&mut self, member: &Member) -> Result<ClipContribution, E>;

    /// Returns the features of a clip; none of a clip that was aligned before features were stored.
    fn features(&mut self, member: &Member) -> Result<Vec<Feature>, E>;

    /// Returns the sums of a tile that the last map keeps; none without a last map.
    fn sums(&mut self, _tile: &TileKey) -> Result<Option<Vec<u8>>, E> {
        Ok(None)
    }
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
