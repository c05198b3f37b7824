//! Pairs of things that are the same.

use rustc_hash::FxHashSet;

/// Keeps of pairs (score, first, second) those of the greatest scores, so that nothing is in two of them; the best first.
/// Of equal scores the smaller numbers come first.
pub(crate) fn greedy(mut pairs: Vec<(f64, usize, usize)>) -> Vec<(f64, usize, usize)> {
    pairs.sort_by(|a, b| b.0.total_cmp(&a.0).then((a.1, a.2).cmp(&(b.1, b.2))));
    let (mut firsts, mut seconds) = (FxHashSet::default(), FxHashSet::default());
    pairs.retain(|(_, first, second)| {
        let is_free = !firsts.contains(first) && !seconds.contains(second);
        if is_free {
            firsts.insert(*first);
            seconds.insert(*second);
        }
        is_free
    });
    pairs
}
