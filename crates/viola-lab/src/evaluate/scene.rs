//! Excerpts of a recording with known poses, against the LiDAR map of the whole scene.

use super::suite::map_fingerprint;
use super::{Case, RunError, Sample, SceneError, Suite, Survey, SurveyParams, Unit, labels};
use nalgebra::UnitQuaternion;
use serde::Deserialize;
use std::ops::Range;
use std::path::Path;
use std::sync::Arc;
use viola_align as align;
use viola_align::{AlignParams, Target};
use viola_formats::clip::Clip;
use viola_formats::lidar::LidarMap;
use viola_geometry::progress::Progress;
use viola_geometry::{LevelName, Pose2, Vector3};

/// A recording with true poses, its LiDAR map, and the transform between the two.
pub struct Scene {
    pub name: String,
    pub clip: Clip,
    pub lidar: Arc<LidarMap>,
    /// From the recording's world, turned upright the short way: `y` up becomes `z` up with (x, -z, y).
    pub map_from_world: Pose2,
    /// Up in the recording's world.
    up: Vector3,
    target: Option<Arc<Target>>,
    /// The labelled mesh in the recording's folder, if there is one.
    labels: Option<labels::Truth>,
}

#[derive(Deserialize)]
struct TruthFile {
    map_from_world: Pose2,
}

impl Scene {
    /// Opens a recording, its LiDAR map, and a JSON file with the truth.
    pub fn open(scene: &Path, lidar: &Path, truth: &Path) -> Result<Scene, SceneError> {
        let bad_truth = |cause: String| SceneError::Truth { path: truth.display().to_string(), cause };
        let text = std::fs::read_to_string(truth).map_err(|e| bad_truth(e.to_string()))?;
        let truth: TruthFile = serde_json::from_str(&text).map_err(|e| bad_truth(e.to_string()))?;
        let clip = Clip::open(scene)?;
        let up = clip.up_in_world().ok_or(SceneError::UnknownUp)?.direction;
        Ok(Scene::new(scene, clip, up, LidarMap::open(lidar)?, truth.map_from_world))
    }

    /// Opens a recording with its mesh (`mesh/*.ply`), and cuts the LiDAR map out of the mesh.
    pub fn open_with_mesh(scene: &Path, params: &SurveyParams) -> Result<(Scene, Survey), SceneError> {
        let clip = Clip::open(scene)?;
        let up = clip.up_in_world().map(|up| up.direction);
        let up = up.filter(is_z).ok_or(SceneError::NotUpright)?;
        let mesh = super::Mesh::open_in(&scene.join("mesh"))?;
        let cameras: Vec<_> = clip.frames().iter().filter_map(|frame| frame.world_from_camera).collect();
        let survey = Survey::new(&mesh, &cameras, params)?;
        let lidar = LidarMap::read(survey.points_csv().as_bytes())?;
        Ok((Scene::new(scene, clip, up, lidar, survey.map_from_world), survey))
    }

    fn new(folder: &Path, clip: Clip, up: Vector3, lidar: LidarMap, map_from_world: Pose2) -> Scene {
        let name = folder.file_name().map_or_else(String::new, |n| n.to_string_lossy().into_owned());
        let target = Target::new(&lidar).map(Arc::new);
        let labels = labels::Truth::open(folder).ok().filter(|_| is_z(&up));
        Scene { name, clip, lidar: Arc::new(lidar), map_from_world, up, target, labels }
    }

    /// Returns whether the recording's world has z up, as its mesh must.
    pub fn is_upright(&self) -> bool {
        is_z(&self.up)
    }

    /// Returns the true pose of a clip whose frame is that of frame `index`; none if that frame has no pose.
    pub fn map_from_clip(&self, index: usize) -> Option<Pose2> {
        let world_from_camera = upright(&self.up) * self.clip.frames().get(index)?.world_from_camera?;
        let heading = viola_reconstruct::heading(&world_from_camera, &Vector3::z());
        let at = world_from_camera.translation.vector;
        Some(self.map_from_world.compose(&Pose2::new(at.x, at.y, heading.y.atan2(heading.x))))
    }
}

fn is_z(up: &Vector3) -> bool {
    up.dot(&Vector3::z()) > 0.9999
}

/// Returns the shortest rotation that turns `up` to z.
fn upright(up: &Vector3) -> UnitQuaternion<f64> {
    let half_turn = || UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI);
    UnitQuaternion::rotation_between(up, &Vector3::z()).unwrap_or_else(half_turn)
}

/// Excerpts of a scene.
pub struct SceneClips {
    scene: Scene,
    cases: Vec<Case>,
    ranges: Vec<Range<usize>>,
    unit: Unit,
}

impl SceneClips {
    /// `ranges` are non-empty index ranges of the recording's frames.
    pub fn new(scene: Scene, ranges: Vec<Range<usize>>, unit: Unit) -> SceneClips {
        let headers = scene.clip.frames();
        let case = |range: &Range<usize>| Case {
            name: format!("{:06}", headers[range.start].number),
            set: scene.name.clone(),
            frames: range.len(),
        };
        SceneClips { cases: ranges.iter().map(case).collect(), scene, ranges, unit }
    }
}

impl Suite for SceneClips {
    fn cases(&self) -> &[Case] {
        &self.cases
    }

    fn fingerprint(&self) -> String {
        let Scene { name, clip, lidar, map_from_world, .. } = &self.scene;
        let (map, unit) = (map_fingerprint(lidar), self.unit.fingerprint());
        format!("{name} {:?} {map} {map_from_world:?}{unit}", clip.info())
    }

    fn sample(
        &self,
        index: usize,
        params: &AlignParams,
        progress: &dyn Progress,
    ) -> Result<Option<Sample>, RunError> {
        let headers = self.scene.clip.frames();
        let range = self.ranges[index].clone();
        let Some(begin) = range.clone().find(|&i| headers[i].world_from_camera.is_some()) else {
            return Ok(None);
        };
        let numbers = headers[range.start].number..headers[range.end - 1].number + 1;
        let (clip, scale) = self.unit.applied(self.scene.clip.clone(), index as u64);
        let targets: Vec<&Target> = self.scene.target.iter().map(Arc::as_ref).collect();
        let observation = align::observe_any_scale(&targets, &clip, Some(numbers.clone()), params, progress)
            .map_err(|error| RunError::of_clip(&self.cases[index].name, error))?;
        let first = observation.first_camera.as_ref().map_or(begin, |camera| camera.index);
        let Some(map_from_clip) = self.scene.map_from_clip(first) else { return Ok(None) };
        // The labels are in metres, and the excerpt is not.
        let labels = self.scene.labels.as_ref().filter(|_| self.unit == Unit::Metres);
        let floor_in_sight = labels.and_then(|truth| labels::shows_floor(&observation, truth));
        Ok(Some(Sample {
            observation,
            lidar: self.scene.lidar.clone(),
            target: self.scene.target.clone(),
            level: LevelName::MAIN,
            other_levels: Vec::new(),
            map_from_clip: Some(map_from_clip),
            unknowable: None,
            floor_in_sight,
            scale,
            first_frame: numbers.start,
            last_frame: numbers.end - 1,
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_world_is_turned_upright_the_short_way() {
        let place = Vector3::new(1.0, 2.0, 3.0);
        for (up, want) in [
            (Vector3::z(), place),
            (Vector3::y(), Vector3::new(1.0, -3.0, 2.0)),
            (-Vector3::z(), Vector3::new(1.0, -2.0, -3.0)),
        ] {
            let turned = upright(&up) * place;
            assert!((turned - want).norm() < 1e-12, "{up:?}: {turned:?}");
            assert!((upright(&up) * up - Vector3::z()).norm() < 1e-12, "{up:?}");
        }
    }
}
