//! Pieces of furniture as the surface network tells them: sites that name the same centre decide their class together. The
//! weights in the program know the height of a centre only; its place on the floor is that of the site (docs/experiments.md,
//! Surface network).

use super::likeliest::ByClass;
use rustc_hash::FxHashMap;
use viola_geometry::Point3;
use viola_geometry::taxonomy::{CLASSES, Class};

/// Side of the cells that count the named centres.
const CELL_M: f64 = 0.1;
/// Cells in each direction that a peak of the counts reaches.
const REACH: i32 = 2;
/// Minimum probability of being a piece for a site to take part.
const MIN_PIECE: f32 = 0.5;

/// Returns whether a class is a piece by itself. A worktop, its sink and its stove have the centre of the units below
/// them; pillows, lamps and televisions stand on other pieces (docs/experiments.md, Surface network).
fn is_piece(class: Class) -> bool {
    use Class::*;
    matches!(class, Bed | Sofa | Chair | Table | Desk | Cabinet | Shelf | Refrigerator)
}

/// Replaces the probabilities of each site among pieces by their geometric mean with those of all sites that name the same
/// centre. The probability of being a piece stays. `centres_m` are those that the sites name.
pub(super) fn agree(said: &mut [Option<ByClass>], centres_m: &[Option<Point3>]) {
    let mut centres = Centres::default();
    let cells: Vec<Option<u32>> = said
        .iter()
        .zip(centres_m)
        .map(|(said, centre)| {
            let piece = piece_of(said.as_ref()?);
            (piece >= MIN_PIECE).then_some(centres.count(centre.as_ref()?, piece))
        })
        .collect();
    let peaks = centres.peaks();
    let mut sums = vec![[0f32; CLASSES]; peaks.len()];
    for (said, cell) in said.iter().zip(&cells) {
        let (Some(said), Some(cell)) = (said, cell) else { continue };
        let sum = &mut sums[peaks[*cell as usize] as usize];
        pieces().for_each(|class| sum[class] += said[class]);
    }
    for (said, cell) in said.iter_mut().zip(&cells) {
        let (Some(said), Some(cell)) = (said, cell) else { continue };
        let sum = &sums[peaks[*cell as usize] as usize];
        let before = piece_of(said);
        pieces().for_each(|class| said[class] = (said[class] * sum[class]).sqrt());
        // Positive, for the sum has what the site says.
        let after = piece_of(said);
        pieces().for_each(|class| said[class] *= before / after);
    }
}

fn pieces() -> impl Iterator<Item = usize> {
    Class::ALL.iter().filter(|class| is_piece(**class)).map(|class| *class as usize)
}

/// Returns the probability of being a piece.
fn piece_of(said: &ByClass) -> f32 {
    pieces().map(|class| said[class]).sum()
}

/// The named centres in cells.
#[derive(Default)]
struct Centres {
    of_key: FxHashMap<[i32; 3], u32>,
    keys: Vec<[i32; 3]>,
    weights: Vec<f32>,
}

impl Centres {
    /// Counts a centre and returns its cell.
    fn count(&mut self, centre_m: &Point3, weight: f32) -> u32 {
        let key = [centre_m.x, centre_m.y, centre_m.z].map(|c| (c / CELL_M).floor() as i32);
        let cell = *self.of_key.entry(key).or_insert_with(|| {
            self.keys.push(key);
            self.weights.push(0.0);
            self.keys.len() as u32 - 1
        });
        self.weights[cell as usize] += weight;
        cell
    }

    /// Returns the peak of the counts that each cell leads to, as a cell.
    fn peaks(&self) -> Vec<u32> {
        let all = || 0..self.keys.len() as u32;
        let count = |cell| self.around(cell).map(|other| self.weights[other as usize]).sum();
        let counts: Vec<f32> = all().map(count).collect();
        // Of equal cells the first, so that no path is a circle.
        let higher = |a: &u32, b: &u32| counts[*a as usize].total_cmp(&counts[*b as usize]).then(b.cmp(a));
        let next: Vec<u32> = all().map(|cell| self.around(cell).max_by(higher).unwrap_or(cell)).collect();
        let peak = |mut cell: u32| {
            while next[cell as usize] != cell {
                cell = next[cell as usize];
            }
            cell
        };
        all().map(peak).collect()
    }

    /// Returns the cells at most [`REACH`] away, with the cell itself.
    fn around(&self, cell: u32) -> impl Iterator<Item = u32> {
        const SIDE: i32 = 2 * REACH + 1;
        let key = self.keys[cell as usize];
        let steps = (0..SIDE.pow(3)).map(|i| [i / SIDE / SIDE, i / SIDE % SIDE, i % SIDE]);
        // A network may name a centre beyond all numbers.
        let keys = steps.map(move |step| [0, 1, 2].map(|axis| key[axis].saturating_add(step[axis] - REACH)));
        keys.filter_map(|key| self.of_key.get(&key).copied())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn said(probabilities: &[(Class, f32)]) -> Option<ByClass> {
        let mut out = [0f32; CLASSES];
        probabilities.iter().for_each(|(class, p)| out[*class as usize] = *p);
        Some(out)
    }

    fn likeliest(said: &Option<ByClass>) -> Class {
        let said = said.unwrap();
        *Class::ALL.iter().max_by(|a, b| said[**a as usize].total_cmp(&said[**b as usize])).unwrap()
    }

    #[test]
    fn sites_with_one_centre_decide_together() {
        let sofa = said(&[(Class::Sofa, 0.7), (Class::Bed, 0.2), (Class::Wall, 0.1)]);
        let doubtful = said(&[(Class::Sofa, 0.4), (Class::Bed, 0.5), (Class::Wall, 0.1)]);
        let wall = said(&[(Class::Wall, 0.6), (Class::Bed, 0.4)]);
        let worktop = said(&[(Class::Counter, 0.6), (Class::Cabinet, 0.4)]);
        let at = |x: f64| Some(Point3::new(x, 0.05, 0.45));
        // Nine sites of a sofa, one in doubt, and one in doubt by itself.
        let mut all = vec![sofa; 9];
        let mut centres_m: Vec<Option<Point3>> = (0..9).map(|i| at(0.02 * f64::from(i))).collect();
        for (said, centre) in [
            (doubtful, at(0.2)),
            (doubtful, at(2.0)),
            (wall, at(0.1)),
            (worktop, at(0.1)),
            (doubtful, None),
            (None, None),
        ] {
            all.push(said);
            centres_m.push(centre);
        }
        let before = all.clone();
        agree(&mut all, &centres_m);
        assert_eq!((likeliest(&all[9]), likeliest(&all[10])), (Class::Sofa, Class::Bed));
        assert_eq!(all[11..], before[11..], "neither piece nor centre");
        for (after, before) in all.iter().zip(&before).take(11) {
            let (after, before) = (after.unwrap(), before.unwrap());
            assert!((piece_of(&after) - piece_of(&before)).abs() < 1e-6);
            assert_eq!(after[Class::Wall as usize], before[Class::Wall as usize]);
        }
    }

    #[test]
    fn centres_lead_to_their_peak() {
        let mut centres = Centres::default();
        let near = |x: f64| Point3::new(x, 0.0, 0.5);
        let cells: Vec<u32> =
            [0.05, 0.15, 0.15, 0.25, 1.05, 1.15].map(|x| centres.count(&near(x), 1.0)).to_vec();
        let peaks = centres.peaks();
        let peak = |i: usize| peaks[cells[i] as usize];
        assert!((1..4).all(|i| peak(i) == peak(0)) && peak(4) == peak(5) && peak(0) != peak(4), "{peaks:?}");
        assert!(Centres::default().peaks().is_empty());
        let mut far = Centres::default();
        let end = |x: f64| Point3::new(x, -1e30, 1e30);
        let cells = [1e30, -1e30].map(|x| far.count(&end(x), 1.0));
        assert_eq!(far.peaks(), cells);
    }
}
