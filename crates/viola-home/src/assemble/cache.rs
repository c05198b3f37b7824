//! LRU cache of clip contributions: no repeated reads, bounded memory.

use super::load::LoadClips;
use super::members::{Extent, Member};
use super::surface::Surface;
use super::tile::TileKey;
use crate::contribution::ClipContribution;
use std::collections::VecDeque;
use std::sync::{Arc, OnceLock};
use viola_reconstruct::Feature;

/// Maximum number of points of the cached contributions; with its surface a point takes about 100 bytes.
const KEPT_POINTS: usize = 1_500_000;

/// A contribution and its lazily built surface.
pub(super) struct Loaded {
    pub share: ClipContribution,
    surface: OnceLock<Surface>,
}

impl Loaded {
    pub fn surface(&self) -> &Surface {
        self.surface.get_or_init(|| Surface::new(&self.share.cloud_in_clip))
    }

    pub fn extent(&self) -> Extent {
        let points =
            self.share.cloud_in_clip.points.iter().map(|p| [p.position_m[0], p.position_m[1]].map(f64::from));
        let cameras = self.share.views.iter().map(|view| view.clip_from_camera.translation.vector);
        Extent::around(points.chain(cameras.map(|at| [at.x, at.y])))
    }
}

pub(super) struct Cache<'a, E> {
    load: &'a mut dyn LoadClips<E>,
    /// Least recently used first.
    kept: VecDeque<(String, Arc<Loaded>)>,
}

impl<'a, E> Cache<'a, E> {
    pub fn new(load: &'a mut dyn LoadClips<E>) -> Cache<'a, E> {
        Cache { load, kept: VecDeque::new() }
    }

    pub fn features(&mut self, member: &Member) -> Result<Vec<Feature>, E> {
        self.load.features(member)
    }

    pub fn sums(&mut self, tile: &TileKey) -> Result<Option<Vec<u8>>, E> {
        self.load.sums(tile)
    }

    pub fn get(&mut self, member: &Member) -> Result<Arc<Loaded>, E> {
        let known = self.kept.iter().position(|(share, _)| *share == member.share);
        let entry = match known.and_then(|place| self.kept.remove(place)) {
            Some(entry) => entry,
            None => {
                let share = self.load.contribution(member)?;
                (member.share.clone(), Arc::new(Loaded { share, surface: OnceLock::new() }))
            }
        };
        let loaded = entry.1.clone();
        self.kept.push_back(entry);
        let points = |kept: &VecDeque<(String, Arc<Loaded>)>| -> usize {
            kept.iter().map(|(_, loaded)| loaded.share.cloud_in_clip.points.len()).sum()
        };
        while self.kept.len() > 1 && points(&self.kept) > KEPT_POINTS {
            self.kept.pop_front();
        }
        Ok(loaded)
    }
}
