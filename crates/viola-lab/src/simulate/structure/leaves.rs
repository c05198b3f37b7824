//! Leaves of doors: plain, panelled or of glass, hinged or sliding.

use super::faces;
use crate::simulate::finish::{DARK, Finish, METAL, WHITE, wood};
use crate::simulate::piece::Piece;
use crate::simulate::plan::{Leaf, Opening, OpeningKind, Plan, RoomKind};
use crate::simulate::rng::Rng;
use std::f64::consts::FRAC_PI_2;
use viola_geometry::Pose2;
use viola_geometry::taxonomy::Class;

/// Thickness of a leaf.
const THICK_M: f64 = 0.04;

/// Make of a leaf.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Make {
    Plain,
    /// With recessed panels.
    Panelled,
    /// A wooden border around a pane.
    Glazed,
    /// A pane without a border.
    AllGlass,
}

/// Returns the leaf of every door as a piece.
pub(in crate::simulate) fn leaves(plan: &Plan, rng: &mut Rng) -> Vec<Piece> {
    let finish = if rng.chance(0.6) { Finish::plain(WHITE).glossy(0.2) } else { wood(rng) };
    let mut out = vec![];
    for opening in &plan.openings {
        if !matches!(opening.kind, OpeningKind::Door | OpeningKind::Entrance) {
            continue;
        }
        let mut leaf = leaf(opening, make(plan, opening), finish);
        leaf.room = opening.rooms.iter().flatten().copied().next().unwrap_or(0);
        leaf.home_from_piece = leaf_pose(plan, opening, opening.open_rad);
        out.push(leaf);
    }
    out
}

fn make(plan: &Plan, opening: &Opening) -> Make {
    let mut rng = Rng::new(opening.detail);
    let day = |room: usize| {
        matches!(plan.rooms[room].kind, RoomKind::Living | RoomKind::Kitchen | RoomKind::Dining)
    };
    let glass = if opening.rooms.iter().flatten().any(|&room| day(room)) { 0.35 } else { 0.03 };
    match (opening.kind, rng.between(0.0, 1.0)) {
        (OpeningKind::Entrance, _) => Make::Plain,
        (_, draw) if draw < 0.7 * glass => Make::Glazed,
        (_, draw) if draw < glass => Make::AllGlass,
        (_, draw) if draw > 0.75 => Make::Panelled,
        _ => Make::Plain,
    }
}

/// Returns a leaf in its own frame: centre at the origin, hinge at -x.
fn leaf(opening: &Opening, make: Make, finish: Finish) -> Piece {
    let width = opening.width_m - 0.075;
    let height = opening.head_m - 0.05;
    let mut leaf = Piece::new(Class::Door, [width, THICK_M, height]);
    leaf.movable = opening.kind == OpeningKind::Door;
    let bottom = [0.0, 0.0, 0.008];
    match make {
        Make::Plain => {
            leaf.block(bottom, [width, THICK_M, height], finish);
        }
        Make::AllGlass => {
            leaf.block(bottom, [width, 0.01, height], Finish::glass());
        }
        Make::Panelled | Make::Glazed => {
            let border = 0.12;
            let (open, tall) = (width - 2.0 * border, height - 3.0 * border);
            for side in [-1.0, 1.0] {
                let x = side * (width - border) / 2.0;
                leaf.block([x, 0.0, 0.008], [border, THICK_M, height], finish);
            }
            leaf.block(bottom, [open, THICK_M, 2.0 * border], finish);
            leaf.block([0.0, 0.0, height + 0.008 - border], [open, THICK_M, border], finish);
            let (thick, filling) =
                if make == Make::Glazed { (0.008, Finish::glass()) } else { (0.022, finish) };
            leaf.block([0.0, 0.0, 0.008 + 2.0 * border], [open, thick, tall], filling);
            if make == Make::Panelled {
                leaf.block([0.0, 0.0, 0.95], [open, THICK_M, border], finish);
            }
        }
    }
    // A sliding leaf goes into its wall, so it has only a shell.
    let knob = if opening.leaf == Leaf::Hinged { 1.0 } else { 0.2 };
    for side in [-1.0, 1.0] {
        leaf.block(
            [width / 2.0 - 0.09, side * (0.02 + 0.025 * knob), 1.03],
            [0.11, 0.02 * knob, 0.02],
            Finish::plain(METAL).glossy(0.8),
        );
        leaf.block([width / 2.0 - 0.05, side * 0.025, 0.98], [0.03, 0.012, 0.14], Finish::plain(DARK));
    }
    leaf
}

/// Returns the pose of a door's leaf that is open by `open_rad`.
pub(in crate::simulate) fn leaf_pose(plan: &Plan, opening: &Opening, open_rad: f64) -> Pose2 {
    let faces = faces(plan, opening.rooms, opening.line());
    let reach = (opening.width_m - 0.075) / 2.0;
    let (at, off, along, across) = match opening.leaf {
        Leaf::Hinged => {
            let face = if opening.swing > 0.0 { faces[1] - 0.02 } else { faces[0] + 0.02 };
            let hinge = opening.at() + opening.hinge * (opening.width_m / 2.0 - 0.0375);
            // In the wall's coordinates the closed leaf points away from the hinge and opens towards the
            // swing.
            let (along, across) = (-opening.hinge * open_rad.cos(), opening.swing * open_rad.sin());
            (hinge + reach * along, face + reach * across, along, across)
        }
        Leaf::Sliding => {
            let slid = (open_rad / FRAC_PI_2).clamp(0.0, 1.0) * (opening.width_m - 0.06);
            (opening.at() + opening.hinge * slid, (faces[0] + faces[1]) / 2.0, -opening.hinge, 0.0)
        }
    };
    if opening.along_x {
        Pose2::new(at, off, across.atan2(along))
    } else {
        Pose2::new(off, at, along.atan2(across))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::{Home, HomeParams, Set};

    #[test]
    fn sliding_leaves_close_their_opening_and_vanish_in_the_wall() {
        let mut sliding = 0;
        for seed in 0..12 {
            let plan = Home::generate(&HomeParams::new(Set::Normal, seed)).plan;
            for opening in plan.openings.iter().filter(|o| o.leaf == Leaf::Sliding) {
                sliding += 1;
                let along = |pose: Pose2| if opening.along_x { pose.x_m } else { pose.y_m } - opening.at();
                assert!(along(leaf_pose(&plan, opening, 0.0)).abs() < 1e-9);
                let open = along(leaf_pose(&plan, opening, FRAC_PI_2)) * opening.hinge;
                assert!((open - opening.width_m).abs() < 0.07, "{seed}: {open} m");
            }
        }
        assert!(sliding >= 5, "{sliding} sliding doors");
    }
}
