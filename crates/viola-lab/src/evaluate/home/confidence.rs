//! Fits the confidence of objects to simulated homes.

use nalgebra::{DMatrix, DVector};
use std::collections::BTreeMap;
use viola_geometry::taxonomy::Class;
use viola_home::{ConfidenceModel, OBJECT_FEATURES, ObjectEvidence};

/// A candidate, and whether a true object has its class and its box.
#[derive(Debug, Clone, Copy)]
pub struct Judged {
    pub class: Class,
    pub evidence: ObjectEvidence,
    pub right: bool,
}

/// Strength of the ridge on the weights of features, and on the offsets of classes: some classes are rare.
const RIDGE: f64 = 1.0;
const CLASS_RIDGE: f64 = 4.0;
const STEPS: usize = 50;

/// Returns a ridge logistic regression by Newton's method; none unless right and wrong candidates are present.
pub fn fit_confidence(rows: &[Judged], made_by: BTreeMap<String, String>) -> Option<ConfidenceModel> {
    let right = rows.iter().filter(|row| row.right).count();
    if right == 0 || right == rows.len() {
        return None;
    }
    let features = OBJECT_FEATURES.len();
    let size = 1 + features + Class::ALL.len();
    let ridge = |i: usize| match i {
        0 => 1e-6,
        i if i <= features => RIDGE,
        _ => CLASS_RIDGE,
    };
    let row = |judged: &Judged| {
        let values = judged.evidence.features();
        DVector::from_fn(size, |i, _| match i {
            0 => 1.0,
            i if i <= features => values[i - 1],
            i => f64::from(u8::from(i - 1 - features == usize::from(judged.class.id()))),
        })
    };
    let standard: Vec<(DVector<f64>, f64)> =
        rows.iter().map(|judged| (row(judged), f64::from(u8::from(judged.right)))).collect();
    let mut weights = DVector::<f64>::zeros(size);
    for _ in 0..STEPS {
        let mut gradient = DVector::from_fn(size, |i, _| ridge(i) * weights[i]);
        let mut hessian = DMatrix::from_fn(size, size, |i, j| if i == j { ridge(i) } else { 0.0 });
        for (row, right) in &standard {
            let p = 1.0 / (1.0 + (-weights.dot(row)).exp());
            gradient.axpy(p - right, row, 1.0);
            hessian.ger((p * (1.0 - p)).max(1e-9), row, row, 1.0);
        }
        let step = hessian.cholesky()?.solve(&gradient);
        weights -= &step;
        if step.norm() < 1e-9 {
            break;
        }
    }
    let rounded = |value: f64| (value * 1e4).round() / 1e4;
    let seen = Class::ALL.iter().filter(|class| rows.iter().any(|row| row.class == **class));
    Some(ConfidenceModel {
        made_by,
        intercept: rounded(weights[0]),
        weights: OBJECT_FEATURES
            .iter()
            .enumerate()
            .map(|(i, name)| ((*name).to_owned(), rounded(weights[i + 1])))
            .collect(),
        classes: seen
            .map(|class| (class.name().to_owned(), rounded(weights[1 + features + usize::from(class.id())])))
            .collect(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn judged(class: Class, posterior: f64, right: bool) -> Judged {
        let evidence = ObjectEvidence {
            posterior,
            heard: 0.5,
            named: 0.5,
            size_fit: 0.0,
            surface_m2: 1.0,
            coverage: 1.0,
            label_probability: 0.5,
            contact: 0.0,
            outside_m: 0.0,
            suits_room: 0.0,
        };
        Judged { class, evidence, right }
    }

    #[test]
    fn the_fit_finds_the_share_of_right_candidates() {
        // Beds with a high posterior are right nine times of ten, with a low one twice; chairs always half as often.
        let mut rows = Vec::new();
        for (class, posterior, right) in
            [(Class::Bed, 0.9, 90), (Class::Bed, 0.3, 20), (Class::Chair, 0.9, 45), (Class::Chair, 0.3, 10)]
        {
            rows.extend((0..200).map(|i| judged(class, posterior, i < 2 * right)));
        }
        let model = fit_confidence(&rows, BTreeMap::new()).unwrap();
        for (class, posterior, share) in
            [(Class::Bed, 0.9, 0.9), (Class::Bed, 0.3, 0.2), (Class::Chair, 0.9, 0.45)]
        {
            let got = model.probability(class, &judged(class, posterior, true).evidence);
            assert!((got - share).abs() < 0.12, "{class:?} {posterior}: {got}");
        }
    }

    #[test]
    fn one_kind_of_candidate_teaches_nothing() {
        let rows = [judged(Class::Bed, 0.9, true)];
        assert!(fit_confidence(&rows, BTreeMap::new()).is_none());
        assert!(fit_confidence(&[], BTreeMap::new()).is_none());
    }
}
