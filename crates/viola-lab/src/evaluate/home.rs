//! Evaluation of a home's map against a labelled mesh: surface, rooms, objects.

mod changes;
mod clips;
mod filmed;
mod floor_plan;
mod fused;
mod instances;
mod joint;
mod matching;
mod member;
mod mesh_surface;
mod mesh_walls;
mod score;
mod shown;
mod simulated;
mod surface;
mod visit;

pub use changes::{ChangesHome, ChangesRow, changes};
pub use clips::ClipsError;
pub use filmed::film;
pub use floor_plan::{PlanScore, TruePlan, score_plan};
pub use fused::{Agreement, Excerpt, Fused, consecutive, fuse};
pub use instances::{Instance, LabelledMesh, MIN_EXTENT_M, along_axes};
pub use joint::{JointClip, JointHome, JointMatch, JointMode, JointRow, joint};
pub use matching::{ClassRow, MIN_IOU, Matches, Thing, matches};
pub use mesh_surface::{MeshScore, score_mesh};
pub use mesh_walls::{WallScore, score_walls};
pub use score::{FoundRow, ObjectScore, TruthRow, score_objects};
pub(super) use shown::{MIN_POINTS, along};
pub use simulated::{ComputedHome, SampleParams, SimulatedMap, SimulatedScore, TrueRoom, sample, simulated};
pub use surface::{Seen, SurfaceScore, compare, seen_by};

use super::labels::LabelRow;
use super::{MeshError, Scene, labels};
use serde::Serialize;
use std::fmt::Write;
use std::ops::Range;
use std::path::Path;
use viola_align::{AlignError, AlignParams};
use viola_formats::clip::ClipError;
use viola_geometry::Point3;
use viola_geometry::progress::Progress;
use viola_home as home;
use viola_home::{Coverage, Object, Plan, Room};
use viola_reconstruct::{NO_COLOR, PointCloud};

/// Results of one scene.
#[derive(Debug, Clone, Serialize)]
pub struct HomeReport {
    pub excerpts: Vec<Excerpt>,
    pub agreement: Agreement,
    pub surface: SurfaceScore,
    pub mesh: MeshScore,
    /// The plan's walls.
    pub walls: WallScore,
    /// Classes of the single clips and of the map, on the same vertices.
    pub labels: [LabelRow; 2],
    /// Fused points that no picture showed.
    pub uncolored: usize,
    pub coverage: Coverage,
    pub rooms: Vec<Room>,
    pub objects: Vec<Object>,
    pub score: ObjectScore,
}

#[derive(Debug, thiserror::Error)]
pub enum HomeError {
    #[error(transparent)]
    Align(#[from] AlignError),
    #[error(transparent)]
    Clip(#[from] ClipError),
    #[error("the labelled mesh: {0}")]
    Mesh(#[from] MeshError),
    #[error(transparent)]
    Truth(#[from] labels::TruthError),
    #[error("the recording is shorter than one excerpt")]
    TooShort,
    #[error("the recording's world has another axis than z up; its mesh cannot be compared")]
    NotUpright,
}

/// Aligns and merges the excerpts of a scene, and compares the map with the labelled mesh in `folder/mesh`. `progress`
/// is called with the name of each excerpt.
pub fn evaluate(
    scene: &Scene,
    folder: &Path,
    ranges: &[Range<usize>],
    params: &AlignParams,
    progress: &dyn Fn(String) -> Box<dyn Progress>,
) -> Result<(HomeReport, Plan), HomeError> {
    if ranges.is_empty() {
        return Err(HomeError::TooShort);
    }
    if !scene.is_upright() {
        return Err(HomeError::NotUpright);
    }
    let mesh = super::Mesh::open_labelled_in(&folder.join("mesh"))?;
    let mesh = LabelledMesh::new(mesh, &labels::Folding::open(folder)?);
    let Fused { points: map, tiles, excerpts, agreement, clips } = fuse(scene, ranges, params, progress)?;
    let rooms = home::rooms(&scene.lidar, &map);
    let found = home::find_objects(&map, &rooms, home::MAP_VOXEL_M);
    let objects: Vec<Object> = found.iter().map(|found| found.object.clone()).collect();
    let plan = home::plan(&scene.lidar, &map, &rooms, &objects);
    let truth = mesh.instances(&scene.map_from_world, home::is_furniture);
    let placed = excerpts.iter().filter(|excerpt| excerpt.placed_by.is_some());
    let frames: Vec<Range<usize>> = placed.map(|excerpt| excerpt.frames.clone()).collect();
    let seen = seen_by(&scene.clip, &frames, &mesh)?;
    let made = home::Mesh::new(&tiles, &[], home::MESH_TRIANGLES);
    let cloud = PointCloud { points: map.iter().map(|p| p.point).collect(), voxel_m: home::MAP_VOXEL_M };
    let in_map = |vertex: &Point3| Point3::from(mesh.in_map(vertex, &scene.map_from_world));
    let report = HomeReport {
        labels: labels::together(&labels::Truth::open(folder)?, &clips, &cloud, in_map),
        uncolored: map.iter().filter(|p| p.point.color == NO_COLOR).count(),
        surface: compare(&map, &mesh, &seen.in_pictures, &scene.map_from_world),
        mesh: score_mesh(&made, &mesh, &seen.in_depth, &scene.map_from_world),
        walls: score_walls(&plan, &mesh, &seen.in_pictures, &scene.map_from_world),
        coverage: home::coverage(&scene.lidar, &map, &rooms),
        score: score_objects(&map, &found, &truth, &mesh, &scene.map_from_world),
        excerpts,
        agreement,
        rooms,
        objects,
    };
    Ok((report, plan))
}

impl HomeReport {
    /// Returns the report as Markdown tables.
    pub fn markdown(&self) -> String {
        let percent = |fraction: f64| match fraction {
            nothing if nothing.is_nan() => "-".to_owned(),
            fraction => format!("{:.1} %", fraction * 100.0),
        };
        let aligned = self.excerpts.iter().filter(|e| e.state == viola_align::AlignmentState::Aligned);
        let placed: Vec<&Excerpt> = self.excerpts.iter().filter(|e| e.placed_by.is_some()).collect();
        let by_others = placed.iter().filter(|e| e.placed_by == Some(home::PlacedBy::Neighbours));
        let with_truth = placed.iter().filter(|e| e.together_m.is_some());
        let wrong = placed.iter().filter(|e| e.is_wrong());
        let mut out = format!(
            "{} of {} excerpts aligned, {} placed by the others; {} of the {} placed ones with a true pose wrong (0.3 m, 10 \
             degrees)\n\n",
            aligned.count(),
            self.excerpts.len(),
            by_others.count(),
            wrong.count(),
            with_truth.count()
        );
        let alone = mean_error(&placed, |e| e.error_m, |e| e.error_deg);
        let together = mean_error(&placed, |e| e.together_m, |e| e.together_deg);
        // Writing into a string cannot fail.
        let _ = writeln!(
            out,
            "| | mean error of poses | overlaps' disagreement ({} pairs) |\n|---|---|---|\n\
             | each clip alone | {alone} | {:.1} mm |\n| refined together | {together} | {:.1} mm |\n",
            self.agreement.pairs,
            1e3 * self.agreement.alone_m,
            1e3 * self.agreement.together_m
        );
        let _ = writeln!(
            out,
            "| fused points | within 5 cm of the mesh | vertices seen | with a point within 5 cm | LiDAR map explained | \
             floor seen |\n|---|---|---|---|---|---|\n| {} | {} | {} | {} | {} | {} |\n",
            self.surface.points,
            percent(self.surface.accuracy),
            self.surface.seen_vertices,
            percent(self.surface.completeness),
            percent(self.coverage.seen),
            percent(self.coverage.floor_seen)
        );
        let _ = writeln!(out, "{}", self.mesh.markdown());
        let _ = writeln!(out, "{} of the fused points have no colour.\n", self.uncolored);
        let _ = writeln!(out, "{}", self.walls.markdown());
        let _ = writeln!(out, "{}", labels::markdown(&self.labels));
        let _ = writeln!(out, "| room | area | corners | objects |\n|---|---|---|---|");
        for room in &self.rooms {
            let inside = self.objects.iter().filter(|o| o.room.as_ref() == Some(&room.id)).count();
            let name = room.name.as_deref().unwrap_or(&room.id);
            let _ =
                writeln!(out, "| {name} | {:.1} m2 | {} | {inside} |", room.area_m2, room.polygon_m.len());
        }
        let _ = write!(
            out,
            "\nFurniture over {MIN_EXTENT_M} m, same class, 3D IoU of at least {MIN_IOU} of boxes along the axes of the \
             recording's world:\n\n{}",
            self.score.along_axes.markdown()
        );
        let oriented = &self.score.oriented.total;
        let _ = writeln!(
            out,
            "\nWith turned boxes {} of {} matched, precision {}. Neither right nor wrong, for the truth does not label \
             them: {}.",
            oriented.matched,
            oriented.truth,
            percent(oriented.precision()),
            if self.score.unjudged.is_empty() { "none".to_owned() } else { self.score.unjudged.join(", ") }
        );
        out
    }
}

/// Returns the mean error of the excerpts that have a pose alone and in the map; `-` without any.
fn mean_error(
    excerpts: &[&Excerpt],
    error_m: fn(&Excerpt) -> Option<f64>,
    error_deg: fn(&Excerpt) -> Option<f64>,
) -> String {
    let both = excerpts.iter().filter(|e| e.error_m.is_some() && e.together_m.is_some());
    let errors: Vec<(f64, f64)> = both.filter_map(|e| error_m(e).zip(error_deg(e))).collect();
    if errors.is_empty() {
        return "-".to_owned();
    }
    let mean = |of: fn(&(f64, f64)) -> f64| errors.iter().map(of).sum::<f64>() / errors.len() as f64;
    format!("{:.1} cm, {:.2} deg", 100.0 * mean(|error| error.0), mean(|error| error.1))
}

#[cfg(test)]
mod tests {
    use super::*;
    use viola_align::AlignmentState;

    #[test]
    fn rows_are_means_of_the_same_excerpts() {
        let excerpt = |error_m: Option<f64>, together_m: Option<f64>| Excerpt {
            frames: 0..1,
            state: AlignmentState::Aligned,
            map_from_clip: None,
            error_m,
            error_deg: error_m,
            placed_by: None,
            together_m,
            together_deg: together_m,
        };
        let excerpts = [excerpt(Some(0.02), Some(0.01)), excerpt(None, Some(9.0)), excerpt(Some(9.0), None)];
        let excerpts: Vec<&Excerpt> = excerpts.iter().collect();
        let mean = |excerpts: &[&Excerpt]| mean_error(excerpts, |e| e.together_m, |e| e.together_deg);
        assert_eq!(mean(&excerpts), "1.0 cm, 0.01 deg");
        assert_eq!(mean(&excerpts[1..]), "-");
    }
}
