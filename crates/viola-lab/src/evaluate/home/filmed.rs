//! Simulated homes as clips map them: with everything that is lost and wrong on the way to rooms, objects and plan.

use super::clips::{ClipsError, Recorder};
use super::floor_plan::TruePlan;
use super::member::{FilesOfClips, member};
use super::shown;
use super::simulated::{SimulatedMap, true_rooms};
use super::visit::Visit;
use crate::evaluate::HomesParams;
use crate::simulate::{Home, HomeParams, Set, TrueOpening};
use std::path::Path;
use viola_align::AlignParams;
use viola_geometry::Point3;
use viola_geometry::progress::Progress;
use viola_home::{ClipNumbers, Manifest, Member, Verdict, assemble};

/// Heights at which an opening is looked at, as clips see doors and windows.
const OPENING_M: [f64; 3] = [1.0, 1.3, 1.6];
/// Places along an opening at each height.
const ALONG: usize = 7;

/// Films a home, and merges its clips as `viola map` does. The truth is the surface that the clips show: all rooms, the
/// openings that they look at, and furniture as far as it was seen. The LiDAR map has no rooms. Aligned clips are kept in
/// `folder`.
pub fn film(
    set: Set,
    seed: u64,
    homes: &HomesParams,
    params: &AlignParams,
    folder: &Path,
    progress: &dyn Progress,
) -> Result<SimulatedMap, ClipsError> {
    let home = Home::generate(&HomeParams::new(set, seed));
    let survey = home.survey();
    let mut lidar = survey.lidar_map()?;
    // The robot's own segments are the truth.
    lidar.rooms.clear();
    let recorder = Recorder { homes, params, folder, progress };
    let numbers = 0..homes.clips_per_home;
    // Other evaluations align the same clips to the map with its rooms.
    let name = format!("{}_{seed}_without_rooms", set.name());
    let clips = recorder.clips(&home, &survey, &lidar, &name, numbers.clone())?;
    let members = clips.iter().enumerate();
    let members: Vec<Member> = members
        .filter_map(|(number, clip)| Some(member(number, Verdict::of(&clip.answer.alignment)?)))
        .collect();
    let mut load = FilesOfClips(clips.iter().map(|clip| &clip.files).collect());
    let assembly = assemble(&Manifest::default(), members, &mut load, progress)?;
    let map = assembly.label(Default::default(), params.label.surface.as_deref(), progress)?;
    let clip_numbers = ClipNumbers::new(map.manifest.clips.iter().map(|clip| &clip.clip));
    let points = map.tiles.values().flat_map(|tile| clip_numbers.in_map(tile)).collect();
    let map_from_home = survey.valetudo_from_home();
    let visit = Visit::of(&home, &survey, numbers, &recorder.recording());
    let [truth, small] = shown::things(&home, visit.shown(&map_from_home), &map_from_home);
    let plan = TruePlan::new(&home.plan, map_from_home, |opening| visit.looks_at(&places(opening)));
    Ok(SimulatedMap { lidar, points, truth, small, rooms: true_rooms(&home, &map_from_home), plan })
}

/// Returns places in an opening.
fn places(opening: &TrueOpening) -> Vec<Point3> {
    let [from, to] = opening.ends;
    let at = |step: usize| from + (to - from) * ((step as f64 + 0.5) / ALONG as f64);
    let along = (0..ALONG).map(at);
    along.flat_map(|p| OPENING_M.map(|z| Point3::new(p.x, p.y, z))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use viola_geometry::progress::Silent;

    #[test]
    fn clips_that_were_aligned_to_a_map_with_rooms_are_not_taken() {
        let folder = std::env::temp_dir().join(format!("viola-lab-filmed-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        // Its name in `--joint`, which would be refused.
        std::fs::write(folder.join("normal_6_0.json"), "{}").unwrap();
        let homes = HomesParams { frames: vec![4], ..HomesParams::default() };
        let map = film(Set::Normal, 6, &homes, &AlignParams::default(), &folder, &Silent);
        std::fs::remove_dir_all(&folder).unwrap();
        assert!(map.is_ok_and(|map| !map.rooms.is_empty()));
    }
}
