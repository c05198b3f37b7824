//! Finds upright planes in a clip's surface by a Hough transform (Hough, 1962).

use super::sites::Sites;
use rustc_hash::{FxHashMap, FxHashSet};
use viola_geometry::{Point2, Vector2};

/// A connected upright patch.
#[derive(Debug, Clone)]
pub(super) struct Upright {
    /// Towards the seen side, in the clip frame.
    pub(super) normal: Vector2,
    /// Distance of the plane from the origin along the normal.
    pub(super) offset_m: f64,
    pub(super) members: Vec<u32>,
    pub(super) area_m2: f64,
    pub(super) low_m: f64,
    pub(super) high_m: f64,
    /// Extent along [`Upright::along`].
    pub(super) from_m: f64,
    pub(super) to_m: f64,
}

impl Upright {
    /// Returns the horizontal direction in the plane.
    pub(super) fn along(&self) -> Vector2 {
        Vector2::new(-self.normal.y, self.normal.x)
    }
}

const ANGLES: usize = 120;
const OFFSET_M: f64 = 0.03;
/// Sites further from the clip's origin than this are ignored.
const REACH_M: f64 = 40.0;
/// Angle bins on each side of its own direction that a site votes for.
const SPREAD: usize = 3;
/// Maximum distance of a member from its plane, and minimum cosine (about thirty degrees) to its normal.
const NEAR_M: f64 = 0.05;
const FACING: f64 = 0.85;
/// Minimum area of a plane.
const MIN_AREA_M2: f64 = 0.2;
/// A flat of ten rooms has about a hundred; clutter must not take all the time.
const MAX_PLANES: usize = 400;
/// Side of the cells that split a plane into patches, and the maximum step between cells of one patch.
const PATCH_CELL_M: f64 = 0.10;
const PATCH_GAP: i32 = 3;

/// Returns the patches plane by plane, the plane with the most surface first. `sites` are in the clip frame.
pub(super) fn upright_patches(sites: &Sites) -> Vec<Upright> {
    let mut votes = Votes::new(sites);
    let mut patches = Vec::new();
    for _ in 0..MAX_PLANES {
        let Some((angle, peak_m, count)) = votes.peak() else { break };
        if sites.area_m2(count as usize) < MIN_AREA_M2 {
            break;
        }
        let (normal, offset_m) = votes.fit(direction(angle), peak_m);
        let members = votes.near(&normal, offset_m, NEAR_M, FACING);
        if members.is_empty() {
            votes.clear_peak(angle, peak_m);
            continue;
        }
        votes.remove(&members);
        patches.extend(split(sites, normal, offset_m, &members));
    }
    patches
}

fn direction(angle: usize) -> Vector2 {
    let (sin, cos) = (angle as f64 * std::f64::consts::TAU / ANGLES as f64).sin_cos();
    Vector2::new(cos, sin)
}

/// Counts of upright flat sites by direction and offset.
struct Votes<'a> {
    sites: &'a Sites,
    /// The voting sites, in order.
    voters: Vec<u32>,
    counts: Vec<u32>,
    bins: usize,
}

impl<'a> Votes<'a> {
    fn new(sites: &'a Sites) -> Votes<'a> {
        let votes = |&i: &u32| {
            let i = i as usize;
            sites.smooth_normals[i].z.abs() < 0.25
                && sites.flatness[i] > 0.9
                && sites.positions_m[i].coords.xy().norm() < REACH_M
        };
        let voters: Vec<u32> = (0..sites.len() as u32).filter(votes).collect();
        let bins = (2.0 * REACH_M / OFFSET_M) as usize + 2;
        let mut this = Votes { sites, voters: Vec::new(), counts: vec![0; ANGLES * bins], bins };
        for &voter in &voters {
            this.count(voter, |count| *count += 1);
        }
        this.voters = voters;
        this
    }

    fn count(&mut self, voter: u32, change: impl Fn(&mut u32)) {
        let (normal, at) = (self.normal(voter), self.place(voter));
        let turn = normal.y.atan2(normal.x).rem_euclid(std::f64::consts::TAU) / std::f64::consts::TAU;
        let own = (turn * ANGLES as f64).round() as usize;
        for step in 0..=2 * SPREAD {
            let angle = (own + ANGLES + step - SPREAD) % ANGLES;
            let bin = ((direction(angle).dot(&at.coords) + REACH_M) / OFFSET_M) as usize;
            change(&mut self.counts[angle * self.bins + bin.min(self.bins - 1)]);
        }
    }

    fn normal(&self, site: u32) -> Vector2 {
        self.sites.smooth_normals[site as usize].xy()
    }

    fn place(&self, site: u32) -> Point2 {
        self.sites.positions_m[site as usize].xy()
    }

    /// Returns the fullest pair of neighbouring offsets: direction, the offset between them, and count.
    fn peak(&self) -> Option<(usize, f64, u32)> {
        let mut best = (0, 0, 0);
        for angle in 0..ANGLES {
            let row = &self.counts[angle * self.bins..][..self.bins];
            for (bin, pair) in row.windows(2).enumerate() {
                if pair[0] + pair[1] > best.2 {
                    best = (angle, bin, pair[0] + pair[1]);
                }
            }
        }
        (best.2 > 0).then(|| (best.0, (best.1 + 1) as f64 * OFFSET_M - REACH_M, best.2))
    }

    /// Fits a line to the sites near it, in three iterations.
    fn fit(&self, normal: Vector2, offset_m: f64) -> (Vector2, f64) {
        let (mut normal, mut offset_m) = (normal, offset_m);
        for _ in 0..3 {
            let near = self.near(&normal, offset_m, NEAR_M, 0.9);
            if near.len() < 20 {
                break;
            }
            let count = near.len() as f64;
            let mean = near.iter().map(|&i| self.place(i).coords).sum::<Vector2>() / count;
            let mut spread = nalgebra::Matrix2::zeros();
            for &i in &near {
                let off = self.place(i).coords - mean;
                spread += off * off.transpose();
            }
            let eigen = spread.symmetric_eigen();
            let across = eigen.eigenvectors.column(eigen.eigenvalues.imin()).into_owned();
            normal = if across.dot(&normal) < 0.0 { -across } else { across };
            offset_m = mean.dot(&normal);
        }
        (normal, offset_m)
    }

    fn near(&self, normal: &Vector2, offset_m: f64, near_m: f64, facing: f64) -> Vec<u32> {
        let is_near = |&i: &u32| {
            (self.place(i).coords.dot(normal) - offset_m).abs() < near_m
                && self.normal(i).dot(normal) > facing
        };
        self.voters.iter().copied().filter(is_near).collect()
    }

    /// Removes the votes of sites.
    fn remove(&mut self, members: &[u32]) {
        for &member in members {
            // A cleared peak has lost its votes already.
            self.count(member, |count| *count = count.saturating_sub(1));
        }
        let gone: FxHashSet<u32> = members.iter().copied().collect();
        self.voters.retain(|voter| !gone.contains(voter));
    }

    /// Clears a peak without members.
    fn clear_peak(&mut self, angle: usize, offset_m: f64) {
        let bin = ((offset_m + REACH_M) / OFFSET_M) as usize;
        let row = &mut self.counts[angle * self.bins..][..self.bins];
        row[bin.saturating_sub(2)..(bin + 2).min(self.bins)].fill(0);
    }
}

/// Splits a plane into its connected patches.
fn split(sites: &Sites, normal: Vector2, offset_m: f64, members: &[u32]) -> Vec<Upright> {
    let along = Vector2::new(-normal.y, normal.x);
    let place = |i: u32| {
        let at = sites.positions_m[i as usize];
        [at.coords.xy().dot(&along), at.z]
    };
    let cell = |i: u32| place(i).map(|c| (c / PATCH_CELL_M).floor() as i32);
    let mut cells: FxHashMap<[i32; 2], Vec<u32>> = FxHashMap::default();
    for &member in members {
        cells.entry(cell(member)).or_default().push(member);
    }
    let mut patches = Vec::new();
    for &member in members {
        let Some(first) = cells.remove(&cell(member)) else { continue };
        let (mut open, mut patch) = (vec![cell(member)], first);
        while let Some([x, y]) = open.pop() {
            for dy in -PATCH_GAP..=PATCH_GAP {
                for dx in -PATCH_GAP..=PATCH_GAP {
                    if let Some(more) = cells.remove(&[x + dx, y + dy]) {
                        open.push([x + dx, y + dy]);
                        patch.extend(more);
                    }
                }
            }
        }
        patch.sort_unstable();
        let mut upright = Upright {
            normal,
            offset_m,
            area_m2: sites.area_m2(patch.len()),
            low_m: f64::INFINITY,
            high_m: f64::NEG_INFINITY,
            from_m: f64::INFINITY,
            to_m: f64::NEG_INFINITY,
            members: patch,
        };
        for &i in &upright.members {
            let [t, z] = place(i);
            (upright.low_m, upright.high_m) = (upright.low_m.min(z), upright.high_m.max(z));
            (upright.from_m, upright.to_m) = (upright.from_m.min(t), upright.to_m.max(t));
        }
        patches.push(upright);
    }
    patches
}
