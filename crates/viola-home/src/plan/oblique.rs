//! Straight faces of walls that are not along the plan's axes.

use super::axes::place;
use super::evidence::{Evidence, by_lidar, fraction, heights};
use super::faces::{Face, GAP_LOSS};
use super::uprights::Upright;
use rayon::prelude::*;
use viola_geometry::{Point2, Vector2};

/// Smallest angle to the axes.
pub(super) const ANGLE_DEG: f64 = 5.0;
/// Directions that are tried, and half of the band in which columns belong to a face of such a direction.
const STEP_DEG: f64 = 3.0;
const COARSE_M: f64 = 0.05;
/// Half of the band of a fitted face.
const BAND_M: f64 = 0.04;
/// Width of a column.
const ALONG_M: f64 = 0.05;
/// Minimum evidence of a face, as a length.
const MIN_FACE_M: f64 = 0.6;
/// Minimum fraction of its length that was seen: a line across several pieces of furniture has less.
const DENSE: f64 = 0.6;
/// Layers of one face: so far before it, and the cosine of the angle between them.
const LAYERS_M: std::ops::RangeInclusive<f64> = -0.1..=0.3;
const PARALLEL: f64 = 0.97;
/// Surface this near a face along the axes is explained by it, if that has this much evidence.
const EXPLAINED_M: f64 = 0.06;
const EXPLAINING_M: f64 = 1.0;
/// Cosine of the largest angle between the surface that it explains and the face.
const EXPLAINED_COS: f64 = 0.9;
/// Cosine between a point's normal and the direction that its face looks into.
const FACING: f64 = 0.8;
/// A bound on work.
const MAX_FACES: usize = 40;

/// An oblique face of a wall. Its room is on the left of the way from `from_m` to the other end.
#[derive(Debug, Clone)]
pub(super) struct Oblique {
    pub from_m: Point2,
    /// Unit vectors along the face, and into its room.
    pub along: Vector2,
    pub normal: Vector2,
    pub length_m: f64,
    /// Evidence of each column, 0..1.
    cover: Vec<f32>,
}

impl Oblique {
    /// Returns coordinates of a point: along the face from its first end, and into the room.
    pub fn within(&self, p: &Point2) -> [f64; 2] {
        let off = p - self.from_m;
        [off.dot(&self.along), off.dot(&self.normal)]
    }

    pub fn at(&self, along_m: f64) -> Point2 {
        self.from_m + self.along * along_m
    }

    /// Returns how far a point is before the face, in its room.
    pub fn before(&self, p: &Point2) -> f64 {
        self.within(p)[1]
    }

    /// Returns the length of the face that was seen.
    pub fn evidence_m(&self) -> f64 {
        self.cover.iter().map(|fraction| f64::from(*fraction)).sum::<f64>() * ALONG_M
    }

    /// Gives the face another middle and normal.
    pub fn turn(&mut self, middle: Point2, normal: Vector2) {
        (self.normal, self.along) = (normal, Vector2::new(normal.y, -normal.x));
        self.from_m = middle - self.along * (self.length_m / 2.0);
    }

    /// Returns the evidence at a place along the face; 0 beyond its ends.
    pub fn fraction(&self, along_m: f64) -> f64 {
        let column = (along_m / ALONG_M).floor();
        let seen = if column < 0.0 { None } else { self.cover.get(column as usize) };
        f64::from(seen.copied().unwrap_or(0.0))
    }
}

/// A side of a cell within this of the face may be a step of it.
pub(super) const OFF_M: f64 = 0.06;
/// Length of the face that a step of its stairs has.
const STAIR_M: f64 = 0.12;

impl Oblique {
    /// Returns points of the face, between which cells have the shape of stairs.
    pub fn stairs(&self) -> Vec<[f64; 2]> {
        let count = (self.length_m / STAIR_M).round().max(1.0);
        let at = |step: usize| self.at(step as f64 / count * self.length_m);
        (0..=count as usize).map(|step| [at(step).x, at(step).y]).collect()
    }

    /// Returns the evidence for a side of a cell across an axis, whose room is on the side of larger
    /// coordinates (`up`) or of smaller ones; 0 if it is no step of the face.
    pub fn step_fraction(&self, axis: usize, up: bool, ends: [Point2; 2]) -> f64 {
        let into_room = if up { self.normal[axis] } else { -self.normal[axis] };
        let middle = nalgebra::center(&ends[0], &ends[1]);
        let [along_m, off_m] = self.within(&middle);
        let is_step = into_room > 0.0 && off_m.abs() <= OFF_M && (ends[1] - ends[0]).norm() <= 4.0 * STAIR_M;
        if is_step { self.fraction(along_m) } else { 0.0 }
    }
}

/// A surface column in the frame of a direction, and its place in the list.
struct Seen {
    across_m: f64,
    along_m: f64,
    bits: u32,
    index: usize,
}

/// Returns the oblique faces, the longest evidence first.
pub(super) fn faces(evidence: &Evidence, straight: &[Face]) -> Vec<Oblique> {
    let explaining: Vec<&Face> = straight.iter().filter(|face| is_long(face)).collect();
    let mut left: Vec<&Upright> =
        evidence.uprights.iter().filter(|upright| !is_explained(upright, &explaining)).collect();
    let gain = |left: &[&Upright], normal: &Vector2| {
        best_band(&looking(evidence, left, normal), COARSE_M).map_or(0.0, |run| run.gain)
    };
    let directions = directions();
    // Columns are only taken away, so earlier gains are bounds.
    let mut gains: Vec<f32> = directions.par_iter().map(|normal| gain(&left, normal)).collect();
    let least = MIN_FACE_M * f64::from(1.0 - GAP_LOSS) / ALONG_M;
    let mut faces = Vec::new();
    while faces.len() < MAX_FACES {
        let best = (0..gains.len()).max_by(|a, b| gains[*a].total_cmp(&gains[*b]).then(b.cmp(a)));
        let Some(best) = best.filter(|best| f64::from(gains[*best]) >= least) else { break };
        let now = gain(&left, &directions[best]);
        if now < gains[best] {
            gains[best] = now;
            continue;
        }
        let Some((face, used)) = fitted(evidence, &left, directions[best]) else { break };
        if used.is_empty() {
            break;
        }
        let mut place = 0;
        left.retain(|_| {
            place += 1;
            used.binary_search(&(place - 1)).is_err()
        });
        let axis_deg = face.along.y.abs().atan2(face.along.x.abs()).to_degrees();
        let is_dense = face.evidence_m() >= DENSE * face.length_m;
        let is_oblique = (ANGLE_DEG..=90.0 - ANGLE_DEG).contains(&axis_deg);
        if is_oblique && is_dense && !faces.iter().any(|other| is_same(other, &face)) {
            faces.push(face);
        }
    }
    faces
}

/// Returns whether a face is another layer of a longer one: noise of many clips is wider than a band, and furniture stands
/// before walls.
fn is_same(face: &Oblique, layer: &Oblique) -> bool {
    let [along_m, before_m] = face.within(&layer.at(layer.length_m / 2.0));
    face.normal.dot(&layer.normal) >= PARALLEL
        && LAYERS_M.contains(&before_m)
        && (0.0..=face.length_m).contains(&along_m)
}

/// Returns the directions into which oblique faces may look.
fn directions() -> Vec<Vector2> {
    let degrees = (0..(360.0 / STEP_DEG) as usize).map(|step| step as f64 * STEP_DEG);
    let is_oblique =
        |degrees: &f64| (ANGLE_DEG - STEP_DEG..=90.0 - ANGLE_DEG + STEP_DEG).contains(&(degrees % 90.0));
    degrees
        .filter(is_oblique)
        .map(|degrees| {
            let (sin, cos) = degrees.to_radians().sin_cos();
            Vector2::new(cos, sin)
        })
        .collect()
}

/// Takes out the faces along the axes that are steps of an oblique one.
pub(super) fn without_steps(straight: Vec<Face>, oblique: &[Oblique]) -> Vec<Face> {
    let is_step = |face: &Face| {
        let ends = [face.from_m, face.to_m]
            .map(|along_m| Point2::from(place(face.facing.axis, face.line_m, along_m)));
        oblique.iter().any(|oblique| {
            let is_near = ends.iter().all(|end| {
                let [along_m, off_m] = oblique.within(end);
                off_m.abs() <= EXPLAINED_M + BAND_M
                    && (-EXPLAINED_M..=oblique.length_m + EXPLAINED_M).contains(&along_m)
            });
            is_near
                && oblique.normal.dot(&face.facing.normal()) > 0.0
                && oblique.length_m > face.to_m - face.from_m
        })
    };
    straight.into_iter().filter(|face| is_long(face) || !is_step(face)).collect()
}

/// Returns whether a face along the axes is too long for a step: it explains columns.
fn is_long(face: &Face) -> bool {
    face.cover.iter().map(|fraction| f64::from(*fraction)).sum::<f64>() * face.along_m >= EXPLAINING_M
}

/// Returns whether a face along the axes explains a column.
fn is_explained(upright: &Upright, explaining: &[&Face]) -> bool {
    let at = [upright.at.x, upright.at.y];
    explaining.iter().any(|face| {
        let axis = face.facing.axis;
        // Cells of the LiDAR map have no normal.
        let is_along = upright.normal == Vector2::zeros() || upright.normal[axis].abs() >= EXPLAINED_COS;
        is_along
            && (at[axis] - face.line_m).abs() <= EXPLAINED_M
            && (face.from_m - EXPLAINED_M..=face.to_m + EXPLAINED_M).contains(&at[1 - axis])
    })
}

/// Returns the columns that look into a direction.
fn looking(evidence: &Evidence, left: &[&Upright], normal: &Vector2) -> Vec<Seen> {
    let along = Vector2::new(normal.y, -normal.x);
    let mut seen = Vec::new();
    for (index, upright) in left.iter().enumerate() {
        let by_map = by_lidar(upright.bits);
        let looks = if by_map {
            evidence.is_free_before(&upright.at, normal)
        } else {
            upright.normal.dot(normal) > FACING
        };
        if !looks {
            continue;
        }
        // A cell of the map shows all of its width.
        let offsets: &[f64] = if by_map { &[-0.5, 0.0, 0.5] } else { &[0.0] };
        seen.extend(offsets.iter().map(|part| Seen {
            across_m: upright.at.coords.dot(normal),
            along_m: upright.at.coords.dot(&along) + part * evidence.cell_m(),
            bits: upright.bits,
            index,
        }));
    }
    seen
}

/// Best run of the columns of a band: its evidence, and its first and last column.
struct Run {
    gain: f32,
    across_m: f64,
    from: i64,
    to: i64,
}

/// Returns the best run of all bands.
fn best_band(seen: &[Seen], half_m: f64) -> Option<Run> {
    // Bands overlap by half.
    let mut columns: Vec<(i64, i64, u32)> = seen
        .iter()
        .flat_map(|seen| {
            let band = (seen.across_m / half_m).floor() as i64;
            let column = (seen.along_m / ALONG_M).floor() as i64;
            [band - 1, band].map(|band| (band, column, seen.bits))
        })
        .collect();
    columns.sort_unstable();
    let mut best: Option<Run> = None;
    for band in columns.chunk_by(|a, b| a.0 == b.0) {
        let fractions: Vec<(i64, f32)> = band
            .chunk_by(|a, b| a.1 == b.1)
            .map(|same| (same[0].1, fraction(same.iter().fold(0, |bits, one| bits | one.2))))
            .collect();
        // Kadane's algorithm; columns without evidence lie between the listed ones.
        let (mut sum, mut from, mut last) = (0f32, 0, i64::MIN);
        for (column, fraction) in fractions {
            if sum > 0.0 {
                sum -= GAP_LOSS * (column - last - 1) as f32;
            }
            if sum <= 0.0 {
                (sum, from) = (0.0, column);
            }
            sum += fraction - GAP_LOSS;
            last = column;
            if sum > best.as_ref().map_or(0.0, |best| best.gain) {
                let across_m = (band[0].0 + 1) as f64 * half_m;
                best = Some(Run { gain: sum, across_m, from, to: column + 1 });
            }
        }
    }
    best
}

/// Returns the face with the most evidence near a direction, and the columns that it uses.
fn fitted(evidence: &Evidence, left: &[&Upright], start: Vector2) -> Option<(Oblique, Vec<usize>)> {
    let mut normal = start;
    for _ in 0..3 {
        let seen = looking(evidence, left, &normal);
        let run = best_band(&seen, COARSE_M)?;
        normal = direction(left, &in_run(&seen, &run, COARSE_M), &normal);
    }
    let seen = looking(evidence, left, &normal);
    let run = best_band(&seen, BAND_M)?;
    let mut used = in_run(&seen, &run, BAND_M);
    let across_m = middle(left, &used, &normal);
    let columns = (run.to - run.from) as usize;
    let mut bits = vec![0u32; columns];
    for one in seen.iter().filter(|one| (one.across_m - across_m).abs() <= BAND_M + 0.02) {
        let column = (one.along_m / ALONG_M).floor() as i64 - run.from;
        if (0..columns as i64).contains(&column) {
            bits[column as usize] |= one.bits;
        }
        used.push(one.index);
    }
    used.sort_unstable();
    used.dedup();
    let along = Vector2::new(normal.y, -normal.x);
    let from_m = Point2::from(normal * across_m + along * (run.from as f64 * ALONG_M));
    let cover: Vec<f32> = bits.into_iter().map(fraction).collect();
    let length_m = columns as f64 * ALONG_M;
    Some((Oblique { from_m, along, normal, length_m, cover }, used))
}

/// Returns the columns of a run, by their index.
fn in_run(seen: &[Seen], run: &Run, half_m: f64) -> Vec<usize> {
    let is_in = |one: &&Seen| {
        let column = (one.along_m / ALONG_M).floor() as i64;
        (one.across_m - run.across_m).abs() <= half_m && (run.from..run.to).contains(&column)
    };
    let mut indices: Vec<usize> = seen.iter().filter(is_in).map(|one| one.index).collect();
    indices.sort_unstable();
    indices.dedup();
    indices
}

/// Weight of a column: the clips place a wall better than the cells of a map.
fn weight(upright: &Upright) -> f64 {
    if by_lidar(upright.bits) { 0.1 } else { f64::from(heights(upright.bits)) }
}

/// Returns the normal of the line through columns (total least squares) that is nearest to another one.
fn direction(left: &[&Upright], used: &[usize], near: &Vector2) -> Vector2 {
    let all = || used.iter().map(|index| left[*index]);
    let total: f64 = all().map(weight).sum();
    if total <= 0.0 {
        return *near;
    }
    let sum = all().fold(Vector2::zeros(), |sum, one| sum + one.at.coords * weight(one));
    let centre = sum / total;
    let (mut xx, mut xy, mut yy) = (0f64, 0f64, 0f64);
    for one in all() {
        let (off, weight) = (one.at.coords - centre, weight(one));
        xx += weight * off.x * off.x;
        xy += weight * off.x * off.y;
        yy += weight * off.y * off.y;
    }
    let yaw_rad = 0.5 * (2.0 * xy).atan2(xx - yy);
    let normal = Vector2::new(-yaw_rad.sin(), yaw_rad.cos());
    let normal = if normal.dot(near) < 0.0 { -normal } else { normal };
    // A few columns tell no direction.
    if normal.dot(near) > (2.0 * STEP_DEG).to_radians().cos() { normal } else { *near }
}

/// Returns the weighted median of columns across a direction.
fn middle(left: &[&Upright], used: &[usize], normal: &Vector2) -> f64 {
    let mut places: Vec<(f64, f64)> =
        used.iter().map(|index| (left[*index].at.coords.dot(normal), weight(left[*index]))).collect();
    places.sort_by(|a, b| a.0.total_cmp(&b.0));
    let half = places.iter().map(|place| place.1).sum::<f64>() / 2.0;
    let mut sum = 0.0;
    for (place, weight) in &places {
        sum += weight;
        if sum >= half {
            return *place;
        }
    }
    0.0
}

#[cfg(test)]
pub(super) mod tests;
