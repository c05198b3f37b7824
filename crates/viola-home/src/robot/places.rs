//! The places of a level to clean and to drive to: each room and each object.

use super::area::{Cover, box_around, cover};
use super::drive::{Drive, GoalArea};
use super::labels::REACH_M;
use super::titles::Titles;
use super::{RobotLevel, RobotObject, round};
use serde::Serialize;
use viola_geometry::taxonomy::Class;

/// Width of the strip around an object that is cleaned with it.
const AROUND_M: f64 = 0.5;

/// The places of a level.
#[derive(Debug, Clone, PartialEq)]
pub struct Places {
    /// The rooms in their order, then the objects in theirs.
    pub all: Vec<Place>,
    /// The free space that has all goals.
    pub goal_area: GoalArea,
}

/// A room, or the surroundings of an object.
#[derive(Debug, Clone, PartialEq)]
pub struct Place {
    /// Id of the room or the object.
    pub id: String,
    /// Name that a room was given; of an object its title.
    pub name: Option<String>,
    /// Name to show, which no other place of the level has.
    pub title: String,
    /// The object's class; none for a room.
    pub class: Option<Class>,
    /// Id of the room that it is in; of a room its own.
    pub room: Option<String>,
    pub zone: Cover,
    /// None without free space.
    pub goal: Option<Goal>,
    /// True for an object on a wall or above the robot, to which nobody sends it.
    pub is_hung: bool,
}

/// A position of the robot's centre in free space.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Goal {
    pub x_m: f64,
    pub y_m: f64,
    /// Direction that faces the object, in radians counter-clockwise from x; null for a room, in which any direction
    /// will do.
    pub yaw_rad: Option<f64>,
}

/// Returns the places of a level. It takes most of the time of the files that have them.
pub fn places(level: &RobotLevel) -> Places {
    let drive = Drive::new(level);
    let titles = Titles::of(level);
    let rooms = level.rooms.iter().zip(titles.rooms).map(|(room, title)| Place {
        id: room.id.clone(),
        name: room.name.clone(),
        title,
        class: None,
        room: Some(room.id.clone()),
        zone: cover([f64::NEG_INFINITY; 2], [f64::INFINITY; 2], Some(room)),
        goal: drive.inside(room).map(|at| Goal { x_m: round(at.x), y_m: round(at.y), yaw_rad: None }),
        is_hung: false,
    });
    let objects = level.objects.iter().zip(titles.objects);
    let all = rooms.chain(objects.map(|(object, title)| of_object(level, object, title, &drive))).collect();
    Places { all, goal_area: drive.area }
}

fn of_object(level: &RobotLevel, object: &RobotObject, title: String, drive: &Drive) -> Place {
    let room = level.room(object.room.as_deref());
    let [low, high] = box_around(&object.bounds.corners());
    Place {
        id: object.id.clone(),
        name: Some(title.clone()),
        title,
        class: Some(object.class),
        room: room.map(|room| room.id.clone()),
        zone: cover(low.map(|c| c - AROUND_M), high.map(|c| c + AROUND_M), room),
        goal: drive.beside(object, room).map(|pose| Goal {
            x_m: round(pose.x_m),
            y_m: round(pose.y_m),
            yaw_rad: Some(round(pose.yaw_rad)),
        }),
        is_hung: is_hung(object),
    }
}

/// Returns whether an object is on a wall or above the robot.
pub fn is_hung(object: &RobotObject) -> bool {
    matches!(object.class, Class::Window | Class::Curtain | Class::Mirror | Class::Picture)
        || object.bounds.bottom_m() >= REACH_M
}
