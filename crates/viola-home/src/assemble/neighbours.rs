//! The clips that a clip is registered to: few of those before it, which show the most of its surface.
//!
//! A clip chooses among the clips before it in the map's order only. So a clip that comes last changes no other pair,
//! and its merge costs the same in a home of many clips as in one of few.

use super::footprint::PlacedFootprint;

/// Maximum clips that a clip is registered to.
pub(super) const MAX_NEIGHBOURS: usize = 8;
/// Minimum gain of a further clip, in patches: a surface that a chosen clip has counts half, that of two a quarter.
const MIN_GAIN: f64 = 4.0;

/// Returns the indices of the chosen clips, ascending. `before`: clips before `clip` that it may overlap, by their
/// indices.
pub(super) fn neighbours(clip: &PlacedFootprint, before: &[(usize, &PlacedFootprint)]) -> Vec<usize> {
    let shared: Vec<(usize, Vec<u32>)> =
        before.iter().map(|(index, other)| (*index, clip.shared_with(other))).collect();
    let mut worth = vec![1.0f64; clip.len()];
    let mut chosen: Vec<usize> = Vec::new();
    while chosen.len() < MAX_NEIGHBOURS {
        let gain = |patches: &[u32]| patches.iter().map(|patch| worth[*patch as usize]).sum::<f64>();
        let left = shared.iter().filter(|(index, _)| !chosen.contains(index));
        let gains = left.map(|(index, patches)| (gain(patches), *index, patches));
        // Of equal ones the first.
        let best = gains.max_by(|a, b| a.0.total_cmp(&b.0).then(b.1.cmp(&a.1)));
        let Some((_, index, patches)) = best.filter(|(gain, ..)| *gain >= MIN_GAIN) else { break };
        chosen.push(index);
        patches.iter().for_each(|patch| worth[*patch as usize] /= 2.0);
    }
    chosen.sort_unstable();
    chosen
}
