//! Errors of a vacuum's map over metres: a scale, a bend, shifted rooms and doubled walls.

use super::plan::{Plan, Rect};
use super::rng::Rng;
use viola_geometry::{Point2, Pose2};

/// Maximum error of the scale: the odometry of a vacuum on carpet.
const MAX_SCALE_ERROR: f64 = 0.01;
/// Maximum curvature of a straight corridor: 8 cm between the ends and the middle of 9 m.
const MAX_BEND_PER_M: f64 = 0.008;
const MAX_SHIFT_M: f64 = 0.1;
const MAX_TURN_RAD: f64 = 0.5f64.to_radians();
/// Fraction of the rooms whose walls are doubled, and the distance of the copies.
const DOUBLED_FRACTION: f64 = 0.3;
const DOUBLED_M: [f64; 2] = [0.05, 0.12];

/// The believed pose of a robot as a function of its true pose, in the frame `home`.
#[derive(Debug, Clone, PartialEq)]
pub struct Warp {
    centre: Point2,
    scale: f64,
    /// Curvature of lines along `bent_axis`.
    bend_per_m: f64,
    bent_axis: usize,
    rooms: Vec<WarpedRoom>,
}

#[derive(Debug, Clone, PartialEq)]
struct WarpedRoom {
    outline: Rect,
    shift: Pose2,
    /// Additional shift of every other scan.
    second_pass: Option<Pose2>,
}

impl Warp {
    /// Returns the warp of a map without such errors.
    pub(super) fn none() -> Warp {
        Warp { centre: Point2::origin(), scale: 1.0, bend_per_m: 0.0, bent_axis: 0, rooms: vec![] }
    }

    /// Draws the warp of a home's map.
    pub(super) fn draw(plan: &Plan, rng: &mut Rng) -> Warp {
        let bounds = plan.bounds();
        let room = |outline: Rect, rng: &mut Rng| WarpedRoom {
            outline,
            shift: Pose2 {
                yaw_rad: rng.between(-MAX_TURN_RAD, MAX_TURN_RAD),
                ..offset(rng.between(0.0, MAX_SHIFT_M), rng)
            },
            second_pass: rng.chance(DOUBLED_FRACTION).then(|| {
                let distance_m = rng.within(DOUBLED_M);
                offset(distance_m, rng)
            }),
        };
        Warp {
            centre: bounds.centre(),
            scale: 1.0 + rng.between(-MAX_SCALE_ERROR, MAX_SCALE_ERROR),
            bend_per_m: rng.between(-MAX_BEND_PER_M, MAX_BEND_PER_M),
            bent_axis: usize::from(bounds.size(1) > bounds.size(0)),
            rooms: plan.rooms.iter().map(|of| room(of.outline, rng)).collect(),
        }
    }

    /// Returns the scale of measured ranges.
    pub(super) fn scale(&self) -> f64 {
        self.scale
    }

    /// Returns the believed pose.
    pub fn believed(&self, pose: &Pose2) -> Pose2 {
        let from_centre = [pose.x_m - self.centre.x, pose.y_m - self.centre.y];
        let along_m = from_centre[self.bent_axis];
        let mut bent = from_centre;
        bent[1 - self.bent_axis] += 0.5 * self.bend_per_m * along_m * along_m;
        // A line along y that bends to larger x turns clockwise.
        let turn_rad = self.bend_per_m * along_m * if self.bent_axis == 0 { 1.0 } else { -1.0 };
        let [x, y] = bent;
        let mut believed = Pose2::new(
            self.centre.x + self.scale * x,
            self.centre.y + self.scale * y,
            pose.yaw_rad + turn_rad,
        );
        if let Some(room) = self.room(pose) {
            believed = around(&room.outline.centre(), &room.shift).compose(&believed);
        }
        believed
    }

    /// Returns the believed pose of a scan; every other scan belongs to the second pass.
    pub(super) fn believed_of_scan(&self, index: usize, pose: &Pose2) -> Pose2 {
        let believed = self.believed(pose);
        let second = self.room(pose).and_then(|room| room.second_pass).filter(|_| index % 2 == 1);
        second.map_or(believed, |shift| shift.compose(&believed))
    }

    fn room(&self, pose: &Pose2) -> Option<&WarpedRoom> {
        let at = Point2::new(pose.x_m, pose.y_m);
        self.rooms.iter().find(|room| room.outline.contains(&at))
    }

    /// Returns the mean believed pose of a body that consists of surfaces at `points`, over both passes.
    pub(super) fn mean(&self, body: &Pose2, points: impl Iterator<Item = Point2>) -> Pose2 {
        if *self == Warp::none() {
            return *body;
        }
        let (mut sum, mut count) = ([0.0; 3], 0.0);
        for (pass, at) in points.flat_map(|point| [(0, point), (1, point)]) {
            let pose = Pose2::new(at.x, at.y, 0.0);
            let moved = self.believed_of_scan(pass, &pose).compose(&pose.inverse()).compose(body);
            let turn_rad = viola_geometry::wrap_angle(moved.yaw_rad - body.yaw_rad);
            for (sum, value) in sum.iter_mut().zip([moved.x_m, moved.y_m, turn_rad]) {
                *sum += value;
            }
            count += 1.0;
        }
        if count == 0.0 {
            return self.believed(body);
        }
        let [x_m, y_m, turn_rad] = sum.map(|sum| sum / count);
        Pose2::new(x_m, y_m, body.yaw_rad + turn_rad)
    }
}

/// Returns a shift of this length in a random direction.
fn offset(distance_m: f64, rng: &mut Rng) -> Pose2 {
    let (s, c) = rng.between(-std::f64::consts::PI, std::f64::consts::PI).sin_cos();
    Pose2::new(distance_m * c, distance_m * s, 0.0)
}

/// Returns a motion that turns about a point.
fn around(centre: &Point2, motion: &Pose2) -> Pose2 {
    let to_centre = Pose2::new(centre.x, centre.y, 0.0);
    to_centre.compose(motion).compose(&to_centre.inverse())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn warp() -> Warp {
        let outline = Rect { min: [0.0, 0.0], max: [4.0, 3.0] };
        let shift = Pose2::new(0.06, -0.03, 0.004);
        let room = WarpedRoom { outline, shift, second_pass: Some(Pose2::new(0.0, 0.1, 0.0)) };
        Warp {
            centre: Point2::new(5.0, 1.0),
            scale: 1.01,
            bend_per_m: 0.006,
            bent_axis: 0,
            rooms: vec![room],
        }
    }

    #[test]
    fn no_warp_leaves_poses() {
        let pose = Pose2::new(1.0, 2.0, 0.3);
        assert_eq!(Warp::none().believed_of_scan(1, &pose), pose);
    }

    /// The believed heading is that of the believed path, as far as the sine of a bend is its angle.
    #[test]
    fn headings_follow_the_bend() {
        for bent_axis in [0, 1] {
            let warp = Warp { scale: 1.0, bent_axis, rooms: vec![], ..warp() };
            let ahead = |step_m: f64| {
                let mut at = [8.0, -2.0];
                at[bent_axis] += step_m;
                Pose2::new(at[0], at[1], if bent_axis == 0 { 0.0 } else { std::f64::consts::FRAC_PI_2 })
            };
            let (a, b) = (warp.believed(&ahead(-1e-4)), warp.believed(&ahead(1e-4)));
            let heading_rad = (b.y_m - a.y_m).atan2(b.x_m - a.x_m);
            assert!((heading_rad - warp.believed(&ahead(0.0)).yaw_rad).abs() < 1e-5, "{bent_axis}");
        }
    }

    #[test]
    fn a_room_moves_as_one_and_its_second_pass_beside_it() {
        let warp = Warp { scale: 1.0, bend_per_m: 0.0, ..warp() };
        let pose = Pose2::new(2.0, 1.5, 0.0);
        let believed = warp.believed_of_scan(0, &pose);
        assert!((believed.x_m - 2.06).abs() < 1e-9 && (believed.y_m - 1.47).abs() < 1e-9, "{believed:?}");
        assert!((warp.believed_of_scan(1, &pose).y_m - 1.57).abs() < 1e-9);
        let outside = Pose2::new(6.0, 1.0, 0.0);
        assert_eq!(warp.believed_of_scan(1, &outside), outside);
    }

    #[test]
    fn a_body_in_one_room_has_the_motion_of_the_room() {
        let warp = Warp { scale: 1.0, bend_per_m: 0.0, ..warp() };
        let body = Pose2::new(1.0, 1.0, 3.1);
        let points = [Point2::new(1.0, 1.0), Point2::new(3.0, 2.0)];
        let mean = warp.mean(&body, points.into_iter());
        // Halfway between the two passes.
        let want = Pose2::new(0.0, 0.05, 0.0).compose(&warp.believed(&body));
        assert!(
            mean.distance_m(&want) < 1e-9 && (mean.yaw_rad - want.yaw_rad).abs() < 1e-9,
            "{mean:?} {want:?}"
        );
    }
}
