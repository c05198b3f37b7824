//! Pairs records of nearly the same time.

/// Pairs two ascending lists of times one to one, the closest first, with gaps of at most `max_gap_s`.
/// Returns the pairs in the order of time.
pub(super) fn associate(color_s: &[f64], depth_s: &[f64], max_gap_s: f64) -> Vec<(usize, usize)> {
    let mut candidates = Vec::new();
    for (color, &time_s) in color_s.iter().enumerate() {
        let after = depth_s.partition_point(|&t| t < time_s);
        // Only the two neighbours can be nearest; this keeps lists of equal times cheap.
        for depth in [after.checked_sub(1), Some(after)].into_iter().flatten() {
            let gap_s = depth_s.get(depth).map_or(f64::INFINITY, |depth_s| (depth_s - time_s).abs());
            if gap_s <= max_gap_s {
                candidates.push((gap_s, color, depth));
            }
        }
    }
    candidates.sort_by(|a, b| a.0.total_cmp(&b.0).then((a.1, a.2).cmp(&(b.1, b.2))));
    let (mut color_taken, mut depth_taken) = (vec![false; color_s.len()], vec![false; depth_s.len()]);
    let mut pairs = Vec::new();
    for (_, color, depth) in candidates {
        if !color_taken[color] && !depth_taken[depth] {
            color_taken[color] = true;
            depth_taken[depth] = true;
            pairs.push((color, depth));
        }
    }
    pairs.sort_unstable_by_key(|&(color, depth)| (depth, color));
    pairs
}
