//! Solids of the building of a plan: floors, ceilings, walls with openings, frames, doors.

mod attic;
mod frames;
mod leaves;
mod outside;
mod trim;
mod windows;

use super::finish::{Finish, Pattern, paint, wood};
use super::plan::{Opening, Plan, RoomKind, Wall};
use super::rng::Rng;
use super::solid::Solid;
use trim::Trim;
use viola_geometry::taxonomy::Class;

pub(super) use leaves::{leaf_pose, leaves};

/// Returns the building without door leaves.
pub(super) fn solids(plan: &Plan, rng: &mut Rng) -> Vec<Solid> {
    let mut out = vec![];
    let paints: Vec<Finish> = plan.rooms.iter().map(|_| paint(rng)).collect();
    let common = paint(rng);
    let planks = wood(rng).with(Pattern::Planks, 0.13).glossy(0.2);
    let ceiling = Finish::plain([0.93, 0.93, 0.92]);
    let trim = Trim::of_a_home(&mut rng.fork("trim", 0));
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
        out.push(Solid::block(Class::Ceiling, [centre.x, centre.y, plan.ceiling_m], size, ceiling));
    }
    for wall in &plan.walls {
        let finish = match wall.rooms {
            [Some(room), None] | [None, Some(room)] => paints[room],
            _ => common,
        };
        build_wall(plan, wall, finish, &trim, &mut out);
    }
    for opening in &plan.openings {
        frames::frame(plan, opening, &trim, &mut out);
        windows::window(plan, opening, &mut out);
    }
    for slope in &plan.slopes {
        attic::slope(slope, paints[slope.room], &mut out);
    }
    trim::beams(plan, &mut rng.fork("beams", 0), &mut out);
    outside::around(plan, &mut rng.fork("outside", 0), &mut out);
    let painted = |solid: &Solid| match solid.class {
        Class::Wall => Solid { finish: common, ..*solid },
        _ => *solid,
    };
    out.extend(plan.features.iter().flat_map(|feature| feature.solids.iter().map(painted)));
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
        [Some(_), None] => [line - half, line - half + plan.outer_m],
        [None, Some(_)] => [line + half - plan.outer_m, line + half],
        _ => [line - half, line + half],
    }
}

fn build_wall(plan: &Plan, wall: &Wall, finish: Finish, trim: &Trim, out: &mut Vec<Solid>) {
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
        if up[0] == 0.0 && up[1] > trim.skirting_m {
            trim.skirting(wall, along, across, out);
        }
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
