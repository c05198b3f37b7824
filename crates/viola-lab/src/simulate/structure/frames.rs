//! Frames and casings of doors.

use super::trim::Trim;
use super::{faces, upright};
use crate::simulate::plan::{Opening, OpeningKind, Plan};
use crate::simulate::solid::Solid;
use viola_geometry::taxonomy::Class;

/// Thickness of the frame in the opening, and of the boards around it.
const FRAME_M: f64 = 0.035;
const BOARD_M: f64 = 0.014;

/// Adds the frame of a door, with boards on the walls around it.
pub(super) fn frame(plan: &Plan, opening: &Opening, trim: &Trim, out: &mut Vec<Solid>) {
    if !matches!(opening.kind, OpeningKind::Door | OpeningKind::Entrance) {
        return;
    }
    let faces = faces(plan, opening.rooms, opening.line());
    let (left, right) = (opening.at() - opening.width_m / 2.0, opening.at() + opening.width_m / 2.0);
    let high = opening.head_m;
    let mut bar = |along: [f64; 2], across: [f64; 2], up: [f64; 2]| {
        out.extend(upright(Class::Door, opening.along_x, along, across, up, trim.finish));
    };
    let lining = [faces[0] - 0.012, faces[1] + 0.012];
    bar([left, left + FRAME_M], lining, [0.0, high]);
    bar([right - FRAME_M, right], lining, [0.0, high]);
    bar([left, right], lining, [high - FRAME_M, high]);
    let wide = trim.casing_m;
    let boards = [[faces[0] - BOARD_M, faces[0]], [faces[1], faces[1] + BOARD_M]];
    for (room, across) in opening.rooms.iter().zip(boards) {
        if wide > 0.0 && room.is_some() {
            bar([left - wide, left], across, [0.0, high + wide]);
            bar([right, right + wide], across, [0.0, high + wide]);
            bar([left, right], across, [high, high + wide]);
        }
    }
}
