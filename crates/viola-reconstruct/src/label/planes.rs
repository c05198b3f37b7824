//! Finds upright planes in a clip's surface by a Hough transform (Hough, 1962).

use super::sites::Sites;
use rayon::prelude::*;
use rustc_hash::FxHashMap;
use viola_geometry::Vector2;

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
        let members = votes.take(normal, offset_m);
        if members.is_empty() {
            votes.clear_peak(angle, peak_m);
            continue;
        }
        patches.extend(split(sites, normal, offset_m, &members));
    }
    patches
}

fn direction(angle: usize) -> Vector2 {
    let (sin, cos) = (angle as f64 * std::f64::consts::TAU / ANGLES as f64).sin_cos();
    Vector2::new(cos, sin)
}

/// Counts of upright flat sites by direction and offset.
struct Votes {
    /// The voting sites that belong to no plane yet, in order.
    voters: Vec<Voter>,
    directions: Vec<Vector2>,
    counts: Vec<u32>,
    bins: usize,
    /// The bins that ever counted a vote.
    used: std::ops::Range<usize>,
}

#[derive(Debug, Clone, Copy)]
struct Voter {
    site: u32,
    at: Vector2,
    normal: Vector2,
}

impl Votes {
    fn new(sites: &Sites) -> Votes {
        let votes = |&i: &usize| {
            sites.smooth_normals[i].z.abs() < 0.25
                && sites.flatness[i] > 0.9
                && sites.positions_m[i].coords.xy().norm() < REACH_M
        };
        let voter = |i: usize| Voter {
            site: i as u32,
            at: sites.positions_m[i].coords.xy(),
            normal: sites.smooth_normals[i].xy(),
        };
        let voters: Vec<Voter> = (0..sites.len()).filter(votes).map(voter).collect();
        let bins = (2.0 * REACH_M / OFFSET_M) as usize + 2;
        let directions = (0..ANGLES).map(direction).collect();
        let mut this =
            Votes { voters: Vec::new(), directions, counts: vec![0; ANGLES * bins], bins, used: bins..0 };
        for voter in &voters {
            this.count(voter, |count| *count += 1);
        }
        this.voters = voters;
        this
    }

    fn count(&mut self, voter: &Voter, change: impl Fn(&mut u32)) {
        let turn = voter.normal.y.atan2(voter.normal.x).rem_euclid(std::f64::consts::TAU);
        let own = (turn / std::f64::consts::TAU * ANGLES as f64).round() as usize;
        for step in 0..=2 * SPREAD {
            let angle = (own + ANGLES + step - SPREAD) % ANGLES;
            let bin = ((self.directions[angle].dot(&voter.at) + REACH_M) / OFFSET_M) as usize;
            let bin = bin.min(self.bins - 1);
            self.used = self.used.start.min(bin)..self.used.end.max(bin + 1);
            change(&mut self.counts[angle * self.bins + bin]);
        }
    }

    /// Returns the fullest pair of neighbouring offsets: direction, the offset between them, and count.
    fn peak(&self) -> Option<(usize, f64, u32)> {
        let mut best = (0, 0, 0);
        // A pair with one bin that ever counted.
        let first = self.used.start.saturating_sub(1);
        let end = (self.used.end + 1).min(self.bins);
        for angle in 0..ANGLES {
            let row = &self.counts[angle * self.bins..][first..end.max(first)];
            for (bin, pair) in row.windows(2).enumerate() {
                if pair[0] + pair[1] > best.2 {
                    best = (angle, first + bin, pair[0] + pair[1]);
                }
            }
        }
        (best.2 > 0).then(|| (best.0, (best.1 + 1) as f64 * OFFSET_M - REACH_M, best.2))
    }

    /// Fits a line to the sites near it, in three iterations.
    fn fit(&self, normal: Vector2, offset_m: f64) -> (Vector2, f64) {
        let (mut normal, mut offset_m) = (normal, offset_m);
        for _ in 0..3 {
            let near: Vec<Vector2> = self.near(normal, offset_m, 0.9).map(|voter| voter.at).collect();
            if near.len() < 20 {
                break;
            }
            let mean = near.iter().sum::<Vector2>() / near.len() as f64;
            let mut spread = nalgebra::Matrix2::zeros();
            for at in &near {
                let off = at - mean;
                spread += off * off.transpose();
            }
            let eigen = spread.symmetric_eigen();
            let across = eigen.eigenvectors.column(eigen.eigenvalues.imin()).into_owned();
            normal = if across.dot(&normal) < 0.0 { -across } else { across };
            offset_m = mean.dot(&normal);
        }
        (normal, offset_m)
    }

    /// Returns the voters within [`NEAR_M`] of a plane whose normals are within an angle, by its cosine, of the plane's, in
    /// their order.
    fn near(&self, normal: Vector2, offset_m: f64, facing: f64) -> impl ParallelIterator<Item = &Voter> {
        let is_near = move |voter: &&Voter| {
            (voter.at.dot(&normal) - offset_m).abs() < NEAR_M && voter.normal.dot(&normal) > facing
        };
        self.voters.par_iter().with_min_len(4096).filter(is_near)
    }

    /// Takes the voters of a plane out, with their votes; returns their sites, in order.
    fn take(&mut self, normal: Vector2, offset_m: f64) -> Vec<u32> {
        let members: Vec<Voter> = self.near(normal, offset_m, FACING).copied().collect();
        for member in &members {
            // A cleared peak has lost its votes already.
            self.count(member, |count| *count = count.saturating_sub(1));
        }
        // Both are in the order of the sites.
        let mut gone = members.iter().peekable();
        self.voters.retain(|voter| gone.next_if(|member| member.site == voter.site).is_none());
        members.iter().map(|member| member.site).collect()
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
