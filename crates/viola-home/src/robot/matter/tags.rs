//! Semantic tags of Matter 1.4: the common namespaces Area (0x10), Landmark (0x11) and Relative Position (0x12).

use super::super::RobotObject;
use super::LandmarkInfo;
use viola_geometry::taxonomy::{Class, Purposes};

/// Tags of the namespace Area with their names in lower case, and other names for them, without apostrophes.
const AREAS: [(&str, u8); 34] = [
    ("attic", 0x01),
    ("balcony", 0x04),
    ("bathroom", 0x06),
    ("bedroom", 0x07),
    ("cellar", 0x0c),
    ("childrens bedroom", 0x2d),
    ("childrens room", 0x2c),
    ("childs bedroom", 0x2d),
    ("childs room", 0x2c),
    ("closet", 0x0e),
    ("corridor", 0x10),
    ("dining room", 0x15),
    ("dressing room", 0x17),
    ("entryway", 0x1c),
    ("family room", 0x1d),
    ("garage", 0x22),
    ("guest bedroom", 0x27),
    ("guest room", 0x28),
    ("gym", 0x29),
    ("hallway", 0x2a),
    ("kids bedroom", 0x2d),
    ("kids room", 0x2c),
    ("kitchen", 0x2e),
    ("laundry room", 0x2f),
    ("library", 0x31),
    ("living room", 0x32),
    ("nursery", 0x37),
    ("office", 0x38),
    ("pantry", 0x3b),
    ("storage room", 0x53),
    ("studio", 0x54),
    ("study", 0x55),
    ("toilet", 0x59),
    ("utility room", 0x5a),
];

/// Tags for the purposes of rooms. A room of several purposes gets the first one here.
const PURPOSES: [(Purposes, u8); 9] = [
    (Purposes::LIVE, 0x32),
    (Purposes::COOK, 0x2e),
    (Purposes::SLEEP, 0x07),
    (Purposes::BATH, 0x06),
    (Purposes::DINE, 0x15),
    (Purposes::WORK, 0x38),
    (Purposes::PASS, 0x2a),
    (Purposes::STORE, 0x53),
    (Purposes::OUTSIDE, 0x04),
];

const BATHROOM: u8 = 0x06;

/// Tag of a room without a telling name that has one of these objects. Those of a tag are together, bathrooms first.
const FURNISHED: [(Class, u8); 7] = [
    (Class::Toilet, BATHROOM),
    (Class::Bathtub, BATHROOM),
    (Class::Shower, BATHROOM),
    (Class::Stove, 0x2e),
    (Class::Refrigerator, 0x2e),
    (Class::Bed, 0x07),
    (Class::Sofa, 0x32),
];

const UNDER: u8 = 0x00;
const NEXT_TO: u8 = 0x01;
const AROUND: u8 = 0x02;
const FRONT_OF: u8 = 0x05;

/// Returns the area tag of a room by its name, else by the classes of its objects.
pub fn area(name: Option<&str>, classes: &[Class]) -> Option<u8> {
    let name = name.unwrap_or_default();
    let plain = name.trim().to_lowercase().replace(['\'', '’'], "");
    let exact = AREAS.iter().find(|(area, _)| *area == plain).map(|(_, tag)| *tag);
    let purposes = Purposes::of_name(name);
    let of_name = PURPOSES.iter().find(|(purpose, _)| purposes.has(*purpose)).map(|(_, tag)| *tag);
    exact.or(of_name).or_else(|| furnished(classes))
}

/// Returns the area tag that follows from the classes of objects; none for a studio, which is no kitchen, bedroom or
/// living room though it has the furniture of several of them.
fn furnished(classes: &[Class]) -> Option<u8> {
    let found = FURNISHED.iter().filter(|(class, _)| classes.contains(class));
    let mut tags: Vec<u8> = found.map(|(_, tag)| *tag).collect();
    tags.dedup();
    let others = tags.iter().filter(|tag| **tag != BATHROOM).count();
    if others > 1 { None } else { tags.first().copied() }
}

/// Returns the landmark tag of an object with the position of the area that is cleaned; none for objects that the
/// namespace lacks, and for doors, windows and mirrors, which nobody cleans around. `area` is the area tag of its room.
pub fn landmark(object: &RobotObject, area: Option<u8>) -> Option<LandmarkInfo> {
    /// Dining tables stand in dining rooms and kitchens.
    const DINING: [u8; 2] = [0x15, 0x2e];
    /// Top of a coffee table, at most.
    const COFFEE_TABLE_M: f64 = 0.55;
    let (landmark_tag, relative_position_tag) = match object.class {
        Class::Table if object.bounds.top_m() < COFFEE_TABLE_M => (0x0b, AROUND),
        Class::Table if area.is_some_and(|area| DINING.contains(&area)) => (0x12, AROUND),
        Class::Table => (0x2d, AROUND),
        Class::Chair => (0x08, AROUND),
        Class::Desk => (0x11, UNDER),
        Class::Bed => (0x06, NEXT_TO),
        Class::Sofa => (0x2b, NEXT_TO),
        Class::Lamp => (0x1d, NEXT_TO),
        Class::Toilet => (0x2e, NEXT_TO),
        Class::Shelf => (0x07, FRONT_OF),
        Class::Counter => (0x0e, FRONT_OF),
        Class::Refrigerator => (0x25, FRONT_OF),
        Class::Stove => (0x2c, FRONT_OF),
        Class::WashingMachine => (0x30, FRONT_OF),
        Class::Sink => (0x2a, FRONT_OF),
        Class::Bathtub => (0x05, FRONT_OF),
        Class::Shower => (0x28, FRONT_OF),
        _ => return None,
    };
    Some(LandmarkInfo { landmark_tag, relative_position_tag })
}
