//! Beds and their bedding.

use super::sizes::PILLOW;
use crate::simulate::finish::{Finish, METAL, Pattern, WHITE, cloth, wood};
use crate::simulate::piece::{Piece, TopKind};
use crate::simulate::rng::Rng;
use viola_geometry::taxonomy::Class;

/// Returns a bed with its head at the wall; a vacuum drives under some and stops at the base of others.
/// `mess` from 0 to 1 is that of the bedding.
pub fn bed(width: f64, mess: f64, rng: &mut Rng) -> Piece {
    let length = rng.between(1.95, 2.2);
    let finish = if rng.chance(0.5) { wood(rng) } else { cloth(rng) };
    match rng.count(0, 6) {
        0 => divan(width, length, finish, mess, rng),
        1 => metal(width, length, mess, rng),
        2 => mattress(width, mess, rng),
        _ => framed(width, length, finish, mess, rng),
    }
}

/// Returns a bed for a child: a cot, a bunk bed, or a narrow bed.
pub fn childs_bed(mess: f64, rng: &mut Rng) -> Piece {
    match rng.count(0, 5) {
        0 => cot(mess, rng),
        1 => bunk(mess, rng),
        _ => bed(0.9, mess, rng),
    }
}

fn framed(width: f64, length: f64, finish: Finish, mess: f64, rng: &mut Rng) -> Piece {
    let head = rng.between(0.7, 1.25);
    let mut bed = Piece::new(Class::Bed, [width, length, head]);
    let gap = rng.pick([0.0, 0.06, 0.14, 0.18, 0.22]);
    if gap > 0.1 {
        bed.legs(width, length, gap, 0.06, 0.03, finish);
    } else {
        // A plinth recessed from the edge.
        bed.block([0.0, 0.0, 0.0], [width - 0.1, length - 0.1, gap.max(0.02)], finish.darker(0.6));
    }
    let rim = rng.between(0.26, 0.36);
    bed.block([0.0, 0.0, gap], [width, length, rim - gap], finish);
    let padded = rng.chance(0.4);
    let board = [width, 0.08, head - rim];
    let bottom = [0.0, length / 2.0 - 0.04, rim];
    if padded {
        bed.cushion(bottom, board, finish);
    } else {
        bed.block(bottom, board, finish);
    }
    if rng.chance(0.25) {
        bed.block([0.0, 0.02 - length / 2.0, rim], [width, 0.04, rng.between(0.15, 0.35)], finish);
    }
    make_up(&mut bed, [width, length], rim, mess, rng);
    bed
}

/// Returns a mattress on an upholstered box.
fn divan(width: f64, length: f64, finish: Finish, mess: f64, rng: &mut Rng) -> Piece {
    let mut bed = Piece::new(Class::Bed, [width, length, 0.6]);
    let base = rng.between(0.28, 0.38);
    bed.block([0.0, 0.0, 0.03], [width - 0.02, length - 0.02, base - 0.03], finish);
    make_up(&mut bed, [width, length], base, mess, rng);
    bed
}

fn metal(width: f64, length: f64, mess: f64, rng: &mut Rng) -> Piece {
    let (head, foot) = (rng.between(0.85, 1.2), rng.between(0.5, 0.8));
    let mut bed = Piece::new(Class::Bed, [width, length, head]);
    let steel = Finish::plain(rng.pick([METAL, WHITE, [0.12, 0.12, 0.13]])).glossy(0.4);
    for (y, top) in [(length / 2.0 - 0.02, head), (0.02 - length / 2.0, foot)] {
        for k in 0..5 {
            let x = (f64::from(k) / 4.0 - 0.5) * (width - 0.04);
            let low = if k == 0 || k == 4 { 0.0 } else { 0.3 };
            bed.post([x, y, low], 0.012, top - low, steel);
        }
        bed.bar([-width / 2.0 + 0.02, y, top], [width / 2.0 - 0.02, y, top], 0.014, steel);
    }
    bed.block([0.0, 0.0, 0.28], [width - 0.04, length - 0.06, 0.04], steel);
    make_up(&mut bed, [width - 0.04, length - 0.08], 0.31, mess, rng);
    bed
}

/// Returns a mattress on the floor or on pallets.
fn mattress(width: f64, mess: f64, rng: &mut Rng) -> Piece {
    let mut bed = Piece::new(Class::Bed, [width, 2.0, 0.4]);
    let base = rng.pick([0.0, 0.14]);
    if base > 0.0 {
        bed.block([0.0; 3], [width - 0.04, 1.96, base], wood(rng));
    }
    make_up(&mut bed, [width, 2.0], base, mess, rng);
    bed
}

fn cot(mess: f64, rng: &mut Rng) -> Piece {
    let (width, length, top) = (0.72, 1.32, rng.between(0.85, 1.0));
    let mut bed = Piece::new(Class::Bed, [width, length, top]);
    let finish = if rng.chance(0.5) { Finish::plain(WHITE) } else { wood(rng) };
    bed.legs(width, length, top, 0.04, 0.0, finish);
    bed.block([0.0, 0.0, 0.3], [width - 0.02, length - 0.02, 0.04], finish);
    for side in [-1.0, 1.0] {
        let x = side * (width / 2.0 - 0.02);
        bed.block([x, 0.0, top - 0.04], [0.03, length - 0.04, 0.04], finish);
        bed.block([x, 0.0, 0.32], [0.03, length - 0.04, 0.04], finish);
        for k in 0..9 {
            let y = (f64::from(k) + 0.5) / 9.0 * length - length / 2.0;
            bed.post([x, y, 0.34], 0.009, top - 0.36, finish);
        }
        bed.block([0.0, side * (length / 2.0 - 0.015), 0.32], [width, 0.03, top - 0.34], finish);
    }
    make_up(&mut bed, [width - 0.1, length - 0.1], 0.32, mess, rng);
    bed.rest = None;
    bed
}

fn bunk(mess: f64, rng: &mut Rng) -> Piece {
    let (width, length, top) = (0.98, 2.06, rng.between(1.55, 1.75));
    let mut bed = Piece::new(Class::Bed, [width, length, top]);
    let finish = if rng.chance(0.3) { Finish::plain(WHITE) } else { wood(rng) };
    bed.legs(width, length, top, 0.06, 0.0, finish);
    for level in [0.26, top - 0.45] {
        bed.block([0.0, 0.0, level], [width - 0.04, length - 0.04, 0.1], finish);
        make_up(&mut bed, [width - 0.1, length - 0.1], level + 0.08, mess, rng);
    }
    // Only the lower bed is reached.
    bed.tops.truncate(1);
    bed.rest = None;
    for x in [-1.0, 1.0] {
        bed.block([x * (width / 2.0 - 0.015), 0.2, top - 0.16], [0.03, length - 0.5, 0.1], finish);
    }
    let side = rng.sign() * (width / 2.0 - 0.015);
    for y in [0.1, 0.45] {
        bed.block([side, y - length / 2.0, 0.0], [0.03, 0.04, top], finish);
    }
    for step in 1..5 {
        bed.block([side, 0.275 - length / 2.0, f64::from(step) * 0.27], [0.03, 0.35, 0.03], finish);
    }
    bed
}

/// Adds a mattress on a base of height `base`, with pillows and a cover that is flat or heaped up.
fn make_up(bed: &mut Piece, [width, length]: [f64; 2], base: f64, mess: f64, rng: &mut Rng) {
    let sheet =
        Finish::plain(if rng.chance(0.6) { WHITE } else { cloth(rng).rgb }).with(Pattern::Grain, 0.02);
    let thick = rng.between(0.14, 0.26);
    bed.block([0.0, -0.02, base], [width - 0.04, length - 0.1, thick], sheet);
    let level = base + thick;
    let cover = cloth(rng).with(rng.pick([Pattern::Grain, Pattern::Grain, Pattern::Picture]), 0.12);
    if rng.chance(0.15 + 0.75 * mess) {
        heap(bed, [width, length], level, cover, rng);
    } else {
        let covered = rng.between(0.55, 0.8) * length;
        let y = (covered - length) / 2.0;
        bed.block([0.0, y, level - 0.12], [width + 0.02, covered, 0.16], cover);
        // The edge that is folded back.
        bed.cushion([0.0, y + covered / 2.0, level + 0.01], [width, 0.22, 0.06], sheet);
        bed.cushion([0.0, y, level - 0.02], [width, covered, rng.between(0.07, 0.1)], cover);
    }
    let pillows = if width > 1.2 { rng.count(2, 4) } else { rng.count(1, 2) };
    let places = if width > 1.2 { 2 } else { 1 };
    for index in 0..pillows {
        let [deep, _, high] = PILLOW.draw(rng);
        let wide = (0.9 * width / f64::from(places)).min(0.7);
        let place = (index % places as usize) as f64 + 0.5;
        let x = (place / f64::from(places) - 0.5) * width + rng.between(-0.08, 0.08) * (1.0 + mess);
        let row = (index / places as usize) as f64;
        let y = length / 2.0 - 0.3 - 0.16 * row - rng.between(0.0, 0.06);
        let size = [wide.max(0.4), deep.min(0.48), high];
        let pillow =
            bed.cushion([x.clamp(0.3 - width / 2.0, width / 2.0 - 0.3), y, level - 0.02], size, sheet);
        pillow.class = Class::Pillow;
        pillow.yaw_rad = rng.between(-0.2, 0.2) * (1.0 + 2.0 * mess);
        pillow.tilt_rad = rng.between(0.0, 0.3) + 0.2 * row;
        if index >= 2 {
            pillow.finish = cloth(rng);
        }
    }
    bed.rest = Some([0.0, -0.05, level + 0.02]);
    bed.top(TopKind::Soft, [0.0, -0.2 * length, level + 0.06], [width * 0.7, length * 0.45], 0.5);
}

/// Adds a duvet as somebody left it: overlapping lumps that lean at random.
fn heap(bed: &mut Piece, [width, length]: [f64; 2], level: f64, cover: Finish, rng: &mut Rng) {
    let aside = rng.between(-0.15, 0.15) * width;
    for _ in 0..rng.count(4, 8) {
        let size = [rng.between(0.35, 0.75) * width, rng.between(0.4, 0.9), rng.between(0.09, 0.24)];
        let slack = (width - size[0]).max(0.0) / 2.0;
        let x = (aside + rng.between(-0.5, 0.5) * width).clamp(-slack, slack);
        let y = rng.between(-0.5, 0.25) * (length - 0.8);
        let lump = bed.cushion([x, y, level - 0.04], size, cover);
        lump.yaw_rad = rng.between(-0.5, 0.5);
        lump.tilt_rad = rng.between(-0.12, 0.12);
        lump.roll_rad = rng.between(-0.12, 0.12);
    }
    if rng.chance(0.4) {
        // A corner hangs over the side.
        let side = rng.sign();
        let at = [side * (width / 2.0 + 0.01), rng.between(-0.3, 0.1) * length, level - 0.25];
        bed.cushion(at, [0.07, rng.between(0.4, 0.8), 0.32], cover);
    }
}
