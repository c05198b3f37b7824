//! Prior knowledge of object classes: usual sizes, and confusable classes.

use std::ops::Range;
use viola_geometry::taxonomy::Class;

/// Usual size of a class, in metres, as furniture is sold.
#[derive(Debug, Clone, PartialEq)]
pub struct Kind {
    pub long_m: Range<f64>,
    pub short_m: Range<f64>,
    /// Height of its top above the floor.
    pub top_m: Range<f64>,
    /// True if it stands on the floor: its box extends downwards.
    pub stands: bool,
}

/// Returns the kind of a class; none for structure, people and unnamed things.
pub fn kind(class: Class) -> Option<Kind> {
    use Class::*;
    let kind = |long_m, short_m, top_m, stands| Some(Kind { long_m, short_m, top_m, stands });
    match class {
        Bed => kind(1.2..2.5, 0.7..2.3, 0.3..1.5, true),
        Sofa => kind(1.1..4.0, 0.6..3.0, 0.55..1.2, true),
        Chair => kind(0.35..1.1, 0.3..1.0, 0.4..1.4, true),
        Table => kind(0.4..3.0, 0.3..1.6, 0.3..1.2, true),
        Desk => kind(0.8..2.5, 0.4..1.6, 0.6..1.3, true),
        Cabinet => kind(0.3..4.5, 0.2..0.8, 0.3..2.6, true),
        Shelf => kind(0.3..4.5, 0.15..0.5, 0.3..2.6, true),
        Counter => kind(0.6..5.0, 0.4..1.6, 0.8..1.2, true),
        Refrigerator => kind(0.45..1.1, 0.45..0.9, 0.8..2.1, true),
        Stove => kind(0.4..1.0, 0.2..0.8, 0.8..1.2, true),
        WashingMachine => kind(0.45..0.8, 0.4..0.75, 0.7..1.1, true),
        // Old ones are as deep as wide.
        Television => kind(0.4..2.0, 0.02..0.6, 0.5..2.2, false),
        Lamp => kind(0.1..0.8, 0.1..0.6, 0.3..2.6, false),
        // Those for towels are tall.
        Radiator => kind(0.3..2.5, 0.03..0.3, 0.3..1.9, false),
        Toilet => kind(0.45..0.9, 0.3..0.6, 0.35..1.2, true),
        Sink => kind(0.3..0.9, 0.25..0.65, 0.7..1.1, false),
        Bathtub => kind(1.1..2.1, 0.6..1.1, 0.35..0.9, true),
        Shower => kind(0.6..1.8, 0.05..1.3, 1.6..2.6, true),
        Curtain => kind(0.3..5.0, 0.03..0.5, 1.2..2.8, false),
        Plant => kind(0.2..1.5, 0.2..1.2, 0.2..2.4, false),
        Box => kind(0.2..1.0, 0.15..0.9, 0.15..1.5, false),
        Mirror => kind(0.3..2.0, 0.01..0.15, 0.8..2.4, false),
        Picture => kind(0.3..2.5, 0.01..0.15, 1.0..2.5, false),
        Door => kind(0.6..1.2, 0.03..0.3, 1.8..2.3, true),
        Window => kind(0.4..4.0, 0.03..0.4, 1.2..2.6, false),
        Other | Floor | Wall | Ceiling | Stairs | Rug | Pillow | Clothes | Person | Animal => None,
    }
}

impl Kind {
    /// Returns the fit of a size, 0..1: 1 inside all ranges, less for every factor outside.
    pub fn fit(&self, long_m: f64, short_m: f64, top_m: f64) -> f64 {
        let one = |value: f64, range: &Range<f64>| {
            let off = (range.start / value.max(1e-3)).max(value / range.end).max(1.0);
            // A factor of two outside a range is a sixth as likely.
            off.powf(-2.5)
        };
        one(long_m, &self.long_m) * one(short_m, &self.short_m) * one(top_m, &self.top_m)
    }
}

/// Returns whether the evaluation counts a class: furniture and appliances.
pub fn is_furniture(class: Class) -> bool {
    use Class::*;
    matches!(
        class,
        Bed | Sofa
            | Chair
            | Table
            | Desk
            | Cabinet
            | Shelf
            | Counter
            | Refrigerator
            | Stove
            | WashingMachine
            | Television
            | Lamp
            | Radiator
            | Toilet
            | Sink
            | Bathtub
            | Shower
    )
}

/// Returns the fraction of an object's points allowed beyond each face of its box, as outliers: chairs touch what is beside.
pub fn beyond(class: Class) -> f64 {
    if class == Class::Chair { 0.05 } else { super::fit::BEYOND }
}

/// Maximum height of a sink: only its basin with the tap belongs to it, not the cabinet below.
pub const BASIN_M: f64 = 0.35;

/// Returns whether a class is storage furniture along walls. A worktop is none: it lies on it.
pub fn is_storage(class: Class) -> bool {
    matches!(class, Class::Cabinet | Class::Shelf)
}

/// Returns whether a class is an appliance that may be built into storage furniture.
pub fn is_appliance(class: Class) -> bool {
    matches!(class, Class::Stove | Class::WashingMachine | Class::Refrigerator)
}

/// Returns whether networks confuse two classes: parts of one object may get either label.
pub fn confusable(a: Class, b: Class) -> bool {
    use Class::*;
    const FAMILIES: [&[Class]; 6] = [
        &[Bed, Sofa, Chair],
        &[Table, Desk, Counter],
        &[Cabinet, Shelf, Counter, Refrigerator, Stove, WashingMachine, Desk],
        &[Bathtub, Shower, Sink, Toilet],
        &[Curtain, Window, Shower],
        &[Sink, Counter],
    ];
    a == b || FAMILIES.iter().any(|family| family.contains(&a) && family.contains(&b))
}

/// Returns whether two touching fragments of the class are one object. Tables and desks are not: they are set
/// against each other.
pub fn is_solid(class: Class) -> bool {
    use Class::*;
    matches!(class, Bed | Sofa | Chair | Cabinet | Shelf)
}
