//! Objects in pictures that distinguish rooms: a bed stands in no bathroom.

use super::hit::{MAX_HEIGHT_M, RaycastParams};
use rustc_hash::FxHashMap;
use viola_geometry::taxonomy::{Class, Purposes};
use viola_geometry::{Point2, Pose2, Vector2, angle_between, cell_of};
use viola_reconstruct::PointCloud;

/// An object that belongs in some rooms and not in others, in the clip frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Landmark {
    pub point_m: Point2,
    /// Position of the camera that it was seen from.
    pub from_m: Point2,
    pub class: Class,
    /// Fraction of the area with anything standing in pictures, times the probability of this class.
    pub fraction: f64,
}

/// Side of the cells of the floor plan in which classes are summed up.
const CELL_M: f64 = 0.2;
/// Minimum height of an object; pictures cannot distinguish lower surface from the floor.
const ABOVE_FLOOR_M: f64 = 0.05;
/// Half of the field of view of a phone that is held upright, with some tolerance.
const HALF_VIEW_RAD: f64 = 0.6;

#[derive(Default)]
struct Cell {
    /// Sum of the points' probabilities, by class.
    classes: Vec<(Class, f64)>,
    count: f64,
    sum: Vector2,
}

/// Returns the landmarks in a cloud, in the order of their cells.
pub(super) fn landmarks(
    cloud_in_clip: &PointCloud,
    cameras: &[Pose2],
    params: &RaycastParams,
) -> Vec<Landmark> {
    let mut cells: FxHashMap<[i32; 2], Cell> = FxHashMap::default();
    for point in cloud_in_clip.points.iter().filter(|point| point.label.views > 0) {
        let at = point.position();
        if !(ABOVE_FLOOR_M..MAX_HEIGHT_M).contains(&(at.z - params.floor_m)) {
            continue;
        }
        let cell = cells.entry(cell_of(&at.xy(), CELL_M)).or_default();
        let probability = f64::from(point.label.probability());
        match cell.classes.iter_mut().find(|(class, _)| *class == point.label.class) {
            Some((_, sum)) => *sum += probability,
            None => cell.classes.push((point.label.class, probability)),
        }
        cell.count += 1.0;
        cell.sum += at.coords.xy();
    }
    let area = cells.len() as f64;
    let mut cells: Vec<([i32; 2], Cell)> = cells.into_iter().collect();
    cells.sort_by_key(|(key, _)| *key);
    let thing = |(_, cell): &([i32; 2], Cell)| {
        let by_sum = |a: &&(Class, f64), b: &&(Class, f64)| a.1.total_cmp(&b.1).then(b.0.cmp(&a.0));
        let (class, sum) = *cell.classes.iter().max_by(by_sum)?;
        if !Purposes::any_for(class) {
            return None;
        }
        let point_m = Point2::from(cell.sum / cell.count);
        Some(Landmark {
            point_m,
            from_m: seen_from(&point_m, cameras)?,
            class,
            fraction: sum / cell.count / area,
        })
    };
    cells.iter().filter_map(thing).collect()
}

/// Returns the nearest camera that looks there; the fallback is the nearest one.
fn seen_from(point: &Point2, cameras: &[Pose2]) -> Option<Point2> {
    let distance = |camera: &&Pose2| {
        let way = point - Point2::new(camera.x_m, camera.y_m);
        let aside_rad = angle_between(way.y.atan2(way.x), camera.yaw_rad).abs();
        (aside_rad > HALF_VIEW_RAD, way.norm())
    };
    let nearest = cameras.iter().min_by(|a, b| {
        let (a, b) = (distance(a), distance(b));
        a.0.cmp(&b.0).then(a.1.total_cmp(&b.1))
    })?;
    Some(Point2::new(nearest.x_m, nearest.y_m))
}

#[cfg(test)]
mod tests {
    use super::*;
    use viola_reconstruct::{CloudPoint, Label};

    fn cloud(points: &[([f32; 3], Label)]) -> PointCloud {
        let point = |(position_m, label): &([f32; 3], Label)| CloudPoint {
            label: *label,
            ..CloudPoint::new(*position_m, [0.0, 0.0, 1.0])
        };
        PointCloud { points: points.iter().map(point).collect(), voxel_m: 0.03 }
    }

    #[test]
    fn things_are_what_pictures_call_so() {
        let bed = |views| Label::new(Class::Bed, 1.0, views);
        let wall = Label::new(Class::Wall, 1.0, 1);
        // A bed, a wall with one point of a bed in it, a bed without a view, and one on the ceiling.
        let cloud = cloud(&[
            ([2.1, 0.1, 0.5], bed(1)),
            ([2.1, 1.1, 0.5], wall),
            ([2.1, 1.1, 0.6], wall),
            ([2.1, 1.1, 0.7], bed(1)),
            ([3.1, 0.1, 0.5], bed(0)),
            ([1.1, 0.1, 2.4], bed(1)),
        ]);
        // The nearest camera looks the other way.
        let cameras = [Pose2::new(2.1, -0.5, -1.5), Pose2::IDENTITY];
        let found = landmarks(&cloud, &cameras, &RaycastParams::default());
        let [thing] = found[..] else { panic!("{found:?}") };
        assert_eq!((thing.class, thing.from_m), (Class::Bed, Point2::origin()));
        assert!((thing.point_m - Point2::new(2.1, 0.1)).norm() < 1e-6, "{thing:?}");
        assert!((thing.fraction - 0.5).abs() < 1e-6, "{thing:?}");
        assert_eq!(landmarks(&cloud, &[], &RaycastParams::default()), []);
    }
}
