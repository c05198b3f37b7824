//! Prior likelihoods of classes: usual sizes, where the underside is, and whether it stands at a wall.
//!
//! Sizes are log-normal with heavy tails (Student's t), because boxes of partly seen objects are too small and
//! boxes of joined objects too large. Medians and spreads of loose furniture are those of the asset database of
//! ProcTHOR (Deitke et al., 2022; about 1 600 models of products). Built-in furniture follows standards: kitchens
//! EN 1116 (0.6 m deep, worktops at 0.85 m to 0.95 m), appliances 0.6 m wide, bathtubs EN 232, showers EN 251,
//! sanitary ware EN 33, doors DIN 18101. Shares of the forms of a class are estimates.

use super::fit::UprightBox;
use viola_geometry::taxonomy::Class;

/// A usual form of a class. Pairs are the median in metres and the standard deviation of the logarithm.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Form {
    /// Fraction of the class's objects with this form.
    share: f64,
    long: (f64, f64),
    short: (f64, f64),
    /// Height of the top above the floor.
    top: (f64, f64),
    /// Height of the underside of a form that hangs or lies on another object; none if it stands on the floor.
    bottom_m: Option<f64>,
}

const fn form(share: f64, long: (f64, f64), short: (f64, f64), top: (f64, f64)) -> Form {
    Form { share, long, short, top, bottom_m: None }
}

impl Form {
    const fn above(self, bottom_m: f64) -> Form {
        Form { bottom_m: Some(bottom_m), ..self }
    }
}

const BED: &[Form] = &[
    form(0.45, (2.10, 0.10), (1.60, 0.15), (0.80, 0.35)),
    form(0.4, (2.05, 0.10), (0.98, 0.15), (0.80, 0.35)),
    // A cot.
    form(0.15, (1.30, 0.12), (0.72, 0.12), (0.90, 0.15)),
];
const SOFA: &[Form] = &[
    form(0.8, (2.15, 0.22), (0.96, 0.17), (0.85, 0.17)),
    form(0.2, (2.60, 0.15), (1.75, 0.20), (0.85, 0.17)),
];
const CHAIR: &[Form] = &[
    form(0.6, (0.55, 0.17), (0.48, 0.15), (0.91, 0.13)),
    form(0.2, (0.93, 0.21), (0.84, 0.17), (0.87, 0.17)),
    form(0.2, (0.45, 0.28), (0.38, 0.28), (0.52, 0.25)),
];
const TABLE: &[Form] = &[
    form(0.4, (1.43, 0.29), (0.95, 0.24), (0.77, 0.11)),
    form(0.35, (1.11, 0.27), (0.69, 0.25), (0.41, 0.30)),
    form(0.25, (0.58, 0.30), (0.43, 0.30), (0.58, 0.23)),
];
const DESK: &[Form] = &[form(1.0, (1.43, 0.27), (0.66, 0.25), (0.77, 0.18))];
const CABINET: &[Form] = &[
    form(0.4, (1.25, 0.39), (0.50, 0.25), (0.91, 0.25)),
    form(0.25, (1.40, 0.40), (0.60, 0.12), (2.10, 0.10)),
    form(0.15, (0.50, 0.20), (0.42, 0.20), (0.58, 0.20)),
    form(0.2, (1.50, 0.60), (0.35, 0.15), (2.15, 0.08)).above(1.4),
];
const SHELF: &[Form] = &[
    form(0.7, (0.88, 0.33), (0.32, 0.30), (1.50, 0.42)),
    form(0.3, (0.90, 0.40), (0.25, 0.25), (1.60, 0.20)).above(1.4),
];
const COUNTER: &[Form] = &[
    form(0.6, (2.30, 0.36), (0.62, 0.10), (0.93, 0.06)),
    form(0.2, (1.60, 0.30), (0.85, 0.20), (0.93, 0.06)),
    form(0.2, (2.80, 0.30), (2.00, 0.35), (0.93, 0.06)),
];
const REFRIGERATOR: &[Form] = &[
    form(0.8, (0.72, 0.20), (0.64, 0.12), (1.80, 0.12)),
    form(0.2, (0.58, 0.10), (0.56, 0.10), (0.87, 0.10)),
];
const STOVE: &[Form] = &[
    form(0.7, (0.60, 0.10), (0.58, 0.12), (0.93, 0.06)),
    // A hob and the hood above it.
    form(0.3, (0.60, 0.15), (0.50, 0.20), (2.00, 0.20)).above(0.9),
];
const WASHING_MACHINE: &[Form] = &[form(1.0, (0.62, 0.08), (0.60, 0.10), (0.87, 0.08))];
const TELEVISION: &[Form] = &[form(1.0, (1.16, 0.25), (0.12, 0.60), (1.25, 0.25)).above(0.6)];
const LAMP: &[Form] = &[
    form(0.4, (0.50, 0.22), (0.48, 0.20), (1.75, 0.12)),
    form(0.3, (0.30, 0.31), (0.25, 0.40), (1.00, 0.25)).above(0.6),
    form(0.3, (0.45, 0.35), (0.42, 0.40), (2.40, 0.12)).above(1.9),
];
const RADIATOR: &[Form] = &[form(1.0, (0.95, 0.40), (0.10, 0.35), (0.70, 0.20)).above(0.12)];
const TOILET: &[Form] = &[form(1.0, (0.68, 0.12), (0.38, 0.12), (0.80, 0.18))];
const SINK: &[Form] = &[
    form(0.6, (0.60, 0.25), (0.46, 0.15), (0.95, 0.12)).above(0.75),
    // A pedestal or a vanity.
    form(0.4, (0.70, 0.20), (0.45, 0.12), (0.95, 0.10)),
];
const BATHTUB: &[Form] = &[form(1.0, (1.70, 0.08), (0.76, 0.10), (0.58, 0.10))];
const SHOWER: &[Form] = &[
    form(0.6, (0.95, 0.15), (0.85, 0.12), (2.00, 0.10)),
    form(0.4, (0.95, 0.20), (0.08, 0.60), (2.00, 0.10)),
];
const CURTAIN: &[Form] = &[form(1.0, (1.60, 0.50), (0.15, 0.40), (2.30, 0.12)).above(0.1)];
const PLANT: &[Form] = &[
    form(0.6, (0.42, 0.40), (0.38, 0.39), (0.90, 0.45)),
    form(0.4, (0.30, 0.30), (0.27, 0.30), (1.20, 0.30)).above(0.8),
];
const BOX: &[Form] = &[form(1.0, (0.43, 0.23), (0.37, 0.22), (0.33, 0.30))];
const MIRROR: &[Form] = &[form(1.0, (0.70, 0.40), (0.04, 0.50), (1.75, 0.15)).above(0.9)];
const PICTURE: &[Form] = &[form(1.0, (0.77, 0.30), (0.04, 0.50), (1.70, 0.15)).above(1.1)];
const DOOR: &[Form] = &[form(1.0, (0.86, 0.12), (0.06, 0.50), (2.02, 0.05))];
const WINDOW: &[Form] = &[form(1.0, (1.30, 0.40), (0.12, 0.50), (2.15, 0.12)).above(0.9)];

fn forms(class: Class) -> &'static [Form] {
    match class {
        Class::Bed => BED,
        Class::Sofa => SOFA,
        Class::Chair => CHAIR,
        Class::Table => TABLE,
        Class::Desk => DESK,
        Class::Cabinet => CABINET,
        Class::Shelf => SHELF,
        Class::Counter => COUNTER,
        Class::Refrigerator => REFRIGERATOR,
        Class::Stove => STOVE,
        Class::WashingMachine => WASHING_MACHINE,
        Class::Television => TELEVISION,
        Class::Lamp => LAMP,
        Class::Radiator => RADIATOR,
        Class::Toilet => TOILET,
        Class::Sink => SINK,
        Class::Bathtub => BATHTUB,
        Class::Shower => SHOWER,
        Class::Curtain => CURTAIN,
        Class::Plant => PLANT,
        Class::Box => BOX,
        Class::Mirror => MIRROR,
        Class::Picture => PICTURE,
        Class::Door => DOOR,
        Class::Window => WINDOW,
        _ => &[],
    }
}

/// Standard deviation that the measurement adds to a logarithm: two voxels of 3 cm on half a metre.
const MEASURED: f64 = 0.12;
/// Standard deviation of a measured underside, in metres.
const BOTTOM_M: f64 = 0.25;
/// An underside that is higher than this fraction of the top was not seen, or the object hangs.
const UNSEEN_SHARE: f64 = 0.8;
/// Degrees of freedom of Student's t.
const TAILS: f64 = 4.0;

/// Returns the logarithm of a size's density for a class; none for classes that are no objects.
pub fn size_likelihood(class: Class, bounds: &UprightBox) -> Option<f64> {
    let sum: f64 = forms(class).iter().map(|form| form.share * form.density(bounds)).sum();
    (sum > 0.0).then(|| sum.ln())
}

/// Returns how usual a size is for a class: the logarithm of its density over the largest density of the class.
/// At most 0.
pub fn size_fit(class: Class, bounds: &UprightBox) -> Option<f64> {
    let most = forms(class).iter().map(|form| form.share * form.largest()).fold(0.0, f64::max);
    let fit = size_likelihood(class, bounds)? - most.ln();
    Some(fit.min(0.0))
}

/// Returns whether a box of a class stands on the floor, although its lower part may not have been seen.
pub fn stands(class: Class, bounds: &UprightBox) -> bool {
    let likelier = |form: &&Form, other: &&Form| {
        (form.share * form.density(bounds)).total_cmp(&(other.share * other.density(bounds)))
    };
    forms(class).iter().max_by(likelier).is_some_and(|form| form.bottom_m.is_none())
}

impl Form {
    fn density(&self, bounds: &UprightBox) -> f64 {
        let log = |value: f64, (median, sigma): (f64, f64)| {
            let sigma = sigma.hypot(MEASURED);
            student((value.max(1e-3) / median).ln() / sigma) / sigma
        };
        let size = log(bounds.size_m[0], self.long) * log(bounds.size_m[1], self.short);
        let above_m = match self.bottom_m {
            Some(usual_m) => bounds.bottom_m() - usual_m,
            None => (bounds.bottom_m() - UNSEEN_SHARE * bounds.top_m()).max(0.0),
        };
        size * log(bounds.top_m(), self.top) * student(above_m / BOTTOM_M)
    }

    fn largest(&self) -> f64 {
        [self.long, self.short, self.top].iter().map(|(_, sigma)| 1.0 / sigma.hypot(MEASURED)).product()
    }
}

/// Returns the density of Student's t over its largest value.
fn student(t: f64) -> f64 {
    (1.0 + t * t / TAILS).powf(-(TAILS + 1.0) / 2.0)
}

/// Returns the fraction of a class's objects that stand at a wall: the placement annotations of ProcTHOR, with
/// estimates where these only say yes or no.
pub fn at_wall_share(class: Class) -> f64 {
    use Class::*;
    match class {
        Refrigerator | Stove | WashingMachine | Toilet | Sink | Bathtub | Shower | Radiator => 0.95,
        Cabinet | Shelf | Mirror | Picture | Door | Window | Curtain => 0.95,
        Bed | Desk | Counter | Television => 0.85,
        Sofa => 0.65,
        Lamp | Plant | Box => 0.6,
        Table => 0.35,
        Chair => 0.3,
        _ => 0.5,
    }
}

/// Returns how often a class is in a home, relative to the others; rounded from simulated homes.
pub fn frequency(class: Class) -> f64 {
    use Class::*;
    match class {
        Chair => 0.2,
        Cabinet => 0.2,
        Table | Lamp => 0.08,
        Shelf | Door | Window | Plant | Box | Picture => 0.06,
        Bed | Sofa | Counter | Radiator | Sink | Curtain => 0.04,
        _ => 0.025,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sized(size_m: [f64; 3], bottom_m: f64) -> UprightBox {
        UprightBox { centre_m: [0.0, 0.0, bottom_m + size_m[2] / 2.0], size_m, yaw_rad: 0.0 }
    }

    /// Sizes of products, each with the class that they fit best of the two.
    #[test]
    fn a_size_tells_classes_apart() {
        use Class::*;
        for (size_m, bottom_m, is, is_not) in [
            ([0.99, 0.97, 0.48], 0.0, Table, Bed),
            ([2.0, 1.6, 0.6], 0.0, Bed, Table),
            ([0.6, 0.6, 0.85], 0.0, WashingMachine, Cabinet),
            ([0.6, 0.6, 1.8], 0.0, Refrigerator, WashingMachine),
            ([1.2, 0.08, 0.7], 0.8, Television, Cabinet),
            ([2.2, 0.9, 0.8], 0.0, Sofa, Chair),
            ([0.5, 0.5, 0.9], 0.0, Chair, Sofa),
            ([1.7, 0.75, 0.57], 0.0, Bathtub, Bed),
        ] {
            let bounds = sized(size_m, bottom_m);
            let [yes, no] = [is, is_not].map(|class| size_likelihood(class, &bounds).unwrap());
            assert!(yes > no + 1.0, "{size_m:?}: {is:?} {yes:.2}, {is_not:?} {no:.2}");
        }
    }

    /// A table's top is seen from above, and its legs are thin.
    #[test]
    fn tops_stand_and_boards_hang() {
        for (class, size_m, bottom_m, is_standing) in [
            (Class::Table, [1.4, 0.8, 0.06], 0.7, true),
            (Class::Stove, [0.56, 0.5, 0.05], 0.88, true),
            (Class::Cabinet, [1.5, 0.35, 0.7], 1.45, false),
            (Class::Cabinet, [1.2, 0.5, 0.7], 0.1, true),
            (Class::Shelf, [0.8, 0.25, 0.05], 1.5, false),
            (Class::Television, [1.1, 0.06, 0.7], 0.7, false),
        ] {
            assert_eq!(stands(class, &sized(size_m, bottom_m)), is_standing, "{class:?} {size_m:?}");
        }
    }

    #[test]
    fn every_kind_has_sizes_and_no_other_class() {
        let bounds = sized([1.0, 0.5, 1.0], 0.0);
        for class in Class::ALL {
            let fit = size_fit(*class, &bounds);
            assert_eq!(fit.is_some(), super::super::kind::kind(*class).is_some(), "{class:?}");
            assert!(fit.is_none_or(|fit| fit.is_finite() && fit <= 0.0), "{class:?}: {fit:?}");
            let shares: f64 = forms(*class).iter().map(|form| form.share).sum();
            assert!(forms(*class).is_empty() || (shares - 1.0).abs() < 1e-9, "{class:?}");
        }
    }
}
