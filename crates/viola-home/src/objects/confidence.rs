//! The probability that an object is a true one: its class is right, and its box overlaps the true box.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::sync::LazyLock;
use viola_geometry::taxonomy::Class;

/// What speaks for an object and against it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ObjectEvidence {
    /// Posterior of the class among all classes of objects.
    pub posterior: f64,
    /// Fraction of the labels that speak for the class.
    pub heard: f64,
    /// Fraction of the labels that name an object of any class, not structure.
    pub named: f64,
    /// Logarithm of how usual the size is for the class, at most 0.
    pub size_fit: f64,
    /// Area of its surface in the map, in square metres.
    pub surface_m2: f64,
    /// That area over the area of the box's top and two of its sides.
    pub coverage: f64,
    /// Mean probability of its points' labels.
    pub label_probability: f64,
    /// Fraction of a side with a wall behind it.
    pub contact: f64,
    /// Distance of its middle from the rooms, in metres.
    pub outside_m: f64,
    /// Whether things of its class belong in a room of this name: 1, -1, or 0 if the name does not tell.
    pub suits_room: f64,
}

/// Names of the features, in order.
pub const FEATURES: [&str; 10] = [
    "posterior",
    "heard",
    "named",
    "size_fit",
    "surface",
    "coverage",
    "label_probability",
    "contact",
    "outside",
    "suits_room",
];

impl ObjectEvidence {
    /// Returns the features, each of the order of one.
    pub fn features(&self) -> [f64; FEATURES.len()] {
        let odds = |p: f64| (p.clamp(0.01, 0.99) / (1.0 - p.clamp(0.01, 0.99))).ln() / 2.0;
        [
            odds(self.posterior),
            odds(self.heard),
            odds(self.named),
            self.size_fit.max(-8.0) / 3.0,
            self.surface_m2.clamp(0.05, 5.0).ln(),
            self.coverage.clamp(0.05, 2.0).ln(),
            odds(self.label_probability),
            self.contact,
            self.outside_m.min(1.0),
            self.suits_room,
        ]
    }
}

/// A logistic regression on the features, with an offset for each class.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ConfidenceModel {
    /// Command, seeds and commit of the fit.
    pub made_by: BTreeMap<String, String>,
    pub intercept: f64,
    pub weights: BTreeMap<String, f64>,
    /// Added for a class; 0 for a class without one.
    pub classes: BTreeMap<String, f64>,
}

/// The fitted model. `viola evaluate --home --fit FILE` writes it.
static MODEL: LazyLock<ConfidenceModel> =
    LazyLock::new(|| serde_json::from_str(include_str!("model.json")).expect("a test reads it"));

impl ConfidenceModel {
    /// Returns the probability that an object of this class is a true one.
    pub fn probability(&self, class: Class, evidence: &ObjectEvidence) -> f64 {
        let weight = |name: &str| self.weights.get(name).copied().unwrap_or(0.0);
        let sum: f64 = FEATURES.iter().zip(evidence.features()).map(|(name, x)| weight(name) * x).sum();
        let offset = self.classes.get(class.name()).copied().unwrap_or(0.0);
        1.0 / (1.0 + (-(self.intercept + offset + sum)).exp())
    }
}

/// Returns the probability in thousandths.
pub fn confidence(class: Class, evidence: &ObjectEvidence) -> f64 {
    (MODEL.probability(class, evidence) * 1e3).round() / 1e3
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_model_has_a_weight_for_each_feature_and_known_classes() {
        let mut names: Vec<&str> = MODEL.weights.keys().map(String::as_str).collect();
        names.sort_by_key(|name| FEATURES.iter().position(|feature| feature == name));
        assert_eq!(names, FEATURES);
        let known = |name: &String| Class::ALL.iter().any(|class| class.name() == name);
        assert!(MODEL.classes.keys().all(known), "{:?}", MODEL.classes);
    }

    /// Each sign against the object makes it less probable.
    #[test]
    fn doubts_lower_the_confidence() {
        let good = ObjectEvidence {
            posterior: 0.95,
            heard: 0.9,
            named: 0.95,
            size_fit: -0.5,
            surface_m2: 2.0,
            coverage: 0.8,
            label_probability: 0.8,
            contact: 0.8,
            outside_m: 0.0,
            suits_room: 0.0,
        };
        let sure = confidence(Class::Bed, &good);
        for doubt in [
            ObjectEvidence { posterior: 0.3, ..good },
            ObjectEvidence { heard: 0.3, ..good },
            ObjectEvidence { size_fit: -7.0, ..good },
            ObjectEvidence { surface_m2: 0.15, ..good },
            ObjectEvidence { label_probability: 0.3, ..good },
            ObjectEvidence { outside_m: 0.9, ..good },
            ObjectEvidence { suits_room: -1.0, ..good },
        ] {
            assert!(confidence(Class::Bed, &doubt) < sure, "{doubt:?}");
        }
    }
}
