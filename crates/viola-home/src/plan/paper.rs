//! Common parts of plan pictures: colours, labels and scale bar.

use super::{Plan, hangs, opens, words};
use crate::objects::Object;
use crate::rooms::Room;

pub const MARGIN_M: f64 = 0.6;
/// Height of the scale bar's strip below the plan.
pub const FOOT_M: f64 = 0.7;

pub const PAPER: [u8; 3] = [255, 255, 255];
pub const WALL: [u8; 3] = [38, 43, 51];
pub const OBSTACLE: [u8; 3] = [173, 179, 189];
pub const TEXT: [u8; 3] = [33, 37, 43];
pub const QUIET: [u8; 3] = [95, 103, 115];
/// Tints of rooms: light and distinct.
pub const ROOMS: [[u8; 3]; 8] = [
    [253, 244, 227],
    [230, 241, 252],
    [233, 246, 233],
    [250, 232, 238],
    [240, 236, 251],
    [228, 246, 246],
    [252, 238, 226],
    [243, 246, 222],
];

/// Returns the tint of the room with an index.
pub fn tint(place: usize) -> [u8; 3] {
    ROOMS[place % ROOMS.len()]
}

/// Returns a colour mixed with white by a fraction in 0..1.
pub fn lighter(color: [u8; 3], by: f64) -> [u8; 3] {
    color.map(|c| (f64::from(c) + (255.0 - f64::from(c)) * by).round() as u8)
}

pub fn darker(color: [u8; 3], by: f64) -> [u8; 3] {
    color.map(|c| (f64::from(c) * (1.0 - by)).round() as u8)
}

/// A centred line of text.
pub struct Label {
    pub words: String,
    pub at_m: [f64; 2],
    /// Height of capitals.
    pub height_m: f64,
    pub ink: [u8; 3],
    pub bold: bool,
}

/// Maximum characters of a drawn name.
const LONGEST: usize = 28;

/// Returns all labels: room names, areas and object classes.
pub fn labels(plan: &Plan) -> Vec<Label> {
    let mut labels: Vec<Label> = Vec::new();
    for room in &plan.rooms {
        labels.extend(room_labels(room, plan));
    }
    for object in plan.objects.iter().filter(|o| !opens(o.class) && !hangs(o.class)) {
        let label = object_label(object);
        let mut place = label;
        // Of overlapping labels the first stays; the others are shifted, or dropped.
        for step in [0.0, 1.0, -1.0, 2.0, -2.0] {
            let moved = [place.at_m[0], object.centre_m[1] + step * 1.5 * place.height_m];
            if labels.iter().all(|other| !overlap(&place.words, place.height_m, moved, other)) {
                place.at_m = moved;
                labels.push(place);
                break;
            }
        }
    }
    labels
}

fn room_labels(room: &Room, plan: &Plan) -> Vec<Label> {
    let name: String = match &room.name {
        Some(name) => name.chars().filter(|c| !c.is_control()).take(LONGEST).collect(),
        None => format!("Room {}", room.id),
    };
    // At the fewest objects: the label's own position, or a step above or below.
    let busy = |y: f64| {
        let spots = [-0.5, 0.0, 0.5].map(|dx| [room.label_at_m[0] + dx, y]);
        let holds = |spot: &[f64; 2]| {
            plan.objects.iter().any(|o| o.bounds().holds(&[spot[0], spot[1], o.centre_m[2]], 0.1))
        };
        spots.iter().filter(|spot| holds(spot)).count()
    };
    let steps = [0.0, 0.35, -0.35, 0.7, -0.7].map(|step| room.label_at_m[1] + step);
    let inside = |y: &f64| room.contains(&viola_geometry::Point2::new(room.label_at_m[0], *y));
    let y = steps.into_iter().filter(inside).min_by_key(|y| busy(*y)).unwrap_or(room.label_at_m[1]);
    let size = if room.area_m2 < 4.0 { 0.12 } else { 0.17 };
    let line = |words: String, dy: f64, height_m: f64, ink, bold| Label {
        words,
        at_m: [room.label_at_m[0], y + dy],
        height_m,
        ink,
        bold,
    };
    vec![
        line(name, 0.62 * size, size, TEXT, true),
        line(format!("{:.1} m\u{b2}", room.area_m2), -0.95 * size, 0.75 * size, QUIET, false),
    ]
}

fn object_label(object: &Object) -> Label {
    let words = words(object.class);
    let width = object.size_m[0].max(object.size_m[1]).max(0.4);
    let height_m = (width / (words.len() as f64 * 0.9)).clamp(0.07, 0.11);
    let at_m = [object.centre_m[0], object.centre_m[1]];
    Label { words, at_m, height_m, ink: darker(object.class.color(), 0.55), bold: false }
}

fn overlap(words: &str, height_m: f64, at_m: [f64; 2], other: &Label) -> bool {
    let half = |words: &str, height_m: f64| words.chars().count() as f64 * height_m * 0.48;
    let wide = half(words, height_m) + half(&other.words, other.height_m);
    let high = 0.6 * (height_m + other.height_m);
    (at_m[0] - other.at_m[0]).abs() < wide && (at_m[1] - other.at_m[1]).abs() < high
}

/// Returns the scale bar's length: a round number of metres, about a quarter of the plan's width.
pub fn bar_m(plan: &Plan) -> f64 {
    let quarter = (plan.max_m[0] - plan.min_m[0]) / 4.0;
    let round = [0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0];
    round.into_iter().rfind(|metres| *metres <= quarter).unwrap_or(0.5)
}
