//! The likeliest class of a distribution.

use crate::cloud::{Label, OTHER_CLASSES};
use viola_geometry::taxonomy::{CLASSES, Class};

/// A value for each class: probabilities, or sums of votes.
pub(super) type ByClass = [f32; CLASSES];

/// Returns the known probabilities of a label.
pub(super) fn by_class(label: &Label) -> ByClass {
    let mut out = [0f32; CLASSES];
    label.fractions().for_each(|(class, fraction)| out[class as usize] += f32::from(fraction) / 255.0);
    out
}

/// Returns the class with the largest sum in the family with the largest sum; its fraction of all sums is
/// its probability.
pub(super) fn likeliest(sums: &[f32], views: u16) -> Label {
    likeliest_beside(sums, 0.0, views)
}

/// The same if classes that are not in `sums` have `rest` together.
pub fn likeliest_beside(sums: &[f32], rest: f32, views: u16) -> Label {
    likeliest_of(sums, rest, views, family)
}

/// Returns the class with the largest sum in the family with the largest sum in the structure with the largest
/// sum; its fraction of all sums is its probability.
pub(super) fn likeliest_in_structure(sums: &[f32], views: u16) -> Label {
    likeliest_of(sums, 0.0, views, structure)
}

/// Compares first the sums of the classes with the same `group`, then those of families, then those of classes.
fn likeliest_of(sums: &[f32], rest: f32, views: u16, group: fn(Class) -> Class) -> Label {
    let total: f32 = sums.iter().sum::<f32>() + rest;
    let (mut groups, mut families) = ([0f32; CLASSES], [0f32; CLASSES]);
    for (class, sum) in Class::ALL.iter().zip(sums) {
        groups[group(*class) as usize] += sum;
        families[family(*class) as usize] += sum;
    }
    let (mut best, mut most) = (Class::Other, (0.0, 0.0, 0.0));
    for (class, &sum) in Class::ALL.iter().zip(sums) {
        let rank = (groups[group(*class) as usize], families[family(*class) as usize], sum);
        if rank > most {
            (best, most) = (*class, rank);
        }
    }
    if total > 0.0 {
        Label::new(best, most.2 / total, views).with_others(next_best(sums, best, total))
    } else {
        Label::NONE
    }
}

/// Returns the classes with the largest sums beside `best`, of equal ones the first, with their fractions.
fn next_best(sums: &[f32], best: Class, total: f32) -> [(Class, f32); OTHER_CLASSES] {
    let mut next = [(Class::Other, 0.0); OTHER_CLASSES];
    for (class, &sum) in Class::ALL.iter().zip(sums).filter(|(class, _)| **class != best) {
        if let Some(place) = next.iter().position(|(_, other)| sum > *other) {
            next[place..].rotate_right(1);
            next[place] = (*class, sum);
        }
    }
    next.map(|(class, sum)| (class, sum / total))
}

/// Returns the family of a class. Networks split probability between similar classes, so the sum of
/// the family is compared first.
fn family(class: Class) -> Class {
    match class {
        Class::Curtain => Class::Window,
        Class::Shelf => Class::Cabinet,
        Class::Desk => Class::Table,
        Class::Rug => Class::Floor,
        Class::Pillow => Class::Bed,
        other => other,
    }
}

/// Returns the structure of a class: floor, wall or opening, ceiling, or [`Class::Other`] for all objects. A family is
/// in one structure.
fn structure(class: Class) -> Class {
    match class {
        Class::Floor | Class::Rug => Class::Floor,
        Class::Wall | Class::Door | Class::Window | Class::Curtain => Class::Wall,
        Class::Ceiling => Class::Ceiling,
        _ => Class::Other,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Checks the class and probability that result from sums by class.
    fn check(rule: fn(&[f32], u16) -> Label, sums: &[(Class, f32)], want: Class, probability: f32) {
        let mut all = [0f32; CLASSES];
        for (class, sum) in sums {
            all[*class as usize] = *sum;
        }
        let label = rule(&all, 7);
        assert_eq!((label.class, label.views), (want, 7), "{sums:?}");
        assert!((label.probability() - probability).abs() < 0.003, "{sums:?} {}", label.probability());
    }

    #[test]
    fn families_count_before_classes() {
        let check = |sums: &[(Class, f32)], want, probability| check(likeliest, sums, want, probability);
        check(&[(Class::Wall, 4.0), (Class::Door, 1.0)], Class::Wall, 0.8);
        check(&[(Class::Wall, 4.0), (Class::Window, 3.0), (Class::Curtain, 3.0)], Class::Window, 0.3);
        check(&[(Class::Wall, 4.0), (Class::Shelf, 3.0), (Class::Cabinet, 2.0)], Class::Shelf, 1.0 / 3.0);
        assert_eq!(likeliest(&[0.0; CLASSES], 0), Label::NONE);
    }

    #[test]
    fn structures_count_before_families() {
        let opening = [(Class::Wall, 0.3), (Class::Door, 0.15), (Class::Window, 0.15), (Class::Cabinet, 0.4)];
        check(likeliest, &opening, Class::Cabinet, 0.4);
        check(likeliest_in_structure, &opening, Class::Wall, 0.3);
        let things = [(Class::Wall, 0.45), (Class::Bed, 0.2), (Class::Table, 0.25), (Class::Desk, 0.1)];
        check(likeliest, &things, Class::Wall, 0.45);
        check(likeliest_in_structure, &things, Class::Table, 0.25);
        let ground = [(Class::Rug, 0.3), (Class::Floor, 0.25), (Class::Sofa, 0.45)];
        check(likeliest_in_structure, &ground, Class::Rug, 0.3);
        assert_eq!(likeliest_in_structure(&[0.0; CLASSES], 0), Label::NONE);
    }

    #[test]
    fn the_next_classes_are_kept() {
        let mut sums = [0f32; CLASSES];
        let fractions = [
            (Class::Table, 0.1),
            (Class::Sofa, 0.3),
            (Class::Bed, 0.25),
            (Class::Chair, 0.2),
            (Class::Wall, 0.05),
        ];
        fractions.iter().for_each(|(class, fraction)| sums[*class as usize] = 2.0 * fraction);
        let kept: Vec<Class> = likeliest_beside(&sums, 0.2, 1).fractions().map(|(class, _)| class).collect();
        assert_eq!(kept, [Class::Sofa, Class::Bed, Class::Chair, Class::Table]);
        // With the rest the sums are 2, so the fractions are those above.
        for ((_, fraction), want) in likeliest_beside(&sums, 0.2, 1).fractions().zip([0.3, 0.25, 0.2, 0.1]) {
            assert!((f64::from(fraction) / 255.0 - want).abs() < 0.003, "{fraction} {want}");
        }
    }
}
