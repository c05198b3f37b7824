//! LRU cache of clip contributions: no repeated reads, bounded memory.

use super::load::LoadClips;
use super::members::{Extent, Member};
use super::surface::Surface;
use super::tile::TileKey;
use crate::contribution::ClipContribution;
use rayon::prelude::*;
use std::collections::VecDeque;
use std::sync::{Arc, OnceLock};
use viola_geometry::progress::{self, Cancelled, Progress};
use viola_reconstruct::{CloudPoint, Feature, View};

/// Clips that are loaded at a time, to bound the memory.
pub(super) const AT_A_TIME: usize = 8;
/// Maximum size of the cached contributions.
const MAX_KEPT_BYTES: usize = 150_000_000;
/// Bytes of a point's surface: about every fourth point is in it.
const SURFACE_BYTES: usize = 24;

/// A contribution and its lazily built surface.
pub(super) struct Loaded {
    pub contribution: ClipContribution,
    surface: OnceLock<Surface>,
}

impl Loaded {
    pub fn surface(&self) -> &Surface {
        self.surface.get_or_init(|| Surface::new(&self.contribution.cloud_in_clip))
    }

    /// Returns roughly the memory that it takes.
    fn size_bytes(&self) -> usize {
        let of_surface = self.surface.get().map_or(0, |_| SURFACE_BYTES);
        let points = self.contribution.cloud_in_clip.points.len() * (size_of::<CloudPoint>() + of_surface);
        points + self.contribution.views.iter().map(View::size_bytes).sum::<usize>()
    }

    pub fn extent(&self) -> Extent {
        let points = self
            .contribution
            .cloud_in_clip
            .points
            .iter()
            .map(|p| [p.position_m[0], p.position_m[1]].map(f64::from));
        let cameras = self.contribution.views.iter().map(|view| view.clip_from_camera.translation.vector);
        Extent::around(points.chain(cameras.map(|at| [at.x, at.y])))
    }
}

/// Contributions in use. The long loops of a merge take their files from here, so each request checks the order to stop.
pub(super) struct Cache<'a, E> {
    load: &'a mut dyn LoadClips<E>,
    /// For the loops that need no file.
    pub progress: &'a dyn Progress,
    /// Least recently used first.
    kept: VecDeque<(String, Arc<Loaded>)>,
}

impl<'a, E: From<Cancelled>> Cache<'a, E> {
    pub fn new(load: &'a mut dyn LoadClips<E>, progress: &'a dyn Progress) -> Cache<'a, E> {
        Cache { load, progress, kept: VecDeque::new() }
    }

    pub fn features(&mut self, members: &[&Member]) -> Result<Vec<Vec<Feature>>, E> {
        progress::check(self.progress)?;
        self.load.features(members)
    }

    pub fn sums(&mut self, tiles: &[TileKey]) -> Result<Vec<Option<Vec<u8>>>, E> {
        progress::check(self.progress)?;
        self.load.sums(tiles)
    }

    pub fn get(&mut self, member: &Member) -> Result<Arc<Loaded>, E> {
        Ok(self.get_all(&[member])?.remove(0))
    }

    /// Returns the contributions of different members, in their order.
    pub fn get_all(&mut self, members: &[&Member]) -> Result<Vec<Arc<Loaded>>, E> {
        progress::check(self.progress)?;
        let take = |kept: &mut VecDeque<(String, Arc<Loaded>)>, member: &Member| {
            let place = kept.iter().position(|(name, _)| *name == member.contribution)?;
            kept.remove(place).map(|(_, loaded)| loaded)
        };
        let known: Vec<Option<Arc<Loaded>>> =
            members.iter().map(|member| take(&mut self.kept, member)).collect();
        let missing: Vec<&Member> = members
            .iter()
            .zip(&known)
            .filter(|(_, known)| known.is_none())
            .map(|(member, _)| *member)
            .collect();
        let loaded = self.load.contributions(&missing)?;
        debug_assert_eq!(loaded.len(), missing.len());
        let mut loaded = loaded.into_iter();
        let mut all = Vec::with_capacity(members.len());
        for (member, known) in members.iter().zip(known) {
            let next = || Some(Arc::new(Loaded { contribution: loaded.next()?, surface: OnceLock::new() }));
            let Some(of_member) = known.or_else(next) else { continue };
            self.kept.push_back((member.contribution.clone(), of_member.clone()));
            all.push(of_member);
        }
        self.bound();
        Ok(all)
    }

    /// Returns the results of `work` for each of `others` beside `clip`, in their order. It gets the place of the other clip,
    /// then both contributions, that of the other clip first.
    pub fn with_each<R: Send>(
        &mut self,
        clip: &Member,
        others: &[&Member],
        work: impl Fn(usize, &Loaded, &Loaded) -> R + Sync,
    ) -> Result<Vec<R>, E> {
        let mut all = Vec::with_capacity(others.len());
        for part in others.chunks(AT_A_TIME) {
            let clip = self.get(clip)?;
            let loaded = self.get_all(part)?.into_par_iter().enumerate();
            let first = all.len();
            all.par_extend(loaded.map(|(at, other)| work(first + at, &other, &clip)));
        }
        Ok(all)
    }

    /// Forgets the surfaces: later steps need the points only, of more clips.
    pub fn forget_surfaces(&mut self) {
        for (_, loaded) in &mut self.kept {
            if let Some(loaded) = Arc::get_mut(loaded) {
                loaded.surface.take();
            }
        }
    }

    /// Removes contributions until the others are few enough.
    fn bound(&mut self) {
        let bytes = |kept: &VecDeque<(String, Arc<Loaded>)>| -> usize {
            kept.iter().map(|(_, loaded)| loaded.size_bytes()).sum()
        };
        while self.kept.len() > 1 && bytes(&self.kept) > MAX_KEPT_BYTES {
            self.kept.pop_front();
        }
    }
}
