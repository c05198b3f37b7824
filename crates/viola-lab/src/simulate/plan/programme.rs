//! Rooms of a home with their target areas.

use super::RoomKind;
use crate::simulate::rng::Rng;

/// A requested room; none is a part of the outline left outside (an L-shaped home).
#[derive(Debug, Clone, Copy)]
pub(super) struct Wish {
    pub kind: Option<RoomKind>,
    pub area_m2: f64,
}

impl Wish {
    /// Returns the room's minimum width, between the centre lines of its walls.
    pub fn min_side_m(&self) -> f64 {
        match self.kind {
            Some(RoomKind::Corridor) => 1.2,
            Some(RoomKind::Bathroom | RoomKind::Storage) => 1.6,
            Some(RoomKind::Kitchen | RoomKind::Study) => 2.2,
            Some(RoomKind::Child | RoomKind::Bedroom) => 2.6,
            Some(_) => 3.0,
            None => 1.0,
        }
    }
}

/// Returns the requests for a home of `rooms` rooms, 26 to 195 m2 in total.
pub(super) fn wishes(rooms: usize, rng: &mut Rng) -> Vec<Wish> {
    use RoomKind::*;
    let base: &[(RoomKind, f64)] = match rooms {
        1 => &[(Studio, 28.0)],
        2 => &[(Studio, 26.0), (Bathroom, 7.0)],
        3 => &[(Studio, 24.0), (Bathroom, 5.0), (Corridor, 5.0)],
        _ => &[
            (Living, 23.0),
            (Kitchen, 10.0),
            (Bathroom, 6.0),
            (Bedroom, 14.0),
            (Corridor, 8.0),
            (Child, 11.0),
            (Study, 9.5),
            (Bathroom, 5.0),
            (Bedroom, 13.0),
            (Storage, 4.5),
            (Dining, 14.0),
            (Bedroom, 15.0),
        ],
    };
    let mut list: Vec<Wish> = base[..rooms.min(base.len())]
        .iter()
        .map(|&(kind, area_m2)| Wish { kind: Some(kind), area_m2: area_m2 * rng.between(0.85, 1.2) })
        .collect();
    let total: f64 = list.iter().map(|wish| wish.area_m2).sum();
    let wanted = (total * rng.between(0.85, 1.35)).clamp(26.0, 195.0);
    for wish in &mut list {
        wish.area_m2 *= wanted / total;
    }
    list
}
