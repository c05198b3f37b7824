//! Decoration of rooms: curtains, radiators, lamps, pictures, plants, clutter.

use super::textiles::{self, Pane};
use super::{Arranger, decor, lamps, mess, shelves, things};
use crate::simulate::piece::Mount;
use crate::simulate::plan::{OpeningKind, RoomKind};
use viola_geometry::Pose2;

/// Adds radiators and curtains to windows.
pub(super) fn windows(room: &mut Arranger) {
    let inner = room.room().inner;
    let openings: Vec<_> = room.openings().filter(|o| o.kind == OpeningKind::Window).copied().collect();
    let dressed = room.room().kind != RoomKind::Bathroom && room.rng.chance(0.75);
    let to_floor = room.rng.chance(0.5);
    for window in openings {
        let inside_high = window.rooms[0] == Some(room.room);
        let place = |depth: f64| {
            // If the room is at the smaller coordinates, the wall is at its maximum.
            let sign = if inside_high { 1.0 } else { -1.0 };
            if window.along_x {
                let wall = if inside_high { inner.max[1] } else { inner.min[1] };
                let yaw = if inside_high { 0.0 } else { std::f64::consts::PI };
                Pose2::new(window.centre.x, wall - sign * (depth / 2.0 + 0.01), yaw)
            } else {
                let wall = if inside_high { inner.max[0] } else { inner.min[0] };
                let yaw = -sign * std::f64::consts::FRAC_PI_2;
                Pose2::new(wall - sign * (depth / 2.0 + 0.01), window.centre.y, yaw)
            }
        };
        if window.sill_m > 0.7 && room.rng.chance(0.7) {
            let radiator = decor::radiator((window.width_m - 0.1).clamp(0.4, 1.6), &mut room.rng);
            room.at(radiator, place(0.12));
        }
        if dressed {
            let pane = Pane { width_m: window.width_m, sill_m: window.sill_m, head_m: window.head_m };
            let mut curtains = textiles::curtains(pane, to_floor, &mut room.rng);
            let pose = place(0.14);
            if !curtains.footprint_at(&pose).is_within(&inner) {
                continue;
            }
            let lands_free = room.at(curtains.clone(), pose).is_some();
            if !lands_free {
                // Blocked by furniture: use short ones.
                curtains = textiles::curtains(pane, false, &mut room.rng);
                curtains.mount = Mount::Hung;
                room.put_anyway(curtains, pose);
            }
        } else if window.sill_m > 0.6 && room.rng.chance(0.6) {
            let sill = decor::sill(window.width_m, window.sill_m, &mut room.rng);
            let pose = place(sill.size[1]);
            room.put_anyway(sill, pose);
        }
    }
}

/// Adds lamps, pictures, wall shelves, plants and clutter.
pub(super) fn decorate(room: &mut Arranger) {
    let kind = room.room().kind;
    let area = room.room().inner.area_m2();
    let middle = room.room().inner.centre();
    let lamp = lamps::ceiling_lamp(room.plan.ceiling_m, &mut room.rng);
    let under_pillar = room.plan.features.iter().any(|f| f.footprint.grown(0.3).contains(&middle));
    if !under_pillar {
        room.put_anyway(lamp, Pose2::new(middle.x, middle.y, 0.0));
    }
    let lived_in = !matches!(kind, RoomKind::Bathroom | RoomKind::Storage);
    if lived_in {
        for _ in 0..room.rng.count(0, if area > 12.0 { 5 } else { 3 }) {
            if room.rng.chance(0.75) {
                let piece = decor::picture(&mut room.rng);
                room.hang(piece, 1.2);
            } else {
                let piece = shelves::wall_shelf(&mut room.rng);
                room.hang(piece, 1.3);
            }
        }
        if area > 6.0 {
            for _ in 0..room.rng.count(0, 2) {
                let plant = decor::plant(&mut room.rng);
                room.in_corner(plant, 0.0);
            }
        }
        if area > 7.0 && room.rng.chance(0.12) {
            let mirror = decor::leaning_mirror(&mut room.rng);
            room.against_wall(mirror, 0.0);
        }
    }
    // Messy rooms are also crowded.
    let most = 1.0 + area / 6.0 * (0.6 + 1.2 * room.mess);
    for _ in 0..room.rng.count(0, most as usize) {
        let item = things::standing_thing(kind, &mut room.rng);
        if room.rng.chance(0.75) {
            room.against_wall(item, 0.0);
        } else {
            room.free(item, 0.05);
        }
    }
    mess::spread(room);
}
