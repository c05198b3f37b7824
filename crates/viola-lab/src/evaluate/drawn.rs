//! Clips drawn inside a LiDAR map: hits of a camera that walks through it, cast in the map itself.
//!
//! They need no pictures and no mesh, so every map with free cells can be evaluated; the map itself is the
//! ground truth.

use super::suite::map_fingerprint;
use super::{Case, DrawnError, RunError, Sample, Suite};
use crate::simulate::gaussian;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rustc_hash::FxHashSet;
use std::path::Path;
use std::sync::Arc;
use viola_align::{AlignParams, FREE_CELL_M, HIT_SPACING_M, Hit, Observation, Target, VirtualScan};
use viola_formats::lidar::{Cell, LidarMap};
use viola_geometry::progress::{self, Progress};
use viola_geometry::{Grid, LevelName, Point2, Pose2, Vector2, cell_of};
use viola_reconstruct::{CloudPoint, FloorReport, Label, PointCloud};

/// Parameters of drawn clips.
#[derive(Debug, Clone, PartialEq)]
pub struct DrawnParams {
    pub seed: u64,
    /// Clips per map and length.
    pub clips: usize,
    /// Lengths of the clips in frames; between two frames the camera walks or turns.
    pub frames: Vec<usize>,
    /// Standard deviation of a hit in x and in y.
    pub noise_m: f64,
    /// Fraction of outliers: hits on objects absent from the map, at random positions on their rays.
    pub outliers: f64,
}

impl Default for DrawnParams {
    fn default() -> Self {
        DrawnParams { seed: 0, clips: 10, frames: vec![60], noise_m: 0.03, outliers: 0.3 }
    }
}

/// Clips drawn inside maps; each map is its own set.
pub struct DrawnClips {
    params: DrawnParams,
    maps: Vec<Map>,
    cases: Vec<Case>,
    /// Index into `maps` and seed of each case.
    draws: Vec<(usize, u64)>,
}

struct Map {
    path: String,
    lidar: Arc<LidarMap>,
    target: Arc<Target>,
    /// Free cells with clearance for a person.
    places_m: Vec<Point2>,
}

impl DrawnClips {
    pub fn open<P: AsRef<Path>>(paths: &[P], params: DrawnParams) -> Result<DrawnClips, DrawnError> {
        let maps =
            paths.iter().map(|path| Map::open(path.as_ref())).collect::<Result<Vec<_>, DrawnError>>()?;
        let (mut cases, mut draws) = (Vec::<Case>::new(), Vec::new());
        for (at, path) in paths.iter().enumerate() {
            let stem = path.as_ref().file_stem().unwrap_or_default().to_string_lossy();
            let is_plain = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
            let mut set: String = stem.chars().map(|c| if is_plain(c) { c } else { '_' }).collect();
            // Files in different folders may have the same name.
            if cases.iter().any(|case| case.set == set) {
                set = format!("{set}-{at}");
            }
            for &frames in &params.frames {
                for clip in 0..params.clips as u64 {
                    cases.push(Case { name: format!("{clip:03}"), set: set.clone(), frames });
                    draws.push((at, params.seed.wrapping_add(clip)));
                }
            }
        }
        Ok(DrawnClips { params, maps, cases, draws })
    }
}

impl Map {
    fn open(path: &Path) -> Result<Map, DrawnError> {
        const ROOM_M: f64 = 0.3;
        let name = path.display().to_string();
        let lidar =
            LidarMap::open(path).map_err(|source| DrawnError::Lidar { path: name.clone(), source })?;
        let no_place = || DrawnError::NoPlace { path: name.clone() };
        let target = Target::new(&lidar).ok_or_else(no_place)?;
        let cells = lidar.cells.as_ref().ok_or_else(|| DrawnError::NoCells { path: name.clone() })?;
        let centres = (0..cells.frame.height).flat_map(|y| (0..cells.frame.width).map(move |x| (x, y)));
        let places_m: Vec<Point2> = centres
            .filter(|(x, y)| cells.get(*x, *y) == Cell::Free)
            .map(|(x, y)| cells.frame.centre(x, y))
            .filter(|place| target.field.value(place) > ROOM_M)
            .collect();
        if places_m.is_empty() {
            return Err(no_place());
        }
        Ok(Map { path: name, lidar: Arc::new(lidar), target: Arc::new(target), places_m })
    }
}

impl Suite for DrawnClips {
    fn cases(&self) -> &[Case] {
        &self.cases
    }

    fn fingerprint(&self) -> String {
        let DrawnParams { seed, noise_m, outliers, clips: _, frames: _ } = &self.params;
        let maps: Vec<String> = self.maps.iter().map(|map| map_fingerprint(&map.lidar)).collect();
        format!("{seed} {noise_m} {outliers} {}", maps.join(" "))
    }

    fn sample(
        &self,
        index: usize,
        params: &AlignParams,
        progress: &dyn Progress,
    ) -> Result<Option<Sample>, RunError> {
        /// Minimum hits of a clip: two metres of wall.
        const ENOUGH_HITS: usize = 60;
        const DRAWS: usize = 200;
        let (at, seed) = self.draws[index];
        let map = &self.maps[at];
        let Some(cells) = map.lidar.cells.as_ref() else { return Ok(None) };
        let frames = self.cases[index].frames;
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        for _ in 0..DRAWS {
            progress::check(progress)?;
            let path = walk(map, frames, &mut rng);
            let Some(first) = path.first() else { continue };
            let scan = look(cells, &path, &self.params, &mut rng);
            if scan.hits.len() >= ENOUGH_HITS {
                return Ok(Some(Sample {
                    observation: observation(scan, params.raycast.vacuum_height_m),
                    lidar: map.lidar.clone(),
                    target: Some(map.target.clone()),
                    level: LevelName::MAIN,
                    other_levels: Vec::new(),
                    map_from_clip: Some(*first),
                    unknowable: None,
                    floor_in_sight: None,
                    scale: None,
                    first_frame: 0,
                    last_frame: frames.saturating_sub(1) as u32,
                }));
            }
        }
        Err(DrawnError::NoPlace { path: map.path.clone() }.into())
    }
}

/// Returns the poses of a camera that walks and looks around, in the map.
fn walk(map: &Map, frames: usize, rng: &mut ChaCha8Rng) -> Vec<Pose2> {
    /// 0.5 m/s at 2.5 frames per second; turns up to 20 degrees between frames.
    const STEP_M: f64 = 0.2;
    const TURN_RAD: f64 = 0.35;
    const ROOM_M: f64 = 0.25;
    let place = map.places_m[rng.random_range(0..map.places_m.len())];
    let mut pose = Pose2::new(place.x, place.y, rng.random_range(-3.1..3.1));
    let mut turn = 0.0;
    let mut path = Vec::with_capacity(frames);
    for _ in 0..frames {
        path.push(pose);
        let ahead = pose.apply(&Point2::new(STEP_M, 0.0));
        let is_free = map.lidar.cells.as_ref().is_some_and(|cells| cells.at(&ahead) == Some(Cell::Free))
            && map.target.field.value(&ahead) > ROOM_M;
        turn = (turn + rng.random_range(-0.1..0.1f64)).clamp(-TURN_RAD, TURN_RAD);
        pose = if is_free {
            Pose2::new(ahead.x, ahead.y, pose.yaw_rad + turn)
        } else {
            // At an obstacle the camera turns further in its current direction.
            Pose2::new(pose.x_m, pose.y_m, pose.yaw_rad + TURN_RAD.copysign(turn))
        };
    }
    path
}

/// Returns the cameras' scan of the map, in the first camera's frame.
fn look(cells: &Grid<Cell>, path: &[Pose2], drawn: &DrawnParams, rng: &mut ChaCha8Rng) -> VirtualScan {
    const VIEW_RAD: f64 = 1.1;
    const RAYS: usize = 80;
    const RANGE_M: f64 = 5.0;
    const NEAR_M: f64 = 0.3;
    const OFF_WALL_M: f64 = 0.1;
    let clip_from_map = path[0].inverse();
    let mut hits: Vec<Hit> = Vec::new();
    let mut hit_cells = FxHashSet::default();
    let mut free_cells = FxHashSet::default();
    for camera in path {
        let from = Point2::new(camera.x_m, camera.y_m);
        for ray in 0..RAYS {
            let bearing = VIEW_RAD * (ray as f64 / (RAYS - 1) as f64 - 0.5);
            let toward = camera.rotate(&Vector2::new(bearing.cos(), bearing.sin()));
            let (seen_m, wall_m) = march(cells, &from, &toward, RANGE_M);
            let (from_m, toward) = (clip_from_map.apply(&from), clip_from_map.rotate(&toward));
            free(&from_m, &toward, seen_m - OFF_WALL_M, FREE_CELL_M, &mut free_cells);
            let Some(range_m) = wall_m.filter(|range_m| *range_m > NEAR_M) else { continue };
            let point_m = from_m + toward * range_m;
            if hit_cells.insert(cell_of(&point_m, HIT_SPACING_M)) {
                // Equal heights, so that outliers cannot be distinguished from the map's walls.
                let (extent_m, at_vacuum_height) = (1.0, true);
                hits.push(Hit {
                    point_m,
                    normal: -toward,
                    weight: 1.0,
                    extent_m,
                    at_vacuum_height,
                    completed: false,
                    from_m,
                });
            }
        }
    }
    for hit in &mut hits {
        if rng.random_bool(drawn.outliers) {
            let way = hit.point_m - hit.from_m;
            let nearest = NEAR_M / way.norm();
            // The length of the nearest hits may be rounded down to `NEAR_M` or less: they have no place before them.
            let part = if nearest < 1.0 { rng.random_range(nearest..1.0) } else { 1.0 };
            hit.point_m = hit.from_m + way * part;
            // Cells around an outlier are not seen as free.
            let [x, y] = cell_of(&hit.point_m, FREE_CELL_M);
            (-2..=2).for_each(|dx| (-2..=2).for_each(|dy| _ = free_cells.remove(&[x + dx, y + dy])));
        }
        hit.point_m += Vector2::new(gaussian(rng), gaussian(rng)) * drawn.noise_m;
    }
    let mut free_cells: Vec<[i32; 2]> = free_cells.into_iter().collect();
    free_cells.sort_unstable();
    let centre = |c: i32| (f64::from(c) + 0.5) * FREE_CELL_M;
    VirtualScan {
        hits,
        free_m: free_cells.into_iter().map(|[x, y]| Point2::new(centre(x), centre(y))).collect(),
        cameras: path.iter().map(|camera| clip_from_map.compose(camera)).collect(),
        landmarks: Vec::new(),
    }
}

/// Returns a ray's free length, and the range to the middle of the first occupied cell, if any. The ray ends
/// at unknown cells.
fn march(cells: &Grid<Cell>, from: &Point2, toward: &Vector2, most_m: f64) -> (f64, Option<f64>) {
    let step_m = 0.1 * cells.frame.cell_m;
    let mut along_m = 0.0;
    let mut entered_m = None;
    while along_m < most_m {
        match (cells.at(&(from + toward * along_m)), entered_m) {
            (Some(Cell::Occupied), None) => entered_m = Some(along_m),
            (Some(Cell::Occupied), Some(entered)) if along_m - entered < cells.frame.cell_m => {}
            (_, Some(entered)) => return (entered, Some(0.5 * (entered + along_m))),
            (Some(Cell::Free), None) => {}
            (Some(Cell::Unknown) | None, None) => break,
        }
        along_m += step_m;
    }
    (along_m, None)
}

/// Adds the cells that a ray of this length crosses.
fn free(from: &Point2, toward: &Vector2, length_m: f64, cell_m: f64, cells: &mut FxHashSet<[i32; 2]>) {
    let mut along_m = 0.0;
    while along_m < length_m {
        cells.insert(cell_of(&(from + toward * along_m), cell_m));
        along_m += 0.5 * cell_m;
    }
}

/// Returns an observation of the scan, with surface points at the vacuum's height for methods that cast rays.
fn observation(scan: VirtualScan, vacuum_height_m: f64) -> Observation {
    let surface = |hit: &Hit| CloudPoint {
        position_m: [hit.point_m.x as f32, hit.point_m.y as f32, vacuum_height_m as f32],
        normal: [hit.normal.x as f32, hit.normal.y as f32, 0.0],
        color: [0; 3],
        label: Label::NONE,
        weight: 1,
    };
    let points = scan.hits.iter().map(surface).collect();
    Observation {
        cloud_in_clip: PointCloud { points, voxel_m: 0.03 },
        key_frames: scan.cameras.len(),
        floor: Some(FloorReport {
            assumed: false,
            camera_height_m: 1.4,
            support_points: 0,
            gravity_angle_deg: None,
        }),
        scan,
        ..Observation::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::{Home, HomeParams, Set};
    use viola_geometry::GridFrame;

    #[test]
    fn a_map_with_another_wall_has_another_fingerprint() {
        let fingerprint = |lidar: &LidarMap| {
            let target = Arc::new(Target::new(lidar).unwrap());
            let lidar = Arc::new(lidar.clone());
            let map = Map { path: String::new(), lidar, target, places_m: Vec::new() };
            let params = DrawnParams::default();
            DrawnClips { params, maps: vec![map], cases: Vec::new(), draws: Vec::new() }.fingerprint()
        };
        let mut lidar = Home::generate(&HomeParams::new(Set::Normal, 6)).survey().lidar_map().unwrap();
        let before = fingerprint(&lidar);
        lidar.occupied_m[0].x += 0.5;
        assert_ne!(fingerprint(&lidar), before);
    }

    /// Cameras at 20 to 30 cm from a wall. A few of their rays end where outliers begin, but for rounding.
    #[test]
    fn every_hit_may_be_an_outlier() {
        let frame = GridFrame { origin_m: [0.0, 0.0], cell_m: 0.05, width: 40, height: 820 };
        let mut cells = Grid::filled(frame, Cell::Free);
        (0..frame.height).for_each(|y| cells.set(30, y, Cell::Occupied));
        let at = |i: i32| Pose2::new(1.2 + 0.005 * f64::from(i % 20), 0.5 + 0.2 * f64::from(i), 0.0);
        let path: Vec<Pose2> = (0..200).map(at).collect();
        let drawn = DrawnParams { outliers: 1.0, noise_m: 0.0, ..DrawnParams::default() };
        let scan = look(&cells, &path, &drawn, &mut ChaCha8Rng::seed_from_u64(0));
        assert!(scan.hits.len() > 500, "{}", scan.hits.len());
        assert!(scan.hits.iter().all(|hit| (hit.point_m - hit.from_m).norm() > 0.3 - 1e-9));
    }
}
