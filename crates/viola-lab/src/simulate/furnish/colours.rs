//! Finishes of things.

use crate::simulate::finish::{Finish, METAL, cloth};
use crate::simulate::rng::Rng;

/// Returns a slightly glossy coat of a random colour.
pub fn painted(rng: &mut Rng) -> Finish {
    Finish::plain(cloth(rng).rgb).glossy(0.3)
}

pub fn ceramic() -> Finish {
    Finish::plain([0.94, 0.94, 0.93]).glossy(0.5)
}

pub fn steel() -> Finish {
    Finish::plain(METAL).glossy(0.8)
}
