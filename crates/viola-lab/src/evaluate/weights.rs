//! Learns the weights of the loss that rank the true pose first, from clips with ground truth.

use super::{ClipResult, Listed};
use nalgebra::{Matrix6, Vector6};
use viola_align::{LossWeights, TYPICAL_HITS};

/// Learned weights of the loss.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LearnedLoss {
    /// Number of clips with the true pose and another one among their alternatives.
    pub clips: usize,
    pub weights: LossWeights,
    /// A pose with a loss higher by this is e times less probable, for a clip of [`TYPICAL_HITS`].
    pub temperature_m: f64,
}

/// Evidence on one pose: distance in metres, then the fractions in the order of [`LossWeights`].
type Figures = Vector6<f64>;

/// Fits a ridge conditional logit (McFadden, 1974) by Newton's method: the odds of two alternatives are
/// exponential in their evidence. The weights are drawn towards those of `known`, because simulated homes are not
/// real ones. Contradictions never make a pose more probable: a weight that would be negative is 0. Without labels of
/// a network `misplaced_m` stays that of `known`. None if no clip has both a right and a wrong alternative.
pub fn learned_loss(results: &[ClipResult], known: &LossWeights) -> Option<LearnedLoss> {
    let most_misplaced = known.most_misplaced;
    let clips: Vec<Vec<(Figures, bool)>> = results
        .iter()
        .filter(|r| r.unknowable != Some(true))
        .filter_map(|r| figures(r, most_misplaced))
        .collect();
    let scale = spread(&clips)?;
    let has_labels = clips.iter().flatten().any(|(figures, _)| figures[5] != 0.0);
    let prior = prior(known, &scale);
    // 1 for each figure that has a weight.
    let mut used = Figures::repeat(1.0);
    let slopes = loop {
        let slopes = fit(&clips, &scale, &prior, &used)?;
        let (worst, slope) = slopes.argmax();
        if slope <= 0.0 {
            break slopes;
        }
        used[worst] = 0.0;
    };
    let slopes = slopes.component_div(&scale);
    // Without the sign of a zero.
    let weight = |i: usize| (slopes[i] / slopes[0]).abs();
    Some(LearnedLoss {
        clips: clips.len(),
        weights: LossWeights {
            blocked_m: weight(1),
            hits_on_floor_m: weight(2),
            unseen_sides_m: weight(3),
            walls_on_floor_m: weight(4),
            misplaced_m: if has_labels { weight(5) } else { known.misplaced_m },
            most_misplaced,
        },
        temperature_m: -1.0 / slopes[0],
    })
}

/// Returns the information of the prior on the standardised slopes: a ridge on the distance's, and the ratios of the
/// others to it as in `known`.
fn prior(known: &LossWeights, scale: &Figures) -> Matrix6<f64> {
    const RIDGE: f64 = 1.0;
    /// Weight of the ratios, in clips.
    const KNOWN: f64 = 30.0;
    let weights = [
        known.blocked_m,
        known.hits_on_floor_m,
        known.unseen_sides_m,
        known.walls_on_floor_m,
        known.misplaced_m,
    ];
    let mut information = Matrix6::zeros();
    information[(0, 0)] = RIDGE;
    for (i, weight) in (1..).zip(weights) {
        let mut off = Figures::zeros();
        off[0] = -weight * scale[i] / scale[0];
        off[i] = 1.0;
        information += off * off.transpose() * KNOWN;
    }
    information
}

/// Returns the slopes of the standardised figures; those of figures that are not used are 0.
fn fit(
    clips: &[Vec<(Figures, bool)>],
    scale: &Figures,
    prior: &Matrix6<f64>,
    used: &Figures,
) -> Option<Figures> {
    const STEPS: usize = 50;
    let mut slopes = Figures::zeros();
    for _ in 0..STEPS {
        let mut gradient = prior * slopes;
        let mut hessian = *prior;
        for clip in clips {
            let of_all = Mean::of(clip.iter(), &slopes, scale);
            let of_right = Mean::of(clip.iter().filter(|(_, right)| *right), &slopes, scale);
            gradient += of_all.mean - of_right.mean;
            hessian += of_all.square - of_all.mean * of_all.mean.transpose();
        }
        // The rows and columns of the others become those of the identity.
        let pairs = used * used.transpose();
        let hessian = hessian.component_mul(&pairs) + Matrix6::from_diagonal(&used.map(|used| 1.0 - used));
        let step = hessian.cholesky()?.solve(&gradient.component_mul(used));
        // Far from the optimum a full step may diverge.
        slopes -= step / f64::max(step.amax(), 1.0);
        if step.amax() < 1e-9 {
            break;
        }
    }
    Some(slopes)
}

/// Returns the alternatives of a clip; none without a choice. The noise of a mean falls with the square root of
/// the hits, so the figures of long clips are scaled up.
fn figures(result: &ClipResult, most_misplaced: f64) -> Option<Vec<(Figures, bool)>> {
    let scale = (result.hits.max(1) as f64 / TYPICAL_HITS).sqrt();
    let of = |listed: &Listed| {
        let e = listed.evidence?;
        let misplaced = e.misplaced.min(most_misplaced);
        let figures = Figures::new(
            e.distance_m,
            e.blocked_rays,
            e.hits_on_floor,
            e.unseen_sides,
            e.walls_on_floor,
            misplaced,
        );
        Some((figures * scale, listed.right))
    };
    let clip: Vec<(Figures, bool)> = result.alternatives.iter().filter_map(of).collect();
    let is_choice = clip.iter().any(|(_, right)| *right) && clip.iter().any(|(_, right)| !right);
    is_choice.then_some(clip)
}

/// Returns the standard deviation of each figure among the alternatives of a clip.
fn spread(clips: &[Vec<(Figures, bool)>]) -> Option<Figures> {
    let (mut squares, mut count) = (Figures::zeros(), 0.0);
    for clip in clips {
        let mean = clip.iter().map(|(x, _)| x).sum::<Figures>() / clip.len() as f64;
        for (x, _) in clip {
            squares += (x - mean).map(|d| d * d);
            count += 1.0;
        }
    }
    (count > 0.0).then(|| squares.map(|square| (square / count).sqrt().max(1e-6)))
}

/// Odds-weighted mean and mean square of alternatives.
struct Mean {
    mean: Figures,
    square: Matrix6<f64>,
}

impl Mean {
    fn of<'a>(
        alternatives: impl Iterator<Item = &'a (Figures, bool)> + Clone,
        slopes: &Figures,
        scale: &Figures,
    ) -> Mean {
        let standard = alternatives.map(|(x, _)| x.component_div(scale));
        let highest = standard.clone().map(|x| slopes.dot(&x)).fold(f64::MIN, f64::max);
        let (mut sum, mut mean, mut square) = (0.0, Figures::zeros(), Matrix6::zeros());
        for x in standard {
            let odds = (slopes.dot(&x) - highest).exp();
            sum += odds;
            mean += x * odds;
            square += x * x.transpose() * odds;
        }
        Mean { mean: mean / sum, square: square / sum }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use viola_align::{AlignmentState, Evidence};

    const MAX_MISPLACED: f64 = 0.15;
    const CLIPS: usize = 20_000;
    const TRUTH: LossWeights = LossWeights {
        blocked_m: 0.05,
        hits_on_floor_m: 0.1,
        unseen_sides_m: 0.0,
        walls_on_floor_m: 0.2,
        misplaced_m: 0.15,
        most_misplaced: MAX_MISPLACED,
    };
    const TEMPERATURE_M: f64 = 0.02;

    /// Returns a clip of four alternatives, of which one is right by the odds of `TRUTH`.
    fn clip(rng: &mut ChaCha8Rng) -> ClipResult {
        let mut listed = Vec::new();
        let mut odds = Vec::new();
        for _ in 0..4 {
            let [distance_m, blocked_rays, hits_on_floor, unseen_sides, walls_on_floor, misplaced]: [f64; 6] =
                [0.1, 0.5, 0.5, 0.5, 0.5, MAX_MISPLACED].map(|most| rng.random::<f64>() * most);
            let evidence = Evidence {
                distance_m,
                blocked_rays,
                hits_on_floor,
                unseen_sides,
                walls_on_floor,
                misplaced,
                ..Evidence::default()
            };
            let loss_m = TRUTH.loss_m(&evidence);
            odds.push((-loss_m / TEMPERATURE_M).exp());
            listed.push(Listed { loss_m, evidence: Some(evidence), ..Listed::example() });
        }
        let mut at = rng.random::<f64>() * odds.iter().sum::<f64>();
        let right = odds.iter().position(|odds| {
            at -= odds;
            at < 0.0
        });
        listed[right.unwrap_or(3)].right = true;
        ClipResult { alternatives: listed, ..ClipResult::example(AlignmentState::Aligned, Some((1.0, 0.1))) }
    }

    #[test]
    fn finds_the_weights_that_made_the_data() {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let clips: Vec<ClipResult> = (0..CLIPS).map(|_| clip(&mut rng)).collect();
        let found = learned_loss(&clips, &TRUTH).unwrap();
        let of = |w: &LossWeights| {
            [w.blocked_m, w.hits_on_floor_m, w.unseen_sides_m, w.walls_on_floor_m, w.misplaced_m]
        };
        let pairs = of(&found.weights).into_iter().zip(of(&TRUTH));
        for (found, want) in pairs.chain([(found.temperature_m, TEMPERATURE_M)]) {
            assert!((found - want).abs() < 0.01, "{found} is not {want}");
        }
        assert_eq!(found.clips, CLIPS);
    }

    /// Evidence that speaks for poses in the data gets no weight.
    #[test]
    fn no_weight_is_negative() {
        let mut rng = ChaCha8Rng::seed_from_u64(6);
        let clips: Vec<ClipResult> = (0..2_000)
            .map(|_| {
                let mut clip = clip(&mut rng);
                for listed in &mut clip.alternatives {
                    let fraction = if listed.right { 0.5 } else { 0.2 };
                    listed.evidence.as_mut().unwrap().blocked_rays = fraction * rng.random::<f64>();
                }
                clip
            })
            .collect();
        let found = learned_loss(&clips, &TRUTH).unwrap();
        assert_eq!(found.weights.blocked_m, 0.0);
        assert!((found.weights.walls_on_floor_m - TRUTH.walls_on_floor_m).abs() < 0.03, "{found:?}");
    }

    #[test]
    fn clips_without_a_choice_teach_nothing() {
        let alone = ClipResult::example(AlignmentState::Aligned, Some((1.0, 0.1)));
        assert_eq!(learned_loss(&[alone], &TRUTH), None);
        assert_eq!(learned_loss(&[], &TRUTH), None);
    }
}
