//! Extends walls: down to the floor if only their upper part was seen, through gaps between their seen parts,
//! and to the wall that they meet. They stay open where the camera looked through them.

use rayon::prelude::*;
use viola_geometry::progress::{self, Cancelled, Progress};
use viola_geometry::taxonomy::Class;
use viola_geometry::{Point2, Point3, Pose3, Vector2, Vector3};
use viola_reconstruct::label::Wall;
use viola_reconstruct::{CloudPoint, KeyFrame, Label};

/// Maximum extension of a wall beyond its seen end to meet another one.
const REACH_M: f64 = 1.0;
/// Minimum angle between walls that end each other.
const MIN_CORNER_RAD: f64 = 30f64.to_radians();
/// Wall seen only above this, and by less than the next height, is the lintel of a door.
const LINTEL_M: f64 = 1.8;
const LINTEL_HEIGHT_M: f64 = 0.7;
/// Walls are extended from the floor up to this height, because the vacuum sees only low parts.
const HEIGHT_M: f64 = 0.5;
/// Minimum number of readings through a place of a wall that open it.
const PASSAGES: u32 = 2;
/// Minimum distance behind the plane of a reading that went through it; less may be noise.
const BEHIND_M: f64 = 0.2;

/// Walls with their ends extended to each other.
#[derive(Debug, Clone)]
pub(super) struct Extended {
    walls: Vec<ExtendedWall>,
}

/// A wall with its extended start and end along itself.
#[derive(Debug, Clone)]
struct ExtendedWall {
    wall: Wall,
    from_m: f64,
    to_m: f64,
}

impl Extended {
    pub(super) fn new(walls: &[Wall]) -> Extended {
        let extended = walls.iter().map(|wall| {
            let (from_m, to_m) = ends(wall, walls);
            ExtendedWall { wall: wall.clone(), from_m, to_m }
        });
        Extended { walls: extended.collect() }
    }

    /// Returns the extended walls as points in the clip frame, without their seen parts.
    pub(super) fn points(
        &self,
        keys: &[KeyFrame],
        clip_from_world: &Pose3,
        voxel_m: f64,
        progress: &dyn Progress,
    ) -> Result<Vec<CloudPoint>, Cancelled> {
        let openings = self.openings(keys, clip_from_world, progress)?;
        let mut points = Vec::new();
        for (wall, open) in self.walls.iter().zip(&openings) {
            wall.add_points(open, voxel_m, &mut points);
        }
        Ok(points)
    }

    /// Returns the openings of each wall.
    fn openings(
        &self,
        keys: &[KeyFrame],
        clip_from_world: &Pose3,
        progress: &dyn Progress,
    ) -> Result<Vec<Openings>, Cancelled> {
        let mut openings: Vec<Openings> = self.walls.iter().map(Openings::none).collect();
        for key in keys {
            progress::check(progress)?;
            let clip_from_camera = clip_from_world * key.world_from_camera;
            let eye = clip_from_camera.translation.vector;
            let readings = key.readings.points_in_camera();
            let hits: Vec<Vector3> = readings.map(|reading| (clip_from_camera * reading).coords).collect();
            let walls = openings.par_iter_mut().zip(&self.walls);
            walls.for_each(|(open, extended)| open.add(&extended.wall, &eye, &hits));
        }
        Ok(openings)
    }

    /// Returns the first hit of a ray on the front of a wall, as a multiple of the ray's direction.
    pub(super) fn first_hit(&self, from: &Point3, ray: &Vector3) -> Option<f64> {
        /// Approximate height of rooms.
        const CEILING_M: f64 = 2.6;
        let meets = |ExtendedWall { wall, from_m, to_m }: &ExtendedWall| {
            let approach = ray.xy().dot(&wall.normal);
            let fraction = (wall.offset_m - from.coords.xy().dot(&wall.normal)) / approach;
            let at = from + ray * fraction;
            let along_m = at.coords.xy().dot(&wall.along());
            let on = (*from_m..=*to_m).contains(&along_m) && (0.0..CEILING_M).contains(&at.z);
            (approach < 0.0 && fraction > 0.0 && on).then_some(fraction)
        };
        self.walls.iter().filter_map(meets).min_by(f64::total_cmp)
    }
}

/// Returns the start and end of a wall, extended to the walls that it meets.
fn ends(wall: &Wall, walls: &[Wall]) -> (f64, f64) {
    let (mut from_m, mut to_m) = (wall.from_m, wall.to_m());
    let (seen_from_m, seen_to_m) = (from_m, to_m);
    for other in walls {
        let Some(corner) = crossing(wall, other) else { continue };
        let on_other_m = corner.coords.dot(&other.along());
        if on_other_m < other.from_m - REACH_M || on_other_m > other.to_m() + REACH_M {
            continue;
        }
        let here_m = corner.coords.dot(&wall.along());
        // Of several corners beyond an end the nearest one counts: walls do not cross.
        if here_m < seen_from_m && here_m > seen_from_m - REACH_M {
            from_m = if from_m < seen_from_m { from_m.max(here_m) } else { here_m };
        } else if here_m > seen_to_m && here_m < seen_to_m + REACH_M {
            to_m = if to_m > seen_to_m { to_m.min(here_m) } else { here_m };
        }
    }
    (from_m, to_m)
}

/// Returns the crossing of two walls' planes on the floor plan.
fn crossing(a: &Wall, b: &Wall) -> Option<Point2> {
    let turn = a.normal.x * b.normal.y - a.normal.y * b.normal.x;
    if turn.abs() < MIN_CORNER_RAD.sin() {
        return None;
    }
    let x = (a.offset_m * b.normal.y - b.offset_m * a.normal.y) / turn;
    let y = (a.normal.x * b.offset_m - b.normal.x * a.offset_m) / turn;
    Some(Point2::new(x, y))
}

/// Places at which the camera looked through a wall's plane.
struct Openings {
    from_m: f64,
    /// Number of readings through each [`Wall::STEP_M`] from there.
    passages: Vec<u32>,
}

impl Openings {
    fn none(wall: &ExtendedWall) -> Openings {
        let steps = ((wall.to_m - wall.from_m) / Wall::STEP_M) as usize + 1;
        Openings { from_m: wall.from_m, passages: vec![0; steps] }
    }

    /// Counts the readings of a camera that went through the wall.
    fn add(&mut self, wall: &Wall, eye: &Vector3, hits: &[Vector3]) {
        let before_m = eye.xy().dot(&wall.normal) - wall.offset_m;
        if before_m <= 0.0 {
            return;
        }
        let along = wall.along();
        for hit in hits {
            let behind_m = wall.offset_m - hit.xy().dot(&wall.normal);
            if behind_m < BEHIND_M {
                continue;
            }
            let at = eye + (hit - eye) * (before_m / (before_m + behind_m));
            let step = (at.xy().dot(&along) - self.from_m) / Wall::STEP_M;
            if at.z < LINTEL_M && step >= 0.0 && (step as usize) < self.passages.len() {
                self.passages[step as usize] += 1;
            }
        }
    }

    /// Returns whether a place along the wall, or the one beside it, is open.
    fn at(&self, along_m: f64) -> bool {
        let step = ((along_m - self.from_m) / Wall::STEP_M) as usize;
        let near = step.saturating_sub(1)..(step + 2).min(self.passages.len());
        self.passages.get(near).is_some_and(|near| near.iter().any(|count| *count >= PASSAGES))
    }
}

impl ExtendedWall {
    /// Adds its unseen parts as points, without the openings.
    fn add_points(&self, open: &Openings, voxel_m: f64, into: &mut Vec<CloudPoint>) {
        let (wall, from_m, to_m) = (&self.wall, self.from_m, self.to_m);
        let along = wall.along();
        let columns = ((to_m - from_m) / voxel_m) as usize;
        for column in 0..=columns {
            let along_m = from_m + column as f64 * voxel_m;
            let step = (along_m - wall.from_m) / Wall::STEP_M;
            let seen = if step < 0.0 { None } else { wall.seen_m.get(step as usize).copied().flatten() };
            let top_m = match seen {
                Some((low_m, high_m)) if low_m > LINTEL_M && high_m - low_m < LINTEL_HEIGHT_M => {
                    continue;
                }
                Some((low_m, _)) => low_m.min(HEIGHT_M),
                None => HEIGHT_M,
            };
            if open.at(along_m) {
                continue;
            }
            let at: Vector2 = wall.normal * wall.offset_m + along * along_m;
            let rows = (top_m / voxel_m) as usize;
            let normal = [wall.normal.x as f32, wall.normal.y as f32, 0.0];
            let place = |row: usize| [at.x as f32, at.y as f32, ((row as f64 + 0.5) * voxel_m) as f32];
            into.extend((0..rows).map(|row| CloudPoint {
                color: [200, 200, 200],
                label: Label::new(Class::Wall, 0.8, 0),
                ..CloudPoint::new(place(row), normal)
            }));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::view::View;
    use super::*;
    use viola_formats::clip::DepthImage;
    use viola_geometry::Pinhole;
    use viola_geometry::progress::Silent;
    use viola_reconstruct::Readings;

    /// Returns a wall along x at `y`, seen from the side of larger y, from x = 0 on, up to 2.4 m. Each value
    /// is the lowest height seen in a step; `None` if nothing was seen.
    fn wall(y: f64, lowest_m: &[Option<f64>]) -> Wall {
        let seen_m = lowest_m.iter().map(|low| low.map(|low| (low, 2.4))).collect();
        // along() is (-1, 0) for this normal: from_m is minus the largest x.
        let length_m = lowest_m.len() as f64 * Wall::STEP_M;
        Wall { normal: Vector2::new(0.0, 1.0), offset_m: y, from_m: -length_m, seen_m }
    }

    fn side(x: f64) -> Wall {
        // Seen from larger x; along() is (0, 1).
        Wall { normal: Vector2::new(1.0, 0.0), offset_m: x, from_m: 0.5, seen_m: vec![Some((1.0, 2.4)); 20] }
    }

    fn xs(points: &[CloudPoint]) -> (f64, f64) {
        points.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), p| {
            (low.min(p.position().x), high.max(p.position().x))
        })
    }

    fn completed(walls: &[Wall]) -> Vec<CloudPoint> {
        Extended::new(walls).points(&[], &Pose3::identity(), 0.03, &Silent).unwrap()
    }

    #[test]
    fn a_wall_seen_above_stands_on_the_floor() {
        let cloud = completed(&[wall(0.0, &[Some(1.2); 30])]);
        let (low, high) = xs(&cloud);
        assert!(low.abs() < 0.04 && (high - 1.8).abs() < 0.04, "{low} {high}");
        assert!(cloud.iter().all(|p| p.position().y.abs() < 1e-6 && p.position().z < 0.5));
        // A wall seen down to the floor needs no extension.
        assert!(completed(&[wall(0.0, &[Some(0.0); 30])]).is_empty());
        // The lintel of a door is no wall.
        assert!(completed(&[wall(0.0, &[Some(2.0); 30])]).is_empty());
    }

    #[test]
    fn where_the_camera_looked_through_there_is_no_wall() {
        // From y = 2 at a height of 1.4 m to the wall at y = 0: the picture's middle third is 4 m deep.
        let camera = Pinhole { width: 96, height: 72, fx: 80.0, fy: 80.0, cx: 47.5, cy: 35.5 };
        let depth_m = |x: u32| if (32..64).contains(&x) { 4.0 } else { 2.0 };
        let depth =
            DepthImage { width: 96, height: 72, depth_m: (0..96 * 72).map(|i| depth_m(i % 96)).collect() };
        let yaw_rad = -std::f64::consts::FRAC_PI_2;
        let view = View { eye_m: [0.9, 2.0, 1.4], yaw_rad, pitch_rad: 0.0 };
        let readings = Readings::thin(&depth, camera);
        let key = KeyFrame::first(view.clip_from_camera(), readings);
        let walls = Extended::new(&[wall(0.0, &[Some(1.2); 30])]);
        let points = walls.points(&[key], &Pose3::identity(), 0.03, &Silent).unwrap();
        // A third of 2.4 m of picture at 2 m: from 0.5 to 1.3 m.
        let open = |x: f64| (0.55..1.25).contains(&x);
        assert!(points.iter().all(|p| !open(p.position().x)), "the opening is respected");
        assert!(points.iter().any(|p| p.position().x < 0.4) && points.iter().any(|p| p.position().x > 1.45));
    }

    #[test]
    fn walls_meet_in_corners() {
        let cloud = completed(&[wall(0.0, &[Some(0.0); 30]), side(-0.6)]);
        let along_x = cloud.iter().filter(|p| p.position().y.abs() < 1e-6);
        let low = along_x.map(|p| p.position().x).fold(f64::INFINITY, f64::min);
        assert!((low + 0.6).abs() < 0.04, "{low}");
        let along_y = cloud.iter().filter(|p| (p.position().x + 0.6).abs() < 1e-6);
        let low = along_y.map(|p| p.position().y).fold(f64::INFINITY, f64::min);
        assert!(low.abs() < 0.04, "{low}");
        // A ray also ends at the unseen part of the wall.
        let extended = Extended::new(&[wall(0.0, &[Some(0.0); 30]), side(-0.6)]);
        let ray = Vector3::new(0.0, -1.0, -0.2);
        assert_eq!(extended.first_hit(&Point3::new(-0.3, 2.0, 1.5), &ray), Some(2.0));
        assert_eq!(extended.first_hit(&Point3::new(-0.9, 2.0, 1.5), &ray), None);
        assert_eq!(extended.first_hit(&Point3::new(-0.3, -2.0, 1.5), &-ray), None, "from behind");
        // Too far to be a corner.
        let far = completed(&[wall(0.0, &[Some(0.0); 30]), side(-3.0)]);
        assert!(far.iter().all(|p| p.position().x < -2.9));
    }

    struct Stopped;

    impl Progress for Stopped {
        fn cancelled(&self) -> bool {
            true
        }
    }

    #[test]
    fn the_search_for_openings_ends_at_the_next_key_frame_if_it_is_cancelled() {
        let walls = Extended::new(&[wall(0.0, &[Some(1.2); 30])]);
        let keys = [KeyFrame::blind(Pose3::identity())];
        assert_eq!(walls.points(&keys, &Pose3::identity(), 0.03, &Stopped), Err(Cancelled));
    }
}
