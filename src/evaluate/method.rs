//! The ways to align a clip that can be compared: rows of the table.

use super::Sample;
use crate::align::paper::{self, PaperParams, Refiner};
use crate::align::{self, Activation, AlignError, AlignParams, Alignment, CompleteParams};
use crate::progress::Progress;

/// A row of the table.
#[derive(Debug, Clone)]
pub struct Method {
    pub name: String,
    pub kind: MethodKind,
}

#[derive(Debug, Clone)]
pub enum MethodKind {
    Viola(Box<AlignParams>),
    Paper(PaperParams),
}

/// Evidence that `viola` can be had without: the name after `viola-without-`, and how it is switched off.
/// The probability is still the one that was fitted to answers with all evidence.
type Ablation = (&'static str, fn(&mut AlignParams));
const ABLATIONS: &[Ablation] = &[
    ("free-space", |params| {
        params.decide.blocked_m = 0.0;
        params.decide.hits_on_floor_m = 0.0;
        params.decide.walls_on_floor_m = 0.0;
    }),
    // What is low counts as much as what is tall.
    ("structure", |params| params.weigh.low_weight = 1.0),
    // What is movable counts as much as what is fixed.
    ("labels", |params| params.weigh.movable_weight = 1.0),
    ("upper-walls", |params| params.weigh.upper_weight = 0.0),
    // A hit where the map knows nothing costs as much as one on free floor.
    ("unknown-cells", |params| params.decide.evidence.unknown_share = 1.0),
];

/// Ways to complete what a clip did not see: the name after `complete-`, and how it is switched on over a
/// method that takes only what was seen at the vacuum's height.
const COMPLETIONS: &[Ablation] = &[
    ("base", |_| {}),
    ("structure", |params| {
        params.weigh.upper_weight = AlignParams::default().weigh.upper_weight;
        params.complete = CompleteParams::default();
    }),
    ("structure-all", |params| {
        params.weigh.upper_weight = AlignParams::default().weigh.upper_weight;
        params.complete = CompleteParams { when: Activation::Always, ..CompleteParams::default() };
    }),
    ("upper-walls", |params| params.weigh.upper_weight = AlignParams::default().weigh.upper_weight),
];

impl Method {
    pub fn viola(params: AlignParams) -> Method {
        Method { name: "viola".into(), kind: MethodKind::Viola(Box::new(params)) }
    }

    /// The method of that name with its default parameters.
    pub fn named(name: &str, seed: u64) -> Option<Method> {
        let params = AlignParams { seed, ..AlignParams::default() };
        let kind = match name {
            "viola" => return Some(Method::viola(params)),
            "paper" => MethodKind::Paper(PaperParams::default()),
            "paper-icp" => MethodKind::Paper(PaperParams { refiner: Refiner::Icp, ..PaperParams::default() }),
            _ if name.starts_with("complete-") => {
                let (_, switch_on) = COMPLETIONS.iter().find(|(known, _)| name[9..] == **known)?;
                let mut params = params;
                params.weigh.upper_weight = 0.0;
                params.complete.when = Activation::Never;
                switch_on(&mut params);
                MethodKind::Viola(Box::new(params))
            }
            _ => {
                let evidence = name.strip_prefix("viola-without-")?;
                let (_, switch_off) = ABLATIONS.iter().find(|(known, _)| *known == evidence)?;
                let mut params = params;
                switch_off(&mut params);
                MethodKind::Viola(Box::new(params))
            }
        };
        Some(Method { name: name.to_owned(), kind })
    }

    /// All names that [`Method::named`] knows.
    pub fn names() -> Vec<String> {
        let ablations = ABLATIONS.iter().map(|(evidence, _)| format!("viola-without-{evidence}"));
        let completions = COMPLETIONS.iter().map(|(way, _)| format!("complete-{way}"));
        let names = ["viola", "paper", "paper-icp"].map(String::from).into_iter();
        names.chain(ablations).chain(completions).collect()
    }

    /// Aligns a sample.
    pub fn register(&self, sample: &Sample, progress: &dyn Progress) -> Result<Alignment, AlignError> {
        let target = sample.target.as_deref();
        match &self.kind {
            MethodKind::Viola(params) => {
                Ok(align::register_completing(&sample.observation, target, params, progress)?.0)
            }
            MethodKind::Paper(params) => paper::register(&sample.observation, target, params, progress),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_name_is_a_method_of_its_own() {
        let methods: Vec<Method> =
            Method::names().iter().map(|name| Method::named(name, 3).expect(name)).collect();
        for (i, a) in methods.iter().enumerate() {
            for b in &methods[..i] {
                assert_ne!(format!("{:?}", a.kind), format!("{:?}", b.kind), "{} {}", a.name, b.name);
            }
        }
        assert!(Method::named("viola-without-luck", 0).is_none());
    }
}
