//! A clip's upright surface in few points: which clips see the same surface is estimated without reading them.

use super::surface::{Surface, cell};
use nalgebra::Vector2;
use rustc_hash::FxHashMap;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use viola_geometry::{Point2, Point3, Pose2, Vector3};

/// Side of the cells whose surface is one patch.
const CELL_M: f64 = 0.4;
/// Minimum number of points of a patch, and minimum length of the mean of their normals.
const MIN_POINTS: u32 = 6;
const MIN_FLATNESS: f64 = 0.7;
/// Two patches closer than this that face the same way are the same surface: patches of two clips have other cells.
const NEAR_M: f64 = 0.4;
const FACING: f64 = 0.8;

/// Patches of a clip's upright surface, in the clip's frame.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Footprint(Vec<[i16; 4]>);

/// Steps of a stored position and direction.
const PER_M: f64 = 100.0;
const PER_RAD: f64 = 100.0;

impl Footprint {
    pub(super) fn of(surface: &Surface) -> Footprint {
        let mut cells: BTreeMap<[i32; 3], (Vector3, Vector3, u32)> = BTreeMap::new();
        for point in surface.points.iter().filter(|point| point.is_upright()) {
            let (position, normal, count) = cells.entry(cell(&point.position, CELL_M)).or_default();
            *position += point.position.coords;
            *normal += point.normal;
            *count += 1;
        }
        let patch = |(position, normal, count): (Vector3, Vector3, u32)| {
            let (position, normal) = (position / f64::from(count), normal / f64::from(count));
            let stored = |value: f64, steps: f64| (value * steps).round() as i16;
            let facing = normal.y.atan2(normal.x);
            (count >= MIN_POINTS && normal.norm() > MIN_FLATNESS).then(|| {
                let [x, y, z] = <[f64; 3]>::from(position).map(|metres| stored(metres, PER_M));
                [x, y, z, stored(facing, PER_RAD)]
            })
        };
        Footprint(cells.into_values().filter_map(patch).collect())
    }

    /// Returns the patches in the map. The origin of the clip's frame is `rise_m` above the floor.
    pub(super) fn placed(&self, map_from_clip: &Pose2, rise_m: f64) -> PlacedFootprint {
        let mut placed = PlacedFootprint::default();
        for (number, [x, y, z, facing]) in (0u32..).zip(&self.0) {
            let [x, y, z] = [x, y, z].map(|steps| f64::from(*steps) / PER_M);
            let at = map_from_clip.apply(&Point2::new(x, y));
            let (sin, cos) = (f64::from(*facing) / PER_RAD + map_from_clip.yaw_rad).sin_cos();
            let patch = Patch { at: Point3::new(at.x, at.y, z + rise_m), facing: Vector2::new(cos, sin) };
            placed.cells.entry(cell(&patch.at, CELL_M)).or_default().push(number);
            placed.patches.push(patch);
        }
        placed
    }
}

struct Patch {
    at: Point3,
    facing: Vector2<f64>,
}

/// Patches of a clip in the map.
#[derive(Default)]
pub(super) struct PlacedFootprint {
    patches: Vec<Patch>,
    cells: FxHashMap<[i32; 3], Vec<u32>>,
}

impl PlacedFootprint {
    pub fn len(&self) -> usize {
        self.patches.len()
    }

    /// Returns the numbers of the patches whose surface `other` has, too.
    pub fn shared_with(&self, other: &PlacedFootprint) -> Vec<u32> {
        let is_shared = |patch: &Patch| other.has(patch);
        let numbered = (0..).zip(&self.patches).filter(|(_, patch)| is_shared(patch));
        numbered.map(|(number, _)| number).collect()
    }

    fn has(&self, patch: &Patch) -> bool {
        let [x, y, z] = cell(&patch.at, CELL_M);
        let around = (0..27).map(|i| [x + i % 3 - 1, y + i / 3 % 3 - 1, z + i / 9 - 1]);
        around.filter_map(|key| self.cells.get(&key)).flatten().any(|number| {
            let own = &self.patches[*number as usize];
            (own.at - patch.at).norm() < NEAR_M && own.facing.dot(&patch.facing) > FACING
        })
    }
}
