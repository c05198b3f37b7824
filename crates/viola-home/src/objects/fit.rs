//! Upright boxes around points.

use std::f64::consts::{FRAC_PI_2, PI};
use viola_geometry::{Point2, Pose2, wrap_angle};

/// A box whose underside is below this stands on the floor.
const STANDS_BELOW_M: f64 = 0.3;

/// An upright box; its own x axis is along the longer side.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct UprightBox {
    pub centre_m: [f64; 3],
    /// Length, width, height.
    pub size_m: [f64; 3],
    /// In [0, pi): a half turn does not change a box.
    pub yaw_rad: f64,
}

impl UprightBox {
    pub fn volume_m3(&self) -> f64 {
        self.size_m.iter().product()
    }

    /// Returns a point in the box's own axes, relative to its centre.
    pub fn local(&self, x: f64, y: f64) -> [f64; 2] {
        let (s, c) = self.yaw_rad.sin_cos();
        let (dx, dy) = (x - self.centre_m[0], y - self.centre_m[1]);
        [c * dx + s * dy, c * dy - s * dx]
    }

    pub fn corners(&self) -> [[f64; 2]; 4] {
        let (s, c) = self.yaw_rad.sin_cos();
        let [l, w] = [self.size_m[0] / 2.0, self.size_m[1] / 2.0];
        [[-l, -w], [l, -w], [l, w], [-l, w]]
            .map(|[x, y]| [self.centre_m[0] + c * x - s * y, self.centre_m[1] + s * x + c * y])
    }

    /// Makes the longer side the length.
    pub fn normalise(&mut self) {
        if self.size_m[0] < self.size_m[1] {
            self.size_m.swap(0, 1);
            self.yaw_rad = (self.yaw_rad + FRAC_PI_2) % PI;
        }
    }

    pub fn bottom_m(&self) -> f64 {
        self.centre_m[2] - self.size_m[2] / 2.0
    }

    pub fn top_m(&self) -> f64 {
        self.centre_m[2] + self.size_m[2] / 2.0
    }

    /// Returns the centre of the footprint.
    pub fn centre(&self) -> Point2 {
        Point2::new(self.centre_m[0], self.centre_m[1])
    }

    /// Returns the box in another frame.
    pub fn moved(&self, other_from_own: &Pose2) -> UprightBox {
        let at = other_from_own.apply(&self.centre());
        let yaw_rad = half_turn(self.yaw_rad + other_from_own.yaw_rad);
        UprightBox { centre_m: [at.x, at.y, self.centre_m[2]], size_m: self.size_m, yaw_rad }
    }

    /// Returns whether the box stands on the floor.
    pub fn stands(&self) -> bool {
        self.bottom_m() < STANDS_BELOW_M
    }

    pub fn area_m2(&self) -> f64 {
        self.size_m[0] * self.size_m[1]
    }

    /// Returns whether a point is in the box grown by `by_m` on all sides.
    pub fn holds(&self, point: &[f64; 3], by_m: f64) -> bool {
        let [x, y] = self.local(point[0], point[1]);
        x.abs() <= self.size_m[0] / 2.0 + by_m
            && y.abs() <= self.size_m[1] / 2.0 + by_m
            && (point[2] - self.centre_m[2]).abs() <= self.size_m[2] / 2.0 + by_m
    }

    /// Returns the points of a grid in the box, `step_m` apart and at least `inset_m` from its sides.
    pub fn places_inside(&self, step_m: f64, inset_m: f64) -> impl Iterator<Item = [f64; 3]> {
        let (s, c) = self.yaw_rad.sin_cos();
        let half_m = self.size_m.map(|side| side / 2.0 - inset_m);
        let along = move |axis: usize| {
            let steps = (half_m[axis] / step_m).floor().min(1000.0) as i32;
            (-steps..=steps).map(move |step| f64::from(step) * step_m).filter(move |_| half_m[axis] >= 0.0)
        };
        let centre_m = self.centre_m;
        along(2).flat_map(move |z| {
            along(1).flat_map(move |y| {
                along(0)
                    .map(move |x| [centre_m[0] + c * x - s * y, centre_m[1] + s * x + c * y, centre_m[2] + z])
            })
        })
    }

    /// Returns the area of the footprints' intersection.
    pub fn shared_m2(&self, other: &UprightBox) -> f64 {
        // Clips one polygon at each side of the other (Sutherland and Hodgman, 1974).
        let mut polygon: Vec<[f64; 2]> = self.corners().to_vec();
        let frame = other.corners();
        for side in 0..4 {
            let (a, b) = (frame[side], frame[(side + 1) % 4]);
            let inside = |p: &[f64; 2]| (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]);
            let mut cut = Vec::with_capacity(polygon.len() + 1);
            for (i, p) in polygon.iter().enumerate() {
                let q = polygon[(i + 1) % polygon.len()];
                let (sp, sq) = (inside(p), inside(&q));
                if sp >= 0.0 {
                    cut.push(*p);
                }
                if (sp > 0.0) != (sq > 0.0) && sp != sq {
                    let t = sp / (sp - sq);
                    cut.push([p[0] + t * (q[0] - p[0]), p[1] + t * (q[1] - p[1])]);
                }
            }
            polygon = cut;
            if polygon.is_empty() {
                return 0.0;
            }
        }
        let area = (0..polygon.len()).map(|i| {
            let (p, q) = (polygon[i], polygon[(i + 1) % polygon.len()]);
            p[0] * q[1] - q[0] * p[1]
        });
        (area.sum::<f64>() / 2.0).max(0.0)
    }

    /// Returns the volume of the intersection.
    pub fn shared_m3(&self, other: &UprightBox) -> f64 {
        let low = self.bottom_m().max(other.bottom_m());
        let high = self.top_m().min(other.top_m());
        self.shared_m2(other) * (high - low).max(0.0)
    }

    /// Returns the intersection over union of the volumes.
    pub fn iou(&self, other: &UprightBox) -> f64 {
        let shared = self.shared_m3(other);
        let union = self.volume_m3() + other.volume_m3() - shared;
        if union > 0.0 { shared / union } else { 0.0 }
    }
}

/// Returns a box's yaw in [0, pi).
pub fn half_turn(yaw_rad: f64) -> f64 {
    let yaw_rad = yaw_rad.rem_euclid(PI);
    // The remainder of a tiny negative angle is rounded to pi.
    if yaw_rad < PI { yaw_rad } else { 0.0 }
}

/// Fraction of the points allowed beyond each face, as outliers.
pub const BEYOND: f64 = 0.02;
/// Area ratio up to which a box along the walls is preferred: furniture mostly stands along them.
const ALONG_WALLS: f64 = 1.15;

/// Returns the upright bounding box of the smallest area, or the one along the walls if it is about as small.
/// `wall_yaw_rad` is the walls' direction, if known. None for fewer than four points.
pub fn fit_box(points: &[[f64; 3]], wall_yaw_rad: Option<f64>, beyond: f64) -> Option<UprightBox> {
    if points.len() < 4 {
        return None;
    }
    // Step of the directions: noisy points do not support a finer one.
    const STEP_DEG: f64 = 3.0;
    let mut best: Option<(f64, UprightBox)> = None;
    let sample: Vec<&[f64; 3]> = points.iter().step_by(points.len().div_ceil(2000)).collect();
    for step in 0..(90.0 / STEP_DEG) as usize {
        let yaw_rad = (step as f64 * STEP_DEG).to_radians() + wall_yaw_rad.unwrap_or(0.0);
        let fitted = around(&sample, yaw_rad, beyond);
        let along = step == 0 && wall_yaw_rad.is_some();
        let cost = fitted.area_m2() / if along { ALONG_WALLS } else { 1.0 };
        if best.as_ref().is_none_or(|(least, _)| cost < least - 1e-9) {
            best = Some((cost, fitted));
        }
    }
    let all: Vec<&[f64; 3]> = points.iter().collect();
    best.map(|(_, fitted)| around(&all, fitted.yaw_rad, beyond))
}

/// Returns the box around points along a direction, without the fraction `beyond` at each face.
pub fn around(points: &[&[f64; 3]], yaw_rad: f64, beyond: f64) -> UprightBox {
    let (s, c) = yaw_rad.sin_cos();
    let [x, y, z] = [
        span(points.iter().map(|p| c * p[0] + s * p[1]), beyond),
        span(points.iter().map(|p| c * p[1] - s * p[0]), beyond),
        span(points.iter().map(|p| p[2]), beyond),
    ];
    let middle = [x, y, z].map(|[low, high]| (low + high) / 2.0);
    let size = [x, y, z].map(|[low, high]| (high - low).max(0.01));
    let centre_m = [c * middle[0] - s * middle[1], s * middle[0] + c * middle[1], middle[2]];
    let swap = size[1] > size[0];
    let size_m = if swap { [size[1], size[0], size[2]] } else { size };
    let turned = if swap { yaw_rad + FRAC_PI_2 } else { yaw_rad };
    let mut yaw_rad = wrap_angle(turned).rem_euclid(PI);
    if yaw_rad > PI - 1e-9 {
        yaw_rad = 0.0;
    }
    UprightBox { centre_m, size_m, yaw_rad }
}

/// Returns the range of the values without the fraction `beyond` at each end.
pub fn span(values: impl Iterator<Item = f64>, beyond: f64) -> [f64; 2] {
    let mut values: Vec<f64> = values.collect();
    if values.is_empty() {
        return [0.0; 2];
    }
    let last = values.len() - 1;
    let off = (values.len() as f64 * beyond) as usize;
    let low = *values.select_nth_unstable_by(off, f64::total_cmp).1;
    let high = *values.select_nth_unstable_by(last - off, f64::total_cmp).1;
    [low, high]
}

/// Returns the dominant direction of upright surface, modulo a quarter turn, in [0, pi/2): that of the walls.
/// `normals` are horizontal; their lengths are weights. None without any.
pub fn wall_direction(normals: impl Iterator<Item = (f64, f64)>) -> Option<f64> {
    // Four times the angle maps quarter turns to the same value.
    let (mut x, mut y) = (0.0, 0.0);
    for (nx, ny) in normals {
        let angle = 4.0 * ny.atan2(nx);
        let weight = nx.hypot(ny);
        x += weight * angle.cos();
        y += weight * angle.sin();
    }
    (x.hypot(y) > 1e-9).then(|| (y.atan2(x) / 4.0).rem_euclid(FRAC_PI_2))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    prop_compose! {
        fn upright()(x in -2.0..2.0f64, y in -2.0..2.0f64, l in 0.6..2.0f64, w in 0.2..0.55f64, h in 0.3..1.0f64,
                     yaw_rad in 0.0..PI) -> UprightBox {
            UprightBox { centre_m: [x, y, 0.5], size_m: [l, w, h], yaw_rad }
        }
    }

    proptest! {
        #[test]
        fn sharing_is_mutual_and_bounded(a in upright(), b in upright()) {
            let (ab, ba) = (a.shared_m2(&b), b.shared_m2(&a));
            prop_assert!((ab - ba).abs() < 1e-9);
            prop_assert!(ab <= (a.size_m[0] * a.size_m[1]).min(b.size_m[0] * b.size_m[1]) + 1e-9);
            prop_assert!((a.iou(&a) - 1.0).abs() < 1e-9);
            prop_assert!((0.0..=1.0).contains(&a.iou(&b)));
        }

        #[test]
        fn a_filled_box_is_found_again(truth in upright()) {
            let turn = truth.yaw_rad.sin_cos();
            let points: Vec<[f64; 3]> = (0..9 * 9 * 9)
                .map(|i| [i % 9, i / 9 % 9, i / 81].map(|k| f64::from(k) / 8.0 - 0.5))
                .map(|[x, y, z]| {
                    let (x, y, z) = (x * truth.size_m[0], y * truth.size_m[1], z * truth.size_m[2]);
                    let [cx, cy, cz] = truth.centre_m;
                    [cx + turn.1 * x - turn.0 * y, cy + turn.0 * x + turn.1 * y, cz + z]
                })
                .collect();
            let fitted = fit_box(&points, None, 0.0).unwrap();
            // Directions are tried every three degrees.
            prop_assert!(fitted.iou(&truth) > 0.75, "{fitted:?} {}", fitted.iou(&truth));
            prop_assert!(fitted.size_m[0] >= fitted.size_m[1] && (0.0..PI).contains(&fitted.yaw_rad));
        }
    }

    #[test]
    fn overlaps_worked_out_by_hand() {
        let square =
            |x: f64, yaw_rad: f64| UprightBox { centre_m: [x, 0.0, 0.5], size_m: [1.0, 1.0, 1.0], yaw_rad };
        for (other, shared) in [
            (square(0.5, 0.0), 0.5),
            (square(1.5, 0.0), 0.0),
            // A square turned by 45 degrees cuts off four corners and leaves an octagon.
            (square(0.0, PI / 4.0), 2.0 * (2f64.sqrt() - 1.0)),
        ] {
            assert!((square(0.0, 0.0).shared_m2(&other) - shared).abs() < 1e-9, "{other:?}");
        }
        assert_eq!(fit_box(&[[0.0; 3]; 3], None, 0.0), None);
    }
}
