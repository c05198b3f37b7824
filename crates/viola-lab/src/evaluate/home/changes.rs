//! Simulated homes over time: the changes of objects that the map tells, against the true ones.
//!
//! A home of the set `changed` is filmed in two visits, before and after its furniture changed. In a home of
//! another set nothing changes, and its map grows clip by clip: every change that it tells is wrong.

mod kept;
mod score;
mod table;
mod truth;

use super::clips::{AlignedClip, ClipsError, Recorder};
use super::matching::Thing;
use super::member::{FilesOfClips, member};
use super::visit::Visit;
use crate::evaluate::HomesParams;
use crate::simulate::{Home, HomeParams, Set};
use kept::{Ids, Kept};
use score::{Scores, score};
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::Path;
use truth::{TrueChanges, shown_things, true_changes};
use viola_align::AlignParams;
use viola_formats::lidar::LidarMap;
use viola_geometry::LevelName;
use viola_geometry::progress::{Cancelled, Progress};
use viola_home as home;
use viola_home::{
    ClipNumbers, History, LookedThrough, Manifest, MapPoint, Member, MovedObject, Object, RevisionObjects,
    Stated, Tile, TileKey, Verdict, assemble, object_changes,
};
use viola_reconstruct::label::SurfaceNetwork;

pub use table::ChangesRow;

/// Time between two clips of a visit, and between the visits.
const CLIP_MS: i64 = 10 * 60_000;
const VISIT_MS: i64 = 7 * 86_400_000;

/// Results of one home.
#[derive(Debug, Clone, Serialize)]
pub struct ChangesHome {
    pub set: &'static str,
    pub seed: u64,
    pub clips: usize,
    /// Clips in the last revision.
    pub placed: usize,
    /// Pairs of revisions that were compared.
    pub comparisons: usize,
    pub scores: Scores,
    /// Ids of objects in a home in which nothing changes; zero in others.
    pub kept: Kept,
    /// Objects of this home whose id changed, in words.
    pub renamed: Vec<String>,
}

/// Objects of one revision.
struct Revision {
    objects: Vec<Object>,
    ids: History,
}

/// A home's map that grows.
#[derive(Default)]
struct Map {
    manifest: Manifest,
    tiles: BTreeMap<TileKey, Tile>,
    ids: History,
}

/// Films a home, merges its clips, and compares the changes that are told with the true ones. Aligned clips are
/// kept in `folder`.
pub fn changes(
    set: Set,
    seed: u64,
    homes: &HomesParams,
    params: &AlignParams,
    folder: &Path,
    progress: &dyn Progress,
) -> Result<ChangesHome, ClipsError> {
    let after = Home::generate(&HomeParams::new(set, seed));
    let before = after.before();
    let survey = after.survey();
    let lidar = survey.lidar_map()?;
    let recorder = Recorder { homes, params, folder, progress };
    let count = homes.clips_per_home;
    let name = |visit: &str| format!("{}_{seed}_{visit}", set.name());
    let mut clips = recorder.clips(&before, &survey, &lidar, &name("before"), 0..count)?;
    clips.extend(recorder.clips(&after, &survey, &lidar, &name("after"), count..2 * count)?);
    let first = count as usize;
    let is_changed = set == Set::Changed;
    let revisions = if is_changed { vec![first, clips.len()] } else { (1..=clips.len()).collect() };
    let recording = recorder.recording();
    let visit = |home: &Home, numbers| Visit::of(home, &survey, numbers, &recording);
    let map_from_home = survey.valetudo_from_home();
    let (truth, still) = if is_changed {
        let visits = [visit(&before, 0..count), visit(&after, count..2 * count)];
        (true_changes(&[before, after], &visits, &map_from_home), Vec::new())
    } else {
        let still = shown_things(&after, &visit(&after, 0..2 * count), &map_from_home);
        (TrueChanges::default(), still)
    };
    let mut ids = Ids::new(still);
    let (mut map, mut scores, mut last) = (Map::default(), Scores::default(), None);
    for there in &revisions {
        let now = map.merge(&lidar, &clips[..*there], first, params.label.surface.as_deref(), progress)?;
        if let Some(last) = &last {
            scores.add(&score(&truth, &told(last, &now)));
        }
        ids.add(&now.objects);
        last = Some(now);
    }
    let (kept, renamed) = ids.kept();
    Ok(ChangesHome {
        set: set.name(),
        seed,
        clips: clips.len(),
        placed: map.manifest.clips.len(),
        comparisons: revisions.len().saturating_sub(1),
        scores,
        kept,
        renamed,
    })
}

impl Map {
    /// Merges clips, of which `first` are of the first visit, as the service does.
    fn merge(
        &mut self,
        lidar: &LidarMap,
        clips: &[AlignedClip],
        first: usize,
        surface: Option<&SurfaceNetwork>,
        progress: &dyn Progress,
    ) -> Result<Revision, Cancelled> {
        let members = clips.iter().enumerate().filter_map(|(number, clip)| {
            let visit_ms = if number < first { 0 } else { VISIT_MS };
            let recorded_at_ms = Some(visit_ms + CLIP_MS * number as i64);
            Some(Member { recorded_at_ms, ..member(number, Verdict::of(&clip.answer.alignment)?) })
        });
        let mut load = FilesOfClips(clips.iter().map(|clip| &clip.files).collect());
        let assembly = assemble(&self.manifest, members.collect(), &mut load, progress)?;
        let kept = std::mem::take(&mut self.tiles);
        let map = assembly.label(kept, surface, progress)?;
        (self.manifest, self.tiles) = (map.manifest, map.tiles);
        let looked = map.looked.get(&LevelName::MAIN).cloned();
        let looked = looked.unwrap_or_else(|| LookedThrough::of(LevelName::MAIN, &self.manifest.clips));
        Ok(self.describe(lidar, &looked))
    }

    fn describe(&mut self, lidar: &LidarMap, looked: &LookedThrough) -> Revision {
        let numbers = ClipNumbers::new(self.manifest.clips.iter().map(|clip| &clip.clip));
        let points: Vec<MapPoint> = self.tiles.values().flat_map(|tile| numbers.in_map(tile)).collect();
        let rooms = home::rooms(lidar, &points);
        let mut objects = home::objects(&points, &rooms, home::MAP_VOXEL_M);
        self.ids.identify_objects(&mut objects, &Stated::new(), looked);
        Revision { objects, ids: self.ids.clone() }
    }
}

impl Revision {
    /// Returns the objects of the revision, without those that it only remembers.
    fn objects(&self) -> RevisionObjects<'_> {
        let objects = self.objects.iter().map(|object| MovedObject {
            id: &object.id,
            class: object.class,
            bounds: object.bounds(),
            is_put: false,
            is_found: true,
        });
        RevisionObjects { objects: objects.collect(), ids: &self.ids }
    }

    fn thing(&self, index: usize) -> Thing {
        Thing::of(&self.objects[index])
    }
}

/// The changes that a map tells.
#[derive(Debug, Clone, Default)]
struct Told {
    added: Vec<Thing>,
    moved: Vec<[Thing; 2]>,
    gone: Vec<Thing>,
    /// Objects of one of the revisions only, about which nothing is said.
    discovered: usize,
    lost: usize,
}

fn told(from: &Revision, to: &Revision) -> Told {
    let changes = object_changes(&from.objects(), &to.objects());
    let things = |of: &Revision, indices: &[usize]| indices.iter().map(|index| of.thing(*index)).collect();
    Told {
        added: things(to, &changes.added),
        moved: changes.moved.iter().map(|(i, j)| [from.thing(*i), to.thing(*j)]).collect(),
        gone: things(from, &changes.gone),
        discovered: changes.discovered.len() + changes.found_again.len(),
        lost: changes.lost.len(),
    }
}
