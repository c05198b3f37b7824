//! Kitchens and bathrooms as rooms.

use super::kitchen::{self, Above, DEPTH_M, Style};
use super::{Arranger, bath, chairs, storage, textiles, things, wet};
use crate::simulate::plan::RoomKind;
use std::f64::consts::FRAC_PI_2;
use viola_geometry::Pose2;
use viola_geometry::taxonomy::Class;

/// Adds units along one wall, or along two or three walls that meet, and the appliances.
pub(super) fn kitchen_units(room: &mut Arranger) {
    let style = Style::draw(&mut room.rng);
    let studio = room.room().kind == RoomKind::Studio;
    let mut width = (room.room().inner.size(0).max(room.room().inner.size(1)) - 0.7).clamp(1.2, 3.6);
    if studio {
        width = width.min(2.4);
    }
    let mut first = None;
    while width >= 1.2 && first.is_none() {
        let above = room.rng.pick([Above::Cabinets, Above::Cabinets, Above::Shelves, Above::Nothing]);
        let run = kitchen::run(width, above, true, &style, &mut room.rng);
        first = room.in_corner(run, 0.75);
        hang_upper(room, first, above);
        if first.is_none() {
            let run = kitchen::run(width, Above::Nothing, true, &style, &mut room.rng);
            first = room.against_wall(run, 0.7);
        }
        width -= 0.6;
    }
    if let Some(first) = first {
        let wings = if studio { 0 } else { room.rng.count(0, 2) };
        wing(room, first, wings, &style);
    }
    let fridge = kitchen::fridge(&mut room.rng);
    room.in_corner(fridge, 0.5);
    if room.rng.chance(0.15) {
        let stove = kitchen::stove(&mut room.rng);
        room.against_wall(stove, 0.5);
    }
    if room.rng.chance(0.25) {
        let column = kitchen::oven_column(&style, &mut room.rng);
        room.in_corner(column, 0.5);
    }
    if room.room().kind == RoomKind::Kitchen && room.room().inner.area_m2() > 14.0 && room.rng.chance(0.6) {
        let island = kitchen::island(&style, &mut room.rng);
        let half = island.size[1] / 2.0;
        if let Some(island) = room.free(island, 0.8) {
            for k in 0..room.rng.count(0, 3) {
                let stool = chairs::stool(&mut room.rng);
                let pose = Pose2::new(0.5 * k as f64 - 0.5, -half - 0.2, room.rng.between(-1.0, 1.0));
                room.beside(stool, island, pose);
            }
        }
    }
}

/// Makes what hangs above a run an object of its own.
fn hang_upper(room: &mut Arranger, run: Option<usize>, above: Above) {
    let Some(run) = run.map(|index| &mut room.pieces_mut()[index]) else { return };
    let pose = run.home_from_piece;
    if let Some(upper) = kitchen::take_upper(run, above) {
        room.put_anyway(upper, pose);
    }
}

/// Adds up to `wings` runs at the ends of the first, at right angles: an L or a U.
fn wing(room: &mut Arranger, first: usize, wings: usize, style: &Style) {
    let width = room.piece(first).size[0];
    let mut left = wings;
    for side in [-1.0, 1.0] {
        if left == 0 {
            break;
        }
        for length in [2.4, 1.8, 1.2] {
            let above = room.rng.pick([Above::Nothing, Above::Nothing, Above::Shelves]);
            let run = kitchen::run(length, above, false, style, &mut room.rng);
            let pose = Pose2::new(
                side * (width / 2.0 - DEPTH_M / 2.0),
                -(DEPTH_M + length) / 2.0 - 0.005,
                -side * FRAC_PI_2,
            );
            let home = room.piece(first).home_from_piece.compose(&pose);
            // The wing stands on the free floor before the first run.
            let placed = room.at_in_front(run, home);
            if placed.is_some() {
                hang_upper(room, placed, above);
                left -= 1;
                break;
            }
        }
    }
}

pub(super) fn bathe(room: &mut Arranger) {
    let area = room.room().inner.area_m2();
    let tub = bath::bathtub(&mut room.rng);
    let tray = wet::shower(&mut room.rng);
    let has_tub = area > 3.6 && room.rng.chance(0.6) && room.in_corner(tub, 0.5).is_some();
    if !has_tub || area > 7.0 {
        room.in_corner(tray, 0.4);
    }
    let toilet = bath::toilet(&mut room.rng);
    room.against_wall(toilet, 0.5);
    let basin = wet::washbasin(&mut room.rng);
    room.against_wall(basin, 0.55);
    if room.rng.chance(0.4) {
        let machine = kitchen::washing_machine(&mut room.rng);
        room.in_corner(machine, 0.5);
    }
    if room.rng.chance(0.4) {
        let size = [room.rng.between(0.3, 0.5), 0.34, room.rng.between(0.8, 1.8)];
        let cabinet = storage::cabinet(Class::Cabinet, size, &mut room.rng);
        room.against_wall(cabinet, 0.4);
    }
    if room.rng.chance(0.7) {
        let towels = bath::towels(&mut room.rng);
        room.hang(towels, 0.7);
    }
    if room.rng.chance(0.35) {
        let rail = bath::towel_radiator(&mut room.rng);
        room.hang(rail, 0.3);
    }
    if room.rng.chance(0.5) {
        let item = things::standing_thing(RoomKind::Bathroom, &mut room.rng);
        room.in_corner(item, 0.0);
    }
    if room.rng.chance(0.6) {
        let mat = textiles::rug(0.8, 0.5, &mut room.rng);
        let middle = room.room().inner.centre();
        let turn = room.rng.between(-0.2, 0.2) * room.mess;
        let pose = Pose2::new(middle.x, middle.y, room.rng.pick([0.0, FRAC_PI_2]) + turn);
        if mat.footprint_at(&pose).is_within(&room.inside(0.1)) {
            room.put_anyway(mat, pose);
        }
    }
}
