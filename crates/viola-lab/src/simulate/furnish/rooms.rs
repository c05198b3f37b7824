//! Furniture of each room kind.

use super::{Arranger, decor, dressing, seating, storage, wet};
use crate::simulate::plan::RoomKind;
use viola_geometry::Pose2;
use viola_geometry::taxonomy::Class;

/// Furnishes the room that the arranger holds.
pub(super) fn furnish(room: &mut Arranger) {
    match room.room().kind {
        RoomKind::Studio => {
            kitchen_units(room);
            sleep(room, 1.4);
            sit(room);
            dine(room, 2);
        }
        RoomKind::Living => {
            sit(room);
            if room.room().inner.area_m2() > 16.0 {
                let seats = room.rng.pick([4, 4, 6]);
                dine(room, seats);
            }
            shelves(room, 3);
        }
        RoomKind::Kitchen => {
            kitchen_units(room);
            if room.room().inner.area_m2() > 7.0 {
                let seats = room.rng.pick([2, 2, 3, 4]);
                dine(room, seats);
            }
        }
        RoomKind::Dining => {
            let seats = room.rng.pick([4, 6, 8]);
            dine(room, seats);
            shelves(room, 2);
        }
        RoomKind::Bedroom => {
            let width = room.rng.pick([1.4, 1.6, 1.8]);
            sleep(room, width);
            if room.rng.chance(0.4) {
                work(room);
            }
            shelves(room, 2);
            if room.rng.chance(0.4) {
                let seat = seating::armchair(&mut room.rng);
                room.in_corner(seat, 0.2);
            }
        }
        RoomKind::Child => {
            sleep(room, 0.9);
            work(room);
            shelves(room, 2);
        }
        RoomKind::Study => {
            work(room);
            shelves(room, 3);
            if room.rng.chance(0.5) {
                let seat = seating::armchair(&mut room.rng);
                room.in_corner(seat, 0.3);
            }
        }
        RoomKind::Bathroom => bathe(room),
        RoomKind::Corridor => hall(room),
        RoomKind::Storage => {
            shelves(room, 3);
            if room.rng.chance(0.4) {
                room.in_corner(wet::washing_machine(), 0.4);
            }
            for _ in 0..room.rng.count(1, 4) {
                let item = storage::clutter(&mut room.rng);
                room.against_wall(item, 0.0);
            }
        }
    }
    dressing::windows(room);
    dressing::decorate(room);
}

fn sit(room: &mut Arranger) {
    let big = room.room().inner.area_m2() > 16.0;
    let sofa = if big && room.rng.chance(0.4) {
        seating::corner_sofa(&mut room.rng)
    } else {
        seating::sofa(&mut room.rng)
    };
    let depth = sofa.size[1];
    let Some(sofa) = room.against_wall(sofa, 0.9) else { return };
    let stand = storage::tv_stand(&mut room.rng);
    if room.opposite(stand, sofa, 0.5).is_none() {
        let stand = storage::tv_stand(&mut room.rng);
        room.against_wall(stand, 0.5);
    }
    let reach = depth / 2.0;
    if room.rng.chance(0.7) {
        let (w, d) = (room.rng.between(1.6, 2.6), room.rng.between(1.2, 1.8));
        let rug = decor::rug(w, d, &mut room.rng);
        let pose = room.piece(sofa).home_from_piece.compose(&Pose2::new(0.0, -reach - d / 2.0 + 0.2, 0.0));
        if rug.footprint_at(&pose).is_within(&room.inside(0.0)) {
            room.put_anyway(rug, pose);
        }
    }
    if room.rng.chance(0.85) {
        let (w, d) = (room.rng.between(0.7, 1.2), room.rng.between(0.5, 0.7));
        let finish = crate::simulate::finish::wood(&mut room.rng);
        let height = room.rng.between(0.36, 0.48);
        let table = seating::table(w, d, height, finish, &mut room.rng);
        let turn = room.rng.between(-0.06, 0.06);
        // It is on the free floor before the sofa: people pass behind it.
        let pose = room.piece(sofa).home_from_piece.compose(&Pose2::new(0.0, -reach - 0.42 - d / 2.0, turn));
        room.at_in_front(table, pose);
    }
    for _ in 0..room.rng.count(0, 2) {
        let seat = seating::armchair(&mut room.rng);
        if room.rng.chance(0.6) {
            let side = room.rng.sign();
            let (x, y) = (side * room.rng.between(1.3, 1.8), -reach - room.rng.between(0.4, 0.9));
            let turn = side * -room.rng.between(0.9, 1.7);
            room.beside(seat, sofa, Pose2::new(x, y, turn));
        } else {
            room.in_corner(seat, 0.3);
        }
    }
    if room.rng.chance(0.6) {
        let lamp = decor::floor_lamp(&mut room.rng);
        room.in_corner(lamp, 0.0);
    }
}

fn dine(room: &mut Arranger, seats: usize) {
    let (table, chairs) = seating::dining_set(seats, &mut room.rng);
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

fn sleep(room: &mut Arranger, width: f64) {
    let mut bed = None;
    for width in [width, 1.4, 0.9] {
        let piece = storage::bed(width, &mut room.rng);
        bed = if width < 1.0 { room.in_corner(piece, 0.0) } else { room.against_wall(piece, 0.5) };
        if bed.is_some() {
            break;
        }
    }
    if let Some(bed) = bed {
        let [w, d, _] = room.piece(bed).size;
        for side in [-1.0, 1.0] {
            if room.rng.chance(0.8) {
                let size = [room.rng.between(0.38, 0.5), 0.4, room.rng.between(0.4, 0.55)];
                let mut stand = storage::cabinet(Class::Cabinet, size, &mut room.rng).movable();
                if room.rng.chance(0.6) {
                    let lamp = decor::table_lamp(&mut room.rng);
                    stand.join(&lamp, &Pose2::IDENTITY, size[2]);
                }
                let x = side * (w / 2.0 + size[0] / 2.0 + 0.05);
                room.beside(stand, bed, Pose2::new(x, d / 2.0 - 0.22, 0.0));
            }
        }
        if room.rng.chance(0.35) {
            let rug = decor::rug(w + 1.0, 1.4, &mut room.rng);
            let pose = room.piece(bed).home_from_piece.compose(&Pose2::new(0.0, -0.6, 0.0));
            if rug.footprint_at(&pose).is_within(&room.inside(0.0)) {
                room.put_anyway(rug, pose);
            }
        }
    }
    let mut width = room.rng.pick([1.0, 1.5, 2.0, 2.4]);
    while width > 0.7 {
        let size = [width, 0.6, room.rng.between(1.9, 2.25)];
        let wardrobe = storage::cabinet(Class::Cabinet, size, &mut room.rng);
        if room.in_corner(wardrobe, 0.6).is_some() {
            break;
        }
        width -= 0.5;
    }
    if room.rng.chance(0.5) {
        let size = [room.rng.between(0.7, 1.2), 0.45, room.rng.between(0.75, 1.1)];
        let dresser = storage::cabinet(Class::Cabinet, size, &mut room.rng).movable();
        room.against_wall(dresser, 0.5);
    }
}

fn work(room: &mut Arranger) {
    let desk = seating::desk(&mut room.rng);
    let depth = desk.size[1];
    let Some(desk) = room.against_wall(desk, 0.0) else { return };
    let chair = seating::office_chair(&mut room.rng);
    let turn = room.rng.between(-0.8, 0.8) + std::f64::consts::PI;
    let y = -depth / 2.0 - room.rng.between(0.32, 0.5);
    let x = room.rng.between(-0.2, 0.2);
    room.beside(chair, desk, Pose2::new(x, y, turn));
}

fn shelves(room: &mut Arranger, most: usize) {
    for _ in 0..room.rng.count(most / 3, most) {
        let width = room.rng.between(0.5, 1.3);
        let piece = if room.rng.chance(0.6) {
            let height = room.rng.pick([0.8, 1.2, 1.8, 2.0]);
            storage::shelf(width, height, &mut room.rng)
        } else {
            let size = [width, room.rng.between(0.36, 0.48), room.rng.between(0.75, 1.4)];
            storage::cabinet(Class::Cabinet, size, &mut room.rng)
        };
        let piece = if piece.size[2] < 1.3 { piece.movable() } else { piece };
        room.against_wall(piece, 0.45);
    }
}

fn kitchen_units(room: &mut Arranger) {
    let mut width = (room.room().inner.size(0).max(room.room().inner.size(1)) - 0.7).clamp(1.2, 3.6);
    if room.room().kind == RoomKind::Studio {
        width = width.min(2.4);
    }
    let mut first = None;
    while width >= 1.2 && first.is_none() {
        let tall = room.rng.chance(0.7);
        let run = wet::kitchen_run(width, tall, &mut room.rng);
        first = room.in_corner(run, 0.75);
        if first.is_none() {
            let run = wet::kitchen_run(width, false, &mut room.rng);
            first = room.against_wall(run, 0.7);
        }
        width -= 0.6;
    }
    let fridge = wet::fridge(&mut room.rng);
    room.in_corner(fridge, 0.5);
    if room.room().kind == RoomKind::Kitchen {
        if room.rng.chance(0.5) {
            let width = room.rng.pick([1.2, 1.8]);
            let run = wet::kitchen_run(width, false, &mut room.rng);
            room.in_corner(run, 0.7);
        }
        if room.room().inner.area_m2() > 14.0 && room.rng.chance(0.6) {
            let island = wet::island(&mut room.rng);
            room.free(island, 0.8);
        }
    }
}

fn bathe(room: &mut Arranger) {
    let area = room.room().inner.area_m2();
    let tub = wet::bathtub(&mut room.rng);
    let tray = wet::shower(&mut room.rng);
    let has_tub = area > 3.6 && room.rng.chance(0.6) && room.in_corner(tub, 0.5).is_some();
    if !has_tub || area > 7.0 {
        room.in_corner(tray, 0.4);
    }
    room.against_wall(wet::toilet(), 0.5);
    let basin = wet::washbasin(&mut room.rng);
    room.against_wall(basin, 0.55);
    if room.rng.chance(0.4) {
        room.in_corner(wet::washing_machine(), 0.5);
    }
    if room.rng.chance(0.4) {
        let size = [0.4, 0.34, room.rng.between(0.8, 1.8)];
        let cabinet = storage::cabinet(Class::Cabinet, size, &mut room.rng);
        room.against_wall(cabinet, 0.4);
    }
    if room.rng.chance(0.5) {
        let item = storage::clutter(&mut room.rng);
        room.in_corner(item, 0.0);
    }
    if room.rng.chance(0.6) {
        let mat = decor::rug(0.8, 0.5, &mut room.rng);
        let middle = room.room().inner.centre();
        let pose = Pose2::new(middle.x, middle.y, room.rng.pick([0.0, std::f64::consts::FRAC_PI_2]));
        if mat.footprint_at(&pose).is_within(&room.inside(0.1)) {
            room.put_anyway(mat, pose);
        }
    }
}

fn hall(room: &mut Arranger) {
    for _ in 0..room.rng.count(0, 3) {
        let size = [room.rng.between(0.5, 1.1), room.rng.between(0.2, 0.36), room.rng.between(0.5, 1.1)];
        let cabinet = storage::cabinet(Class::Cabinet, size, &mut room.rng).movable();
        room.against_wall(cabinet, 0.0);
    }
    if room.rng.chance(0.6) {
        let coats = storage::coats(&mut room.rng);
        room.against_wall(coats, 0.0);
    }
    for _ in 0..room.rng.count(0, 2) {
        let item = storage::clutter(&mut room.rng);
        room.against_wall(item, 0.0);
    }
    if room.rng.chance(0.4) {
        let inner = room.room().inner;
        let long = if inner.size(0) > inner.size(1) { 0.0 } else { std::f64::consts::FRAC_PI_2 };
        let length = (inner.size(0).max(inner.size(1)) * 0.5).clamp(0.8, 3.0);
        let rug = decor::rug(length, 0.7, &mut room.rng);
        let middle = inner.centre();
        let pose = Pose2::new(middle.x, middle.y, long);
        if rug.footprint_at(&pose).is_within(&inner) {
            room.put_anyway(rug, pose);
        }
    }
}
