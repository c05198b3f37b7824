//! Marginal probabilities of a pairwise model of discrete variables.

use std::collections::BTreeMap;
use viola_geometry::groups;
use viola_geometry::progress::{self, Cancelled, Progress};

/// Components with at most this many joint states are enumerated.
const MAX_STATES: usize = 20_000;
/// Iterations of belief propagation, the weight of the last message in the next one, and the change of all
/// messages at which it ends.
const ITERATIONS: usize = 300;
const DAMPING: f64 = 0.5;
const SETTLED: f64 = 1e-9;

/// Variables with log weights of their states, and log weights of pairs of states.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Model {
    /// Log weight of each state of each variable.
    pub states: Vec<Vec<f64>>,
    pub pairs: Vec<Factor>,
}

/// Log weights of the joint states of two variables.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Factor {
    pub a: usize,
    pub b: usize,
    /// Row-major: states of `a` by states of `b`.
    pub weights: Vec<f64>,
}

impl Model {
    /// Returns the probability of each state of each variable: exact for small components, by loopy belief
    /// propagation for large ones.
    pub fn marginals(&self, progress: &dyn Progress) -> Result<Vec<Vec<f64>>, Cancelled> {
        let mut marginals: Vec<Vec<f64>> = self.states.iter().map(|states| normalised(states)).collect();
        for component in self.components() {
            let part = self.part(&component);
            let joint = part.states.iter().map(Vec::len).try_fold(1usize, |all, n| all.checked_mul(n));
            let small = joint.is_some_and(|joint| joint <= MAX_STATES);
            progress::check(progress)?;
            let found = if small { part.enumerated() } else { part.propagated(progress)? };
            for (variable, probabilities) in component.into_iter().zip(found) {
                marginals[variable] = probabilities;
            }
        }
        Ok(marginals)
    }

    /// Returns the connected components with at least one pair.
    fn components(&self) -> Vec<Vec<usize>> {
        let mut parents: Vec<u32> = (0..self.states.len() as u32).collect();
        for pair in &self.pairs {
            groups::join(&mut parents, pair.a as u32, pair.b as u32);
        }
        let mut components: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
        for variable in 0..self.states.len() {
            components.entry(groups::root(&mut parents, variable as u32)).or_default().push(variable);
        }
        components.into_values().filter(|all| all.len() > 1).collect()
    }

    fn part(&self, variables: &[usize]) -> Model {
        let place = |variable: usize| variables.binary_search(&variable).ok();
        let pair = |pair: &Factor| {
            Some(Factor { a: place(pair.a)?, b: place(pair.b)?, weights: pair.weights.clone() })
        };
        Model {
            states: variables.iter().map(|v| self.states[*v].clone()).collect(),
            pairs: self.pairs.iter().filter_map(pair).collect(),
        }
    }

    fn enumerated(&self) -> Vec<Vec<f64>> {
        let mut joint = vec![0usize; self.states.len()];
        let mut logs: Vec<(f64, Vec<usize>)> = Vec::new();
        loop {
            let own: f64 = joint.iter().zip(&self.states).map(|(state, weights)| weights[*state]).sum();
            let pairs: f64 = self
                .pairs
                .iter()
                .map(|pair| pair.weights[joint[pair.a] * self.states[pair.b].len() + joint[pair.b]])
                .sum();
            logs.push((own + pairs, joint.clone()));
            let Some(next) = (0..joint.len()).find(|v| joint[*v] + 1 < self.states[*v].len()) else { break };
            joint[next] += 1;
            joint[..next].fill(0);
        }
        let most = logs.iter().map(|(log, _)| *log).fold(f64::NEG_INFINITY, f64::max);
        let mut marginals: Vec<Vec<f64>> = self.states.iter().map(|states| vec![0.0; states.len()]).collect();
        for (log, joint) in &logs {
            for (variable, state) in joint.iter().enumerate() {
                marginals[variable][*state] += (log - most).exp();
            }
        }
        for probabilities in &mut marginals {
            let sum: f64 = probabilities.iter().sum();
            probabilities.iter_mut().for_each(|p| *p /= sum);
        }
        marginals
    }

    /// Sum-product belief propagation, all messages at once.
    fn propagated(&self, progress: &dyn Progress) -> Result<Vec<Vec<f64>>, Cancelled> {
        // Two messages a pair: to `b`, then to `a`.
        let mut messages: Vec<[Vec<f64>; 2]> = self
            .pairs
            .iter()
            .map(|pair| [vec![0.0; self.states[pair.b].len()], vec![0.0; self.states[pair.a].len()]])
            .collect();
        for _ in 0..ITERATIONS {
            progress::check(progress)?;
            let beliefs = self.beliefs(&messages);
            let mut change: f64 = 0.0;
            let mut next = messages.clone();
            for ((pair, old), new) in self.pairs.iter().zip(&messages).zip(&mut next) {
                let columns = self.states[pair.b].len();
                let weight = |a: usize, b: usize| pair.weights[a * columns + b];
                let from = |variable: usize, back: &[f64]| -> Vec<f64> {
                    beliefs[variable].iter().zip(back).map(|(belief, back)| belief - back).collect()
                };
                let (from_a, from_b) = (from(pair.a, &old[1]), from(pair.b, &old[0]));
                let to_b =
                    (0..columns).map(|b| log_sum(from_a.iter().enumerate().map(|(a, f)| f + weight(a, b))));
                let to_a = (0..from_a.len())
                    .map(|a| log_sum(from_b.iter().enumerate().map(|(b, f)| f + weight(a, b))));
                for (new, fresh) in new.iter_mut().zip([to_b.collect::<Vec<_>>(), to_a.collect()]) {
                    let most = fresh.iter().copied().fold(f64::NEG_INFINITY, f64::max);
                    for (new, fresh) in new.iter_mut().zip(fresh) {
                        let damped = DAMPING * *new + (1.0 - DAMPING) * (fresh - most);
                        change = change.max((damped - *new).abs());
                        *new = damped;
                    }
                }
            }
            messages = next;
            if change < SETTLED {
                break;
            }
        }
        Ok(self.beliefs(&messages).iter().map(|logs| normalised(logs)).collect())
    }

    fn beliefs(&self, messages: &[[Vec<f64>; 2]]) -> Vec<Vec<f64>> {
        let mut beliefs = self.states.clone();
        for (pair, [to_b, to_a]) in self.pairs.iter().zip(messages) {
            beliefs[pair.b].iter_mut().zip(to_b).for_each(|(belief, message)| *belief += message);
            beliefs[pair.a].iter_mut().zip(to_a).for_each(|(belief, message)| *belief += message);
        }
        beliefs
    }
}

fn log_sum(logs: impl Iterator<Item = f64> + Clone) -> f64 {
    let most = logs.clone().fold(f64::NEG_INFINITY, f64::max);
    most + logs.map(|log| (log - most).exp()).sum::<f64>().ln()
}

fn normalised(logs: &[f64]) -> Vec<f64> {
    let sum = log_sum(logs.iter().copied());
    logs.iter().map(|log| (log - sum).exp()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use viola_geometry::progress::Silent;

    fn close(a: &[Vec<f64>], b: &[Vec<f64>], within: f64) -> bool {
        a.iter().flatten().zip(b.iter().flatten()).all(|(a, b)| (a - b).abs() < within)
    }

    proptest! {
        /// Belief propagation is exact on trees.
        #[test]
        fn both_ways_agree_on_a_chain(
            states in prop::collection::vec(prop::collection::vec(-3.0..0.0f64, 2..4), 4),
            weights in prop::collection::vec(-4.0..2.0f64, 27),
        ) {
            let pair = |a: usize| {
                let count = states[a].len() * states[a + 1].len();
                Factor { a, b: a + 1, weights: weights[9 * a..9 * a + count].to_vec() }
            };
            let model = Model { pairs: (0..3).map(pair).collect(), states: states.clone() };
            prop_assert!(close(&model.enumerated(), &model.propagated(&Silent).unwrap(), 1e-6));
        }
    }

    #[test]
    fn a_variable_without_pairs_keeps_its_weights() {
        let model = Model { states: vec![vec![0.25f64.ln(), 0.75f64.ln()], vec![0.0]], pairs: Vec::new() };
        assert!(close(&model.marginals(&Silent).unwrap(), &[vec![0.25, 0.75], vec![1.0]], 1e-12));
    }

    /// Two variables that agree with each other in two ways stay undecided; a third that knows decides both.
    #[test]
    fn knowledge_spreads() {
        let alike = vec![0.0, -9.0, -9.0, 0.0];
        let pair = |a: usize, b: usize| Factor { a, b, weights: alike.clone() };
        let open = vec![0.0, 0.0];
        let two = Model { states: vec![open.clone(), open.clone()], pairs: vec![pair(0, 1)] };
        assert!(close(&two.marginals(&Silent).unwrap(), &[vec![0.5, 0.5], vec![0.5, 0.5]], 1e-9));
        let three =
            Model { states: vec![open.clone(), open, vec![0.0, -7.0]], pairs: vec![pair(0, 1), pair(1, 2)] };
        let marginals = three.marginals(&Silent).unwrap();
        assert!(marginals.iter().all(|p| p[0] > 0.99), "{marginals:?}");
    }
}
