//! Placement of pieces: at a wall, beside another piece, or free, without blocking passages.

use super::passage::Passage;
use crate::simulate::piece::{Footprint, Mount, Piece};
use crate::simulate::plan::{Opening, OpeningKind, Plan, Rect, Room};
use crate::simulate::rng::Rng;
use std::f64::consts::{FRAC_PI_2, PI};
use viola_geometry::{Point2, Pose2, angle_between};

const TRIES: usize = 30;

/// State of one room while it is furnished.
pub(in crate::simulate) struct Arranger<'a> {
    pub plan: &'a Plan,
    pub room: usize,
    pub rng: Rng,
    /// From 0, tidy, to 1.
    pub mess: f64,
    pieces: Vec<Piece>,
    /// Occupied floor.
    taken: Vec<Footprint>,
    /// Floor at doors and passages; stays free.
    doorways: Vec<Footprint>,
    /// Floor before cupboards and seats; free except for pieces that belong to them.
    fronts: Vec<Footprint>,
    passage: Passage,
}

impl<'a> Arranger<'a> {
    pub fn new(plan: &'a Plan, room: usize, rng: Rng) -> Arranger<'a> {
        let inner = plan.rooms[room].inner;
        let mut arranger = Arranger {
            plan,
            room,
            rng,
            mess: 0.0,
            pieces: vec![],
            taken: vec![],
            doorways: vec![],
            fronts: vec![],
            passage: Passage::new(inner),
        };
        for opening in arranger.openings().filter(|opening| opening.kind != OpeningKind::Window) {
            let reach =
                if opening.kind == OpeningKind::Entrance { 1.0 } else { opening.width_m.min(0.95) + 0.05 };
            arranger.doorways.push(opening.zone(reach));
            if opening.is_way() {
                arranger.passage.lead_to(&opening.centre);
            }
        }
        for feature in plan.features.iter().filter(|feature| feature.room == room) {
            arranger.block(&feature.footprint);
        }
        arranger
    }

    pub fn room(&self) -> &'a Room {
        &self.plan.rooms[self.room]
    }

    /// Returns the openings in this room's walls.
    pub fn openings(&self) -> impl Iterator<Item = &'a Opening> + use<'a> {
        let room = self.room;
        self.plan.openings.iter().filter(move |opening| opening.rooms.contains(&Some(room)))
    }

    pub fn finish(self) -> Vec<Piece> {
        self.pieces
    }

    pub fn piece(&self, index: usize) -> &Piece {
        &self.pieces[index]
    }

    /// Sets how messy the room is, from 0 to 1.
    pub fn in_mess(self, mess: f64) -> Arranger<'a> {
        Arranger { mess, ..self }
    }

    pub fn pieces_mut(&mut self) -> &mut [Piece] {
        &mut self.pieces
    }

    /// Adds the room's existing pieces, for changes on another day.
    pub fn with_pieces(mut self, pieces: impl IntoIterator<Item = Piece>) -> Arranger<'a> {
        for piece in pieces {
            if piece.mount == Mount::Floor {
                self.block(&piece.footprint());
            }
            self.pieces.push(piece);
        }
        self
    }

    /// Places a piece with its back at any wall, with `front_m` of free floor before it.
    pub fn against_wall(&mut self, piece: Piece, front_m: f64) -> Option<usize> {
        self.against(piece, front_m, |_| true, None)
    }

    /// Places a piece at a wall, in a corner of the room.
    pub fn in_corner(&mut self, piece: Piece, front_m: f64) -> Option<usize> {
        let offset = if self.rng.chance(0.5) { 0.0 } else { 1.0 };
        self.against(piece, front_m, |_| true, Some(offset))
    }

    /// Places a piece at the wall that another piece faces, opposite to it.
    pub fn opposite(&mut self, piece: Piece, other: usize, front_m: f64) -> Option<usize> {
        let pose = self.pieces[other].home_from_piece;
        let facing = pose.yaw_rad + PI;
        let inner = self.room().inner;
        let axis = if pose.yaw_rad.sin().abs() > 0.5 { 1 } else { 0 };
        let at = [pose.x_m, pose.y_m][axis];
        let fraction =
            (at - inner.min[axis] - piece.size[0] / 2.0) / (inner.size(axis) - piece.size[0]).max(0.01);
        let fraction = fraction.clamp(0.0, 1.0);
        self.against(piece, front_m, move |yaw| angle_between(yaw, facing) < 0.1, Some(fraction))
    }

    fn against(
        &mut self,
        mut piece: Piece,
        front_m: f64,
        allowed: impl Fn(f64) -> bool,
        fraction: Option<f64>,
    ) -> Option<usize> {
        let inner = self.room().inner;
        let [width, depth, _] = piece.size;
        for _ in 0..TRIES {
            // The yaw points the piece's back (+y) to that wall.
            let (yaw, axis, wall) = self.rng.pick([
                (0.0, 0, inner.max[1]),
                (PI, 0, inner.min[1]),
                (-FRAC_PI_2, 1, inner.max[0]),
                (FRAC_PI_2, 1, inner.min[0]),
            ]);
            let slack = inner.size(axis) - width;
            if slack < 0.0 || !allowed(yaw) {
                continue;
            }
            let gap = self.rng.between(0.002, 0.02);
            let offset = match fraction {
                Some(fraction) => fraction * (slack - 0.02).max(0.0) + 0.01,
                None => self.rng.between(0.0, slack),
            };
            let along = inner.min[axis] + width / 2.0 + offset.min(slack);
            let sign = if wall == inner.max[1 - axis] { 1.0 } else { -1.0 };
            // Things that are moved now and then do not stand quite parallel to the wall.
            let turn =
                if piece.movable { self.rng.between(-1.0, 1.0) * (0.015 + 0.08 * self.mess) } else { 0.0 };
            let reach = depth / 2.0 * turn.cos() + width / 2.0 * turn.sin().abs();
            let across = wall - sign * (reach + gap);
            let (x, y) = if axis == 0 { (along, across) } else { (across, along) };
            let pose = Pose2::new(x, y, yaw + turn);
            if self.hides_window(&piece, &pose) {
                continue;
            }
            let front = self.front(&piece, &pose, front_m);
            if front.is_none_or(|front| self.front_is_free(&front)) && self.fits(&piece, &pose) {
                piece.home_from_piece = pose;
                return Some(self.put(piece, front));
            }
        }
        None
    }

    /// Places a piece anywhere with clearance around it.
    pub fn free(&mut self, mut piece: Piece, around_m: f64) -> Option<usize> {
        let inner = self.room().inner;
        let square = self.rng.chance(0.7);
        for _ in 0..2 * TRIES {
            let yaw = if square {
                FRAC_PI_2 * self.rng.count(0, 3) as f64 + self.rng.between(-0.05, 0.05)
            } else {
                self.rng.between(-PI, PI)
            };
            let x = self.rng.between(inner.min[0], inner.max[0]);
            let y = self.rng.between(inner.min[1], inner.max[1]);
            let pose = Pose2::new(x, y, yaw);
            let around = piece.footprint_at(&pose).grown(around_m);
            if self.stands_free(&around, None) && self.fits(&piece, &pose) {
                piece.home_from_piece = pose;
                return Some(self.put(piece, None));
            }
        }
        None
    }

    /// Places a piece at a pose in the frame of another piece.
    pub fn beside(&mut self, piece: Piece, other: usize, other_from_piece: Pose2) -> Option<usize> {
        let pose = self.pieces[other].home_from_piece.compose(&other_from_piece);
        self.at(piece, pose)
    }

    /// Places a piece at a pose, if it fits.
    pub fn at(&mut self, piece: Piece, pose: Pose2) -> Option<usize> {
        self.at_if(piece, pose, Self::fits)
    }

    /// Places a piece on the free floor before the piece to which it belongs.
    pub fn at_in_front(&mut self, piece: Piece, pose: Pose2) -> Option<usize> {
        self.at_if(piece, pose, |this, piece, pose| {
            let spot = piece.footprint_at(pose);
            this.stands_free(&spot, None) && this.passage.stays_open_with(&spot)
        })
    }

    /// Places a piece partly under a table: the two may share floor.
    pub fn at_table(&mut self, piece: Piece, pose: Pose2, table: usize) -> Option<usize> {
        let under = self.pieces[table].footprint();
        self.at_if(piece, pose, |this, piece, pose| {
            let spot = piece.footprint_at(pose);
            this.stands_free(&spot, Some(&under)) && this.passage.stays_open_with(&spot)
        })
    }

    fn at_if(
        &mut self,
        mut piece: Piece,
        pose: Pose2,
        fits: impl Fn(&Self, &Piece, &Pose2) -> bool,
    ) -> Option<usize> {
        if !fits(self, &piece, &pose) {
            return None;
        }
        piece.home_from_piece = pose;
        Some(self.put(piece, None))
    }

    /// Hangs a piece on a wall, above pieces lower than `bottom_m`.
    pub fn hang(&mut self, mut piece: Piece, bottom_m: f64) -> Option<usize> {
        let inner = self.room().inner;
        let [width, depth, _] = piece.size;
        for _ in 0..TRIES {
            let (yaw, axis, wall, sign) = self.rng.pick([
                (0.0, 0, inner.max[1], 1.0),
                (PI, 0, inner.min[1], -1.0),
                (-FRAC_PI_2, 1, inner.max[0], 1.0),
                (FRAC_PI_2, 1, inner.min[0], -1.0),
            ]);
            let slack = inner.size(axis) - width - 0.2;
            if slack < 0.0 {
                continue;
            }
            let along = inner.min[axis] + 0.1 + width / 2.0 + self.rng.between(0.0, slack);
            let across = wall - sign * (depth / 2.0 + 0.002);
            let (x, y) = if axis == 0 { (along, across) } else { (across, along) };
            let pose = Pose2::new(x, y, yaw);
            let spot = piece.footprint_at(&pose);
            let near_opening = self.openings().any(|opening| opening.zone(0.4).grown(0.05).overlaps(&spot));
            let behind = self.pieces.iter().any(|p| {
                p.mount != Mount::Flat
                    && p.size[2] > bottom_m - 0.05
                    && p.footprint().grown(0.05).overlaps(&spot)
            });
            let feature =
                self.plan.features.iter().any(|f| f.room == self.room && f.footprint.overlaps(&spot));
            let under_slope = self.plan.headroom_m(self.room, &spot) < piece.size[2];
            if !near_opening && !behind && !feature && !under_slope {
                piece.home_from_piece = pose;
                return Some(self.put(piece, None));
            }
        }
        None
    }

    /// Adds a piece without checking the space, for flat pieces and ceiling lamps.
    pub fn put_anyway(&mut self, mut piece: Piece, pose: Pose2) -> usize {
        piece.home_from_piece = pose;
        self.put(piece, None)
    }

    /// Returns the room's inside shrunk by `by_m`.
    pub fn inside(&self, by_m: f64) -> Rect {
        self.room().inner.shrunk(by_m)
    }

    fn front(&self, piece: &Piece, pose: &Pose2, front_m: f64) -> Option<Footprint> {
        if front_m <= 0.0 {
            return None;
        }
        let centre = pose.apply(&Point2::new(0.0, -(piece.size[1] + front_m) / 2.0));
        Some(Footprint {
            centre,
            half: [piece.size[0] / 2.0 - 0.01, front_m / 2.0 - 0.01],
            yaw_rad: pose.yaw_rad,
        })
    }

    fn hides_window(&self, piece: &Piece, pose: &Pose2) -> bool {
        let spot = piece.footprint_at(pose);
        self.openings()
            .filter(|opening| opening.kind == OpeningKind::Window && piece.size[2] > opening.sill_m + 0.15)
            .any(|opening| opening.zone(0.7).overlaps(&spot))
    }

    fn fits(&self, piece: &Piece, pose: &Pose2) -> bool {
        let spot = piece.footprint_at(pose);
        self.stands_free(&spot, None)
            && self.fronts.iter().all(|front| !front.overlaps(&spot))
            && self.plan.headroom_m(self.room, &spot) >= piece.size[2]
            && self.passage.stays_open_with(&spot)
    }

    /// Returns whether the floor is free of furniture and doorways; `but` may be shared.
    fn stands_free(&self, spot: &Footprint, but: Option<&Footprint>) -> bool {
        spot.is_within(&self.room().inner)
            && self.taken.iter().all(|other| Some(other) == but || !other.overlaps(spot))
            && self.doorways.iter().all(|zone| !zone.overlaps(spot))
    }

    fn front_is_free(&self, front: &Footprint) -> bool {
        front.is_within(&self.room().inner) && self.taken.iter().all(|other| !other.overlaps(front))
    }

    fn put(&mut self, mut piece: Piece, front: Option<Footprint>) -> usize {
        piece.room = self.room;
        if piece.mount == Mount::Floor {
            let footprint = piece.footprint();
            self.block(&footprint);
        }
        self.fronts.extend(front);
        self.pieces.push(piece);
        self.pieces.len() - 1
    }

    fn block(&mut self, footprint: &Footprint) {
        self.passage.block(footprint);
        self.taken.push(*footprint);
    }
}
