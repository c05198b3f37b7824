//! Finer cells, where rooms are divided without a wall.

use super::Cells;
use super::lines::MAX_REFINED;
use super::lines::SAME_LINE_M;

impl Cells {
    /// Adds a line across an axis, unless one is there. The parts of a divided cell are what it was.
    pub fn refine(&mut self, axis: usize, metres: f64) {
        let lines = &self.lines[axis];
        let after = lines.partition_point(|line| *line <= metres);
        let is_within = (1..lines.len()).contains(&after);
        if !is_within
            || lines.len() >= MAX_REFINED
            || lines.iter().any(|line| (line - metres).abs() < SAME_LINE_M)
        {
            return;
        }
        let parts = [metres - lines[after - 1], lines[after] - metres];
        let fractions = parts.map(|part| part / (parts[0] + parts[1]));
        let count = [self.count(0), self.count(1)];
        let mut new_count = count;
        new_count[axis] += 1;
        // Index of the old cell and its fraction of it.
        let old = |at: usize| {
            let mut place = [at % new_count[0], at / new_count[0]];
            let fraction = if place[axis] + 1 == after || place[axis] == after {
                fractions[place[axis] + 1 - after]
            } else {
                1.0
            };
            place[axis] -= usize::from(place[axis] >= after);
            (place[1] * count[0] + place[0], fraction)
        };
        let cells = 0..new_count[0] * new_count[1];
        let inside = cells.clone().map(|at| self.inside[old(at).0]).collect();
        let pillars = cells.clone().map(|at| self.pillars[old(at).0]).collect();
        // Only the lists of divided cells are copied: a plan has very many cells.
        let mut before = std::mem::take(&mut self.owners);
        let owners = cells.map(|at| {
            let (at, fraction) = old(at);
            if fraction < 1.0 {
                before[at].iter().map(|(owner, area)| (*owner, area * fraction)).collect()
            } else {
                std::mem::take(&mut before[at])
            }
        });
        self.owners = owners.collect();
        (self.inside, self.pillars) = (inside, pillars);
        self.lines[axis].insert(after, metres);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_divided_cell_stays_what_it_was() {
        let lines = [vec![0.0, 1.0, 3.0], vec![0.0, 2.0, 3.0]];
        let before = Cells {
            lines,
            inside: vec![false, true, false, false],
            pillars: vec![false, false, true, false],
            owners: vec![vec![], vec![(1, 4.0)], vec![(2, 1.0)], vec![]],
        };
        for (axis, metres) in [(0, 1.5), (0, 0.4), (1, 0.5), (1, 2.9)] {
            let mut cells = before.clone();
            cells.refine(axis, metres);
            assert_eq!(cells.inside.len(), 6);
            assert!(cells.line(axis, metres).is_some());
            for k in 0..900 {
                let p = [(k % 30) as f64 * 0.1 + 0.05, (k / 30) as f64 * 0.1 + 0.05];
                assert_eq!(cells.is_inside(p), before.is_inside(p), "{p:?}");
                let [new, old] = [&cells, &before].map(|of| of.at(p).unwrap());
                assert_eq!(cells.pillars[new], before.pillars[old]);
            }
            for owner in [1, 2] {
                let area = |of: &Cells| {
                    of.owners.iter().flatten().filter(|(o, _)| *o == owner).map(|(_, a)| a).sum::<f64>()
                };
                assert!((area(&cells) - area(&before)).abs() < 1e-9);
            }
            cells.refine(axis, metres + 0.01);
            assert_eq!(cells.inside.len(), 6, "a line nearby is enough");
        }
    }

    #[test]
    fn the_lists_of_other_cells_are_not_copied() {
        let mut cells = Cells::of([vec![0.0, 1.0, 3.0], vec![0.0, 2.0, 3.0]]);
        cells.owners = (1..=4).map(|owner| vec![(owner, 1.0)]).collect();
        let lists: Vec<*const (u32, f64)> = cells.owners.iter().map(|list| list.as_ptr()).collect();
        cells.refine(0, 1.5);
        // The first column is whole.
        assert_eq!([cells.owners[0].as_ptr(), cells.owners[3].as_ptr()], [lists[0], lists[2]]);
    }
}
