//! Splits a recording into clips.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::ops::Range;

/// Returns half-overlapping runs of `length` out of `total` consecutive frames.
pub fn excerpts(total: usize, length: usize) -> Vec<Range<usize>> {
    if length == 0 || total < length {
        return Vec::new();
    }
    let step = (length / 2).max(1);
    (0..=total - length).step_by(step).map(|first| first..first + length).collect()
}

/// Returns `count` distinct runs of `length` out of `total` consecutive frames, in order; fewer if the
/// recording is short.
pub fn random_excerpts(total: usize, length: usize, count: usize, seed: u64) -> Vec<Range<usize>> {
    if length == 0 || total < length {
        return Vec::new();
    }
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut firsts: Vec<usize> = (0..=total - length).collect();
    // Partial Fisher-Yates shuffle of the first `count`.
    for place in 0..count.min(firsts.len()) {
        let other = rng.random_range(place..firsts.len());
        firsts.swap(place, other);
    }
    firsts.truncate(count);
    firsts.sort_unstable();
    firsts.into_iter().map(|first| first..first + length).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn as_many_as_the_protocol_says() {
        // Reference counts for 300 frames.
        for (length, count) in [(60, 9), (40, 14), (20, 29), (10, 59), (5, 148)] {
            assert_eq!(excerpts(300, length).len(), count, "{length}");
        }
        assert_eq!(excerpts(300, 60)[1], 30..90);
        assert!(excerpts(10, 0).is_empty());
        assert!(excerpts(10, 11).is_empty());
    }

    #[test]
    fn random_ones_differ_and_depend_on_the_seed() {
        let drawn = random_excerpts(300, 60, 20, 7);
        assert_eq!(drawn.len(), 20);
        assert!(drawn.windows(2).all(|w| w[0].start < w[1].start));
        assert!(drawn.iter().all(|r| r.len() == 60 && r.end <= 300));
        assert_eq!(drawn, random_excerpts(300, 60, 20, 7));
        assert_ne!(drawn, random_excerpts(300, 60, 20, 8));
        assert_eq!(random_excerpts(10, 8, 20, 7).len(), 3, "there are only three");
        assert!(random_excerpts(10, 11, 20, 7).is_empty());
    }
}
