//! Scores found objects against the truth.

use super::instances::{Instance, LabelledMesh, along_axes};
use super::matching::{Matches, Thing, matches};
use crate::evaluate::cells::Cells;
use serde::Serialize;
use viola_geometry::taxonomy::Class;
use viola_geometry::{Point2, Point3, Pose2};
use viola_home::{Found, MapPoint, UprightBox, is_furniture};

/// Maximum distance from a map point to its vertex.
const NEAR_M: f64 = 0.1;
/// Fraction of outliers allowed beyond each face of a found object's box along the axes of the world.
const BEYOND: f64 = 0.01;

/// Score of the found objects.
#[derive(Debug, Clone, Serialize)]
pub struct ObjectScore {
    /// With boxes along the axes of the world, as in ScanNet's detection benchmark.
    pub along_axes: Matches,
    /// With oriented upright boxes.
    pub oriented: Matches,
    /// Found objects of classes absent from the truth, on unlabelled surface: neither right nor wrong.
    pub unjudged: Vec<String>,
    /// By oriented boxes.
    pub truth: Vec<TruthRow>,
    pub found: Vec<FoundRow>,
}

/// A ground-truth object.
#[derive(Debug, Clone, Serialize)]
pub struct TruthRow {
    pub class: Class,
    pub centre_m: [f64; 3],
    pub size_m: [f64; 3],
    pub yaw_rad: f64,
    pub found: Option<String>,
    pub iou: Option<f64>,
    /// The found object with the largest IoU, of any class.
    pub nearest: Option<String>,
}

/// A found object.
#[derive(Debug, Clone, Serialize)]
pub struct FoundRow {
    pub id: String,
    pub right: bool,
    pub confidence: f64,
    /// True classes of its points with their fractions, the largest first; `-` is unlabelled.
    pub truth: Vec<(String, f64)>,
}

/// Scores the found furniture. Objects shorter than half a metre along all axes count only if matched.
pub fn score_objects(
    map: &[MapPoint],
    found: &[Found],
    truth: &[Instance],
    mesh: &LabelledMesh,
    map_from_world: &Pose2,
) -> ObjectScore {
    let world_from_map = map_from_world.inverse();
    let named = Named::new(mesh, map_from_world);
    let is_known = |class: Class| mesh.classes.contains(&Some(class));
    let (mut counted, mut unjudged, mut rows) = (Vec::new(), Vec::new(), Vec::new());
    for found in found.iter().filter(|found| is_furniture(found.object.class)) {
        let world_box = world_box(found, map, &world_from_map);
        let said = named.said(found, map);
        let unlabelled =
            said.iter().find(|(name, _)| name == UNLABELLED).map_or(0.0, |(_, fraction)| *fraction);
        let id = found.object.id.clone();
        if !is_known(found.object.class) && unlabelled > 0.5 {
            unjudged.push(id);
            continue;
        }
        rows.push(FoundRow { id, right: false, confidence: found.object.confidence, truth: said });
        counted.push((found, world_box));
    }
    let thing = |class: Class, bounds: UprightBox| Thing { class, bounds };
    let found_in_world: Vec<Thing> =
        counted.iter().map(|(found, bounds)| thing(found.object.class, *bounds)).collect();
    let found_in_map: Vec<Thing> = counted.iter().map(|(found, _)| Thing::of(&found.object)).collect();
    let truth_in_world: Vec<Thing> = truth.iter().map(|t| thing(t.class, t.world_box)).collect();
    let truth_in_map: Vec<Thing> = truth.iter().map(|t| thing(t.class, t.map_box)).collect();
    let oriented = matches(&truth_in_map, &[], &found_in_map);
    for (f, _) in oriented.of_truth.iter().flatten() {
        rows[*f].right = true;
    }
    let truth_rows = truth.iter().zip(&oriented.of_truth).map(|(instance, matched)| {
        let ious = found_in_map.iter().enumerate().map(|(f, o)| (f, instance.map_box.iou(&o.bounds)));
        let nearest = ious.filter(|(_, iou)| *iou > 0.0).max_by(|a, b| a.1.total_cmp(&b.1));
        let id = |f: usize| rows[f].id.clone();
        TruthRow {
            class: instance.class,
            centre_m: instance.map_box.centre_m,
            size_m: instance.map_box.size_m,
            yaw_rad: instance.map_box.yaw_rad,
            found: matched.map(|(f, _)| id(f)),
            iou: matched.map(|(_, iou)| iou),
            nearest: nearest.map(|(f, iou)| format!("{} ({iou:.2})", id(f))),
        }
    });
    ObjectScore {
        truth: truth_rows.collect(),
        along_axes: matches(&truth_in_world, &[], &found_in_world),
        oriented,
        unjudged,
        found: rows,
    }
}

/// Returns a found object's box along the axes of the world: x and y of its points, z of its own box.
fn world_box(found: &Found, map: &[MapPoint], world_from_map: &Pose2) -> UprightBox {
    let place = |i: &u32| {
        let [x, y, z] = map[*i as usize].point.position_m.map(f64::from);
        let at = world_from_map.apply(&Point2::new(x, y));
        [at.x, at.y, z]
    };
    let points: Vec<[f64; 3]> = found.members.iter().map(place).collect();
    let mut bounds = along_axes(&points, BEYOND);
    bounds.centre_m[2] = found.object.centre_m[2];
    bounds.size_m[2] = found.object.size_m[2];
    bounds
}

const UNLABELLED: &str = "-";

/// Cell grid of the mesh's vertices.
struct Named<'a> {
    mesh: &'a LabelledMesh,
    cells: Cells<(Point3, u32)>,
}

impl Named<'_> {
    fn new<'a>(mesh: &'a LabelledMesh, map_from_world: &Pose2) -> Named<'a> {
        let placed = (0u32..).zip(&mesh.mesh.vertices_m).map(|(i, vertex)| {
            let at = Point3::from(mesh.in_map(vertex, map_from_world));
            (at, (at, i))
        });
        Named { mesh, cells: Cells::new(NEAR_M, placed) }
    }

    /// Returns the fractions of the object's points by class of the nearest vertex, if one is near.
    fn said(&self, found: &Found, map: &[MapPoint]) -> Vec<(String, f64)> {
        let mut counts: std::collections::BTreeMap<String, usize> = Default::default();
        for i in &found.members {
            let at = map[*i as usize].point.position();
            let near =
                self.cells.around(&at).map(|(p, i)| ((p - at).norm(), *i)).filter(|(m, _)| *m <= NEAR_M);
            let nearest = near.min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            let class = nearest.and_then(|(_, i)| self.mesh.classes[i as usize]);
            *counts.entry(class.map_or(UNLABELLED, Class::name).to_owned()).or_default() += 1;
        }
        let all = found.members.len().max(1) as f64;
        let fraction = |count: usize| (count as f64 / all * 1e3).round() / 1e3;
        let mut said: Vec<(String, f64)> = counts.into_iter().map(|(name, n)| (name, fraction(n))).collect();
        said.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
        said
    }
}
