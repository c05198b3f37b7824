//! Things that people leave on level places and on floors.

use super::{Arranger, goods, things};
use crate::simulate::piece::{Piece, Top, TopKind};
use crate::simulate::rng::Rng;
use viola_geometry::taxonomy::Class;
use viola_geometry::{Pose2, Vector3};

/// Tries to find a free place for one thing.
const TRIES: usize = 4;
/// Maximum things on one place.
const MAX_THINGS: usize = 7;

/// Puts things on all level places of the room's pieces, under its tables, and on its floor.
pub(super) fn spread(room: &mut Arranger) {
    let mess = room.mess;
    for index in 0..room.pieces_mut().len() {
        let mut rng = room.rng.fork("tops", index as u64);
        let piece = &mut room.pieces_mut()[index];
        for top in std::mem::take(&mut piece.tops) {
            cover(piece, &top, mess, &mut rng);
        }
        if matches!(piece.class, Class::Desk | Class::Table) && rng.chance(0.5 * mess) {
            tuck_under(piece, &mut rng);
        }
    }
    let kind = room.room().kind;
    let most = mess * mess * room.room().inner.area_m2() / 1.6;
    for _ in 0..room.rng.count(0, most as usize) {
        let item = things::dropped(kind, &mut room.rng);
        room.free(item, 0.0);
    }
}

/// Returns the mean number of things on a square metre: of a tidy home, and added by full mess.
fn density(kind: TopKind) -> [f64; 2] {
    match kind {
        TopKind::Table => [1.5, 9.0],
        TopKind::Desk => [4.0, 14.0],
        TopKind::Kitchen => [5.0, 12.0],
        TopKind::Bath => [4.0, 14.0],
        TopKind::Store => [3.0, 9.0],
        TopKind::Soft => [0.1, 2.2],
    }
}

fn cover(piece: &mut Piece, top: &Top, mess: f64, rng: &mut Rng) {
    let [tidy, added] = density(top.kind);
    let mean = (tidy + added * mess) * top.size[0] * top.size[1];
    let wanted = (mean * rng.between(0.2, 1.8) + rng.between(0.0, 1.0)) as usize;
    for _ in 0..wanted.min(MAX_THINGS) {
        let thing = goods::thing_for(top.kind, rng);
        let [width, depth, height] = thing.size;
        if height > top.above_m || width > top.size[0] || depth > top.size[1] {
            continue;
        }
        for _ in 0..TRIES {
            let offset = |rng: &mut Rng, free: f64| rng.between(-0.5, 0.5) * free.max(0.0);
            let x = top.centre[0] + offset(rng, top.size[0] - width);
            let y = top.centre[1] + offset(rng, top.size[1] - depth);
            let at = [x, y, top.centre[2]];
            if top.kind == TopKind::Soft || is_free(piece, at, thing.size) {
                let yaw = rng.between(-0.25, 0.25) * (1.0 + mess);
                piece.join(&thing, &Pose2::new(x, y, yaw), at[2]);
                break;
            }
        }
    }
}

/// Puts a box or a bag on the floor under a table, towards its back.
fn tuck_under(piece: &mut Piece, rng: &mut Rng) {
    let thing = if rng.chance(0.5) { things::carton(rng) } else { goods::bag(rng) };
    let [width, depth, _] = piece.size;
    let x = rng.between(-0.5, 0.5) * (width - thing.size[0] - 0.2);
    let y = 0.5 * (depth - thing.size[1]) - 0.12;
    if y > 0.0 && width > 0.9 && is_free(piece, [x, y, 0.005], thing.size) {
        piece.join(&thing, &Pose2::new(x, y, 0.0), 0.0);
    }
}

/// Returns whether a box that stands at `at` meets none of the piece's solids.
fn is_free(piece: &Piece, at: [f64; 3], size: [f64; 3]) -> bool {
    let half = Vector3::from(size) / 2.0;
    let centre = Vector3::new(at[0], at[1], at[2] + half.z + 1e-3);
    piece.solids.iter().all(|solid| {
        let apart = (solid.centre.coords - centre).abs();
        let reach = half + solid.half_bounds();
        (0..3).any(|axis| apart[axis] >= reach[axis])
    })
}
