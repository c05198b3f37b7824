//! Solids of the building of a plan: floors, ceilings, walls with openings, frames, doors.

use super::finish::{DARK, Finish, METAL, Pattern, WHITE, paint, wood};
use super::piece::Piece;
use super::plan::{Opening, OpeningKind, Plan, RoomKind, Wall};
use super::rng::Rng;
use super::solid::Solid;
use viola_geometry::Pose2;
use viola_geometry::taxonomy::Class;

/// Thickness of the outer walls.
const OUTER_M: f64 = 0.3;

/// Returns the building without door leaves.
pub(super) fn solids(plan: &Plan, rng: &mut Rng) -> Vec<Solid> {
    let mut out = vec![];
    let paints: Vec<Finish> = plan.rooms.iter().map(|_| paint(rng)).collect();
    let common = paint(rng);
    let planks = wood(rng).with(Pattern::Planks, 0.13).glossy(0.2);
    for room in &plan.rooms {
        let centre = room.outline.centre();
        let size = [room.outline.size(0), room.outline.size(1), 0.1];
        let wet = matches!(room.kind, RoomKind::Bathroom | RoomKind::Kitchen);
        let floor = if wet {
            let tone = rng.pick([[0.75, 0.74, 0.72], [0.45, 0.46, 0.48], [0.80, 0.72, 0.62]]);
            Finish::plain(tone).with(Pattern::Tiles, rng.pick([0.2, 0.3, 0.45])).glossy(0.3)
        } else {
            planks
        };
        out.push(Solid::block(Class::Floor, [centre.x, centre.y, -0.1], size, floor));
        let ceiling = Finish::plain([0.93, 0.93, 0.92]);
        out.push(Solid::block(Class::Ceiling, [centre.x, centre.y, plan.ceiling_m], size, ceiling));
    }
    for wall in &plan.walls {
        let finish = match wall.rooms {
            [Some(room), None] | [None, Some(room)] => paints[room],
            _ => common,
        };
        build_wall(plan, wall, finish, &mut out);
    }
    for opening in &plan.openings {
        frame(plan, opening, &mut out);
    }
    out.extend(plan.features.iter().map(|feature| Solid { finish: common, ..feature.solid }));
    out
}

/// Returns a block in a wall's coordinates, by intervals.
fn upright(
    class: Class,
    along_x: bool,
    along: [f64; 2],
    across: [f64; 2],
    up: [f64; 2],
    finish: Finish,
) -> Option<Solid> {
    let size = |interval: [f64; 2]| interval[1] - interval[0];
    if size(along) < 1e-3 || size(up) < 1e-3 {
        return None;
    }
    let middle = |interval: [f64; 2]| (interval[0] + interval[1]) / 2.0;
    let (x, y) = if along_x { (along, across) } else { (across, along) };
    Some(Solid::block(class, [middle(x), middle(y), up[0]], [size(x), size(y), size(up)], finish))
}

/// Returns a wall's faces across: inner walls are centred on their line, outer walls extend outwards.
fn faces(plan: &Plan, rooms: [Option<usize>; 2], line: f64) -> [f64; 2] {
    let half = plan.wall_m / 2.0;
    match rooms {
        [Some(_), None] => [line - half, line - half + OUTER_M],
        [None, Some(_)] => [line + half - OUTER_M, line + half],
        _ => [line - half, line + half],
    }
}

fn build_wall(plan: &Plan, wall: &Wall, finish: Finish, out: &mut Vec<Solid>) {
    let half = plan.wall_m / 2.0;
    let across = faces(plan, wall.rooms, wall.line);
    let mut holes: Vec<&Opening> = plan
        .openings
        .iter()
        .filter(|o| o.along_x == wall.along_x && (o.line() - wall.line).abs() < 1e-6)
        .filter(|o| o.at() > wall.from && o.at() < wall.to)
        .collect();
    holes.sort_by(|a, b| a.at().total_cmp(&b.at()));
    let mut piece = |along: [f64; 2], up: [f64; 2]| {
        out.extend(upright(Class::Wall, wall.along_x, along, across, up, finish));
    };
    // Half a wall beyond the line, so that corners are closed.
    let mut from = wall.from - half;
    for hole in holes {
        let (left, right) = (hole.at() - hole.width_m / 2.0, hole.at() + hole.width_m / 2.0);
        piece([from, left], [0.0, plan.ceiling_m]);
        piece([left, right], [0.0, hole.sill_m]);
        piece([left, right], [hole.head_m, plan.ceiling_m]);
        from = right;
    }
    piece([from, wall.to + half], [0.0, plan.ceiling_m]);
}

/// Adds a door's or window's frame. Panes are omitted: neither LiDAR nor a depth camera sees glass.
fn frame(plan: &Plan, opening: &Opening, out: &mut Vec<Solid>) {
    let class = match opening.kind {
        OpeningKind::Window => Class::Window,
        OpeningKind::Door | OpeningKind::Entrance => Class::Door,
        OpeningKind::Passage | OpeningKind::Wide => return,
    };
    let faces = faces(plan, opening.rooms, opening.line());
    let (thick, across) = if class == Class::Window {
        let middle = (faces[0] + faces[1]) / 2.0;
        (0.06, [middle - 0.035, middle + 0.035])
    } else {
        (0.035, [faces[0] - 0.012, faces[1] + 0.012])
    };
    let finish = Finish::plain(WHITE).glossy(0.2);
    let (left, right) = (opening.at() - opening.width_m / 2.0, opening.at() + opening.width_m / 2.0);
    let (low, high) = (opening.sill_m, opening.head_m);
    let mut bar = |along: [f64; 2], up: [f64; 2]| {
        out.extend(upright(class, opening.along_x, along, across, up, finish));
    };
    bar([left, left + thick], [low, high]);
    bar([right - thick, right], [low, high]);
    bar([left, right], [high - thick, high]);
    if class == Class::Window {
        bar([left, right], [low, low + thick]);
        if opening.width_m > 1.1 {
            bar([opening.at() - 0.04, opening.at() + 0.04], [low, high]);
        }
    }
}

/// Returns the leaf of every door as a piece.
pub(super) fn leaves(plan: &Plan, rng: &mut Rng) -> Vec<Piece> {
    let finish = if rng.chance(0.6) { Finish::plain(WHITE).glossy(0.2) } else { wood(rng) };
    let mut out = vec![];
    for opening in &plan.openings {
        if !matches!(opening.kind, OpeningKind::Door | OpeningKind::Entrance) {
            continue;
        }
        let width = opening.width_m - 0.075;
        let height = opening.head_m - 0.05;
        // The leaf's frame: centre at the origin, hinge at -x.
        let mut leaf = Piece::new(Class::Door, [width, 0.04, height]);
        leaf.movable = opening.kind == OpeningKind::Door;
        leaf.block([0.0, 0.0, 0.008], [width, 0.04, height], finish);
        for side in [-1.0, 1.0] {
            leaf.block(
                [width / 2.0 - 0.09, side * 0.045, 1.03],
                [0.11, 0.02, 0.02],
                Finish::plain(METAL).glossy(0.8),
            );
            leaf.block([width / 2.0 - 0.05, side * 0.025, 0.98], [0.03, 0.012, 0.14], Finish::plain(DARK));
        }
        leaf.room = opening.rooms.iter().flatten().copied().next().unwrap_or(0);
        leaf.home_from_piece = leaf_pose(plan, opening, opening.open_rad);
        out.push(leaf);
    }
    out
}

/// Returns the pose of a door's leaf that is open by `open_rad`.
pub(super) fn leaf_pose(plan: &Plan, opening: &Opening, open_rad: f64) -> Pose2 {
    let faces = faces(plan, opening.rooms, opening.line());
    let face = if opening.swing > 0.0 { faces[1] - 0.02 } else { faces[0] + 0.02 };
    let hinge = opening.at() + opening.hinge * (opening.width_m / 2.0 - 0.0375);
    let reach = (opening.width_m - 0.075) / 2.0;
    // In the wall's coordinates the closed leaf points away from the hinge and opens towards the swing.
    let (along, across) = (-opening.hinge * open_rad.cos(), opening.swing * open_rad.sin());
    let (at, off) = (hinge + reach * along, face + reach * across);
    if opening.along_x {
        Pose2::new(at, off, across.atan2(along))
    } else {
        Pose2::new(off, at, along.atan2(across))
    }
}
