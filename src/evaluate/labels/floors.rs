//! How well the floor is found in excerpts of a labelled scene.

use super::{Truth, coarse};
use crate::align::{self, AlignError, AlignParams, Observation};
use crate::clip::Clip;
use crate::evaluate::excerpts;
use crate::geometry::{Plane, Point3, Pose3, Vector3};
use crate::progress::Progress;
use crate::taxonomy::Class;
use rustc_hash::FxHashSet;
use serde::Serialize;
use std::fmt::Write;

/// The floors of all excerpts of one length, found in one way.
#[derive(Debug, Clone, Serialize)]
pub struct FloorRow {
    pub variant: String,
    /// Length of the excerpts in frames.
    pub frames: usize,
    pub excerpts: usize,
    /// Of those, excerpts that show enough floor for the truth to be known.
    pub see_floor: usize,
    /// Of those, excerpts in which a floor was found,
    pub found: usize,
    /// and in which it is within 1 degree and 2 cm of the truth.
    pub within: usize,
    /// Excerpts whose truth is known as well as that: through the floor that was seen, the floor around it, or all of the
    /// scene's, it is the same plane to within 1 degree and 2 cm. The floors of recordings bend.
    pub known: usize,
    /// Of those, excerpts in which the floor is within.
    pub within_known: usize,
    pub median_deg: f64,
    pub median_m: f64,
    pub worst_deg: f64,
    pub worst_m: f64,
}

/// A vertex of the truth was seen if the fused cloud has a point in its cell of this side, or in one around it.
const CELL_M: f64 = 0.06;
/// Floor that an excerpt must show for its plane to be known: so many vertices (of 2 to 3 cm spacing), and so far
/// apart in every direction, root mean square.
const MIN_VERTICES: usize = 400;
const MIN_SPREAD_M: f64 = 0.15;
const AROUND_M: f64 = 1.5;

/// The excerpts of a clip, half overlapping, with the labels of `params`.
pub fn floors(
    variant: &str,
    clip: &Clip,
    truth: &Truth,
    frames: usize,
    params: &AlignParams,
    progress: &dyn Progress,
) -> Result<FloorRow, AlignError> {
    let headers = clip.frames();
    let (mut count, mut see_floor, mut errors) = (0, 0, Vec::new());
    let (mut known, mut within_known) = (0, 0);
    for range in excerpts(headers.len(), frames) {
        count += 1;
        let numbers = headers[range.start].number..headers[range.end - 1].number + 1;
        let seen = align::observe(clip, Some(numbers), params, progress)?;
        let Some(clip_from_world) = seen.clip_from_world else { continue };
        let Some(plane) = true_plane(&seen, truth, &clip_from_world) else { continue };
        see_floor += 1;
        let is_found = seen.floor.as_ref().is_some_and(|floor| !floor.assumed);
        known += usize::from(plane.is_known);
        if is_found {
            within_known += usize::from(plane.is_known && plane.is_near());
            errors.push(plane);
        }
    }
    let within = errors.iter().filter(|error| error.is_near()).count();
    let sorted = |pick: fn(&FloorError) -> f64| {
        let mut values: Vec<f64> = errors.iter().map(pick).collect();
        values.sort_by(f64::total_cmp);
        let middle = values.get(values.len() / 2).copied().unwrap_or(f64::NAN);
        (middle, values.last().copied().unwrap_or(f64::NAN))
    };
    let ((median_deg, worst_deg), (median_m, worst_m)) = (sorted(|e| e.deg), sorted(|e| e.m));
    Ok(FloorRow {
        variant: variant.to_owned(),
        frames,
        excerpts: count,
        see_floor,
        found: errors.len(),
        within,
        known,
        within_known,
        median_deg,
        median_m,
        worst_deg,
        worst_m,
    })
}

/// By how much two planes differ.
#[derive(Debug, Clone, Copy)]
struct FloorError {
    deg: f64,
    m: f64,
    is_known: bool,
}

impl FloorError {
    fn is_near(&self) -> bool {
        self.deg <= 1.0 && self.m <= 0.02
    }
}

/// Degrees and metres between the floor that was found, which is z = 0 of the clip frame, and the plane through the
/// vertices of the labelled floor within [`AROUND_M`] of the middle of those that the excerpt saw: a strip says little
/// about its own lean. The metres are those at that middle.
fn true_plane(seen: &Observation, truth: &Truth, clip_from_world: &Pose3) -> Option<FloorError> {
    let cell = |p: &Point3| [p.x, p.y, p.z].map(|c| (c / CELL_M).floor() as i32);
    let cells: FxHashSet<[i32; 3]> = seen.cloud_in_clip.points.iter().map(|p| cell(&p.position())).collect();
    let is_near = |at: &Point3| {
        let [x, y, z] = cell(at);
        (0..27).any(|i| cells.contains(&[x + i % 3 - 1, y + i / 3 % 3 - 1, z + i / 9 - 1]))
    };
    let floor_class = coarse(Class::Floor);
    let floor = || {
        let labelled = truth.vertices_m.iter().zip(&truth.classes);
        labelled.filter(|(_, class)| **class == Some(floor_class)).map(|(vertex, _)| clip_from_world * vertex)
    };
    let vertices: Vec<Point3> = floor().filter(is_near).collect();
    if vertices.len() < MIN_VERTICES {
        return None;
    }
    let middle = Point3::from(vertices.iter().map(|v| v.coords).sum::<Vector3>() / vertices.len() as f64);
    let spread: nalgebra::Matrix2<f64> =
        vertices.iter().map(|v| (v - middle).xy()).map(|d| d * d.transpose()).sum();
    let narrowest = (spread / vertices.len() as f64).symmetric_eigenvalues().min().max(0.0).sqrt();
    if narrowest < MIN_SPREAD_M {
        return None;
    }
    let around: Vec<Point3> =
        floor().filter(|v| (v - middle).xy().norm() < AROUND_M && (v.z - middle.z).abs() < 0.2).collect();
    let plane = Plane::fit(around.iter())?;
    let all: Vec<Point3> = floor().collect();
    let others = [Plane::fit(vertices.iter())?, Plane::fit(all.iter())?];
    let between = |a: &Plane, b: &Plane| {
        let deg = a.normal.dot(&b.normal).abs().min(1.0).acos().to_degrees();
        // Where a vertical line through the middle meets them.
        let rise_m = |plane: &Plane| plane.height_m(&middle) / plane.normal.z;
        FloorError { deg, m: (rise_m(a) - rise_m(b)).abs(), is_known: false }
    };
    let is_known = others.iter().all(|other| between(other, &plane).is_near())
        && between(&others[0], &others[1]).is_near();
    let found = Plane::through(&Point3::origin(), Vector3::z());
    Some(FloorError { is_known, ..between(&found, &plane) })
}

/// The rows as a table in Markdown.
pub fn floors_markdown(rows: &[FloorRow]) -> String {
    let mut out =
        "| floor by | frames | excerpts | see the floor | found | within 1 deg and 2 cm | truth known so well | of those within | median | worst |\n\
                   |---|---|---|---|---|---|---|---|---|---|\n"
            .to_owned();
    for row in rows {
        // Writing into a string cannot fail.
        let _ = writeln!(
            out,
            "| {} | {} | {} | {} | {} | {} | {} | {} | {:.2} deg, {:.1} cm | {:.2} deg, {:.1} cm |",
            row.variant,
            row.frames,
            row.excerpts,
            row.see_floor,
            row.found,
            row.within,
            row.known,
            row.within_known,
            row.median_deg,
            row.median_m * 100.0,
            row.worst_deg,
            row.worst_m * 100.0
        );
    }
    out
}
