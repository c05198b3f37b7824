//! Kitchen units and appliances.

use super::colours::{ceramic, steel};
use crate::simulate::finish::{DARK, Finish, METAL, Pattern, WHITE, front, wood};
use crate::simulate::piece::{Mount, Piece, TopKind};
use crate::simulate::rng::Rng;
use viola_geometry::taxonomy::Class;

/// Depth of a worktop, in metres.
pub const DEPTH_M: f64 = 0.62;
/// Height of a worktop, in metres.
const LEVEL_M: f64 = 0.9;
/// Width of one unit, in metres.
const UNIT_M: f64 = 0.6;
/// Bottom of the wall cabinets, in metres.
const UPPER_M: f64 = 1.42;

fn black() -> Finish {
    Finish::plain([0.05; 3]).glossy(0.8)
}

/// Things on the wall above a run of kitchen units.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Above {
    Nothing,
    Cabinets,
    Shelves,
}

/// Finish of all units of a kitchen.
#[derive(Debug, Clone, Copy)]
pub struct Style {
    fronts: Finish,
    worktop: Finish,
    handles: bool,
}

impl Style {
    pub fn draw(rng: &mut Rng) -> Style {
        let tone = rng.pick([[0.35, 0.33, 0.32], [0.75, 0.72, 0.68], [0.12, 0.12, 0.13], WHITE]);
        let stone = Finish::plain(tone).glossy(0.3).with(Pattern::Grain, 0.02);
        let worktop = if rng.chance(0.35) { wood(rng) } else { stone };
        Style { fronts: front(rng), worktop, handles: rng.chance(0.5) }
    }
}

/// Returns a run of units on a recessed plinth, with a hob and a sink if `wet`. As in ScanNet and ADE20K the units are
/// cabinets, and only the worktop is a counter.
pub fn run(width: f64, above: Above, wet: bool, style: &Style, rng: &mut Rng) -> Piece {
    let depth = DEPTH_M;
    let Style { fronts, worktop, .. } = *style;
    let mut run = Piece::new(Class::Cabinet, [width, depth, LEVEL_M]);
    run.block([0.0, 0.03, 0.0], [width, depth - 0.07, 0.1], fronts.darker(0.45));
    run.block([0.0, 0.01, 0.1], [width, depth - 0.03, 0.76], fronts);
    run.block([0.0, 0.0, 0.86], [width, depth, 0.04], worktop).class = Class::Counter;
    let units = (width / UNIT_M) as usize;
    for joint in 1..units {
        let x = joint as f64 * UNIT_M - width / 2.0;
        run.block([x, 0.025 - depth / 2.0, 0.12], [0.006, 0.01, 0.7], fronts.darker(0.4));
    }
    if style.handles {
        for unit in 0..units {
            let x = (unit as f64 + 0.5) * UNIT_M - width / 2.0;
            run.block([x, 0.01 - depth / 2.0, 0.78], [0.16, 0.025, 0.012], steel());
        }
    }
    let side = rng.sign();
    let hob = side * (width / 2.0 - 0.45).max(0.0).min(width / 4.0 + 0.15);
    let front = 0.022 - depth / 2.0;
    if wet {
        run.block([hob, 0.0, LEVEL_M], [0.56, 0.5, 0.006], black()).class = Class::Stove;
        run.block([hob, front, 0.2], [0.56, 0.01, 0.55], Finish::plain(DARK).glossy(0.7)).class =
            Class::Stove;
        if width > 1.5 {
            sink(&mut run, -hob, rng);
        }
        if width > 2.3 && rng.chance(0.5) {
            // A dishwasher beside the sink.
            let bottom = [-hob + side * UNIT_M, front, 0.12];
            run.block(bottom, [0.58, 0.01, 0.72], steel()).class = Class::WashingMachine;
        }
        pans(&mut run, hob, rng);
    }
    let free = if wet { (2.0 * hob.abs() - 0.56 - 0.55).max(0.25) } else { width - 0.1 };
    run.top(TopKind::Kitchen, [0.0, 0.05, LEVEL_M], [free, depth - 0.2], UPPER_M - LEVEL_M - 0.03);
    let outer = side * (hob.abs() + 0.3 + width / 2.0) / 2.0;
    let rest = width / 2.0 - hob.abs() - 0.32;
    if wet && rest > 0.12 {
        run.top(TopKind::Kitchen, [outer, 0.05, LEVEL_M], [rest, depth - 0.2], UPPER_M - LEVEL_M - 0.03);
    }
    match above {
        Above::Nothing => {}
        Above::Cabinets => upper(&mut run, wet.then_some(hob), style, rng),
        Above::Shelves => boards(&mut run, style, rng),
    }
    run
}

/// Takes what hangs above a placed run, as an object of its own.
pub fn take_upper(run: &mut Piece, above: Above) -> Option<Piece> {
    let class = match above {
        Above::Nothing => return None,
        Above::Cabinets => Class::Cabinet,
        Above::Shelves => Class::Shelf,
    };
    let high = run.size[2];
    let mut upper = Piece::new(class, run.size).mounted(Mount::Hung);
    let is_upper = |bottom_m: f64| bottom_m > UPPER_M - 0.01;
    upper.solids = run.solids.extract_if(.., |solid| is_upper(solid.centre.z - solid.half.z)).collect();
    upper.tops = run.tops.extract_if(.., |top| is_upper(top.centre[2])).collect();
    run.size[2] = LEVEL_M;
    upper.size[2] = high;
    Some(upper)
}

fn sink(run: &mut Piece, x: f64, rng: &mut Rng) {
    let double = run.size[0] > 2.2 && rng.chance(0.4);
    let bowls: &[f64] = if double { &[-0.22, 0.22] } else { &[0.0] };
    run.block([x, 0.0, LEVEL_M], [if double { 0.9 } else { 0.5 }, 0.46, 0.008], steel()).class = Class::Sink;
    for bowl in bowls {
        run.block([x + bowl, -0.02, LEVEL_M], [0.38, 0.34, 0.011], steel().darker(0.6)).class = Class::Sink;
    }
    run.post([x, 0.2, LEVEL_M], 0.015, 0.26, steel()).class = Class::Sink;
    run.bar([x, 0.2, LEVEL_M + 0.25], [x, 0.02, LEVEL_M + 0.22], 0.011, steel()).class = Class::Sink;
}

/// Adds pots and pans to the hob.
fn pans(run: &mut Piece, hob: f64, rng: &mut Rng) {
    for (x, y) in [(-0.13, -0.11), (0.14, 0.1)] {
        if rng.chance(0.35) {
            let radius = rng.between(0.08, 0.13);
            let pot = Finish::plain(rng.pick([METAL, DARK, [0.6, 0.2, 0.15]])).glossy(0.6);
            let tall = rng.pick([0.05, 0.12, 0.16]);
            let at = [hob + x, y, LEVEL_M + 0.006];
            run.post(at, radius, tall, pot).class = Class::Other;
            let end = [hob + x, y - radius - 0.15, LEVEL_M + tall];
            run.bar([hob + x, y - radius, LEVEL_M + tall], end, 0.01, pot).class = Class::Other;
        }
    }
}

/// Adds wall cabinets, with a hood over the hob.
fn upper(run: &mut Piece, hob: Option<f64>, style: &Style, rng: &mut Rng) {
    let [width, depth, _] = run.size;
    let high = rng.between(2.0, 2.3);
    let back = depth / 2.0 - 0.18;
    let gap = hob.filter(|_| rng.chance(0.6)).map(|x| [x - 0.31, x + 0.31]);
    let whole = [-width / 2.0, width / 2.0];
    let parts = match gap {
        Some([from, to]) => vec![[whole[0], from], [to, whole[1]]],
        None => vec![whole],
    };
    for [from, to] in parts.into_iter().filter(|[from, to]| to - from > 0.15) {
        let x = (from + to) / 2.0;
        run.block([x, back, UPPER_M], [to - from, 0.36, high - UPPER_M], style.fronts);
        for joint in 1..((to - from) / UNIT_M) as usize {
            let at = from + joint as f64 * UNIT_M;
            run.block(
                [at, depth / 2.0 - 0.36, UPPER_M],
                [0.006, 0.01, high - UPPER_M],
                style.fronts.darker(0.4),
            );
        }
        if high < 2.2 {
            run.top(TopKind::Store, [x, back, high], [to - from, 0.3], 0.3);
        }
    }
    if let Some([from, to]) = gap {
        let x = (from + to) / 2.0;
        run.block([x, depth / 2.0 - 0.25, 1.55], [0.6, 0.5, 0.07], steel()).class = Class::Stove;
        run.block([x, depth / 2.0 - 0.15, 1.6], [0.28, 0.26, high - 1.5], steel()).class = Class::Stove;
    }
    run.size[2] = high;
}

fn boards(run: &mut Piece, style: &Style, rng: &mut Rng) {
    let [width, depth, _] = run.size;
    let wide = width * rng.between(0.5, 0.95);
    for z in [UPPER_M, UPPER_M + 0.35] {
        let bottom = [0.0, depth / 2.0 - 0.13, z];
        run.block(bottom, [wide, 0.25, 0.03], style.worktop).class = Class::Shelf;
        run.top(TopKind::Kitchen, [0.0, depth / 2.0 - 0.13, z + 0.03], [wide * 0.95, 0.2], 0.3);
    }
    run.size[2] = UPPER_M + 0.7;
}

/// Returns a column with an oven and a microwave, of a kitchen's finish.
pub fn oven_column(style: &Style, rng: &mut Rng) -> Piece {
    let height = rng.between(2.0, 2.25);
    let mut column = Piece::new(Class::Cabinet, [0.6, DEPTH_M, height]);
    column.block([0.0, 0.03, 0.0], [0.6, DEPTH_M - 0.07, 0.1], style.fronts.darker(0.45));
    column.block([0.0, 0.0, 0.1], [0.6, DEPTH_M, height - 0.1], style.fronts);
    for (z, high) in [(0.75, 0.58), (1.36, 0.38)] {
        let oven = column.block([0.0, -DEPTH_M / 2.0, z], [0.57, 0.02, high], black());
        oven.class = Class::Stove;
        let handle = [0.0, -DEPTH_M / 2.0 - 0.03, z + high - 0.1];
        column.block(handle, [0.45, 0.02, 0.02], steel()).class = Class::Stove;
    }
    column
}

/// Returns a kitchen island: a plinth, a body, and an overhanging worktop.
pub fn island(style: &Style, rng: &mut Rng) -> Piece {
    let (width, depth) = (rng.between(1.2, 2.2), rng.between(0.7, 1.0));
    let mut piece = Piece::new(Class::Cabinet, [width, depth, 0.92]);
    let over = rng.between(0.04, 0.28);
    piece.block([0.0, 0.0, 0.0], [width - 0.3, depth - over - 0.1, 0.1], style.fronts.darker(0.5));
    piece.block([0.0, over / 2.0, 0.1], [width - 0.06, depth - over, 0.78], style.fronts);
    piece.block([0.0, 0.0, 0.88], [width, depth, 0.04], style.worktop).class = Class::Counter;
    piece.top(TopKind::Kitchen, [0.0, 0.0, 0.92], [width * 0.9, depth * 0.85], 0.5);
    piece
}

/// Returns a refrigerator: low, tall, or with two doors.
pub fn fridge(rng: &mut Rng) -> Piece {
    let size = match rng.count(0, 5) {
        0 => [0.55, 0.58, rng.between(0.82, 0.9)],
        1 => [rng.between(0.8, 0.95), 0.7, rng.between(1.7, 1.85)],
        _ => [rng.between(0.54, 0.7), rng.between(0.58, 0.68), rng.between(1.4, 2.0)],
    };
    let [width, depth, height] = size;
    let finish = Finish::plain(rng.pick([WHITE, WHITE, METAL, DARK])).glossy(0.5);
    let mut piece = Piece::new(Class::Refrigerator, size);
    piece.block([0.0, 0.03, 0.0], [width - 0.04, depth - 0.08, 0.05], Finish::plain(DARK));
    piece.block([0.0, 0.0, 0.05], [width, depth, height - 0.05], finish);
    let handle = |piece: &mut Piece, x: f64, z: f64, tall: f64| {
        piece.block([x, -depth / 2.0 - 0.02, z], [0.025, 0.03, tall], finish.darker(0.6));
    };
    if width > 0.75 {
        piece.block([0.0, -depth / 2.0, 0.1], [0.01, 0.008, height - 0.15], Finish::plain(DARK));
        handle(&mut piece, -0.05, height * 0.4, 0.5);
        handle(&mut piece, 0.05, height * 0.4, 0.5);
    } else {
        if height > 1.0 {
            let split = height * rng.pick([0.38, 0.62]);
            piece.block([0.0, -depth / 2.0, split], [width, 0.008, 0.01], Finish::plain(DARK));
        }
        handle(&mut piece, width * 0.38, height * 0.42, 0.25);
    }
    for _ in 0..rng.count(0, 4) {
        let at = [rng.between(-0.35, 0.35) * width, -depth / 2.0 - 0.001, rng.between(0.6, 0.9) * height];
        let note = Finish::plain([rng.between(0.4, 0.95) as f32, 0.8, rng.between(0.3, 0.9) as f32]);
        piece.block(at, [0.08, 0.004, 0.1], note).roll_rad = rng.between(-0.2, 0.2);
    }
    let above = if height < 1.9 { 0.35 } else { 0.2 };
    piece.top(TopKind::Store, [0.0, 0.0, height], [width * 0.85, depth * 0.7], above);
    piece
}

/// Returns a free-standing stove with its oven.
pub fn stove(rng: &mut Rng) -> Piece {
    let width = rng.pick([0.5, 0.6, 0.6, 0.75]);
    let mut piece = Piece::new(Class::Stove, [width, 0.62, 0.95]);
    let finish = Finish::plain(rng.pick([WHITE, METAL, DARK])).glossy(0.5);
    piece.block([0.0, 0.02, 0.0], [width - 0.04, 0.54, 0.08], Finish::plain(DARK));
    piece.block([0.0, 0.0, 0.08], [width, 0.6, 0.8], finish);
    piece.block([0.0, -0.3, 0.25], [width - 0.1, 0.02, 0.4], black());
    piece.block([0.0, -0.33, 0.68], [width - 0.12, 0.025, 0.02], steel());
    piece.block([0.0, 0.0, 0.88], [width - 0.04, 0.54, 0.01], black());
    for (x, y) in [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)] {
        piece.post([x * width * 0.24, y * 0.13, 0.89], rng.between(0.06, 0.1), 0.012, Finish::plain(DARK));
        piece.bar([x * width * 0.3, -0.3, 0.8], [x * width * 0.3, -0.325, 0.8], 0.02, finish.darker(0.4));
    }
    if rng.chance(0.5) {
        piece.block([0.0, 0.28, 0.88], [width, 0.04, 0.12], finish);
    }
    piece
}

/// Returns a washing machine, sometimes with a dryer on it.
pub fn washing_machine(rng: &mut Rng) -> Piece {
    let mut piece = Piece::new(Class::WashingMachine, [0.6, 0.6, 0.85]);
    let white = ceramic();
    let stack = rng.chance(0.25);
    piece.block([0.0, 0.02, 0.0], [0.58, 0.54, 0.03], Finish::plain(DARK));
    for base in if stack { vec![0.03, 0.87] } else { vec![0.03] } {
        piece.block([0.0, 0.0, base], [0.6, 0.6, 0.82], white);
        // The round door in the front.
        let door = Finish::plain([0.2, 0.22, 0.25]).glossy(0.7);
        piece.ball([0.0, -0.3, base + 0.22], [0.36, 0.05, 0.36], door);
        piece.block([0.0, -0.3, base + 0.7], [0.56, 0.01, 0.09], white.darker(0.85));
    }
    if stack {
        piece.size[2] = 1.69;
    }
    piece.top(TopKind::Bath, [0.0, 0.0, piece.size[2]], [0.54, 0.5], 0.4);
    piece
}
