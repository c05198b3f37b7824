//! Accuracy of the floor in excerpts of a labelled scene.

use super::{Truth, coarse};
use crate::evaluate::cells::Cells;
use crate::evaluate::excerpts;
use serde::Serialize;
use std::fmt::Write;
use viola_align as align;
use viola_align::{AlignError, AlignParams, Observation};
use viola_formats::clip::Clip;
use viola_geometry::progress::Progress;
use viola_geometry::taxonomy::Class;
use viola_geometry::{Plane, Point3, Pose3, Vector3};

/// Floors of all excerpts of one length, by one variant.
#[derive(Debug, Clone, Serialize)]
pub struct FloorRow {
    pub variant: String,
    /// Length of the excerpts in frames.
    pub frames: usize,
    pub excerpts: usize,
    /// Excerpts without a clip frame, whose truth is unknown: they do not count below.
    pub without_frame: usize,
    /// Excerpts with enough visible floor to know the truth.
    pub see_floor: usize,
    /// Of those, excerpts in which a floor was found.
    pub found: usize,
    /// Of those, excerpts with a floor within 1 degree and 2 cm of the truth: the plane through the labelled
    /// floor seen and the floor next to it, since a narrow strip determines its tilt poorly.
    pub within: usize,
    /// The same against only the floor that the excerpt saw.
    pub within_seen: usize,
    /// Excerpts whose own points on the labelled floor give a plane within 1 degree and 2 cm of the floor
    /// seen: true labels, without gravity.
    pub within_by_true_labels: usize,
    pub median_deg: f64,
    pub median_m: f64,
    pub worst_deg: f64,
    pub worst_m: f64,
}

/// A true vertex is seen if the fused cloud has a point in its cell of this side or an adjacent one.
const CELL_M: f64 = 0.06;
/// Minimum visible floor: number of vertices (2 to 3 cm apart), and their RMS spread in the narrowest
/// direction.
const MIN_VERTICES: usize = 400;
const MIN_SPREAD_M: f64 = 0.15;
/// Floor is next to the floor seen if it is in the same cell of this side or an adjacent one.
const NEXT_M: f64 = 0.25;
/// Labelled floor further from its plane is the foot of an object: in the labelled scene it is up to a fifth
/// of an excerpt's floor, 5 to 20 cm high.
const FOOT_M: f64 = 0.03;

/// Evaluates the half-overlapping excerpts of a clip with the labels of `params`. `progress` is called with the name of
/// each excerpt.
pub fn floors(
    variant: &str,
    clip: &Clip,
    truth: &Truth,
    frames: usize,
    params: &AlignParams,
    progress: &dyn Fn(String) -> Box<dyn Progress>,
) -> Result<FloorRow, AlignError> {
    let headers = clip.frames();
    let (mut count, mut see_floor, mut errors) = (0, 0, Vec::new());
    let (mut within_seen, mut by_true_labels, mut without_frame) = (0, 0, 0);
    let ranges = excerpts(headers.len(), frames);
    let total = ranges.len();
    for range in ranges {
        count += 1;
        let progress = progress(format!("floors by {variant}, {frames} frames, excerpt {count} of {total}"));
        let numbers = headers[range.start].number..headers[range.end - 1].number + 1;
        let seen = align::observe(clip, Some(numbers), params, progress.as_ref())?;
        let Some(clip_from_world) = seen.clip_from_world else {
            without_frame += 1;
            continue;
        };
        let Some(compared) = Compared::new(&seen, truth, &clip_from_world) else { continue };
        see_floor += 1;
        by_true_labels += usize::from(compared.by_true_labels.is_some_and(|error| error.is_near()));
        if seen.floor.as_ref().is_some_and(|floor| !floor.assumed) {
            errors.push(compared.found);
            within_seen += usize::from(compared.to_seen.is_near());
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
        without_frame,
        see_floor,
        found: errors.len(),
        within,
        within_seen,
        within_by_true_labels: by_true_labels,
        median_deg,
        median_m,
        worst_deg,
        worst_m,
    })
}

/// Returns whether an excerpt shows enough of the labelled floor to know the truth; none if it has no clip frame.
pub(in crate::evaluate) fn shows_floor(seen: &Observation, truth: &Truth) -> Option<bool> {
    seen.clip_from_world.map(|clip_from_world| Compared::new(seen, truth, &clip_from_world).is_some())
}

/// Difference of two planes.
#[derive(Debug, Clone, Copy)]
struct FloorError {
    deg: f64,
    m: f64,
}

impl FloorError {
    /// Returns the angle, and the vertical distance at `middle`.
    fn between(a: &Plane, b: &Plane, middle: &Point3) -> FloorError {
        let deg = a.normal.dot(&b.normal).abs().min(1.0).acos().to_degrees();
        // Height at which a vertical line through the middle meets a plane.
        let rise_m = |plane: &Plane| plane.height_m(middle) / plane.normal.z;
        FloorError { deg, m: (rise_m(a) - rise_m(b)).abs() }
    }

    fn is_near(&self) -> bool {
        self.deg <= 1.0 && self.m <= 0.02
    }
}

/// Errors of the found floor, which is z = 0 of the clip frame.
struct Compared {
    /// To the plane through the labelled floor vertices that the excerpt saw and those next to them.
    found: FloorError,
    /// To the plane through the vertices that it saw.
    to_seen: FloorError,
    /// Between the planes through the excerpt's own points on the labelled floor and the vertices seen.
    by_true_labels: Option<FloorError>,
}

impl Compared {
    /// None if the excerpt shows too little floor to know the truth.
    fn new(seen: &Observation, truth: &Truth, clip_from_world: &Pose3) -> Option<Compared> {
        let up = clip_from_world.rotation * Vector3::z();
        let floor_class = coarse(Class::Floor);
        let labelled = truth.vertices_m.iter().zip(&truth.classes);
        let floor: Vec<Point3> = labelled
            .filter(|(_, class)| **class == Some(floor_class))
            .map(|(vertex, _)| clip_from_world * vertex)
            .collect();
        let cloud = &seen.cloud_in_clip.points;
        let points = Cells::new(CELL_M, cloud.iter().map(|p| (p.position(), ())));
        let plane = plane_without_feet(floor.iter().filter(|v| is_near(&points, v)), &up)?;
        let on_plane = |v: &&Point3| is_near(&points, v) && plane.height_m(v).abs() < FOOT_M;
        let vertices: Vec<&Point3> = floor.iter().filter(on_plane).collect();
        if vertices.len() < MIN_VERTICES {
            return None;
        }
        let middle = Point3::from(vertices.iter().map(|v| v.coords).sum::<Vector3>() / vertices.len() as f64);
        let spread: nalgebra::Matrix2<f64> =
            vertices.iter().map(|v| (*v - middle).xy()).map(|d| d * d.transpose()).sum();
        let narrowest = (spread / vertices.len() as f64).symmetric_eigenvalues().min().max(0.0).sqrt();
        if narrowest < MIN_SPREAD_M {
            return None;
        }
        let next = Cells::new(NEXT_M, vertices.iter().map(|v| (**v, ())));
        let wider = plane_without_feet(floor.iter().filter(|v| is_near(&next, v)), &up)?;
        let of_floor = Cells::new(CELL_M, vertices.iter().map(|v| (**v, ())));
        let own: Vec<Point3> = cloud
            .iter()
            .filter(|p| p.normal().dot(&up) > 0.9)
            .map(|p| p.position())
            .filter(|p| is_near(&of_floor, p))
            .collect();
        let found = Plane::through(&Point3::origin(), Vector3::z());
        let own = plane_without_feet(own.iter(), &up);
        Some(Compared {
            found: FloorError::between(&found, &wider, &middle),
            to_seen: FloorError::between(&found, &plane, &middle),
            by_true_labels: own.map(|own| FloorError::between(&own, &plane, &middle)),
        })
    }
}

/// Returns whether a point is in the same cell as one of these points, or in an adjacent one.
fn is_near(points: &Cells<()>, at: &Point3) -> bool {
    points.around(at).next().is_some()
}

/// Fits a roughly level plane to most of these points. Starts level at their median height, and refits to the
/// points within a distance that shrinks to [`FOOT_M`].
fn plane_without_feet<'a>(points: impl Iterator<Item = &'a Point3>, up: &Vector3) -> Option<Plane> {
    const ROUNDS: i32 = 20;
    let points: Vec<&Point3> = points.collect();
    let mut heights_m: Vec<f64> = points.iter().map(|p| p.coords.dot(up)).collect();
    heights_m.sort_by(f64::total_cmp);
    let median_m = *heights_m.get(heights_m.len() / 2)?;
    let mut plane = Plane::through(&Point3::from(up * median_m), *up);
    for round in 0..ROUNDS {
        let near_m = FOOT_M.max(0.1 * 0.8f64.powi(round));
        let near: Vec<&Point3> =
            points.iter().copied().filter(|p| plane.height_m(p).abs() < near_m).collect();
        plane = Plane::fit(&near)?.facing(up);
    }
    Some(plane)
}

/// Returns the rows as a Markdown table.
pub fn floors_markdown(rows: &[FloorRow]) -> String {
    let mut out =
        "| floor by | frames | excerpts | without a frame | see the floor | found | within 1 deg and 2 cm | of the floor seen alone | by true labels | median | worst |\n\
                   |---|---|---|---|---|---|---|---|---|---|---|\n"
            .to_owned();
    for row in rows {
        // Writing into a string cannot fail.
        let _ = writeln!(
            out,
            "| {} | {} | {} | {} | {} | {} | {} | {} | {} | {:.2} deg, {:.1} cm | {:.2} deg, {:.1} cm |",
            row.variant,
            row.frames,
            row.excerpts,
            row.without_frame,
            row.see_floor,
            row.found,
            row.within,
            row.within_seen,
            row.within_by_true_labels,
            row.median_deg,
            row.median_m * 100.0,
            row.worst_deg,
            row.worst_m * 100.0
        );
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        /// Any floor tilted up to two degrees, with objects labelled floor up to 20 cm above it on one side.
        #[test]
        fn feet_do_not_lift_the_floor(
            lean in prop::array::uniform2(-0.035..0.035f64), height_m in -0.5..0.5f64, feet in 0..3usize,
        ) {
            let up = Vector3::z();
            let at = |i: usize| {
                let (x, y) = ((i % 40) as f64 * 0.03, (i / 40) as f64 * 0.03);
                Point3::new(x, y, height_m + lean[0] * x + lean[1] * y)
            };
            let floor: Vec<Point3> = (0..1600).map(at).collect();
            let above = (0..feet * 200).map(|i| at(i) + up * (0.04 + 0.0004 * (i % 400) as f64));
            let all: Vec<Point3> = floor.iter().copied().chain(above).collect();
            let plane = plane_without_feet(all.iter(), &up).unwrap();
            let fitted = Plane::fit(&floor.iter().collect::<Vec<_>>()).unwrap();
            let error = FloorError::between(&plane, &fitted, &floor[820]);
            prop_assert!(error.deg < 0.1 && error.m < 0.001, "{error:?}");
        }
    }
}
