//! People and pets, who are at home on the clips' day.

use super::Arranger;
use crate::simulate::finish::{Finish, cloth};
use crate::simulate::piece::{Mount, Piece};
use crate::simulate::plan::{Plan, RoomKind};
use crate::simulate::rng::Rng;
use viola_geometry::Pose2;
use viola_geometry::taxonomy::Class;

/// Share of the homes where somebody is at home.
const AT_HOME: f64 = 1.0 / 3.0;
/// Height for which the parts of a body are given, in metres.
const TALL_M: f64 = 1.75;

/// Returns the people and pets among the pieces of a day, or nobody.
pub(in crate::simulate) fn at_home(plan: &Plan, pieces: &[Piece], rng: &mut Rng) -> Vec<Piece> {
    let mut out: Vec<Piece> = vec![];
    if !rng.chance(AT_HOME) {
        return out;
    }
    let mut seats: Vec<&Piece> = pieces.iter().filter(|piece| piece.rest.is_some()).collect();
    rng.shuffle(&mut seats);
    for _ in 0..rng.count(1, 3) {
        let seat = if rng.chance(0.6) { seats.pop() } else { None };
        match seat {
            Some(seat) => out.extend(resting(seat, rng)),
            None => {
                let person = standing(rng);
                out.extend(on_the_floor(plan, pieces, person, rng));
            }
        }
    }
    for _ in 0..rng.pick([0, 0, 1, 1, 2]) {
        let pet = if rng.chance(0.5) { cat(rng) } else { dog(rng) };
        out.extend(on_the_floor(plan, pieces, pet, rng));
    }
    out
}

/// Returns a person on a seat or a bed.
fn resting(seat: &Piece, rng: &mut Rng) -> Option<Piece> {
    let [x, y, level] = seat.rest?;
    let person = if seat.class == Class::Bed { lying(level, rng) } else { sitting(level, rng) };
    let home_from_piece = seat.home_from_piece.compose(&Pose2::new(x, y, rng.between(-0.1, 0.1)));
    Some(Piece { room: seat.room, home_from_piece, ..person.mounted(Mount::Hung) })
}

/// Places a piece on free floor of a random room, where people can still pass.
fn on_the_floor(plan: &Plan, pieces: &[Piece], piece: Piece, rng: &mut Rng) -> Option<Piece> {
    let room = rng.count(0, plan.rooms.len() - 1);
    if plan.rooms[room].kind == RoomKind::Storage {
        return None;
    }
    let here = pieces.iter().filter(|piece| piece.room == room).cloned();
    let mut arranger = Arranger::new(plan, room, rng.fork("stand", room as u64)).with_pieces(here);
    let index = arranger.free(piece, 0.12)?;
    Some(arranger.piece(index).clone())
}

fn skin(rng: &mut Rng) -> Finish {
    Finish::plain(rng.pick([[0.87, 0.68, 0.56], [0.72, 0.52, 0.40], [0.45, 0.31, 0.23], [0.93, 0.76, 0.66]]))
}

/// Colours of one person.
struct Look {
    skin: Finish,
    hair: Finish,
    shirt: Finish,
    trousers: Finish,
    /// Size against an adult of [`TALL_M`].
    scale: f64,
}

impl Look {
    fn draw(rng: &mut Rng) -> Look {
        let tall = if rng.chance(0.2) { rng.between(0.95, 1.4) } else { rng.between(1.55, 1.92) };
        Look {
            skin: skin(rng),
            hair: Finish::plain(rng.pick([
                [0.1, 0.08, 0.07],
                [0.35, 0.22, 0.12],
                [0.7, 0.55, 0.3],
                [0.6; 3],
            ])),
            shirt: cloth(rng),
            trousers: cloth(rng).darker(0.6),
            scale: tall / TALL_M,
        }
    }

    /// Adds trunk, neck and head above hips at a height, bent forwards by `lean` metres at the shoulders.
    fn upper_body(&self, body: &mut Piece, hips: f64, lean: f64) {
        let s = self.scale;
        body.cushion([0.0, 0.0, hips - 0.1 * s], [0.36 * s, 0.24 * s, 0.26 * s], self.trousers);
        let trunk = body.cushion([0.0, -lean / 2.0, hips], [0.42 * s, 0.25 * s, 0.56 * s], self.shirt);
        trunk.tilt_rad = lean / (0.55 * s);
        let neck = hips + 0.54 * s;
        body.bar([0.0, -lean, neck - 0.06 * s], [0.0, -lean - 0.02, neck + 0.08 * s], 0.055 * s, self.skin);
        let head = [0.0, -lean - 0.03, neck + 0.04 * s];
        body.ball(head, [0.16 * s, 0.20 * s, 0.24 * s], self.skin);
        let hair = [0.0, -lean - 0.005, neck + 0.11 * s];
        body.ball(hair, [0.175 * s, 0.2 * s, 0.185 * s], self.hair);
    }

    /// Adds one arm from a shoulder by an elbow to a hand, all in metres of an adult.
    fn arm(&self, body: &mut Piece, points: [[f64; 3]; 3]) {
        let [shoulder, elbow, hand] = points;
        body.bar(shoulder, elbow, 0.05 * self.scale, self.shirt);
        body.bar(elbow, hand, 0.038 * self.scale, self.skin);
        let size = 0.09 * self.scale;
        body.ball([hand[0], hand[1], hand[2] - size / 2.0], [size, size, size], self.skin);
    }
}

fn person(size: [f64; 3]) -> Piece {
    Piece::new(Class::Person, size).movable()
}

fn standing(rng: &mut Rng) -> Piece {
    let look = Look::draw(rng);
    let s = look.scale;
    let mut body = person([0.6 * s, 0.45 * s, TALL_M * s]);
    let hips = 0.9 * s;
    let stride = rng.between(-0.12, 0.12) * s;
    for side in [-1.0, 1.0] {
        let (x, y) = (side * 0.1 * s, side * stride);
        body.bar([x * 0.9, 0.0, hips], [x, y / 2.0 - 0.02, 0.48 * s], 0.085 * s, look.trousers);
        body.bar([x, y / 2.0 - 0.02, 0.5 * s], [x, y, 0.06 * s], 0.062 * s, look.trousers);
        body.cushion([x, y - 0.06 * s, 0.0], [0.1 * s, 0.27 * s, 0.09 * s], look.hair.darker(0.6));
        // One arm in three is raised to hold something.
        let shoulder = [side * 0.22 * s, 0.0, hips + 0.48 * s];
        let elbow = [side * 0.27 * s, 0.02, hips + 0.2 * s];
        let up = rng.chance(0.33);
        let hand = if up {
            [side * 0.15 * s, -0.2 * s, hips + 0.3 * s]
        } else {
            [side * 0.27 * s, -0.04, hips - 0.05 * s]
        };
        look.arm(&mut body, [shoulder, elbow, hand]);
    }
    look.upper_body(&mut body, hips, 0.02);
    body
}

/// Returns a person whose hips rest on a seat at a height.
fn sitting(level: f64, rng: &mut Rng) -> Piece {
    let look = Look::draw(rng);
    let s = look.scale;
    let hips = level + 0.1 * s;
    let mut body = person([0.6 * s, 1.0 * s, hips + 0.85 * s]);
    let knee = -0.42 * s;
    for side in [-1.0, 1.0] {
        let x = side * rng.between(0.09, 0.16) * s;
        body.bar([side * 0.09 * s, 0.0, hips], [x, knee, level + 0.08 * s], 0.08 * s, look.trousers);
        let foot = [x, knee - rng.between(-0.08, 0.12) * s, (level - 0.42 * s).max(0.05)];
        body.bar([x, knee, level + 0.06 * s], foot, 0.06 * s, look.trousers);
        let sole = [x, foot[1] - 0.06 * s, (foot[2] - 0.05).max(0.0)];
        body.cushion(sole, [0.1 * s, 0.26 * s, 0.09 * s], look.hair.darker(0.6));
        let shoulder = [side * 0.22 * s, 0.03, hips + 0.48 * s];
        let elbow = [side * 0.28 * s, -0.08 * s, hips + 0.2 * s];
        look.arm(&mut body, [shoulder, elbow, [side * 0.14 * s, -0.28 * s, hips + 0.14 * s]]);
    }
    look.upper_body(&mut body, hips, -0.05);
    body
}

/// Returns a person on the back, head towards +y, on a bed of a height.
fn lying(level: f64, rng: &mut Rng) -> Piece {
    let look = Look::draw(rng);
    let s = look.scale;
    let mut body = person([0.6 * s, TALL_M * s, level + 0.25]);
    let under = level + 0.02;
    body.cushion([0.0, 0.22 * s, under], [0.44 * s, 0.58 * s, 0.22 * s], look.shirt);
    body.cushion([0.0, -0.1 * s, under], [0.36 * s, 0.26 * s, 0.22 * s], look.trousers);
    body.ball([0.0, 0.66 * s, under + 0.02], [0.16 * s, 0.24 * s, 0.2 * s], look.skin);
    body.ball([0.0, 0.71 * s, under], [0.18 * s, 0.2 * s, 0.19 * s], look.hair);
    for side in [-1.0, 1.0] {
        let x = side * 0.1 * s;
        let z = under + 0.09 * s;
        body.bar([x, -0.15 * s, z], [x + side * 0.04, -0.52 * s, z + 0.02], 0.08 * s, look.trousers);
        body.bar([x + side * 0.04, -0.52 * s, z], [x, -0.92 * s, z - 0.03], 0.06 * s, look.trousers);
        let shoulder = [side * 0.23 * s, 0.42 * s, z];
        look.arm(&mut body, [shoulder, [side * 0.3 * s, 0.15 * s, z], [side * 0.25 * s, -0.1 * s, z]]);
    }
    body
}

fn fur(rng: &mut Rng) -> Finish {
    Finish::plain(rng.pick([[0.15, 0.13, 0.12], [0.55, 0.4, 0.25], [0.85, 0.8, 0.72], [0.45, 0.44, 0.43]]))
}

/// Returns a dog that stands or lies, its head towards -y.
fn dog(rng: &mut Rng) -> Piece {
    let s = rng.between(0.5, 1.2);
    let fur = fur(rng);
    let mut dog = Piece::new(Class::Animal, [0.3 * s, 1.0 * s, 0.75 * s]).movable();
    let leg = if rng.chance(0.5) { 0.34 * s } else { 0.03 };
    dog.cushion([0.0, 0.05 * s, leg], [0.27 * s, 0.62 * s, 0.27 * s], fur);
    dog.bar([0.0, -0.2 * s, leg + 0.2 * s], [0.0, -0.33 * s, leg + 0.36 * s], 0.08 * s, fur);
    dog.ball([0.0, -0.38 * s, leg + 0.27 * s], [0.17 * s, 0.22 * s, 0.18 * s], fur);
    dog.ball([0.0, -0.5 * s + 0.02, leg + 0.28 * s], [0.09 * s, 0.14 * s, 0.09 * s], fur.darker(0.8));
    dog.bar([0.0, 0.33 * s, leg + 0.2 * s], [0.0, 0.48 * s, leg + 0.3 * s], 0.02 * s, fur);
    for (x, y) in [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)] {
        let at = [x * 0.08 * s, 0.05 * s + y * 0.24 * s, 0.0];
        if leg > 0.1 {
            dog.bar(at, [at[0], at[1], leg + 0.1 * s], 0.035 * s, fur);
        } else {
            dog.ball([at[0] * 1.5, at[1] - 0.08 * s, 0.0], [0.09 * s, 0.24 * s, 0.08 * s], fur);
        }
        if y < 0.0 {
            dog.ball(
                [x * 0.07 * s, -0.33 * s, leg + 0.36 * s],
                [0.04 * s, 0.07 * s, 0.12 * s],
                fur.darker(0.7),
            );
        }
    }
    dog
}

/// Returns a cat that sits or lies curled up.
fn cat(rng: &mut Rng) -> Piece {
    let fur = fur(rng);
    let mut cat = Piece::new(Class::Animal, [0.34, 0.46, 0.42]).movable();
    let head = if rng.chance(0.5) {
        cat.ball([0.0, 0.04, 0.0], [0.2, 0.26, 0.22], fur);
        cat.ball([0.0, -0.05, 0.02], [0.15, 0.15, 0.28], fur);
        cat.bar([0.05, 0.14, 0.03], [0.14, 0.02, 0.03], 0.02, fur);
        [0.0, -0.1, 0.27]
    } else {
        cat.ball([0.0, 0.03, 0.0], [0.32, 0.36, 0.17], fur);
        cat.bar([0.12, 0.1, 0.04], [0.13, -0.12, 0.03], 0.025, fur);
        [0.06, -0.13, 0.05]
    };
    cat.ball(head, [0.11, 0.12, 0.1], fur);
    for x in [-0.032, 0.032] {
        cat.ball([head[0] + x, head[1], head[2] + 0.07], [0.03, 0.02, 0.06], fur.darker(0.8));
    }
    cat
}
