//! The fused points in coarse cells, for fast comparison of neighbours.

use super::fit::{BEYOND, UprightBox, fit_box, wall_direction};
use crate::map_point::MapPoint;
use rustc_hash::FxHashMap;
use viola_geometry::taxonomy::{CLASSES, Class};

/// Views beyond this number do not increase a label's weight.
const MAX_VIEWS: f32 = 4.0;
/// Weight of a vote for wall: walls are behind thin things, in the same cells.
const WALL_VOTE: f32 = 0.6;
/// Heights of objects in metres above the floor.
const HEIGHTS_M: std::ops::Range<f32> = 0.03..4.0;
/// Bits of a packed cell index along x, y and z. Along x and y they reach 500 km: a LiDAR map may lie 100 km from its
/// origin.
const BITS: [u32; 3] = [24, 24, 16];

/// Cells with points that are neither floor nor ceiling, sorted by key.
pub struct Cells {
    pub side_m: f64,
    /// The walls' direction modulo a quarter turn; without walls, that of all upright surface.
    pub wall_yaw_rad: Option<f64>,
    /// Packed cell indices.
    keys: Vec<u64>,
    of_key: FxHashMap<u64, u32>,
    /// The points of cell `i` are `points[start[i]..start[i + 1]]`, as indices into the map.
    start: Vec<u32>,
    points: Vec<u32>,
    /// Sums of the points' normals.
    normals: Vec<[f32; 3]>,
    /// Mean probability of each class at each cell.
    likelihoods: Vec<[f32; CLASSES]>,
    /// Each cell's class, and its fraction of the votes.
    labels: Vec<Option<(Class, f32)>>,
}

impl Cells {
    pub fn new(map: &[MapPoint], side_m: f64) -> Cells {
        let ceiling = Ceiling::new(map);
        let mut placed: Vec<(u64, u32)> = (0u32..)
            .zip(map)
            .filter(|(_, p)| is_thing(p) && !ceiling.holds(p))
            .filter_map(|(i, p)| {
                Some((pack(p.point.position_m.map(|c| (f64::from(c) / side_m).floor() as i64))?, i))
            })
            .collect();
        placed.sort_unstable();
        let mut cells = Cells {
            side_m,
            wall_yaw_rad: None,
            keys: Vec::new(),
            of_key: FxHashMap::default(),
            start: vec![0],
            points: placed.iter().map(|(_, index)| *index).collect(),
            normals: Vec::new(),
            likelihoods: Vec::new(),
            labels: Vec::new(),
        };
        let mut votes: Vec<[f32; CLASSES]> = Vec::new();
        for of_cell in placed.chunk_by(|a, b| a.0 == b.0) {
            let (mut normal, mut voted, mut likelihoods) = ([0.0; 3], [0.0; CLASSES], [0.0; CLASSES]);
            let mut weights = 0.0;
            for point in of_cell.iter().map(|(_, index)| &map[*index as usize].point) {
                normal.iter_mut().zip(point.normal).for_each(|(sum, part)| *sum += part);
                let views = f32::from(point.label.views).min(MAX_VIEWS) / MAX_VIEWS;
                let weight = 0.25 + 0.75 * views;
                let prior = if point.label.class == Class::Wall { WALL_VOTE } else { 1.0 };
                voted[point.label.class as usize] += prior * point.label.probability() * weight;
                for (class, fraction) in point.label.fractions() {
                    likelihoods[class as usize] += f32::from(fraction) / 255.0 * weight;
                }
                weights += weight;
            }
            cells.of_key.insert(of_cell[0].0, cells.keys.len() as u32);
            cells.keys.push(of_cell[0].0);
            cells.start.push(cells.start[cells.start.len() - 1] + of_cell.len() as u32);
            cells.normals.push(normal);
            cells.likelihoods.push(likelihoods.map(|sum| sum / weights));
            votes.push(voted);
        }
        cells.labels = cells.voted(&votes);
        cells.wall_yaw_rad = cells.wall_direction();
        cells
    }

    pub fn len(&self) -> usize {
        self.keys.len()
    }

    /// Returns the numbers of all cells.
    pub fn all(&self) -> std::ops::Range<u32> {
        0..self.keys.len() as u32
    }

    /// Returns a cell's centre, in metres.
    pub fn centre(&self, cell: u32) -> [f64; 3] {
        unpack(self.keys[cell as usize]).map(|c| (c as f64 + 0.5) * self.side_m)
    }

    /// Returns the centres of cells.
    pub fn centres(&self, cells: &[u32]) -> Vec<[f64; 3]> {
        cells.iter().map(|cell| self.centre(*cell)).collect()
    }

    /// Returns the box around places, along the walls if that is about as small as the smallest one.
    pub fn fit_box(&self, places: &[[f64; 3]]) -> Option<UprightBox> {
        fit_box(places, self.wall_yaw_rad, BEYOND)
    }

    /// Returns the cell that contains a position.
    pub fn at(&self, place_m: &[f64; 3]) -> Option<u32> {
        let key = pack(place_m.map(|c| (c / self.side_m).floor() as i64))?;
        self.of_key.get(&key).copied()
    }

    fn wall_direction(&self) -> Option<f64> {
        let upright = |only_walls: bool| {
            let cells = self.normals.iter().zip(&self.labels);
            let cells = cells.filter(move |(_, label)| {
                !only_walls || label.is_some_and(|(class, _)| matches!(class, Class::Wall))
            });
            let level = |n: &[f32; 3]| n[2].abs() < 0.3 * (n[0].hypot(n[1]));
            let each = cells.filter(move |(n, _)| level(n));
            wall_direction(each.map(|(n, _)| (f64::from(n[0]), f64::from(n[1]))))
        };
        upright(true).or_else(|| upright(false))
    }

    /// Returns a cell's class and its fraction of the votes; none without votes, and if it was taken out.
    pub fn label(&self, cell: u32) -> Option<(Class, f32)> {
        self.labels[cell as usize]
    }

    /// Returns a cell's class.
    pub fn class(&self, cell: u32) -> Option<Class> {
        self.label(cell).map(|(class, _)| class)
    }

    /// Takes a cell's class out.
    pub fn take_out(&mut self, cell: u32) {
        self.labels[cell as usize] = None;
    }

    /// Returns the map indices of a cell's points.
    pub fn points(&self, cell: u32) -> &[u32] {
        let cell = cell as usize;
        &self.points[self.start[cell] as usize..self.start[cell + 1] as usize]
    }

    /// Returns the later cells at most `reach` cells away along each axis.
    pub fn later(&self, cell: u32, reach: i64) -> impl Iterator<Item = u32> + '_ {
        let [x, y, z] = unpack(self.keys[cell as usize]);
        let side = -reach..=reach;
        let steps = side.clone().flat_map(move |dx| {
            let side = side.clone();
            side.clone().flat_map(move |dy| side.clone().map(move |dz| [dx, dy, dz]))
        });
        let later = steps.filter(|step| *step > [0, 0, 0]);
        later.filter_map(move |[dx, dy, dz]| self.of_key.get(&pack([x + dx, y + dy, z + dz])?).copied())
    }

    /// Returns the adjacent cells, along axes and diagonals.
    pub fn around(&self, cell: u32) -> impl Iterator<Item = u32> + '_ {
        let [x, y, z] = unpack(self.keys[cell as usize]);
        let keys =
            (0..27).filter(|i| *i != 13).map(move |i| [x + i % 3 - 1, y + i / 3 % 3 - 1, z + i / 9 - 1]);
        keys.filter_map(|key| self.of_key.get(&pack(key)?).copied())
    }

    /// Returns the mean normal of a cell's points; none if they cancel out.
    pub fn normal(&self, cell: u32) -> Option<[f32; 3]> {
        let n = nalgebra::Vector3::from(self.normals[cell as usize]).try_normalize(1e-6)?;
        Some([n.x, n.y, n.z])
    }

    /// Returns the mean probability of each class at a cell. The classes that a label left out are missing.
    pub fn likelihoods(&self, cell: u32) -> &[f32; CLASSES] {
        &self.likelihoods[cell as usize]
    }

    /// Returns each cell's class and its fraction of the votes of the cell and the cells around it on the
    /// same surface. None without votes.
    fn voted(&self, votes: &[[f32; CLASSES]]) -> Vec<Option<(Class, f32)>> {
        let unit = |n: &[f32; 3]| {
            let n = nalgebra::Vector3::from(*n);
            n.try_normalize(1e-6).unwrap_or_else(nalgebra::Vector3::zeros)
        };
        let units: Vec<nalgebra::Vector3<f32>> = self.normals.iter().map(unit).collect();
        // Sparse votes: most cells have two or three classes.
        let said: Vec<Vec<(u8, f32)>> = votes
            .iter()
            .map(|votes| (0u8..).zip(votes).filter(|(_, v)| **v > 0.0).map(|(c, v)| (c, *v)).collect())
            .collect();
        let mut sums = votes.to_vec();
        for cell in self.all() {
            for other in self.later(cell, 1) {
                let [cell, other] = [cell, other].map(|cell| cell as usize);
                // Neighbours across a surface edge count less.
                let weight = 0.25 + 0.75 * units[cell].dot(&units[other]).max(0.0);
                said[other].iter().for_each(|(class, vote)| sums[cell][usize::from(*class)] += weight * vote);
                said[cell].iter().for_each(|(class, vote)| sums[other][usize::from(*class)] += weight * vote);
            }
        }
        sums.iter().map(likeliest).collect()
    }
}

fn likeliest(sums: &[f32; CLASSES]) -> Option<(Class, f32)> {
    let total: f32 = sums.iter().sum();
    let mut best = (Class::Other, 0.0);
    for (class, sum) in Class::ALL.iter().zip(sums) {
        if *sum > best.1 {
            best = (*class, *sum);
        }
    }
    (total > 0.0).then(|| (best.0, best.1 / total))
}

/// Returns whether a point is neither floor nor ceiling.
fn is_thing(point: &MapPoint) -> bool {
    let class = point.point.label.class;
    let z = point.point.position_m[2];
    HEIGHTS_M.contains(&z)
        && !class.is_ground()
        && class != Class::Ceiling
        // Flat, low surface is floor, whatever its label.
        && !(z < 0.06 && point.point.normal[2] > 0.8)
}

/// Height of the ceiling by squares of the floor.
struct Ceiling {
    height_m: FxHashMap<[i32; 2], f32>,
}

impl Ceiling {
    const SQUARE_M: f32 = 2.0;
    /// Lowest ceiling, and the height of unseen ones.
    const LOWEST_M: f32 = 2.1;
    const USUAL_M: f32 = 2.6;
    /// Surface this far below the ceiling is a part of it.
    const THICK_M: f32 = 0.06;
    /// Fewest points that tell the height of a square.
    const FEWEST: usize = 30;

    fn new(map: &[MapPoint]) -> Ceiling {
        let mut heights: FxHashMap<[i32; 2], Vec<f32>> = FxHashMap::default();
        for point in map.iter().map(|p| &p.point) {
            if point.label.class == Class::Ceiling
                && point.normal[2] < -0.8
                && point.position_m[2] > Self::LOWEST_M
            {
                heights.entry(Self::square(&point.position_m)).or_default().push(point.position_m[2]);
            }
        }
        let known = heights.into_iter().filter(|(_, heights)| heights.len() >= Self::FEWEST);
        let height_m = known.map(|(square, mut heights)| {
            let middle = heights.len() / 2;
            (square, *heights.select_nth_unstable_by(middle, f32::total_cmp).1)
        });
        Ceiling { height_m: height_m.collect() }
    }

    fn square([x, y, _]: &[f32; 3]) -> [i32; 2] {
        [*x, *y].map(|c| (c / Self::SQUARE_M).floor() as i32)
    }

    fn holds(&self, point: &MapPoint) -> bool {
        let at = &point.point.position_m;
        let height_m = self.height_m.get(&Self::square(at)).copied().unwrap_or(Self::USUAL_M);
        at[2] > height_m - Self::THICK_M && (point.point.normal[2] < -0.5 || at[2] > height_m)
    }
}

/// Returns the packed cell index, which has the order of the places; none far outside any home.
fn pack(place: [i64; 3]) -> Option<u64> {
    let mut key = 0;
    for (c, bits) in place.into_iter().zip(BITS) {
        let half = 1i64 << (bits - 1);
        if !(-half..half).contains(&c) {
            return None;
        }
        key = key << bits | (c + half) as u64;
    }
    Some(key)
}

fn unpack(key: u64) -> [i64; 3] {
    let mut shift = u64::BITS;
    BITS.map(|bits| {
        shift -= bits;
        (key >> shift & ((1u64 << bits) - 1)) as i64 - (1i64 << (bits - 1))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use viola_reconstruct::Label;

    #[test]
    fn packed_places_keep_their_order_up_to_the_farthest_map() {
        let farthest = (1e5 / super::super::CELL_M) as i64;
        let along = [-farthest, -1, 0, 1, farthest];
        let places = along.iter().flat_map(|x| along.iter().map(move |y| (*x, *y)));
        let places: Vec<[i64; 3]> = places.flat_map(|(x, y)| [-70, 0, 70].map(|z| [x, y, z])).collect();
        let keys: Vec<u64> = places.iter().map(|place| pack(*place).unwrap()).collect();
        assert!(keys.is_sorted());
        assert_eq!(keys.into_iter().map(unpack).collect::<Vec<_>>(), places);
        for far in [[1 << 23, 0, 0], [0, -(1 << 23) - 1, 0], [0, 0, 1 << 15]] {
            assert_eq!(pack(far), None);
        }
    }

    /// At the coordinates of a survey.
    #[test]
    fn points_far_from_the_origin_are_in_cells() {
        let label = Label::new(Class::Table, 0.8, 4);
        let point = MapPoint::new([90_000.0, -90_000.0, 0.7], [0.0, 0.0, 1.0], label);
        let cells = Cells::new(&[point], super::super::CELL_M);
        assert_eq!(cells.len(), 1);
        assert_eq!(cells.at(&point.point.position_m.map(f64::from)), Some(0));
    }
}
