//! Changes between days, and between rooms that look alike.

use super::furnish::{Arranger, standing_thing};
use super::piece::{Mount, Piece};
use super::plan::{OpeningKind, Plan};
use super::rng::Rng;
use super::structure;

/// Returns the furniture on another day: a fraction of the movable pieces changes, and new ones are added.
pub(super) fn another_day(plan: &Plan, pieces: &[Piece], fraction: f64, rng: &Rng) -> Vec<Piece> {
    let mut out = vec![];
    for room in 0..plan.rooms.len() {
        let mut rng = rng.fork("room", room as u64);
        let here: Vec<&Piece> = pieces.iter().filter(|piece| piece.room == room).collect();
        let (touched, kept): (Vec<&Piece>, Vec<&Piece>) =
            here.into_iter().partition(|piece| piece.movable && rng.chance(fraction));
        let mut arranger =
            Arranger::new(plan, room, rng.fork("arrange", 0)).with_pieces(kept.into_iter().cloned());
        for piece in touched {
            change(&mut arranger, piece, &mut rng);
        }
        let newcomers = (plan.rooms[room].inner.area_m2() / 6.0 * fraction * 2.0).round() as usize;
        for _ in 0..rng.count(0, newcomers) {
            let item = standing_thing(plan.rooms[room].kind, &mut rng);
            arranger.free(item, 0.0);
        }
        out.extend(arranger.finish());
    }
    out
}

fn change(arranger: &mut Arranger, piece: &Piece, rng: &mut Rng) {
    let old = piece.home_from_piece;
    let placed = match (piece.mount, rng.count(0, 3)) {
        (Mount::Hung, 0 | 1) | (_, 0) => Some(0),
        (Mount::Hung, _) => {
            let bottom = piece.solids.iter().map(|solid| solid.bottom_m()).fold(f64::INFINITY, f64::min);
            arranger.hang(piece.clone(), bottom)
        }
        (Mount::Flat, _) => {
            let pose = nudged(&old, rng);
            let fits = piece.footprint_at(&pose).is_within(&arranger.inside(0.0));
            fits.then(|| arranger.put_anyway(piece.clone(), pose))
        }
        (Mount::Floor, 1) => arranger.at_in_front(piece.clone(), nudged(&old, rng)),
        (Mount::Floor, 2) => arranger.free(piece.clone(), 0.05),
        (Mount::Floor, _) => arranger.against_wall(piece.clone(), 0.0),
    };
    if placed.is_none() {
        arranger.put_anyway(piece.clone(), old);
    }
}

fn nudged(pose: &viola_geometry::Pose2, rng: &mut Rng) -> viola_geometry::Pose2 {
    let (x, y) = (rng.between(-0.5, 0.5), rng.between(-0.5, 0.5));
    viola_geometry::Pose2::new(pose.x_m + x, pose.y_m + y, pose.yaw_rad + rng.between(-0.7, 0.7))
}

/// Returns the door leaves on another day; `leaves` are those of the plan's doors, in order.
pub(super) fn turn_doors(plan: &Plan, leaves: &[Piece], fraction: f64, rng: &Rng) -> Vec<Piece> {
    let mut rng = rng.fork("doors", 0);
    let doors = plan.openings.iter().filter(|o| matches!(o.kind, OpeningKind::Door | OpeningKind::Entrance));
    let turned = doors.zip(leaves).map(|(opening, leaf)| {
        if opening.kind == OpeningKind::Entrance || !rng.chance(fraction) {
            return leaf.clone();
        }
        let open_rad = rng.between(0.0, 95f64.to_radians());
        Piece { home_from_piece: structure::leaf_pose(plan, opening, open_rad), ..leaf.clone() }
    });
    turned.collect()
}

/// Changes the furniture of some copies of the repeated unit, so that they can be distinguished.
pub(super) fn break_symmetry(plan: &Plan, pieces: Vec<Piece>, rng: &mut Rng) -> Vec<Piece> {
    let fraction = rng.pick([0.0, 0.25, 0.5]);
    let odd: Vec<bool> = plan.units.iter().map(|_| rng.chance(fraction)).collect();
    let is_odd = |piece: &Piece| plan.rooms[piece.room].unit.is_some_and(|(copy, _)| odd[copy]);
    let (changing, mut out): (Vec<Piece>, Vec<Piece>) = pieces.into_iter().partition(is_odd);
    out.extend(another_day(plan, &changing, 0.6, &rng.fork("odd", 0)).into_iter().filter(is_odd));
    out
}
