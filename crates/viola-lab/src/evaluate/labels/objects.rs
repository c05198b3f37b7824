//! Furniture of simulated clips against the furniture that they show.

use crate::evaluate::home::{MIN_POINTS, Matches, Thing, along, matches};
use crate::simulate::{HomeObject, SimulatedClip};
use crate::surfaces::REACH_M;
use serde::Serialize;
use std::collections::BTreeMap;
use viola_geometry::{Pose3, Vector3};
use viola_home::{MapPoint, find_objects, is_furniture};
use viola_reconstruct::PointCloud;

/// Furniture of all clips of a labelling variant, by oriented boxes.
#[derive(Debug, Clone, Default, Serialize)]
pub struct ObjectsRow {
    pub variant: String,
    pub matches: Matches,
    pub found: Vec<FoundFurniture>,
    /// Clips in which no floor was found: neither their points nor their furniture count.
    pub without_floor: usize,
}

/// A found object.
#[derive(Debug, Clone, Serialize)]
pub struct FoundFurniture {
    pub class: String,
    pub confidence: f64,
    pub right: bool,
}

impl ObjectsRow {
    /// Adds a clip, whose cloud is above its floor.
    pub(super) fn add(
        &mut self,
        cloud: &PointCloud,
        clip_from_home: &Pose3,
        recorded: &SimulatedClip,
        objects: &[HomeObject],
    ) {
        let home_from_clip = clip_from_home.inverse();
        let mut shown: BTreeMap<usize, Vec<[f64; 3]>> = BTreeMap::new();
        for point in &cloud.points {
            let (at, normal) = (home_from_clip * point.position(), home_from_clip * point.normal());
            let Some((class, instance)) = recorded.label_at(&at, &normal, REACH_M) else { continue };
            let Some(index) = usize::from(instance).checked_sub(1) else { continue };
            if objects.get(index).is_some_and(|object| object.class == class && is_furniture(class)) {
                shown.entry(index).or_default().push(point.position().into());
            }
        }
        let ahead = clip_from_home * Vector3::x();
        let truth =
            shown.into_iter().filter(|(_, points)| points.len() >= MIN_POINTS).map(|(index, points)| {
                let object = &objects[index];
                let mut bounds = along(&points, object.yaw_rad + ahead.y.atan2(ahead.x));
                // The foot is often hidden.
                let (low, top) = (object.centre_m[2] - object.size_m[2] / 2.0, bounds.top_m());
                bounds.centre_m[2] = (low + top) / 2.0;
                bounds.size_m[2] = (top - low).max(0.01);
                Thing { class: object.class, bounds }
            });
        let (truth, small): (Vec<Thing>, Vec<Thing>) = truth.partition(Thing::is_large);
        let points: Vec<MapPoint> =
            cloud.points.iter().map(|point| MapPoint { point: *point, clip: 0 }).collect();
        let found = find_objects(&points, &[], cloud.voxel_m);
        let found: Vec<_> =
            found.into_iter().map(|found| found.object).filter(|o| is_furniture(o.class)).collect();
        let things: Vec<Thing> = found.iter().map(Thing::of).collect();
        let matched = matches(&truth, &small, &things);
        let is_right = |index: usize| matched.of_truth.iter().flatten().any(|(found, _)| *found == index);
        let row = |(index, object): (usize, &viola_home::Object)| FoundFurniture {
            class: object.class.name().to_owned(),
            confidence: object.confidence,
            right: is_right(index),
        };
        let counted =
            found.iter().enumerate().filter(|(index, _)| is_right(*index) || things[*index].is_large());
        self.found.extend(counted.map(row));
        self.matches.add(&matched);
    }

    pub fn markdown(&self) -> String {
        let table = self.matches.markdown();
        format!(
            "Furniture, {} (clips without a floor, left out: {}):\n\n{table}",
            self.variant, self.without_floor
        )
    }
}
