//! Furniture of each room kind.

use super::living::{dine, sit};
use super::sleeping::{sleep, sleep_as_a_child};
use super::water::{bathe, kitchen_units};
use super::{Arranger, chairs, crowd, desks, dressing, kitchen, shelves, storage, textiles, things};
use crate::simulate::plan::RoomKind;
use viola_geometry::Pose2;
use viola_geometry::taxonomy::Class;

/// Furnishes the room that the arranger holds.
pub(super) fn furnish(room: &mut Arranger, is_crowded: bool) {
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
            put_shelves(room, 3);
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
            put_shelves(room, 2);
        }
        RoomKind::Bedroom => {
            let width = room.rng.pick([1.4, 1.6, 1.8]);
            sleep(room, width);
            if room.rng.chance(0.4) {
                work(room);
            }
            put_shelves(room, 2);
            if room.rng.chance(0.4) {
                let seat = chairs::armchair(&mut room.rng);
                room.in_corner(seat, 0.2);
            }
        }
        RoomKind::Child => {
            sleep_as_a_child(room);
            work(room);
            put_shelves(room, 2);
        }
        RoomKind::Study => {
            work(room);
            put_shelves(room, 3);
            if room.rng.chance(0.5) {
                let seat = chairs::armchair(&mut room.rng);
                room.in_corner(seat, 0.3);
            }
        }
        RoomKind::Bathroom => bathe(room),
        RoomKind::Corridor => hall(room),
        RoomKind::Storage => {
            put_shelves(room, 3);
            if room.rng.chance(0.4) {
                let machine = kitchen::washing_machine(&mut room.rng);
                room.in_corner(machine, 0.4);
            }
            for _ in 0..room.rng.count(1, 4) {
                let item = things::standing_thing(RoomKind::Storage, &mut room.rng);
                room.against_wall(item, 0.0);
            }
        }
    }
    dressing::windows(room);
    if is_crowded {
        crowd::crowd(room);
    }
    dressing::decorate(room);
}

fn work(room: &mut Arranger) {
    let roomy = room.room().inner.area_m2() > 8.0;
    let desk = if roomy && room.rng.chance(0.2) {
        let desk = desks::corner_desk(&mut room.rng);
        room.in_corner(desk, 0.0)
    } else {
        None
    };
    let placed = desk.or_else(|| {
        let desk = desks::desk(&mut room.rng);
        room.against_wall(desk, 0.0)
    });
    let Some(desk) = placed else { return };
    let depth = room.piece(desk).size[1];
    let chair = match room.rng.count(0, 4) {
        0 => chairs::stool(&mut room.rng),
        1 => {
            let finish = crate::simulate::finish::wood(&mut room.rng);
            chairs::chair(finish, &mut room.rng)
        }
        _ => chairs::office_chair(&mut room.rng),
    };
    let turn = room.rng.between(-0.8, 0.8) + std::f64::consts::PI;
    let y = -depth / 2.0 - room.rng.between(0.32, 0.5);
    let x = room.rng.between(-0.2, 0.2);
    room.beside(chair, desk, Pose2::new(x, y, turn));
    if room.rng.chance(0.25) {
        let files = storage::filing_cabinet(&mut room.rng);
        room.against_wall(files, 0.5);
    }
}

fn put_shelves(room: &mut Arranger, most: usize) {
    for _ in 0..room.rng.count(most / 3, most) {
        let piece = if room.rng.chance(0.6) {
            shelves::shelf(&mut room.rng)
        } else {
            let size =
                [room.rng.between(0.5, 1.3), room.rng.between(0.36, 0.48), room.rng.between(0.75, 1.4)];
            storage::cabinet(Class::Cabinet, size, &mut room.rng)
        };
        let piece = if piece.size[2] < 1.3 { piece.movable() } else { piece };
        room.against_wall(piece, 0.45);
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
        let item = things::standing_thing(RoomKind::Corridor, &mut room.rng);
        room.against_wall(item, 0.0);
    }
    if room.rng.chance(0.4) {
        let inner = room.room().inner;
        let long = if inner.size(0) > inner.size(1) { 0.0 } else { std::f64::consts::FRAC_PI_2 };
        let length = (inner.size(0).max(inner.size(1)) * 0.5).clamp(0.8, 3.0);
        let rug = textiles::rug(length, 0.7, &mut room.rng);
        let middle = inner.centre();
        let pose = Pose2::new(middle.x, middle.y, long);
        if rug.footprint_at(&pose).is_within(&inner) {
            room.put_anyway(rug, pose);
        }
    }
}
