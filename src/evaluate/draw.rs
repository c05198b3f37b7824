//! Which clips a scene is cut into.

use std::ops::Range;

/// Half-overlapping runs of `length` out of `total` consecutive frames.
pub fn excerpts(total: usize, length: usize) -> Vec<Range<usize>> {
    if length == 0 || total < length {
        return Vec::new();
    }
    let step = (length / 2).max(1);
    (0..=total - length).step_by(step).map(|first| first..first + length).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn as_many_as_the_protocol_says() {
        // Counts of the yardstick on 300 frames.
        for (length, count) in [(60, 9), (40, 14), (20, 29), (10, 59), (5, 148)] {
            assert_eq!(excerpts(300, length).len(), count, "{length}");
        }
        assert_eq!(excerpts(300, 60)[1], 30..90);
        assert!(excerpts(10, 0).is_empty());
        assert!(excerpts(10, 11).is_empty());
    }
}
