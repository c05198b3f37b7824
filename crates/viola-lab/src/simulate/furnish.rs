//! Furniture by room kind, in usual places.

mod arrange;
mod bath;
mod beds;
mod chairs;
mod colours;
mod crockery;
mod crowd;
mod decor;
mod desks;
mod dressing;
mod goods;
mod kitchen;
mod lamps;
mod living;
mod mess;
mod passage;
mod people;
mod rooms;
mod shelves;
mod sizes;
mod sleeping;
mod sofas;
mod storage;
mod tables;
mod textiles;
mod things;
mod water;
mod wet;

use super::piece::Piece;
use super::plan::{Plan, UnitPlace};
use super::rng::Rng;
use viola_geometry::Pose2;

pub(super) use arrange::Arranger;
pub(super) use people::at_home;
pub(super) use things::standing_thing;

/// Returns all furniture of a home, as much as fits if it is crowded. Copies of a repeated unit get copies of the first
/// unit's furniture.
pub(super) fn furnish(plan: &Plan, is_crowded: bool, rng: &Rng) -> Vec<Piece> {
    let mut pieces = vec![];
    // Tidy homes are as frequent as messy ones, and rooms of a home differ a little.
    let mess = rng.fork("mess", 0).between(0.0, 1.0);
    for room in 0..plan.rooms.len() {
        let first = match plan.rooms[room].unit {
            Some((copy, part)) if copy > 0 => {
                plan.rooms.iter().position(|r| r.unit == Some((0, part))).map(|first| (first, copy))
            }
            _ => None,
        };
        let Some((first, copy)) = first else {
            let here = (mess + rng.fork("mess", room as u64 + 1).between(-0.15, 0.15)).clamp(0.0, 1.0);
            let mut arranger = Arranger::new(plan, room, rng.fork("room", room as u64)).in_mess(here);
            rooms::furnish(&mut arranger, is_crowded);
            pieces.extend(arranger.finish());
            continue;
        };
        let copies: Vec<Piece> = pieces
            .iter()
            .filter(|piece: &&Piece| piece.room == first)
            .map(|piece| copied(piece, room, &plan.units[0], &plan.units[copy]))
            .collect();
        pieces.extend(copies);
    }
    pieces
}

/// Returns a copy of a piece in another copy of the unit.
fn copied(piece: &Piece, room: usize, from: &UnitPlace, to: &UnitPlace) -> Piece {
    let in_unit = from.home_from_unit.inverse().compose(&piece.home_from_piece);
    if from.mirrored == to.mirrored {
        let home_from_piece = to.home_from_unit.compose(&in_unit);
        return Piece { room, home_from_piece, ..piece.clone() };
    }
    let reflected = Pose2::new(-in_unit.x_m, in_unit.y_m, -in_unit.yaw_rad);
    Piece { room, home_from_piece: to.home_from_unit.compose(&reflected), ..piece.mirrored() }
}
