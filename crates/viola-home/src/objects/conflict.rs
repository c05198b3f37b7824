//! Keeps objects out of each other's space.

use super::Found;
use super::fit::UprightBox;
use super::kind::confusable;
use super::nesting::{MAX_SHARED_FRACTION, Nesting, nesting, surrounds};
use crate::map_point::MapPoint;
use viola_geometry::progress::{self, Cancelled, Progress};
use viola_geometry::taxonomy::Class;

/// The resolved overlap: less than the largest one, so that rounding does not matter.
const AIM: f64 = 0.18;
/// Fraction of an object's points that may be cut off by trimming its box.
const MAX_CUT_FRACTION: f64 = 0.1;
/// Minimum ratio of the footprints of an object and of one that is small beside it.
const SEVERAL: f64 = 4.0;
/// Two objects of which one is this far inside the other in space are one object seen twice.
const SAME_FRACTION: f64 = 0.5;

/// Returns the shared footprint as a fraction of the smaller one.
fn shared(a: &UprightBox, b: &UprightBox) -> f64 {
    a.shared_m2(b) / a.area_m2().min(b.area_m2()).max(1e-9)
}

/// Returns the shared volume as a fraction of the smaller one.
fn shared_in_space(a: &UprightBox, b: &UprightBox) -> f64 {
    a.shared_m3(b) / a.volume_m3().min(b.volume_m3()).max(1e-9)
}

/// Returns whether one of two objects may be in the footprint of the other. Those on another one are compared in space.
fn may_share(a: (Class, &UprightBox), b: (Class, &UprightBox)) -> bool {
    [nesting(a, b), nesting(b, a)].into_iter().flatten().any(|nesting| nesting != Nesting::On)
}

/// Returns whether two objects cannot both be where they are.
fn conflicts(a: (Class, &UprightBox), b: (Class, &UprightBox)) -> bool {
    if may_share(a, b) {
        return false;
    }
    if a.1.stands() && b.1.stands() {
        return shared(a.1, b.1) > MAX_SHARED_FRACTION;
    }
    shared_in_space(a.1, b.1) > SAME_FRACTION
}

/// An object whose box may be trimmed.
struct Candidate {
    found: Found,
    bounds: UprightBox,
    /// Its points.
    places: Vec<[f64; 3]>,
}

impl Candidate {
    fn in_way_of(&self, bounds: &UprightBox, other: &Candidate, others: &UprightBox) -> bool {
        conflicts((self.found.object.class, bounds), (other.found.object.class, others))
            && !surrounds(&self.places, bounds, others)
            && !surrounds(&other.places, others, bounds)
    }

    /// Returns whether it is small beside another one.
    fn is_small_beside(&self, other: &Candidate) -> bool {
        SEVERAL * self.bounds.area_m2() <= other.bounds.area_m2()
    }

    /// Adds the points of another one that is a part of the same object.
    fn take_in(&mut self, other: Candidate) {
        let is_part = confusable(self.found.object.class, other.found.object.class)
            && shared_in_space(&self.bounds, &other.bounds) > SAME_FRACTION;
        if is_part {
            self.places.extend(other.places);
            self.found.members.extend(other.found.members);
            self.found.members.sort_unstable();
            self.found.object.points = self.found.members.len();
        }
    }
}

/// Keeps the most confident objects. A less confident one that overlaps them is trimmed if that costs few of its
/// points. Otherwise it is left out, or those that are small beside it are: a large object is more than a label that is
/// taken for another. If the one that is left out is a part of the same object, it gives its points to that object.
pub fn resolve(
    found: Vec<Found>,
    points: &[MapPoint],
    progress: &dyn Progress,
) -> Result<Vec<Found>, Cancelled> {
    let candidate = |found: Found| {
        let place = |member: &u32| points[*member as usize].point.position_m.map(f64::from);
        let places = found.members.iter().map(place).collect();
        Candidate { bounds: found.object.bounds(), places, found }
    };
    let mut candidates: Vec<Candidate> = found.into_iter().map(candidate).collect();
    candidates.sort_by(|a, b| {
        let (a, b) = (&a.found, &b.found);
        // Two objects without a common point have other first points.
        b.object.confidence.total_cmp(&a.object.confidence).then(a.members.first().cmp(&b.members.first()))
    });
    let mut kept: Vec<Candidate> = Vec::new();
    for candidate in candidates {
        progress::check(progress)?;
        // The small ones that were removed, with their places.
        let mut small: Vec<(usize, Candidate)> = Vec::new();
        let result = loop {
            match placed(&kept, &candidate) {
                Err(at) if kept[at].is_small_beside(&candidate) => small.push((at, kept.remove(at))),
                result => break result,
            }
        };
        match result {
            Ok((hosts, bounds)) => {
                kept.iter_mut().zip(hosts).for_each(|(host, bounds)| host.bounds = bounds);
                let mut large = Candidate { bounds, ..candidate };
                small.into_iter().for_each(|(_, part)| large.take_in(part));
                kept.push(large);
            }
            Err(at) => {
                kept[at].take_in(candidate);
                small.into_iter().rev().for_each(|(at, part)| kept.insert(at, part));
            }
        }
    }
    let finished = |Candidate { mut found, bounds, .. }: Candidate| {
        // The length of a trimmed box may have become less than its width.
        found.object.set_bounds(bounds);
        found
    };
    Ok(kept.into_iter().map(finished).collect())
}

/// Returns the boxes of the kept objects and of the candidate, trimmed so that none conflict; the number of the kept
/// object that is in the way if that is not possible.
fn placed(kept: &[Candidate], candidate: &Candidate) -> Result<(Vec<UprightBox>, UprightBox), usize> {
    let mut hosts: Vec<UprightBox> = kept.iter().map(|host| host.bounds).collect();
    let mut bounds = candidate.bounds;
    let in_way =
        |host: &Candidate, at: &UprightBox, bounds: &UprightBox| host.in_way_of(at, candidate, bounds);
    let mut changed = Vec::new();
    for (i, host) in kept.iter().enumerate() {
        if !in_way(host, &hosts[i], &bounds) {
            continue;
        }
        let of_candidate = trimmed(&candidate.places, &bounds, &hosts[i]);
        let of_host = trimmed(&host.places, &hosts[i], &bounds);
        match (of_candidate, of_host) {
            (Some((lost, smaller)), other) if other.is_none_or(|(others, _)| lost <= others) => {
                bounds = smaller
            }
            (_, Some((_, smaller))) => {
                hosts[i] = smaller;
                changed.push(i);
            }
            _ => return Err(i),
        }
    }
    // A smaller box shares more of itself with the others.
    let again = |i: usize| in_way(&kept[i], &hosts[i], &bounds);
    let between =
        |i: usize| (0..kept.len()).any(|j| j != i && kept[i].in_way_of(&hosts[i], &kept[j], &hosts[j]));
    match (0..kept.len()).find(|i| again(*i) || (changed.contains(i) && between(*i))) {
        Some(i) => Err(i),
        None => Ok((hosts, bounds)),
    }
}

/// Returns the box of an object with one side moved so that it overlaps `other` by at most [`AIM`], and the
/// fraction of the points that are outside of it then. None if more than [`MAX_CUT_FRACTION`] would be.
fn trimmed(places: &[[f64; 3]], of: &UprightBox, other: &UprightBox) -> Option<(f64, UprightBox)> {
    const STEP_M: f64 = 0.03;
    let sides = (0..4).filter_map(|side| {
        let axis = 1 - side % 2;
        let most = (0.5 * of.size_m[axis] / STEP_M) as usize;
        let cut = |steps: usize| {
            let mut bounds = *of;
            move_side(&mut bounds, side, -STEP_M * steps as f64);
            bounds
        };
        let bounds = (1..=most).map(cut).find(|bounds| shared(bounds, other) <= AIM)?;
        let outside = places.iter().filter(|at| !bounds.holds(at, 0.02)).count();
        let before = places.iter().filter(|at| !of.holds(at, 0.02)).count();
        let lost = outside.saturating_sub(before) as f64 / places.len().max(1) as f64;
        (lost <= MAX_CUT_FRACTION).then_some((lost, bounds))
    });
    sides.min_by(|a, b| a.0.total_cmp(&b.0))
}

/// Moves one side of a box outwards. Sides 0 and 2 bound its width, 1 and 3 its length.
fn move_side(bounds: &mut UprightBox, side: usize, by_m: f64) {
    let axis = 1 - side % 2;
    let by_m = by_m.max(0.01 - bounds.size_m[axis]);
    let sign = if side == 1 || side == 2 { 1.0 } else { -1.0 };
    let (s, c) = bounds.yaw_rad.sin_cos();
    let outward = if axis == 0 { [c, s] } else { [-s, c] };
    bounds.size_m[axis] += by_m;
    for (centre, outward) in bounds.centre_m.iter_mut().zip(outward) {
        *centre += sign * outward * by_m / 2.0;
    }
}

#[cfg(test)]
mod tests;
