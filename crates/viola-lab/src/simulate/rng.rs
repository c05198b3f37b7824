//! Seeded random numbers, and a hash for noise that does not depend on the order of pixels.

use rand::seq::{IndexedRandom, SliceRandom};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// A stream of random choices. Parts of a home have independent streams, so a change in one part does
/// not affect the others.
#[derive(Clone)]
pub(super) struct Rng {
    seed: u64,
    rng: ChaCha8Rng,
}

impl Rng {
    pub fn new(seed: u64) -> Rng {
        Rng { seed, rng: ChaCha8Rng::seed_from_u64(seed) }
    }

    /// Returns an independent stream that does not depend on the draws from this one.
    pub fn fork(&self, name: &str, index: u64) -> Rng {
        let mut seed = hash(self.seed ^ 0x9e37_79b9_7f4a_7c15);
        for byte in name.bytes() {
            seed = hash(seed ^ u64::from(byte));
        }
        Rng::new(hash(seed ^ index))
    }

    pub fn seed(&self) -> u64 {
        self.seed
    }

    /// Returns a uniform number in `low..high`; `low` if the range is empty.
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        if high > low { self.rng.random_range(low..high) } else { low }
    }

    /// Returns a uniform number in a range.
    pub fn within(&mut self, [low, high]: [f64; 2]) -> f64 {
        self.between(low, high)
    }

    /// Returns a uniform integer in `low..=high`.
    pub fn count(&mut self, low: usize, high: usize) -> usize {
        if high > low { self.rng.random_range(low..=high) } else { low }
    }

    pub fn chance(&mut self, probability: f64) -> bool {
        self.rng.random::<f64>() < probability
    }

    /// Returns -1 or 1.
    pub fn sign(&mut self) -> f64 {
        if self.chance(0.5) { 1.0 } else { -1.0 }
    }

    /// Returns a random item; none if there are no items.
    pub fn any<'a, T>(&mut self, items: &'a [T]) -> Option<&'a T> {
        items.choose(&mut self.rng)
    }

    /// Returns a random item of a non-empty array.
    pub fn pick<T: Copy, const N: usize>(&mut self, items: [T; N]) -> T {
        items[self.count(0, N - 1)]
    }

    pub fn shuffle<T>(&mut self, items: &mut [T]) {
        items.shuffle(&mut self.rng);
    }

    pub fn gaussian(&mut self) -> f64 {
        gaussian(&mut self.rng)
    }
}

/// Returns a standard normal number (Box and Muller, 1958).
pub(crate) fn gaussian(rng: &mut ChaCha8Rng) -> f64 {
    let u: f64 = 1.0 - rng.random::<f64>();
    let v: f64 = rng.random();
    (-2.0 * u.ln()).sqrt() * (std::f64::consts::TAU * v).cos()
}

/// Mixes all bits (SplitMix64 finaliser, Steele et al. 2014).
pub(super) fn hash(value: u64) -> u64 {
    let mut z = value.wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// Returns a uniform number in 0..1 from a hash.
pub(super) fn unit(hashed: u64) -> f32 {
    (hashed >> 40) as f32 / (1u64 << 24) as f32
}

/// Returns an approximately standard normal number, the sum of four 16-bit uniforms. Its tails end at 3.46,
/// enough for a sensor model.
pub(super) fn bell(hashed: u64) -> f32 {
    let sum = (hashed & 0xffff) + ((hashed >> 16) & 0xffff) + ((hashed >> 32) & 0xffff) + (hashed >> 48);
    (sum as f32 / 65536.0 - 2.0) * 1.732_050_8
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bell_has_the_moments_of_a_normal() {
        let n = 200_000u64;
        let values: Vec<f64> = (0..n).map(|i| f64::from(bell(hash(i)))).collect();
        let mean = values.iter().sum::<f64>() / n as f64;
        let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n as f64;
        assert!(mean.abs() < 0.01, "{mean}");
        assert!((variance - 1.0).abs() < 0.02, "{variance}");
    }

    #[test]
    fn forks_do_not_depend_on_what_was_drawn() {
        let mut a = Rng::new(7);
        let first = a.fork("plan", 0).between(0.0, 1.0);
        a.between(0.0, 1.0);
        assert_eq!(first, a.fork("plan", 0).between(0.0, 1.0));
        assert_ne!(first, a.fork("plan", 1).between(0.0, 1.0));
        assert_ne!(first, a.fork("walk", 0).between(0.0, 1.0));
    }
}
