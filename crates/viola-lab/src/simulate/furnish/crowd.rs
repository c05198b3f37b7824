//! More furniture than usual, until hardly any wall is bare: homes of people who own much and have little space.

use super::textiles::{self, Pane};
use super::{Arranger, chairs, decor, desks, kitchen, shelves, sofas, storage, tables, things};
use crate::simulate::piece::{Mount, Piece};
use crate::simulate::plan::RoomKind;
use crate::simulate::rng::Rng;
use viola_geometry::taxonomy::Class;

/// Pieces that are tried for each metre along the walls; most of them find no place.
const TRIED_PER_M: f64 = 3.0;

/// Fills the walls of a room, and most of its free floor.
pub(super) fn crowd(room: &mut Arranger) {
    let kind = room.room().kind;
    let inner = room.room().inner;
    let around = 2.0 * (inner.size(0) + inner.size(1));
    for _ in 0..(around * TRIED_PER_M * room.rng.between(0.4, 1.0)) as usize {
        let piece = at_a_wall(kind, &mut room.rng);
        // People squeeze past what they own.
        let front = room.rng.between(0.0, 0.35);
        room.against_wall(piece, front);
    }
    for _ in 0..room.rng.count(0, (inner.area_m2() / 4.0) as usize) {
        let piece = in_the_room(kind, &mut room.rng);
        room.free(piece, 0.03);
    }
    for _ in 0..room.rng.count(0, around as usize) {
        let piece = on_a_wall(kind, &mut room.rng);
        let low = piece.solids.iter().map(|solid| solid.bottom_m()).fold(f64::INFINITY, f64::min);
        room.hang(piece, low);
    }
}

fn at_a_wall(kind: RoomKind, rng: &mut Rng) -> Piece {
    if matches!(kind, RoomKind::Bathroom | RoomKind::Corridor) && rng.chance(0.6) {
        return if rng.chance(0.5) { slim_cabinet(rng) } else { things::standing_thing(kind, rng) };
    }
    match rng.count(0, 14) {
        0..=2 => shelves::shelf(rng),
        3 => {
            let width = rng.between(0.6, 2.2);
            storage::wardrobe(width, rng)
        }
        4 => storage::dresser(rng),
        5 => slim_cabinet(rng),
        6 => desks::desk(rng),
        7 => tables::side_table(rng),
        8 => chairs::armchair(rng),
        9 => storage::coats(rng),
        10 => storage::filing_cabinet(rng),
        11 => match rng.count(0, 3) {
            0 => kitchen::fridge(rng),
            1 => kitchen::washing_machine(rng),
            2 => sofas::sofa(false, rng),
            _ => decor::leaning_mirror(rng),
        },
        12 => decor::plant(rng),
        13 => {
            // Curtains also hide niches and racks.
            let pane = Pane { width_m: rng.between(0.5, 2.4), sill_m: 0.0, head_m: rng.between(1.9, 2.2) };
            textiles::curtains(pane, true, rng)
        }
        _ => things::standing_thing(kind, rng),
    }
}

fn slim_cabinet(rng: &mut Rng) -> Piece {
    let size = [rng.between(0.3, 1.2), rng.between(0.2, 0.45), rng.between(0.5, 2.2)];
    storage::cabinet(Class::Cabinet, size, rng)
}

fn in_the_room(kind: RoomKind, rng: &mut Rng) -> Piece {
    match rng.count(0, 5) {
        0 => chairs::stool(rng),
        1 => chairs::pouf(rng),
        2 => chairs::office_chair(rng),
        3 => tables::coffee_table(rng),
        _ => things::standing_thing(kind, rng),
    }
}

fn on_a_wall(kind: RoomKind, rng: &mut Rng) -> Piece {
    if rng.chance(0.3) {
        return shelves::wall_shelf(rng);
    }
    if rng.chance(0.25) && !matches!(kind, RoomKind::Corridor) {
        return wall_cabinet(rng);
    }
    decor::picture(rng)
}

/// Returns a closed cabinet that hangs on the wall behind it.
fn wall_cabinet(rng: &mut Rng) -> Piece {
    let (width, depth, height) = (rng.between(0.4, 1.6), rng.between(0.18, 0.38), rng.between(0.3, 0.9));
    let up = rng.between(1.1, 1.5);
    let mut piece = storage::cabinet(Class::Cabinet, [width, depth, height], rng).mounted(Mount::Hung);
    piece.tops.clear();
    piece.raise(up);
    piece
}
