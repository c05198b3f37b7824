//! Joins the same feature of several pictures: features seen repeatedly are reliable.

use super::{Feature, Found};
use rustc_hash::FxHashMap;
use viola_geometry::{Point3, voxels_around};

/// Maximum distance of sightings of one feature.
const NEAR_M: f64 = 0.06;
/// Minimum similarity of their descriptions.
const ALIKE: f32 = 0.85;

/// Sightings of one feature.
struct Group {
    /// The strongest sighting.
    feature: Feature,
    strength: f32,
    sum: Point3,
    sightings: u32,
    /// Bits of the pictures that show it.
    pictures: u64,
}

fn cell(position: &Point3) -> [i32; 3] {
    [position.x, position.y, position.z].map(|c| (c / NEAR_M).floor() as i32)
}

/// Returns the features of all pictures, those of most pictures first, at most `most`.
pub(super) fn distinct(found: &[Vec<Found>], most: usize) -> Vec<Feature> {
    let mut order: Vec<(usize, &Found)> = found
        .iter()
        .enumerate()
        .flat_map(|(picture, all)| all.iter().map(move |one| (picture, one)))
        .collect();
    // Stable: equal ones stay in the order of the pictures.
    order.sort_by(|a, b| b.1.strength.total_cmp(&a.1.strength));
    let mut groups: Vec<Group> = Vec::new();
    let mut cells: FxHashMap<[i32; 3], Vec<usize>> = FxHashMap::default();
    for (picture, one) in order {
        let position = one.feature.position();
        match alike(&groups, &cells, &one.feature) {
            Some(group) => {
                let group = &mut groups[group];
                group.sum += position.coords;
                group.sightings += 1;
                group.pictures |= 1 << picture.min(63);
            }
            None => {
                cells.entry(cell(&position)).or_default().push(groups.len());
                let (feature, strength) = (one.feature, one.strength);
                groups.push(Group {
                    feature,
                    strength,
                    sum: position,
                    sightings: 1,
                    pictures: 1 << picture.min(63),
                });
            }
        }
    }
    groups.sort_by(|a, b| {
        (b.pictures.count_ones().cmp(&a.pictures.count_ones())).then(b.strength.total_cmp(&a.strength))
    });
    groups.truncate(most);
    let mean = |group: Group| {
        let mean = group.sum.coords / f64::from(group.sightings);
        Feature { position_m: mean.map(|c| c as f32).into(), ..group.feature }
    };
    groups.into_iter().map(mean).collect()
}

/// Returns the group of a feature: the most similar one near it.
fn alike(groups: &[Group], cells: &FxHashMap<[i32; 3], Vec<usize>>, feature: &Feature) -> Option<usize> {
    let position = feature.position();
    let mut best: Option<(f32, usize)> = None;
    for near in voxels_around(cell(&position)) {
        for &at in cells.get(&near).into_iter().flatten() {
            let other = &groups[at].feature;
            if (other.position() - position).norm() < NEAR_M {
                let similarity = other.descriptor.similarity(&feature.descriptor);
                let better = best.is_none_or(|(most, first)| {
                    similarity > most || (similarity.total_cmp(&most).is_eq() && at < first)
                });
                if similarity > ALIKE && better {
                    best = Some((similarity, at));
                }
            }
        }
    }
    best.map(|(_, at)| at)
}
