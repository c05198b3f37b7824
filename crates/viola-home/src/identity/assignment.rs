//! Optimal assignment of one list to another.

use std::collections::{BTreeMap, BTreeSet};
use viola_geometry::groups;

/// Rows or columns of one connected part up to which the optimum is computed, in cubic time. A home has
/// far smaller parts: only things in the same place are connected.
const MAX_SIDE: usize = 300;

/// A possible pair and its score; the score is positive.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Candidate {
    pub row: usize,
    pub column: usize,
    pub score: i64,
}

/// Returns the pairs with the largest sum of scores, each row and column at most once, sorted by row. The
/// same candidates give the same pairs, even for equal sums.
pub fn best_pairs(candidates: &[Candidate]) -> Vec<(usize, usize)> {
    let mut pairs: Vec<(usize, usize)> = parts(candidates).iter().flat_map(|part| best_of(part)).collect();
    pairs.sort_unstable();
    pairs
}

/// Returns the connected parts of the graph of candidates.
fn parts(candidates: &[Candidate]) -> Vec<Vec<Candidate>> {
    let rows = candidates.iter().map(|one| one.row + 1).max().unwrap_or(0);
    let columns = candidates.iter().map(|one| one.column + 1).max().unwrap_or(0);
    // Columns are numbered after the rows.
    let mut parent: Vec<u32> = (0..(rows + columns) as u32).collect();
    for one in candidates {
        groups::join(&mut parent, one.row as u32, (rows + one.column) as u32);
    }
    let mut parts: BTreeMap<u32, Vec<Candidate>> = BTreeMap::new();
    for one in candidates {
        parts.entry(groups::root(&mut parent, one.row as u32)).or_default().push(*one);
    }
    parts.into_values().collect()
}

fn best_of(part: &[Candidate]) -> Vec<(usize, usize)> {
    let sorted = |numbers: BTreeSet<usize>| numbers.into_iter().collect::<Vec<usize>>();
    let rows = sorted(part.iter().map(|one| one.row).collect());
    let columns = sorted(part.iter().map(|one| one.column).collect());
    if rows.len().max(columns.len()) > MAX_SIDE {
        return greedy(part);
    }
    // A row without a pair takes a column of its own, of cost 0; any other pair that is no candidate costs more.
    let width = columns.len() + rows.len();
    let mut cost = vec![vec![1_i64; width]; rows.len()];
    for (index, row) in cost.iter_mut().enumerate() {
        row[columns.len() + index] = 0;
    }
    let index_of = |all: &[usize], value: usize| all.binary_search(&value).unwrap_or(0);
    for one in part {
        cost[index_of(&rows, one.row)][index_of(&columns, one.column)] = -one.score;
    }
    let chosen = hungarian(&cost);
    let pairs = chosen.into_iter().enumerate().filter(|(_, column)| *column < columns.len());
    pairs.map(|(row, column)| (rows[row], columns[column])).collect()
}

/// Takes the best pair that is left, again and again.
fn greedy(part: &[Candidate]) -> Vec<(usize, usize)> {
    let mut sorted = part.to_vec();
    sorted.sort_unstable_by_key(|one| (-one.score, one.row, one.column));
    let (mut rows, mut columns) = (BTreeSet::new(), BTreeSet::new());
    let mut pairs = Vec::new();
    for one in sorted {
        if !rows.contains(&one.row) && columns.insert(one.column) {
            rows.insert(one.row);
            pairs.push((one.row, one.column));
        }
    }
    pairs
}

/// Returns the column of each row in an assignment of least cost (Kuhn, 1955; shortest augmenting paths with
/// potentials). There are at least as many columns as rows.
fn hungarian(cost: &[Vec<i64>]) -> Vec<usize> {
    let width = cost.first().map_or(0, Vec::len);
    // Row and column 0 are the start of a path; rows and columns count from 1.
    let (mut of_row, mut of_column) = (vec![0_i64; cost.len() + 1], vec![0_i64; width + 1]);
    let mut row_at = vec![0_usize; width + 1];
    for row in 1..=cost.len() {
        row_at[0] = row;
        let mut column = 0;
        let mut least = vec![i64::MAX; width + 1];
        let mut used = vec![false; width + 1];
        let mut way = vec![0_usize; width + 1];
        while row_at[column] != 0 {
            used[column] = true;
            let at = row_at[column];
            let (mut step, mut next) = (i64::MAX, 0);
            for other in 1..=width {
                if used[other] {
                    continue;
                }
                let reduced = cost[at - 1][other - 1] - of_row[at] - of_column[other];
                if reduced < least[other] {
                    (least[other], way[other]) = (reduced, column);
                }
                if least[other] < step {
                    (step, next) = (least[other], other);
                }
            }
            for other in 0..=width {
                if used[other] {
                    of_row[row_at[other]] += step;
                    of_column[other] -= step;
                } else if least[other] != i64::MAX {
                    least[other] -= step;
                }
            }
            column = next;
        }
        while column != 0 {
            row_at[column] = row_at[way[column]];
            column = way[column];
        }
    }
    let mut chosen = vec![0; cost.len()];
    for column in (1..=width).filter(|column| row_at[*column] != 0) {
        chosen[row_at[column] - 1] = column - 1;
    }
    chosen
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn candidates(scores: &[(usize, usize, i64)]) -> Vec<Candidate> {
        scores
            .iter()
            .map(|(row, column, score)| Candidate { row: *row, column: *column, score: *score })
            .collect()
    }

    #[test]
    fn the_sum_decides_and_not_the_best_pair() {
        for (scores, expected) in [
            (vec![], vec![]),
            (vec![(3, 7, 5)], vec![(3, 7)]),
            // 9 alone is less than 8 and 7.
            (vec![(0, 0, 9), (0, 1, 8), (1, 0, 7)], vec![(0, 1), (1, 0)]),
            (vec![(0, 0, 9), (0, 1, 1), (1, 0, 7)], vec![(0, 0)]),
            // Two parts that have nothing to do with each other.
            (vec![(0, 0, 1), (1, 0, 2), (5, 9, 1)], vec![(1, 0), (5, 9)]),
        ] {
            assert_eq!(best_pairs(&candidates(&scores)), expected, "{scores:?}");
        }
    }

    fn sum(scores: &[Candidate], pairs: &[(usize, usize)]) -> i64 {
        let score = |(row, column): &(usize, usize)| {
            scores
                .iter()
                .find(|one| (one.row, one.column) == (*row, *column))
                .map_or(i64::MIN, |one| one.score)
        };
        pairs.iter().map(score).sum()
    }

    /// Returns the largest sum, by trying everything.
    fn best_sum(scores: &[Candidate], row: usize, taken: u32) -> i64 {
        if row == 5 {
            return 0;
        }
        let with = scores.iter().filter(|one| one.row == row && taken & (1 << one.column) == 0);
        let with = with.map(|one| one.score + best_sum(scores, row + 1, taken | (1 << one.column)));
        with.max().unwrap_or(i64::MIN).max(best_sum(scores, row + 1, taken))
    }

    proptest! {
        #[test]
        fn nothing_is_better(scores in prop::collection::btree_map((0..5_usize, 0..5_usize), 1..50_i64, 0..20)) {
            let scores: Vec<(usize, usize, i64)> = scores.into_iter().map(|((r, c), s)| (r, c, s)).collect();
            let scores = candidates(&scores);
            let pairs = best_pairs(&scores);
            prop_assert_eq!(sum(&scores, &pairs), best_sum(&scores, 0, 0));
        }
    }

    #[test]
    fn a_part_that_is_too_large_is_still_assigned() {
        let many: Vec<(usize, usize, i64)> =
            (0..400).flat_map(|row| [(row, row, 10), (row, (row + 1) % 400, 1)]).collect();
        let pairs = best_pairs(&candidates(&many));
        assert!(pairs.len() == 400 && pairs.iter().all(|(row, column)| row == column));
    }
}
