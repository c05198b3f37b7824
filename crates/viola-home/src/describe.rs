//! Description of a home's map: rooms, objects, coverage and plan.

use super::MAP_VOXEL_M;
use super::assemble::Tile;
use super::corrections::RoomDivision;
use super::coverage::{Coverage, coverage};
use super::map_point::MapPoint;
use super::objects::{Found, Object, find_objects_until, room_of};
use super::plan::{Ground, Plan, PlanRoom, Revised, plan_of_corrected};
use super::points::ClipNumbers;
use super::rooms::{Room, rooms};
use viola_formats::lidar::LidarMap;
use viola_geometry::Point2;
use viola_geometry::progress::{self, Cancelled, Progress};

/// Rooms, objects, their plan, and the coverage of the LiDAR map. The rooms have the outlines of the plan.
#[derive(Debug, Clone, PartialEq)]
pub struct Description {
    pub rooms: Vec<Room>,
    pub objects: Vec<Object>,
    pub coverage: Coverage,
    pub plan: Plan,
}

/// Describes the map of `tiles`, which are in the order of their keys.
pub fn describe(
    lidar: &LidarMap,
    tiles: &[Tile],
    clips: &ClipNumbers,
    progress: &dyn Progress,
) -> Result<Description, Cancelled> {
    describe_revised(lidar, tiles, clips, |_, _| Vec::new(), progress)
}

/// Describes a map whose rooms and objects are revised before the plan is drawn: they get the ids that they
/// had, and the corrections of people. Both are compared with rooms of earlier revisions by the outlines of the
/// LiDAR map's cells. `revise` returns the lines by which people divided rooms. The objects get their rooms last. Ends
/// after the step that is underway once `progress` is cancelled.
pub fn describe_revised(
    lidar: &LidarMap,
    tiles: &[Tile],
    clips: &ClipNumbers,
    revise: impl FnOnce(&mut Vec<Room>, &mut Vec<Object>) -> Vec<RoomDivision>,
    progress: &dyn Progress,
) -> Result<Description, Cancelled> {
    progress::check(progress)?;
    let points: Vec<MapPoint> = tiles.iter().flat_map(|tile| clips.in_map(tile)).collect();
    let rooms_and_objects = || -> Result<(Vec<Room>, Vec<Found>), Cancelled> {
        let rooms = rooms(lidar, &points);
        let objects = find_objects_until(&points, &rooms, MAP_VOXEL_M, progress)?;
        Ok((rooms, objects))
    };
    let (rooms_and_objects, ground) = rayon::join(rooms_and_objects, || Ground::new(lidar, &points));
    let (found, objects) = rooms_and_objects?;
    let mut objects: Vec<Object> = objects.into_iter().map(|found| found.object).collect();
    let mut rooms = found.clone();
    let divisions = revise(&mut rooms, &mut objects);
    progress::check(progress)?;
    let revised = Revised { rooms: &rooms, objects: &objects, divisions: &divisions };
    let (coverage, plan) = rayon::join(
        || coverage(lidar, &points, &rooms),
        || plan_of_corrected(&ground, &points, &found, &revised),
    );
    progress::check(progress)?;
    take_outlines(&mut rooms, &plan);
    for object in &mut objects {
        object.room = room_of(&rooms, &object.bounds()).map(|room| room.id.clone());
    }
    Ok(Description { rooms, objects, coverage, plan })
}

/// Gives the rooms the outlines of the plan, in the map's frame. A room of which the plan lacks the most keeps its own one, and
/// so does a room that the plan drew over it.
fn take_outlines(rooms: &mut [Room], plan: &Plan) {
    let plan_from_map = plan.map_from_plan.inverse();
    let label_in_plan = |room: &Room| {
        let at = plan_from_map.apply(&Point2::from(room.label_at_m));
        [at.x, at.y]
    };
    let in_map = |corner: &[f64; 2]| {
        let at = plan.map_from_plan.apply(&Point2::from(*corner));
        // Adding zero makes -0 and 0 equal.
        [at.x, at.y].map(|metres| (metres * 1e3).round() / 1e3 + 0.0)
    };
    let mut all_drawn: Vec<Option<PlanRoom>> = rooms.iter().map(|room| plan.whole_room(room)).collect();
    loop {
        let own = rooms.iter().zip(&all_drawn).filter(|(_, drawn)| drawn.is_none());
        let labels: Vec<[f64; 2]> = own.map(|(room, _)| label_in_plan(room)).collect();
        let is_over = |drawn: &PlanRoom| labels.iter().any(|label| drawn.contains(*label));
        let over = all_drawn.iter().position(|drawn| drawn.as_ref().is_some_and(is_over));
        let Some(over) = over else { break };
        all_drawn[over] = None;
    }
    for (room, drawn) in rooms.iter_mut().zip(all_drawn) {
        let Some(drawn) = drawn else { continue };
        // Corrections of people are held by the label: the own one is on floor that the robot knows.
        if !drawn.contains(label_in_plan(room)) {
            room.label_at_m = in_map(&drawn.label_at_m);
        }
        room.area_m2 = (drawn.area_m2 * 100.0).round() / 100.0;
        room.polygon_m = drawn.outline.ring_m.iter().map(in_map).collect();
        room.holes_m = drawn.outline.holes_m.iter().map(|hole| hole.iter().map(in_map).collect()).collect();
    }
}

#[cfg(test)]
mod tests {
    use super::super::objects::UprightBox;
    use super::super::rooms::tests::flat;
    use super::*;
    use std::f64::consts::FRAC_PI_2;
    use viola_geometry::Pose2;
    use viola_geometry::progress::Silent;
    use viola_geometry::taxonomy::Class;

    fn described() -> Description {
        describe(&flat(0.0), &[], &ClipNumbers::new(std::iter::empty()), &Silent).unwrap()
    }

    #[test]
    fn rooms_have_the_outlines_of_the_plan() {
        let Description { rooms, plan, .. } = described();
        assert_eq!(rooms.len(), 2);
        for (room, area_m2) in rooms.iter().zip([12.0, 9.0]) {
            let drawn = plan.rooms.iter().find(|drawn| drawn.id.as_ref() == Some(&room.id)).unwrap();
            assert_eq!(room.polygon_m.len(), 4, "{room:?}");
            assert!((room.area_m2 - drawn.area_m2).abs() <= 0.005, "{room:?}");
            // Points of a raster of 5 cm.
            assert!((room.area_m2 / area_m2 - 1.0).abs() < 0.05, "{room:?}");
            assert!(room.contains(&Point2::from(room.label_at_m)));
        }
    }

    #[test]
    fn an_object_that_no_clip_shows_has_a_room() {
        let bounds = UprightBox { centre_m: [2.0, 1.5, 0.45], size_m: [0.6, 0.5, 0.9], yaw_rad: 0.4 };
        let pinned = Object::new(Class::Chair, 0.8, &bounds, 0);
        let revise = |_: &mut Vec<Room>, objects: &mut Vec<Object>| {
            objects.push(pinned);
            Vec::new()
        };
        let numbers = ClipNumbers::new(std::iter::empty());
        let described = describe_revised(&flat(0.0), &[], &numbers, revise, &Silent);
        let Description { rooms, objects, .. } = described.unwrap();
        let room = rooms.iter().find(|room| room.contains(&Point2::new(2.0, 1.5))).unwrap();
        assert_eq!(objects[0].room.as_ref(), Some(&room.id));
    }

    /// The plan's frame is a quarter turn from the map's: its point (x, y) is (-y, x) in the map.
    #[test]
    fn outlines_are_turned_and_keep_their_holes() {
        let square = |low: f64, high: f64| vec![[low, low], [high, low], [high, high], [low, high]];
        let mut plan = described().plan;
        plan.map_from_plan = Pose2::new(0.0, 0.0, FRAC_PI_2);
        plan.rooms.truncate(1);
        let drawn = &mut plan.rooms[0];
        drawn.id = Some("1".to_owned());
        drawn.outline.ring_m = square(0.0, 4.0);
        drawn.outline.holes_m = vec![square(1.0, 2.0).into_iter().rev().collect()];
        (drawn.area_m2, drawn.label_at_m) = (15.0, [3.0, 2.0]);
        let own = Room::rectangle("1", [-3.0, 0.5], [-0.5, 3.0]);
        let far = Room::rectangle("2", [5.0, 5.0], [6.0, 6.0]);
        let under = Room::rectangle("2", [-3.8, 2.2], [-2.2, 3.8]);

        let mut rooms = [own.clone(), far.clone()];
        take_outlines(&mut rooms, &plan);
        assert_eq!(rooms[0].polygon_m, [[0.0, 0.0], [0.0, 4.0], [-4.0, 4.0], [-4.0, 0.0]]);
        assert_eq!(rooms[0].holes_m, [[[-2.0, 1.0], [-2.0, 2.0], [-1.0, 2.0], [-1.0, 1.0]]]);
        // Its own label is in the hole.
        assert_eq!((rooms[0].area_m2, rooms[0].label_at_m), (15.0, [-2.0, 3.0]));
        assert_eq!(rooms[1], far, "the plan lacks it");

        let mut rooms = [own.clone(), under.clone()];
        take_outlines(&mut rooms, &plan);
        assert_eq!(rooms, [own, under], "the plan drew one over the other");
    }

    /// Two parts of 4 m by 3 m and 2 m by 3 m with a wall of 0.1 m between them.
    #[test]
    fn a_room_in_parts_is_all_of_them_or_keeps_its_own_outline() {
        let template = described().plan;
        let part = |id: Option<&str>, low_x: f64, high_x: f64| {
            let mut part = template.rooms[0].clone();
            part.id = id.map(str::to_owned);
            part.outline.ring_m = vec![[low_x, 0.0], [high_x, 0.0], [high_x, 3.0], [low_x, 3.0]];
            (part.area_m2, part.label_at_m) = (part.outline.area_m2(), [(low_x + high_x) / 2.0, 1.5]);
            part
        };
        let mut door = template.openings[0].clone();
        (door.from_m, door.to_m, door.thickness_m) = ([4.05, 1.0], [4.05, 1.8], 0.1);
        let own = Room::rectangle("1", [0.1, 0.1], [6.0, 2.9]);
        for (name, parts, openings, area_m2) in [
            ("a doorway", vec![part(Some("1"), 0.0, 4.0), part(Some("1"), 4.1, 6.1)], vec![door], 18.08),
            ("a wall", vec![part(Some("1"), 0.0, 4.0), part(Some("1"), 4.1, 6.1)], vec![], own.area_m2),
            (
                "the rest is of no room",
                vec![part(Some("1"), 0.0, 4.0), part(None, 4.1, 6.1)],
                vec![],
                own.area_m2,
            ),
            ("little is of no room", vec![part(Some("1"), 0.0, 5.3), part(None, 5.4, 6.1)], vec![], 15.9),
        ] {
            let mut plan = template.clone();
            plan.map_from_plan = Pose2::IDENTITY;
            (plan.rooms, plan.openings) = (parts, openings);
            let mut rooms = [own.clone()];
            take_outlines(&mut rooms, &plan);
            assert!((rooms[0].area_m2 - area_m2).abs() < 1e-9, "{name}: {rooms:?}");
            assert!(rooms[0].contains(&Point2::from(rooms[0].label_at_m)), "{name}: {rooms:?}");
        }
    }
}
