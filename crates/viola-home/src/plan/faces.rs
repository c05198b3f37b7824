//! Straight faces of walls along the plan's axes, fitted to the columns of the evidence.

use super::axes::place;
use super::columns::Columns;
use super::evidence::{Evidence, Facing, above, by_lidar, fraction, heights, is_lintel, is_opening};
use super::glazed;
use viola_geometry::Point2;

/// Half of the band in which columns belong to one face: noise of clips, and half a cell of a LiDAR map.
pub(super) const BAND_M: f64 = 0.03;
/// Columns this near a face are no face of their own.
const CLEAR_M: f64 = 0.07;
/// Loss of a column without evidence: a doorway is bridged if as much wall is beside it.
pub(super) const GAP_LOSS: f32 = 0.3;
/// Minimum evidence of a face, as a length.
const MIN_FACE_M: f64 = 0.25;
/// Faces of one direction this near in line are one wall, which is drawn straight.
const SAME_LINE_M: f64 = 0.05;
const SAME_GAP_M: f64 = 2.0;
/// Doors and windows this far behind a face, or before it, belong to it.
pub(super) const BEHIND_M: f64 = 0.3;
pub(super) const BEFORE_M: f64 = 0.1;
/// Evidence of a face that only the LiDAR saw, if clips saw wall this far behind it: furniture, a radiator.
const STANDING_FRACTION: f32 = 0.1;
const STANDING_M: [f64; 2] = [0.07, 0.7];
/// The front of furniture: a clip saw at least this many heights of the wall above it, this far behind.
const FRONT_M: [f64; 2] = [0.15, 0.75];
const HIGHER: u32 = 2;
/// Heights that a clip must have seen of the wall behind.
const WALL_HEIGHTS: u32 = 3;
/// Evidence of a door or a window for the wall that it is in.
const OPENING_FRACTION: f32 = 0.9;
/// Floor at these distances behind a door is seen if it is open.
const BEHIND_LEAF_M: [f64; 2] = [0.15, 0.28];
/// A bound on work.
const MAX_FACES: usize = 600;

/// A face of a wall: it stands at `line_m` across `facing.axis`, and reaches from `from_m` to `to_m`.
#[derive(Debug, Clone)]
pub(super) struct Face {
    pub facing: Facing,
    pub line_m: f64,
    pub from_m: f64,
    pub to_m: f64,
    /// Evidence of each column from `from_m` on, 0..1.
    pub cover: Vec<f32>,
    pub along_m: f64,
    /// Weight of `line_m`: columns that clips saw.
    pub weight: f64,
}

impl Face {
    /// A face along a run of columns, whose evidence is not measured yet.
    pub fn new(facing: Facing, line_m: f64, seen: &Columns, run: &Run, weight: f64) -> Face {
        Face {
            facing,
            line_m,
            from_m: seen.low_m[1] + run.from as f64 * seen.along_m,
            to_m: seen.low_m[1] + run.to as f64 * seen.along_m,
            cover: Vec::new(),
            along_m: seen.along_m,
            weight,
        }
    }

    /// Returns the evidence at a place along the face; 0 beyond its ends.
    pub fn at(&self, along: f64) -> f32 {
        let column = ((along - self.from_m) / self.along_m).floor();
        if column < 0.0 { 0.0 } else { self.cover.get(column as usize).copied().unwrap_or(0.0) }
    }

    /// Returns the mean evidence of an interval.
    pub fn fraction(&self, from_m: f64, to_m: f64) -> f64 {
        let count = ((to_m - from_m) / self.along_m).ceil().max(1.0) as usize;
        let step = (to_m - from_m) / count as f64;
        let sum: f64 = (0..count).map(|i| f64::from(self.at(from_m + (i as f64 + 0.5) * step))).sum();
        sum / count as f64
    }
}

/// Returns the faces of all walls, the longest evidence of each facing first.
pub(super) fn faces(evidence: &Evidence) -> Vec<Face> {
    let mut all = Vec::new();
    for facing in Facing::ALL {
        let columns = &evidence.columns[facing.index()];
        let mut faces = of_facing(facing, columns);
        faces.extend(glazed::faces(facing, columns, &faces));
        straighten(&mut faces);
        for face in &mut faces {
            cover(face, evidence);
        }
        all.append(&mut faces);
    }
    all
}

/// A run of columns in a row of bins.
#[derive(Clone, Copy)]
pub(super) struct Run {
    pub gain: f32,
    pub from: usize,
    pub to: usize,
}

fn of_facing(facing: Facing, seen: &Columns) -> Vec<Face> {
    let half = ((BAND_M / seen.across_m).round() as usize).max(1);
    let mut left = Columns { bits: seen.bits.clone(), ..*seen };
    let best_of = |columns: &Columns, row: usize| {
        let rows = row.saturating_sub(half)..=(row + half).min(columns.across - 1);
        best_run((0..columns.along).map(|column| fraction(columns.band(rows.clone(), column)) - GAP_LOSS))
    };
    let mut best: Vec<Run> = (0..seen.across).map(|row| best_of(&left, row)).collect();
    let mut faces = Vec::new();
    while faces.len() < MAX_FACES {
        let Some(row) = (0..best.len()).max_by(|a, b| best[*a].gain.total_cmp(&best[*b].gain).then(b.cmp(a)))
        else {
            break;
        };
        let run = best[row];
        if f64::from(run.gain) * seen.along_m < MIN_FACE_M * f64::from(1.0 - GAP_LOSS) {
            break;
        }
        let (line_m, weight) = fitted(&left, row, half, &run);
        faces.push(Face::new(facing, line_m, seen, &run, weight));
        let near = seen.rows([line_m - CLEAR_M, line_m + CLEAR_M]);
        let (low, high) = (row.min(*near.start()), row.max(*near.end()));
        for row in low..=high {
            left.bits[row * seen.along + run.from..row * seen.along + run.to].fill(0);
        }
        for (row, best) in best.iter_mut().enumerate().take(high + half + 1).skip(low.saturating_sub(half)) {
            *best = best_of(&left, row);
        }
    }
    faces
}

/// Returns the run with the largest sum.
pub(super) fn best_run(gains: impl Iterator<Item = f32>) -> Run {
    let mut best = Run { gain: 0.0, from: 0, to: 0 };
    let (mut sum, mut from) = (0.0, 0);
    for (at, gain) in gains.enumerate() {
        if sum <= 0.0 {
            (sum, from) = (0.0, at);
        }
        sum += gain;
        if sum > best.gain {
            best = Run { gain: sum, from, to: at + 1 };
        }
    }
    best
}

/// Returns the place of a face and its weight: the median of what clips saw, else of the LiDAR map's cells.
fn fitted(columns: &Columns, row: usize, half: usize, run: &Run) -> (f64, f64) {
    let rows = row.saturating_sub(half + 1)..=(row + half + 1).min(columns.across - 1);
    let weigh = |by: &dyn Fn(u32) -> f64| -> Vec<(usize, f64)> {
        rows.clone()
            .map(|row| (row, (run.from..run.to).map(|c| by(columns.bits[row * columns.along + c])).sum()))
            .collect()
    };
    let total = |weights: &[(usize, f64)]| weights.iter().map(|(_, weight)| weight).sum::<f64>();
    let by_clips = weigh(&|bits| f64::from(heights(bits)));
    let by_map = weigh(&|bits| f64::from(u8::from(by_lidar(bits))));
    // A tenth of the face at three heights places it better than all of a raster.
    let enough = 0.3 * (run.to - run.from) as f64;
    let (weights, weight) = if total(&by_clips) >= enough {
        (&by_clips, total(&by_clips))
    } else {
        (&by_map, 0.01 * total(&by_map))
    };
    let (mut sum, half_of_all) = (0.0, total(weights) / 2.0);
    for (row, weight_here) in weights {
        if *weight_here > 0.0 && sum + weight_here >= half_of_all {
            let part = (half_of_all - sum) / weight_here;
            return (columns.low_m[0] + (*row as f64 + part) * columns.across_m, weight);
        }
        sum += weight_here;
    }
    (columns.low_m[0] + (row as f64 + 0.5) * columns.across_m, weight)
}

/// Puts faces that continue each other on one line, the heaviest first.
fn straighten(faces: &mut [Face]) {
    let mut order: Vec<usize> = (0..faces.len()).collect();
    order.sort_by(|a, b| faces[*b].weight.total_cmp(&faces[*a].weight).then(a.cmp(b)));
    for place in 1..order.len() {
        let (from_m, to_m, line_m) = {
            let face = &faces[order[place]];
            (face.from_m, face.to_m, face.line_m)
        };
        let heavier = order[..place].iter().map(|other| &faces[*other]).find(|other| {
            let gap_m = (from_m - other.to_m).max(other.from_m - to_m);
            (other.line_m - line_m).abs() <= SAME_LINE_M && gap_m <= SAME_GAP_M
        });
        if let Some(line_m) = heavier.map(|heavier| heavier.line_m) {
            faces[order[place]].line_m = line_m;
        }
    }
}

/// Measures the evidence of each column of a face.
fn cover(face: &mut Face, evidence: &Evidence) {
    let columns = &evidence.columns[face.facing.index()];
    // Rows from one distance before the face to another; behind it is negative.
    let rows = |behind_m: f64, before_m: f64| {
        columns.rows([behind_m, before_m].map(|metres| face.line_m + face.facing.sign() * metres))
    };
    let own = rows(-BAND_M - 0.02, BAND_M + 0.02);
    let deep = rows(-BEHIND_M, BEFORE_M);
    let behind = rows(-STANDING_M[1], -STANDING_M[0]);
    let far = rows(-FRONT_M[1], -FRONT_M[0]);
    let first = ((face.from_m - columns.low_m[1]) / columns.along_m).round() as usize;
    let count = ((face.to_m - face.from_m) / columns.along_m).round() as usize;
    face.cover = (first..first + count)
        .map(|column| {
            let bits = columns.band(own.clone(), column);
            let along_m = columns.low_m[1] + (column as f64 + 0.5) * columns.along_m;
            let place = Point2::from(place(face.facing.axis, face.line_m, along_m));
            if is_lintel(bits) && evidence.is_floor(&place) {
                return 0.0;
            }
            let of_row = |row: usize| columns.band(row..=row, column);
            let is_standing = by_lidar(bits)
                && heights(bits) < WALL_HEIGHTS
                && behind.clone().any(|row| heights(of_row(row)) >= WALL_HEIGHTS);
            let is_front = heights(bits) >= WALL_HEIGHTS
                && far.clone().any(|row| heights(of_row(row) & above(bits)) >= HIGHER);
            let seen = if is_standing || is_front { STANDING_FRACTION } else { fraction(bits) };
            let opens =
                is_opening(columns.band(deep.clone(), column)) && !is_leaf(face.facing, &place, evidence);
            if opens { seen.max(OPENING_FRACTION) } else { seen }
        })
        .collect();
}

/// Returns whether open floor is right behind a face: an open leaf of a door, no wall.
fn is_leaf(facing: Facing, place: &Point2, evidence: &Evidence) -> bool {
    BEHIND_LEAF_M.iter().all(|metres| evidence.is_open(&(place - facing.normal() * *metres)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_best_run_bridges_a_door_between_walls() {
        let wall = [0.7f32; 20];
        let door = [-0.3f32; 18];
        let gains: Vec<f32> = [&[-0.3; 5][..], &wall, &door, &wall, &[-0.3; 5]].concat();
        let run = best_run(gains.into_iter());
        assert_eq!((run.from, run.to), (5, 63));
        let lone: Vec<f32> = [&wall[..], &[-0.3; 60], &wall[..5]].concat();
        let run = best_run(lone.into_iter());
        assert_eq!((run.from, run.to), (0, 20));
    }
}
