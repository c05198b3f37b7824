//! Pieces of furniture that are the same on both days of a home.

use super::home::Home;
use super::piece::Piece;
use crate::pairs::greedy;
use viola_geometry::Pose2;

/// Rotation that counts as this distance, in radians per metre, when pieces that look the same are told apart.
const RAD_PER_M: f64 = 3.0;

impl Home {
    /// Returns the home on the vacuum's day, for recordings before the furniture changed.
    pub fn before(&self) -> Home {
        Home {
            params: self.params,
            plan: self.plan.clone(),
            vacuum_day: self.vacuum_day.clone(),
            clip_day: self.vacuum_day.clone(),
            rng: self.rng.clone(),
        }
    }

    /// Returns the pieces that are there on both days, as their numbers on the vacuum's day and on the clips' day.
    /// Pieces that look the same are told apart by their places: each is the nearest one.
    pub fn same_pieces(&self) -> Vec<(u16, u16)> {
        let (then, now) = (&self.vacuum_day.pieces, &self.clip_day.pieces);
        let mut pairs = Vec::new();
        for (i, a) in then.iter().enumerate() {
            for (j, b) in now.iter().enumerate().filter(|(_, b)| looks_like(a, b)) {
                pairs.push((-apart_m(&a.home_from_piece, &b.home_from_piece), i, j));
            }
        }
        let numbers = |(_, i, j): (f64, usize, usize)| (i as u16 + 1, j as u16 + 1);
        let mut same: Vec<(u16, u16)> = greedy(pairs).into_iter().map(numbers).collect();
        same.sort_unstable();
        same
    }
}

/// Returns whether two pieces are of the same class, size and room; sizes are drawn from continuous ranges.
fn looks_like(a: &Piece, b: &Piece) -> bool {
    (a.class, a.size, a.room) == (b.class, b.size, b.room) && a.solids.len() == b.solids.len()
}

fn apart_m(a: &Pose2, b: &Pose2) -> f64 {
    a.distance_m(b) + viola_geometry::angle_between(a.yaw_rad, b.yaw_rad) / RAD_PER_M
}

#[cfg(test)]
mod tests {
    use super::super::home::{HomeParams, Set};
    use super::*;

    #[test]
    fn most_furniture_of_a_changed_home_is_the_same_and_some_of_it_moved() {
        let home = Home::generate(&HomeParams::new(Set::Changed, 7));
        let (before, same) = (home.before(), home.same_pieces());
        let (then, now) = (before.truth().objects, home.truth().objects);
        let at = |(i, j): &(u16, u16)| (&then[usize::from(*i) - 1], &now[usize::from(*j) - 1]);
        assert!(same.iter().map(at).all(|(a, b)| a.class == b.class && a.size_m == b.size_m));
        let moved = same.iter().map(at).filter(|(a, b)| a.centre_m != b.centre_m).count();
        let (gone, added) = (then.len() - same.len(), now.len() - same.len());
        assert!(same.len() > then.len() / 2 && moved > 0 && gone > 0 && added > 0, "{moved} {gone} {added}");
        // On one day nothing moves.
        let same = before.same_pieces();
        assert!(same.len() == then.len() && same.iter().all(|(i, j)| i == j));
    }
}
