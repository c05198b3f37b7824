//! Places to sleep and to keep clothes.

use super::{Arranger, beds, lamps, storage, textiles};
use viola_geometry::Pose2;

/// Adds a bed of about the given width, with what belongs beside it, and wardrobes.
pub(super) fn sleep(room: &mut Arranger, width: f64) {
    let mess = room.mess;
    let mut bed = None;
    for width in [width, 1.4, 0.9] {
        let piece = beds::bed(width, mess, &mut room.rng);
        bed = if width < 1.0 { room.in_corner(piece, 0.0) } else { room.against_wall(piece, 0.5) };
        if bed.is_some() {
            break;
        }
    }
    if let Some(bed) = bed {
        beside_bed(room, bed);
    }
    wardrobes(room);
}

/// Adds a child's bed or two, and a wardrobe.
pub(super) fn sleep_as_a_child(room: &mut Arranger) {
    let mess = room.mess;
    let beds = if room.room().inner.area_m2() > 13.0 { room.rng.count(1, 2) } else { 1 };
    for _ in 0..beds {
        let bed = beds::childs_bed(mess, &mut room.rng);
        if let Some(bed) = room.in_corner(bed, 0.0) {
            beside_bed(room, bed);
        }
    }
    wardrobes(room);
}

fn beside_bed(room: &mut Arranger, bed: usize) {
    let [w, d, _] = room.piece(bed).size;
    for side in [-1.0, 1.0] {
        if room.rng.chance(0.8) {
            let mut stand = storage::nightstand(&mut room.rng);
            let [wide, deep, high] = stand.size;
            if room.rng.chance(0.55) {
                let lamp = lamps::table_lamp(&mut room.rng);
                let back = (deep - lamp.size[1]) / 2.0;
                stand.join(&lamp, &Pose2::new(0.0, back.max(0.0), 0.0), high);
            }
            let x = side * (w / 2.0 + wide / 2.0 + 0.05);
            let turn = room.rng.between(-0.05, 0.05) * (0.3 + room.mess);
            room.beside(stand, bed, Pose2::new(x, (d - deep) / 2.0 - 0.02, turn));
        }
    }
    if room.rng.chance(0.35) {
        let rug = textiles::rug(w + 1.0, 1.4, &mut room.rng);
        let pose = room.piece(bed).home_from_piece.compose(&Pose2::new(0.0, -0.6, 0.0));
        if rug.footprint_at(&pose).is_within(&room.inside(0.0)) {
            room.put_anyway(rug, pose);
        }
    }
}

fn wardrobes(room: &mut Arranger) {
    let mut width = room.rng.pick([1.0, 1.5, 2.0, 2.4]);
    while width > 0.7 {
        let wardrobe = storage::wardrobe(width, &mut room.rng);
        if room.in_corner(wardrobe, 0.6).is_some() {
            break;
        }
        width -= 0.5;
    }
    if room.rng.chance(0.5) {
        let dresser = storage::dresser(&mut room.rng);
        room.against_wall(dresser, 0.5);
    }
    if room.rng.chance(0.15) {
        let rail = storage::coats(&mut room.rng);
        room.against_wall(rail, 0.2);
    }
}
