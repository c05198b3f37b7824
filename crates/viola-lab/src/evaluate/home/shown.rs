//! Furniture of a simulated home as boxes of the surface that clips or eyes saw.

use super::along_axes;
use super::matching::Thing;
use crate::simulate::Home;
use std::collections::{BTreeMap, BTreeSet};
use viola_geometry::taxonomy::Class;
use viola_geometry::{Point2, Pose2, Vector2};
use viola_home::{UprightBox, is_furniture};

/// Minimum points of a true object.
pub(in crate::evaluate) const MIN_POINTS: usize = 40;

/// Surface points in the map, by the number of their piece and its class there: a television stands on a cabinet.
pub(super) type Shown = BTreeMap<(u16, u16), Vec<[f64; 3]>>;

/// Returns the furniture over half a metre, and the smaller one.
pub(super) fn things(home: &Home, shown: Shown, map_from_home: &Pose2) -> [Vec<Thing>; 2] {
    let objects = home.truth().objects;
    let whole = home.objects_alone();
    let is_worktop = |(_, class): &&(u16, u16)| *class == Class::Counter.id();
    let under_worktop: BTreeSet<u16> =
        shown.keys().filter(is_worktop).map(|(instance, _)| *instance).collect();
    let things = shown.into_iter().filter_map(|((instance, class), points)| {
        let class = Class::from_id(usize::from(class)).filter(|class| is_furniture(*class))?;
        let piece = objects.get(usize::from(instance).checked_sub(1)?)?;
        if points.len() < MIN_POINTS {
            return None;
        }
        let mut bounds = along(&points, piece.yaw_rad + map_from_home.yaw_rad);
        if under_worktop.contains(&instance) {
            let whole = &whole[usize::from(instance) - 1];
            let [x, y, _] = whole.centre_m;
            let middle = map_from_home.apply(&Point2::new(x, y));
            if class == piece.class {
                // Only the fronts are seen: the body under the worktop is the object.
                [bounds.centre_m[0], bounds.centre_m[1]] = [middle.x, middle.y];
                [bounds.size_m[0], bounds.size_m[1]] = [whole.size_m[0], whole.size_m[1]];
            } else if class == Class::WashingMachine {
                deepen(&mut bounds, &middle, whole.size_m[1]);
            }
        }
        Some(Thing { class, bounds })
    });
    let (large, small) = things.partition(Thing::is_large);
    [large, small]
}

/// Gives the front of a dishwasher the depth of the units, whose middle is known.
fn deepen(bounds: &mut UprightBox, middle: &Point2, depth_m: f64) {
    let across = Vector2::new(-bounds.yaw_rad.sin(), bounds.yaw_rad.cos());
    let off_m = across.dot(&(middle - Point2::new(bounds.centre_m[0], bounds.centre_m[1])));
    bounds.centre_m[0] += across.x * off_m;
    bounds.centre_m[1] += across.y * off_m;
    bounds.size_m[1] = depth_m;
}

/// Returns the bounding box of points along a direction.
pub(in crate::evaluate) fn along(points: &[[f64; 3]], yaw_rad: f64) -> UprightBox {
    let turn = Pose2::new(0.0, 0.0, yaw_rad);
    let turned: Vec<[f64; 3]> = points
        .iter()
        .map(|p| {
            let q = turn.inverse().apply(&Point2::new(p[0], p[1]));
            [q.x, q.y, p[2]]
        })
        .collect();
    let mut bounds = along_axes(&turned, 0.0);
    let centre = turn.apply(&Point2::new(bounds.centre_m[0], bounds.centre_m[1]));
    bounds.centre_m = [centre.x, centre.y, bounds.centre_m[2]];
    bounds.yaw_rad = yaw_rad;
    bounds
}
