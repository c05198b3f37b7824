//! Classifies surface by shape alone: floor, wall, ceiling, or something in front of them.

use super::planes::{self, Upright};
use super::sites::Sites;
use rayon::prelude::*;
use rustc_hash::{FxHashMap, FxHashSet};
use viola_geometry::{Vector2, cells_around};

/// An upright patch that reaches this height is a wall, unless it is a front ...
const TALL_M: f64 = 1.9;
/// ... and so is an upright patch of this height from bottom to top, at any place.
const EXTENT_M: f64 = 1.2;
/// Minimum area of a classified patch.
const MIN_AREA_M2: f64 = 0.25;
/// A patch with a parallel wall less than this behind it is the front of something.
const DEPTH_M: f64 = 0.9;
/// Minimum height of a ceiling.
const CEILING_M: f64 = 2.0;
/// Maximum distance of floor from the floor's plane: a scanned floor is uneven, and the fused surface of a long
/// clip bends. Treads and landings of stairs that go down are lower.
const UNEVEN_M: f64 = 0.12;
/// A patch whose bottom is above this can be the front of a wall cabinet: the wall behind it is seen only below
/// it, down to the counter.
const HANGING_M: f64 = 1.0;

/// Shape of a site, without its pictures.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Shape {
    Floor,
    /// In an upright plane that is tall enough for a wall.
    Wall,
    Ceiling,
    /// In an upright plane with a wall close behind most of it, or with a top: the front of a cabinet.
    Front,
    /// In another upright plane.
    Upright,
    /// None of these.
    Loose,
}

/// The seen part of a wall, in the clip frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Wall {
    /// Towards the seen side.
    pub normal: Vector2,
    /// Distance of the wall's plane from the origin along the normal.
    pub offset_m: f64,
    /// Start along [`Wall::along`].
    pub from_m: f64,
    /// Lowest and highest surface in each [`Wall::STEP_M`] from there; `None` if nothing was seen.
    pub seen_m: Vec<Option<(f64, f64)>>,
}

impl Wall {
    pub const STEP_M: f64 = 0.06;

    /// Returns the horizontal direction in the wall.
    pub fn along(&self) -> Vector2 {
        Vector2::new(-self.normal.y, self.normal.x)
    }

    /// Returns the end along [`Wall::along`].
    pub fn to_m(&self) -> f64 {
        self.from_m + self.seen_m.len() as f64 * Wall::STEP_M
    }

    fn of(patch: &Upright, sites: &Sites) -> Wall {
        let steps = ((patch.to_m - patch.from_m) / Wall::STEP_M) as usize + 1;
        let mut seen_m = vec![None; steps];
        let along = patch.along();
        for &member in &patch.members {
            let at = sites.positions_m[member as usize];
            let step = ((at.coords.xy().dot(&along) - patch.from_m) / Wall::STEP_M) as usize;
            let (low, high) = seen_m[step.min(steps - 1)].unwrap_or((at.z, at.z));
            seen_m[step.min(steps - 1)] = Some((f64::min(low, at.z), f64::max(high, at.z)));
        }
        Wall { normal: patch.normal, offset_m: patch.offset_m, from_m: patch.from_m, seen_m }
    }
}

/// Returns the shape of each site, and the walls. `sites` are in the clip frame: z up, the floor at 0.
pub fn shapes(sites: &Sites) -> (Vec<Shape>, Vec<Wall>) {
    let patches = planes::upright_patches(sites);
    let level: Vec<usize> = (0..sites.len()).filter(|&i| sites.smooth_normals[i].z >= 0.7).collect();
    let mut shapes = vec![Shape::Loose; sites.len()];
    let mut walls = Vec::new();
    for patch in patches.iter().filter(|patch| patch.area_m2 >= MIN_AREA_M2) {
        let shape = shape_of(patch, &patches, &level, sites);
        for &member in &patch.members {
            shapes[member as usize] = shape;
        }
        if shape == Shape::Wall {
            walls.push(patch);
        }
    }
    for wall in &walls {
        claim(wall, sites, &mut shapes);
    }
    for (i, shape) in shapes.iter_mut().enumerate() {
        let (z, up) = (sites.positions_m[i].z, sites.smooth_normals[i].z);
        if (-UNEVEN_M..UNEVEN_M).contains(&z) && up > 0.65 {
            *shape = Shape::Floor;
        } else if z > CEILING_M && up < -0.85 {
            *shape = Shape::Ceiling;
        }
    }
    (shapes, walls.into_iter().map(|patch| Wall::of(patch, sites)).collect())
}

/// `level` are the sites that face up.
fn shape_of(patch: &Upright, all: &[Upright], level: &[usize], sites: &Sites) -> Shape {
    let height_m = patch.high_m - patch.low_m;
    if height_m < 0.3 {
        return Shape::Upright;
    }
    if wall_behind(patch, all, sites) > 0.5 || has_top(patch, level, sites) {
        Shape::Front
    } else if patch.high_m >= TALL_M || height_m >= EXTENT_M {
        Shape::Wall
    } else {
        Shape::Upright
    }
}

/// Returns the fraction of a patch's length that has a parallel wall close behind it. Furniture hides most of
/// the wall behind it, so a small visible part of the wall is enough.
fn wall_behind(patch: &Upright, all: &[Upright], sites: &Sites) -> f64 {
    const SECTION_M: f64 = 0.25;
    const CLOSE_M: f64 = 0.1;
    /// Minimum area of wall behind a section and the two beside it.
    const MIN_WALL_BEHIND_M2: f64 = 0.01;
    /// Minimum area of the wall below a wall cabinet, and its maximum height above the cabinet's bottom.
    const MIN_STRIP_M2: f64 = 0.1;
    const OVERLAP_M: f64 = 0.25;
    let along = patch.along();
    let is_tall = |other: &Upright| other.area_m2 >= MIN_AREA_M2 && other.high_m >= TALL_M;
    let is_strip = |other: &Upright| {
        patch.low_m > HANGING_M && other.area_m2 >= MIN_STRIP_M2 && other.high_m <= patch.low_m + OVERLAP_M
    };
    let is_wall = |other: &&Upright| {
        (is_tall(other) || is_strip(other))
            && other.normal.dot(&patch.normal) > 0.97
            && !std::ptr::eq(*other, patch)
    };
    let place = |i: u32| -> Vector2 { sites.positions_m[i as usize].coords.xy() };
    let section = |at: &Vector2| (at.dot(&along) / SECTION_M).floor() as i32;
    let mut behind: FxHashMap<i32, usize> = FxHashMap::default();
    for at in all.iter().filter(is_wall).flat_map(|other| &other.members).map(|&i| place(i)) {
        if (CLOSE_M..DEPTH_M).contains(&(patch.offset_m - at.dot(&patch.normal))) {
            *behind.entry(section(&at)).or_default() += 1;
        }
    }
    let own: FxHashSet<i32> = patch.members.iter().map(|&i| section(&place(i))).collect();
    let has_wall = |own: &&i32| {
        let near = (-1..=1).map(|step| behind.get(&(**own + step)).copied().unwrap_or(0));
        sites.area_m2(near.sum()) > MIN_WALL_BEHIND_M2
    };
    own.iter().filter(has_wall).count() as f64 / own.len().max(1) as f64
}

/// Returns whether a level surface begins at the upper edge of a patch and extends back from it. `level` are the sites that
/// face up.
fn has_top(patch: &Upright, level: &[usize], sites: &Sites) -> bool {
    /// Minimum square metres of top for each metre of front: a strip of 10 cm.
    const DEEP_M: f64 = 0.1;
    let along = patch.along();
    let count = level
        .par_iter()
        .with_min_len(4096)
        .filter(|&&i| {
            let at = sites.positions_m[i];
            if (at.z - patch.high_m).abs() > 0.12 {
                return false;
            }
            let behind_m = patch.offset_m - at.coords.xy().dot(&patch.normal);
            (0.03..0.6).contains(&behind_m)
                && (patch.from_m..patch.to_m).contains(&at.coords.xy().dot(&along))
        })
        .count();
    sites.area_m2(count) > DEEP_M * (patch.to_m - patch.from_m)
}

/// Adds tilted sites on the wall's plane to it: beside edges, the smoothed normal is not the wall's.
fn claim(wall: &Upright, sites: &Sites, shapes: &mut [Shape]) {
    const ON_M: f64 = 0.08;
    const CELL_M: f64 = 0.15;
    let along = wall.along();
    let cell = |i: usize| {
        let at = sites.positions_m[i];
        [at.coords.xy().dot(&along), at.z].map(|c| (c / CELL_M).floor() as i32)
    };
    let cells: FxHashSet<[i32; 2]> = wall.members.iter().map(|&i| cell(i as usize)).collect();
    let is_beside = |at: [i32; 2]| cells_around(at).any(|near| cells.contains(&near));
    shapes.par_iter_mut().with_min_len(4096).enumerate().for_each(|(i, shape)| {
        let at = sites.positions_m[i];
        if matches!(shape, Shape::Loose | Shape::Upright)
            && at.z > 0.08
            && (at.coords.xy().dot(&wall.normal) - wall.offset_m).abs() < ON_M
            && sites.normals[i].xy().dot(&wall.normal).abs() > 0.3
            && is_beside(cell(i))
        {
            *shape = Shape::Wall;
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::ops::Range;
    use viola_geometry::{Point3, Vector3};

    /// Returns an upright patch that faces +x at `offset_m`, seen along `seen_m` from the lower to the upper end of
    /// `up_m`.
    fn upright(sites: &mut Sites, offset_m: f64, seen_m: Range<f64>, up_m: Range<f64>) -> Upright {
        const STEP_M: f64 = 0.05;
        let first = sites.positions_m.len() as u32;
        let cells = |range: &Range<f64>| (range.start / STEP_M) as usize..(range.end / STEP_M) as usize;
        for along in cells(&seen_m) {
            let at = |up: usize| Point3::new(offset_m, along as f64 * STEP_M, up as f64 * STEP_M);
            sites.positions_m.extend(cells(&up_m).map(at));
        }
        sites.voxel_m = STEP_M;
        let members: Vec<u32> = (first..sites.positions_m.len() as u32).collect();
        Upright {
            normal: Vector2::x(),
            offset_m,
            area_m2: sites.area_m2(members.len()),
            members,
            low_m: up_m.start,
            high_m: up_m.end,
            from_m: seen_m.start,
            to_m: seen_m.end,
        }
    }

    /// Checks the fraction for a patch of two metres with a wall `behind_m` behind it, seen along `seen_m`.
    fn check(behind_m: f64, seen_m: Range<f64>, want: std::ops::RangeInclusive<f64>) {
        let mut sites = Sites::default();
        let patch = upright(&mut sites, 0.0, 0.0..2.0, 0.0..2.0);
        let all = [patch, upright(&mut sites, -behind_m, seen_m.clone(), 0.0..2.0)];
        let fraction = wall_behind(&all[0], &all, &sites);
        assert!(want.contains(&fraction), "{behind_m} m behind, {seen_m:?}: {fraction}");
    }

    #[test]
    fn a_wall_behind_counts_by_the_length_that_it_stands_behind() {
        check(0.5, 0.0..2.0, 1.0..=1.0);
        // A section next to a section with a wall behind it counts, too.
        check(0.5, 0.0..1.0, 0.5..=0.75);
        check(0.5, 2.5..4.0, 0.0..=0.0);
        // The same wall, and a wall of another room.
        check(0.05, 0.0..2.0, 0.0..=0.0);
        check(1.2, 0.0..2.0, 0.0..=0.0);
    }

    /// Checks the shape of a patch 0.35 m before a wall that is seen within `strip_m` only, and 0.25 m behind the
    /// front of a counter.
    fn check_cabinet(up_m: Range<f64>, strip_m: Range<f64>, want: Shape) {
        let mut sites = Sites::default();
        let patch = upright(&mut sites, 0.35, 0.0..2.0, up_m.clone());
        let strip = upright(&mut sites, 0.0, 0.0..2.0, strip_m.clone());
        let all = [patch, strip, upright(&mut sites, 0.6, 0.0..2.0, 0.0..0.9)];
        assert_eq!(shape_of(&all[0], &all, &[], &sites), want, "{up_m:?} before {strip_m:?}");
    }

    #[test]
    fn a_wall_cabinet_is_a_front_if_the_wall_below_it_is_seen() {
        check_cabinet(1.4..2.2, 0.9..1.4, Shape::Front);
        check_cabinet(1.4..2.2, 0.9..1.6, Shape::Front);
        // The surface behind does not end below the patch, or is too small.
        check_cabinet(1.4..2.2, 0.9..1.75, Shape::Wall);
        check_cabinet(1.4..2.2, 1.3..1.35, Shape::Wall);
        // A wall that stands on the floor.
        check_cabinet(0.0..2.2, 0.0..0.2, Shape::Wall);
        check_cabinet(0.0..2.2, 0.0..2.0, Shape::Front);
    }

    #[test]
    fn the_floor_ends_below_its_plane() {
        let heights_m = [0.05, -0.05, -0.11, -0.17, -0.34, -2.0, 0.13];
        let normals = vec![Vector3::z(); heights_m.len()];
        let sites = Sites {
            positions_m: heights_m.map(|z| Point3::new(0.0, 0.0, z)).to_vec(),
            smooth_normals: normals.clone(),
            flatness: vec![1.0; heights_m.len()],
            normals,
            voxel_m: 0.03,
            ..Sites::default()
        };
        let floor = [Shape::Floor; 3].into_iter().chain([Shape::Loose; 4]);
        assert_eq!(shapes(&sites).0, floor.collect::<Vec<Shape>>());
    }
}
