//! Open leaves of doors, by their shape: thin upright slabs beside a doorway, whatever their label. A leaf is no wall.

mod clear;

use super::evidence::{Evidence, LOWEST_M, height, is_upright};
use crate::map_point::MapPoint;
use std::collections::BTreeSet;
use viola_geometry::{Point2, Vector2};

/// Width of a leaf, and its largest difference from the width of the doorway.
const WIDTH_M: [f64; 2] = [0.6, 1.1];
const SAME_WIDTH_M: f64 = 0.15;
/// Maximum distance of the hinge from the doorway's jamb.
const HINGE_M: f64 = 0.2;
/// Angles of an open leaf to the closed one. Nearer to the wall, its points are the wall's.
const ANGLES_DEG: [f64; 2] = [30.0, 150.0];
const ANGLE_STEP_DEG: f64 = 3.0;
/// Points of a leaf are this near the middle of its thickness: 2 cm and noise.
const SLAB_M: f64 = 0.05;
/// Something as wide as this on one side is free: furniture and walls are thicker.
const BESIDE_M: [f64; 2] = [0.09, 0.25];
/// The front of a piece of furniture, whose side looks like a leaf, is sought from this distance on, and has at least this many
/// steps there.
const FRONT_M: f64 = 0.1;
const MIN_FRONT: usize = 4;
/// Surface this far beyond a leaf shows whether it ends.
const BEYOND_M: f64 = 0.5;
/// Side of a column of points, step along a leaf, and step across it in which its middle is sought.
const COLUMN_M: f64 = 0.03;
const STEP_M: f64 = 0.05;
const ACROSS_M: f64 = 0.02;
/// Heights, as bits of the evidence: of the leaf without its foot and its top, of its top (1.6 to 2.2 m), and above it.
const BODY: u32 = 0x7fe;
const TOP: u32 = 0x3c00;
const ABOVE: u32 = !0 << 14;
/// Minimum heights of a step that shows the leaf, and minimum fraction of the steps that do.
const MIN_HEIGHTS: u32 = 5;
const SHOWN_FRACTION: f64 = 0.7;
/// Minimum fraction of these steps that reach the top, and maximum fraction of those that reach above it.
const TOP_FRACTION: f64 = 0.5;
const ABOVE_FRACTION: f64 = 0.2;
/// Maximum fraction of them with surface on the free side.
const BESIDE_FRACTION: f64 = 0.3;
/// Steps that may be hidden in a row.
const HIDDEN_STEPS: usize = 2;
/// Columns around the doorway that reach above leaves: clips saw what is there.
const MIN_ABOVE: usize = 5;
/// Surface this far from the middle of a doorway may be its leaf.
const REACH_M: f64 = 2.0;
/// Side of the squares in which points near doorways are sought.
const SQUARE_M: f64 = 0.5;

/// A gap in a wall: the ends of its centre line, and the thickness of the wall.
#[derive(Debug, Clone, Copy)]
pub(super) struct Doorway {
    pub ends_m: [[f64; 2]; 2],
    pub thickness_m: f64,
}

/// An open leaf: its centre line from the hinge to the other end, in the plan's frame.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct OpenLeaf {
    pub hinge: Point2,
    pub end: Point2,
}

/// Upright surface above a small square, as heights of the evidence.
struct Column {
    at: Point2,
    heights: u32,
}

/// The way from a jamb of a doorway: along the closed leaf, and into the room.
pub(super) struct Jamb {
    pub corner: Point2,
    pub along: Vector2,
    pub into: Vector2,
    width_m: f64,
}

impl Doorway {
    fn width_m(&self) -> f64 {
        let [a, b] = self.ends_m;
        (b[0] - a[0]).hypot(b[1] - a[1])
    }

    fn middle(&self) -> Point2 {
        let [a, b] = self.ends_m.map(Point2::from);
        nalgebra::center(&a, &b)
    }

    fn may_have_leaf(&self) -> bool {
        (WIDTH_M[0] - SAME_WIDTH_M..=WIDTH_M[1] + SAME_WIDTH_M).contains(&self.width_m())
    }

    /// Returns its four corners with the directions of a leaf that is hinged there.
    pub fn jambs(&self) -> Vec<Jamb> {
        let [a, b] = self.ends_m.map(Point2::from);
        let width_m = self.width_m();
        let Some(direction) = (b - a).try_normalize(1e-9) else { return Vec::new() };
        let across = Vector2::new(-direction.y, direction.x);
        let jamb = |end: Point2, along: Vector2, into: Vector2| Jamb {
            corner: end + into * (self.thickness_m / 2.0),
            along,
            into,
            width_m,
        };
        [(a, direction), (b, -direction)]
            .into_iter()
            .flat_map(|(end, along)| [across, -across].map(|into| jamb(end, along, into)))
            .collect()
    }
}

/// Returns the open leaves at some doorways. `points` is the fused map.
pub(super) fn leaves(doorways: &[Doorway], points: &[MapPoint], evidence: &Evidence) -> Vec<OpenLeaf> {
    let doorways: Vec<&Doorway> = doorways.iter().filter(|doorway| doorway.may_have_leaf()).collect();
    let columns = columns(&doorways, points, evidence);
    let mut found: Vec<(u32, OpenLeaf)> = Vec::new();
    for doorway in doorways {
        let middle = doorway.middle();
        let near: Vec<&Column> =
            columns.iter().filter(|column| (column.at - middle).norm() <= REACH_M).collect();
        if near.iter().filter(|column| column.heights & ABOVE != 0).count() >= MIN_ABOVE {
            found.extend(doorway.jambs().iter().filter_map(|jamb| jamb.leaf(&near)));
        }
    }
    // The best first: several gaps may be in one doorway.
    found.sort_by_key(|(score, _)| std::cmp::Reverse(*score));
    let mut leaves: Vec<OpenLeaf> = Vec::new();
    for (_, leaf) in found {
        if !leaves.iter().any(|other| other.is_same(&leaf)) {
            leaves.push(leaf);
        }
    }
    leaves
}

/// Returns the columns of upright surface near doorways.
fn columns(doorways: &[&Doorway], points: &[MapPoint], evidence: &Evidence) -> Vec<Column> {
    let key = |p: &Point2, side_m: f64| [p.x, p.y].map(|metres| (metres / side_m).floor() as i32);
    let mut squares: BTreeSet<[i32; 2]> = BTreeSet::new();
    for doorway in doorways {
        let middle = doorway.middle();
        let reach = Vector2::repeat(REACH_M);
        let [low, high] = [middle - reach, middle + reach].map(|corner| key(&corner, SQUARE_M));
        squares.extend((low[0]..=high[0]).flat_map(|x| (low[1]..=high[1]).map(move |y| [x, y])));
    }
    let mut near: Vec<([i32; 2], Point2, u32)> = Vec::new();
    for point in points.iter().filter(|point| is_upright(point)) {
        let [x, y, z] = point.point.position_m.map(f64::from);
        let at = evidence.plan_from_map.apply(&Point2::new(x, y));
        if z >= LOWEST_M && squares.contains(&key(&at, SQUARE_M)) {
            near.push((key(&at, COLUMN_M), at, height(z)));
        }
    }
    near.sort_by_key(|(key, ..)| *key);
    let column = |same: &[([i32; 2], Point2, u32)]| {
        let sum = same.iter().fold(Vector2::zeros(), |sum, (_, at, _)| sum + at.coords);
        Column {
            at: Point2::from(sum / same.len() as f64),
            heights: same.iter().fold(0, |heights, (.., height)| heights | height),
        }
    };
    near.chunk_by(|a, b| a.0 == b.0).map(column).collect()
}

/// Steps along a line from a jamb: the heights on the line, and on both sides of it.
struct Steps {
    on: Vec<u32>,
    beside: [Vec<u32>; 2],
}

fn shows(heights: u32) -> bool {
    (heights & BODY).count_ones() >= MIN_HEIGHTS
}

/// A column by its coordinates along a leaf and across it, from the jamb.
struct Local {
    along_m: f64,
    across_m: f64,
    heights: u32,
}

impl Jamb {
    /// Returns the leaf that is hinged here, with its score: the heights that show it.
    fn leaf(&self, columns: &[&Column]) -> Option<(u32, OpenLeaf)> {
        let reach_m = self.width_m + BEYOND_M;
        let offsets = columns.iter().map(|column| (column.at - self.corner, column.heights));
        let near: Vec<(Vector2, u32)> =
            offsets.filter(|(off, _)| off.norm() <= reach_m && off.dot(&self.into) >= -SLAB_M).collect();
        let count = ((ANGLES_DEG[1] - ANGLES_DEG[0]) / ANGLE_STEP_DEG).round() as usize;
        let angles = (0..=count).map(|step| ANGLES_DEG[0] + step as f64 * ANGLE_STEP_DEG);
        let found = angles.filter_map(|degrees| {
            let (sin, cos) = degrees.to_radians().sin_cos();
            self.leaf_along(&(self.along * cos + self.into * sin), &near)
        });
        found.reduce(|best, next| if next.0 > best.0 { next } else { best })
    }

    /// Returns the leaf in a direction. `near` are columns by their offset from the jamb.
    fn leaf_along(&self, reach: &Vector2, near: &[(Vector2, u32)]) -> Option<(u32, OpenLeaf)> {
        let across = Vector2::new(-reach.y, reach.x);
        let local = |(off, heights): &(Vector2, u32)| Local {
            along_m: off.dot(reach),
            across_m: off.dot(&across),
            heights: *heights,
        };
        let mut columns: Vec<Local> = near.iter().map(local).collect();
        let off_m = middle_m(self.width_m, &columns)?;
        columns.iter_mut().for_each(|column| column.across_m -= off_m);
        let steps = Steps::new(&columns);
        let [first, last] = steps.run()?;
        let [from_m, to_m] = [first, last + 1].map(|step| step as f64 * STEP_M);
        let hinge = self.corner + across * off_m + reach * from_m;
        let is_leaf = (WIDTH_M[0]..=WIDTH_M[1]).contains(&(to_m - from_m))
            && (to_m - from_m - self.width_m).abs() <= SAME_WIDTH_M
            && (hinge - self.corner).norm() <= HINGE_M
            && steps.is_leaf(first, last)
            && !has_front(to_m, &columns);
        let is_on = |column: &&Local| {
            (from_m..to_m).contains(&column.along_m) && column.across_m.abs() <= SLAB_M / 2.0
        };
        let score = || columns.iter().filter(is_on).map(|column| (column.heights & BODY).count_ones()).sum();
        is_leaf.then(|| (score(), OpenLeaf { hinge, end: hinge + reach * (to_m - from_m) }))
    }
}

/// Returns where across a direction the most surface is, within reach of a hinge.
fn middle_m(width_m: f64, columns: &[Local]) -> Option<f64> {
    const BINS: usize = 2 * (HINGE_M / ACROSS_M) as usize + 1;
    /// Two faces 4 cm apart, and no wall behind them.
    const HALF: usize = 1;
    let mut counts = [0u32; BINS];
    for column in columns.iter().filter(|column| (2.0 * SLAB_M..width_m).contains(&column.along_m)) {
        let bin = ((column.across_m + HINGE_M) / ACROSS_M).round();
        if (0.0..BINS as f64).contains(&bin) {
            counts[bin as usize] += (column.heights & BODY).count_ones();
        }
    }
    let window = |bin: usize| bin.saturating_sub(HALF)..(bin + HALF + 1).min(BINS);
    let sum = |bin: usize| counts[window(bin)].iter().sum::<u32>();
    let best = (0..BINS).max_by_key(|bin| (sum(*bin), counts[*bin], std::cmp::Reverse(*bin)))?;
    // The middle of the surface in the window, which two faces of a leaf share.
    let weighted: f64 = window(best).map(|bin| f64::from(counts[bin]) * bin as f64).sum();
    (sum(best) > 0).then(|| weighted / f64::from(sum(best)) * ACROSS_M - HINGE_M)
}

impl Steps {
    fn new(columns: &[Local]) -> Steps {
        let count = ((WIDTH_M[1] + BEYOND_M) / STEP_M) as usize;
        let mut steps = Steps { on: vec![0; count], beside: [vec![0; count], vec![0; count]] };
        for Local { along_m, across_m, heights } in columns {
            let step = (along_m / STEP_M).floor();
            if !(0.0..count as f64).contains(&step) {
                continue;
            }
            if across_m.abs() <= SLAB_M {
                steps.on[step as usize] |= heights;
            } else if (BESIDE_M[0]..=BESIDE_M[1]).contains(&across_m.abs()) {
                steps.beside[usize::from(*across_m > 0.0)][step as usize] |= heights;
            }
        }
        steps
    }

    /// Returns the first and the last step of the surface that begins near the hinge. None if it has no end.
    fn run(&self) -> Option<[usize; 2]> {
        let nearest = (HINGE_M / STEP_M) as usize;
        let first = (0..=nearest).find(|step| shows(self.on[*step]))?;
        let mut last = first;
        for step in first + 1..self.on.len() {
            if shows(self.on[step]) {
                last = step;
            } else if step - last > HIDDEN_STEPS {
                return Some([first, last]);
            }
        }
        None
    }

    /// Returns whether a run is as high as a leaf, and free on one side.
    fn is_leaf(&self, first: usize, last: usize) -> bool {
        let shown: Vec<usize> = (first..=last).filter(|step| shows(self.on[*step])).collect();
        let fraction = |is: &dyn Fn(usize) -> bool| {
            shown.iter().filter(|step| is(**step)).count() as f64 / shown.len().max(1) as f64
        };
        let is_free = |side: &Vec<u32>| fraction(&|step| shows(side[step])) <= BESIDE_FRACTION;
        shown.len() as f64 >= SHOWN_FRACTION * (last - first + 1) as f64
            && fraction(&|step| self.on[step] & TOP != 0) >= TOP_FRACTION
            && fraction(&|step| self.on[step] & ABOVE != 0) <= ABOVE_FRACTION
            && self.beside.iter().any(is_free)
    }
}

/// Returns whether surface goes on at a right angle from the end of a slab: the front of furniture.
fn has_front(end_m: f64, columns: &[Local]) -> bool {
    const STEPS: usize = 7;
    let mut sides = [[0u32; STEPS]; 2];
    for Local { along_m, across_m, heights } in columns {
        let step = ((across_m.abs() - FRONT_M) / STEP_M).floor();
        if (along_m - end_m).abs() <= 2.0 * SLAB_M && (0.0..STEPS as f64).contains(&step) {
            sides[usize::from(*across_m > 0.0)][step as usize] |= heights;
        }
    }
    let is_front = |side: &[u32; STEPS]| side.iter().filter(|heights| shows(**heights)).count() >= MIN_FRONT;
    sides.iter().any(is_front)
}

impl OpenLeaf {
    fn length_m(&self) -> f64 {
        (self.end - self.hinge).norm()
    }

    fn is_same(&self, other: &OpenLeaf) -> bool {
        (self.hinge - other.hinge).norm() <= HINGE_M && (self.end - other.end).norm() <= HINGE_M
    }

    /// Returns whether it is the leaf of a doorway.
    pub fn is_at(&self, doorway: &Doorway) -> bool {
        let is_into = |jamb: &Jamb| (self.end - self.hinge).dot(&jamb.into) > 0.0;
        (self.length_m() - doorway.width_m()).abs() <= SAME_WIDTH_M
            && doorway
                .jambs()
                .iter()
                .any(|jamb| is_into(jamb) && (self.hinge - jamb.corner).norm() <= HINGE_M)
    }
}
