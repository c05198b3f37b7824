//! Places to sit and to eat.

use super::{Arranger, chairs, lamps, sofas, storage, tables, textiles};
use viola_geometry::Pose2;

pub(super) fn sit(room: &mut Arranger) {
    let big = room.room().inner.area_m2() > 16.0;
    let sofa = sofas::sofa(big, &mut room.rng);
    let depth = sofa.size[1];
    let placed = room.against_wall(sofa, 0.9).or_else(|| {
        let smaller = sofas::sofa(false, &mut room.rng);
        room.against_wall(smaller, 0.7)
    });
    let Some(sofa) = placed else { return };
    let stand = storage::tv_stand(&mut room.rng);
    if room.opposite(stand, sofa, 0.5).is_none() {
        let stand = storage::tv_stand(&mut room.rng);
        room.against_wall(stand, 0.5);
    }
    let reach = depth / 2.0;
    if room.rng.chance(0.7) {
        let (w, d) = (room.rng.between(1.4, 2.8), room.rng.between(1.2, 1.9));
        let rug = textiles::rug(w, d, &mut room.rng);
        let turn = room.rng.between(-0.08, 0.08) * (1.0 + room.mess);
        let before = Pose2::new(0.0, -reach - d / 2.0 + 0.2, turn);
        let pose = room.piece(sofa).home_from_piece.compose(&before);
        if rug.footprint_at(&pose).is_within(&room.inside(0.0)) {
            room.put_anyway(rug, pose);
        }
    }
    if room.rng.chance(0.85) {
        let table = tables::coffee_table(&mut room.rng);
        let turn = room.rng.between(-0.1, 0.1) * (1.0 + room.mess);
        // It is on the free floor before the sofa: people pass behind it.
        let before = Pose2::new(0.0, -reach - 0.42 - table.size[1] / 2.0, turn);
        let pose = room.piece(sofa).home_from_piece.compose(&before);
        room.at_in_front(table, pose);
    }
    seats_around(room, sofa, reach);
    side_tables(room, sofa);
    if room.rng.chance(0.6) {
        let lamp = lamps::floor_lamp(&mut room.rng);
        room.in_corner(lamp, 0.0);
    }
}

/// Adds armchairs, a second sofa and poufs.
fn seats_around(room: &mut Arranger, sofa: usize, reach: f64) {
    for _ in 0..room.rng.count(0, 2) {
        let seat = chairs::armchair(&mut room.rng);
        if room.rng.chance(0.6) {
            let side = room.rng.sign();
            let (x, y) = (side * room.rng.between(1.3, 1.8), -reach - room.rng.between(0.4, 0.9));
            let turn = side * -room.rng.between(0.9, 1.7);
            room.beside(seat, sofa, Pose2::new(x, y, turn));
        } else {
            room.in_corner(seat, 0.3);
        }
    }
    if room.room().inner.area_m2() > 20.0 && room.rng.chance(0.3) {
        let second = sofas::sofa(false, &mut room.rng);
        room.against_wall(second, 0.6);
    }
    if room.rng.chance(0.35) {
        let pouf = chairs::pouf(&mut room.rng);
        let (x, y) = (room.rng.between(-1.2, 1.2), -reach - room.rng.between(0.5, 1.2));
        let pose = room.piece(sofa).home_from_piece.compose(&Pose2::new(x, y, x));
        room.at_in_front(pouf, pose);
    }
}

fn side_tables(room: &mut Arranger, sofa: usize) {
    let [width, depth, _] = room.piece(sofa).size;
    for side in [-1.0, 1.0] {
        if room.rng.chance(0.35) {
            let table = tables::side_table(&mut room.rng);
            let x = side * (width / 2.0 + table.size[0] / 2.0 + 0.04);
            let y = (depth - table.size[1]) / 2.0 - 0.08;
            room.beside(table, sofa, Pose2::new(x, y, 0.0));
        }
    }
}

pub(super) fn dine(room: &mut Arranger, seats: usize) {
    let mess = room.mess;
    let (table, chairs) = tables::dining_set(seats, mess, &mut room.rng);
    let wide = room.room().inner.area_m2() > 10.0;
    let mut placed = None;
    if wide {
        placed = room.free(table.clone(), 0.75).or_else(|| room.free(table.clone(), 0.5));
    }
    let Some(table) = placed.or_else(|| room.against_wall(table, 0.3)) else { return };
    for (chair, pose) in chairs {
        // A chair shares floor with its table; chairs without space are dropped.
        let home = room.piece(table).home_from_piece.compose(&pose);
        room.at_table(chair, home, table);
    }
}
