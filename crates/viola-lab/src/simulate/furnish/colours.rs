//! Random colours of things.

use crate::simulate::finish::{Finish, cloth};
use crate::simulate::rng::Rng;

/// Returns a slightly glossy coat of a random colour.
pub fn painted(rng: &mut Rng) -> Finish {
    Finish::plain(cloth(rng).rgb).glossy(0.3)
}
