//! Simulated homes as fused maps with noisy labels, without simulated clips: tests rooms and objects against
//! exact truth.

use super::floor_plan::{PlanScore, TruePlan, score_plan};
use super::matching::{Matches, Thing, matches};
use super::shown::{self, Shown};
use crate::simulate::{Home, HomeParams, Set};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rustc_hash::FxHashMap;
use std::collections::BTreeMap;
use viola_formats::lidar::{LidarError, LidarMap};
use viola_geometry::taxonomy::Class;
use viola_geometry::{Point2, Point3, Pose2, Vector3};
use viola_home as home;
use viola_home::{MapPoint, Object, Plan, Room, is_furniture};
use viola_reconstruct::{CloudPoint, Label};

/// Distance between eyes (viewpoints at a person's height).
const EYES_M: f64 = 1.2;
/// Label errors are constant in patches of this size.
const PATCH_M: f64 = 0.35;
/// Standard deviations of positions and normals.
const PLACE_M: f64 = 0.008;
const NORMAL_RAD: f64 = 0.2;

/// Sampling of a home, and the label accuracy.
#[derive(Debug, Clone, PartialEq)]
pub struct SampleParams {
    pub voxel_m: f64,
    /// Rays from each eye, in all directions.
    pub rays: usize,
    /// Fraction of correctly labelled patches.
    pub accuracy: f64,
}

impl Default for SampleParams {
    fn default() -> Self {
        SampleParams { voxel_m: 0.05, rays: 20_000, accuracy: 0.75 }
    }
}

/// A simulated home as a fused map.
pub struct SimulatedMap {
    pub lidar: LidarMap,
    pub points: Vec<MapPoint>,
    /// Furniture over half a metre with enough points in the map.
    pub truth: Vec<Thing>,
    /// Smaller furniture.
    pub small: Vec<Thing>,
    pub rooms: Vec<TrueRoom>,
    pub plan: TruePlan,
}

/// A true room: the inner side of its walls, in the map.
pub struct TrueRoom {
    pub name: String,
    pub corners_m: [Point2; 4],
}

/// Typical confusions of networks: (true class, label).
const MISTAKES: [(Class, Class); 10] = [
    (Class::Bed, Class::Sofa),
    (Class::Sofa, Class::Bed),
    (Class::Chair, Class::Sofa),
    (Class::Table, Class::Desk),
    (Class::Desk, Class::Table),
    (Class::Cabinet, Class::Shelf),
    (Class::Shelf, Class::Cabinet),
    (Class::Counter, Class::Cabinet),
    (Class::Refrigerator, Class::Cabinet),
    (Class::WashingMachine, Class::Cabinet),
];
const EYE_M: f64 = 1.5;
const REACH_M: f64 = 5.0;

/// Samples the home of these parameters. The LiDAR map has no rooms.
pub fn sample(home: &HomeParams, params: &SampleParams) -> Result<SimulatedMap, LidarError> {
    let home = Home::generate(home);
    let survey = home.survey();
    let mut lidar = survey.lidar_map()?;
    // The robot's own segments are the truth.
    lidar.rooms.clear();
    let map_from_home = survey.valetudo_from_home();
    let scene = home.scene();
    // Each voxel keeps its first hit.
    let mut voxels: BTreeMap<[i32; 3], (Point3, usize)> = BTreeMap::new();
    for room in &home.plan.rooms {
        let count = |axis: usize| (room.inner.size(axis) / EYES_M).ceil().max(1.0) as usize;
        for (i, j) in (0..count(0)).flat_map(|i| (0..count(1)).map(move |j| (i, j))) {
            let at = |axis: usize, i: usize| {
                room.inner.min[axis] + (i as f64 + 0.5) / count(axis) as f64 * room.inner.size(axis)
            };
            let eye = Point3::new(at(0, i), at(1, j), EYE_M);
            if scene.is_inside(&eye) {
                continue;
            }
            for ray in 0..params.rays {
                let toward = direction(ray, params.rays);
                if let Some(hit) = scene.cast_through_glass(&eye, &toward, REACH_M) {
                    let p = eye + toward * hit.distance;
                    // A cloud of a home has little of what is outside its windows.
                    if !home.plan.rooms.iter().any(|room| room.outline.shrunk(-0.5).contains(&p.xy())) {
                        continue;
                    }
                    let key = [p.x, p.y, p.z].map(|c| (c / params.voxel_m).floor() as i32);
                    voxels.entry(key).or_insert((p, hit.solid));
                }
            }
        }
    }
    let mut noise = Noise::new(home.params.seed, params);
    let mut points = Vec::with_capacity(voxels.len());
    let mut shown = Shown::new();
    for (p, solid) in voxels.values() {
        let (class, instance) = scene.label(*solid);
        let at = map_from_home.apply(&p.xy());
        if instance > 0 {
            shown.entry((instance, class.id())).or_default().push([at.x, at.y, p.z]);
        }
        let normal = scene.normal(*solid, p);
        points.push(noise.point(p, &normal, class, instance, &map_from_home));
    }
    let [truth, small] = shown::things(&home, shown, &map_from_home);
    let plan = TruePlan::new(&home.plan, map_from_home, |_| true);
    Ok(SimulatedMap { truth, small, rooms: true_rooms(&home, &map_from_home), plan, lidar, points })
}

/// Returns the true rooms of a home.
pub(super) fn true_rooms(home: &Home, map_from_home: &Pose2) -> Vec<TrueRoom> {
    home.plan.rooms.iter().map(|room| TrueRoom::new(room, map_from_home)).collect()
}

impl TrueRoom {
    fn new(room: &crate::simulate::Room, map_from_home: &Pose2) -> TrueRoom {
        let [a, b] = [room.inner.min, room.inner.max];
        let corners = [[a[0], a[1]], [b[0], a[1]], [b[0], b[1]], [a[0], b[1]]];
        TrueRoom {
            name: room.name.clone(),
            corners_m: corners.map(|[x, y]| map_from_home.apply(&Point2::new(x, y))),
        }
    }
}

/// Returns evenly distributed directions on the sphere (Fibonacci lattice).
fn direction(i: usize, count: usize) -> Vector3 {
    let golden = std::f64::consts::PI * (3.0 - 5f64.sqrt());
    let z = 1.0 - 2.0 * (i as f64 + 0.5) / count as f64;
    let (s, c) = (golden * i as f64).sin_cos();
    let level = (1.0 - z * z).sqrt();
    Vector3::new(level * c, level * s, z)
}

/// Noise of sensor and network.
struct Noise<'a> {
    rng: ChaCha8Rng,
    params: &'a SampleParams,
    /// Label of each patch.
    patches: FxHashMap<([i32; 3], u16, u16), Class>,
}

impl Noise<'_> {
    fn new(seed: u64, params: &SampleParams) -> Noise<'_> {
        Noise { rng: ChaCha8Rng::seed_from_u64(seed), params, patches: FxHashMap::default() }
    }

    fn point(
        &mut self,
        p: &Point3,
        normal: &Vector3,
        class: Class,
        instance: u16,
        map_from_home: &Pose2,
    ) -> MapPoint {
        let mut jitter = |sigma: f64| {
            // Approximately normal: sum of three uniform numbers.
            let sum: f64 = (0..3).map(|_| self.rng.random::<f64>() - 0.5).sum();
            2.0 * sigma * sum
        };
        let at = map_from_home.apply(&p.xy());
        let place = PLACE_M;
        let at = [at.x + jitter(place), at.y + jitter(place), p.z + jitter(place)];
        let lean = NORMAL_RAD;
        let turned = map_from_home.rotate(&normal.xy());
        let normal = Vector3::new(turned.x + jitter(lean), turned.y + jitter(lean), normal.z + jitter(lean));
        let normal = normal.try_normalize(1e-6).unwrap_or_else(Vector3::z);
        let called = self.called(p, class, instance);
        let point = CloudPoint {
            position_m: at.map(|c| c as f32),
            normal: [normal.x as f32, normal.y as f32, normal.z as f32],
            color: class.color(),
            label: Label::new(called, 0.7, 3),
            weight: 100,
        };
        MapPoint { point, clip: 0 }
    }

    fn called(&mut self, p: &Point3, class: Class, instance: u16) -> Class {
        let key = [p.x, p.y, p.z].map(|c| (c / PATCH_M).floor() as i32);
        let (rng, accuracy) = (&mut self.rng, self.params.accuracy);
        *self.patches.entry((key, instance, class.id())).or_insert_with(|| {
            if rng.random::<f64>() < accuracy {
                return class;
            }
            let mistake = MISTAKES.iter().find(|(of, _)| *of == class).map(|(_, by)| *by);
            match mistake.filter(|_| rng.random::<f64>() < 0.6) {
                Some(mistake) => mistake,
                None if rng.random::<f64>() < 0.5 => Class::Wall,
                None => Class::ALL[rng.random_range(0..Class::ALL.len())],
            }
        })
    }
}

/// Matches objects of a simulated home with its truth, by oriented boxes.
fn match_objects(map: &SimulatedMap, objects: &[Object]) -> Matches {
    let furniture = objects.iter().filter(|object| is_furniture(object.class));
    let found: Vec<Thing> = furniture.map(Thing::of).collect();
    matches(&map.truth, &map.small, &found)
}

/// Returns the number of rooms, and of those matched by a computed room with an IoU of at least 0.5.
fn count_rooms(map: &SimulatedMap, rooms: &[Room]) -> (usize, usize) {
    let matched = map.rooms.iter().filter(|truth| rooms.iter().any(|room| room_iou(truth, room) >= 0.5));
    (map.rooms.len(), matched.count())
}

fn room_iou(truth: &TrueRoom, room: &Room) -> f64 {
    const STEP_M: f64 = 0.1;
    let corners = truth.corners_m.iter().map(|c| [c.x, c.y]).chain(room.polygon_m.iter().copied());
    let (mut low, mut high) = ([f64::MAX; 2], [f64::MIN; 2]);
    for corner in corners {
        for axis in 0..2 {
            low[axis] = low[axis].min(corner[axis]);
            high[axis] = high[axis].max(corner[axis]);
        }
    }
    let inside = |p: &Point2| {
        (0..4).all(|i| {
            let (a, b) = (truth.corners_m[i], truth.corners_m[(i + 1) % 4]);
            (b - a).perp(&(p - a)) >= 0.0
        })
    };
    let (mut both, mut either) = (0, 0);
    let count = |axis: usize| ((high[axis] - low[axis]) / STEP_M) as usize + 1;
    for (i, j) in (0..count(0)).flat_map(|i| (0..count(1)).map(move |j| (i, j))) {
        let p = Point2::new(low[0] + (i as f64 + 0.5) * STEP_M, low[1] + (j as f64 + 0.5) * STEP_M);
        let (t, r) = (inside(&p), room.contains(&p));
        both += usize::from(t && r);
        either += usize::from(t || r);
    }
    f64::from(both as u32) / f64::from(either.max(1) as u32)
}

/// Scores over simulated homes.
#[derive(Default)]
pub struct SimulatedScore {
    pub objects: Matches,
    /// Number of true rooms, and of those that a computed room matches.
    pub rooms: usize,
    pub matched_rooms: usize,
    pub plan: PlanScore,
}

/// Rooms, objects and floor plan that were computed for a home.
pub struct ComputedHome {
    pub rooms: Vec<Room>,
    pub objects: Vec<Object>,
    pub plan: Plan,
}

impl SimulatedMap {
    /// Computes rooms, objects and floor plan. `voxel_m` is the distance of the points.
    pub fn compute(&self, voxel_m: f64) -> ComputedHome {
        let rooms = home::rooms(&self.lidar, &self.points);
        let objects = home::objects(&self.points, &rooms, voxel_m);
        let plan = home::plan(&self.lidar, &self.points, &rooms, &objects);
        ComputedHome { rooms, objects, plan }
    }
}

impl SimulatedScore {
    /// Adds the score of a home.
    pub fn add(&mut self, map: &SimulatedMap, computed: &ComputedHome) {
        self.objects.add(&match_objects(map, &computed.objects));
        let (there, matched) = count_rooms(map, &computed.rooms);
        self.rooms += there;
        self.matched_rooms += matched;
        score_plan(&map.plan, &computed.plan, &mut self.plan);
    }
}

/// Returns the scores of objects, computed rooms and floor plans over simulated homes. `advance` is called after each.
pub fn simulated(
    set: Set,
    seeds: impl Iterator<Item = u64>,
    params: &SampleParams,
    advance: &dyn Fn(u64),
) -> Result<SimulatedScore, LidarError> {
    let mut score = SimulatedScore::default();
    for seed in seeds {
        let map = sample(&HomeParams::new(set, seed), params)?;
        score.add(&map, &map.compute(params.voxel_m));
        advance(seed);
    }
    Ok(score)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Held-out homes. The thresholds are the project's goals: 70 % recall and precision of furniture, four
    /// rooms of five.
    #[test]
    fn furniture_and_rooms_of_simulated_homes_are_found() {
        let params = SampleParams { rays: 10_000, ..SampleParams::default() };
        let SimulatedScore { objects, rooms, matched_rooms: matched, plan } =
            simulated(Set::Normal, 3000..3003, &params, &|_| ()).unwrap();
        assert!(objects.total.truth > 40, "{objects:?}");
        assert!(objects.total.recall() >= 0.7, "{}", objects.markdown());
        assert!(objects.total.precision() >= 0.7, "{}", objects.markdown());
        assert!(matched * 5 >= rooms * 4, "{matched} of {rooms}");
        assert!(plan.recall() > 0.93 && plan.precision() > 0.92, "{}", plan.markdown());
        assert_eq!(plan.overlaps + plan.broken_rooms, 0);
    }

    #[test]
    fn the_true_rooms_are_not_in_the_map() {
        let params = SampleParams { rays: 200, ..SampleParams::default() };
        let map = sample(&HomeParams::new(Set::Normal, 2001), &params).unwrap();
        assert!(!map.rooms.is_empty() && map.lidar.rooms.is_empty());
    }
}
