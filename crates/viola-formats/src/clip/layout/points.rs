//! A point cloud and the camera's path, as learned reconstructions of plain video write them: `NAME.ply` beside
//! `NAME.txt` (MASt3R-SLAM) or `trajectory.txt`, with rows of TUM RGB-D: time tx ty tz qx qy qz qw. Any unit.
//!
//! Each pose sees the points that no nearer ones hide; so the rest of the program has its depth pictures.

use super::trajectory::Timed;
use super::tum::read_poses;
use super::{Cameras, ClipError, ColorAt, DepthAt, Intrinsics, Layout, Numbers, Of, Source};
use crate::clip::MAX_FRAMES;
use crate::clip::files::find_file;
use crate::clip::rendered::Cloud;
use crate::container::Container;
use crate::ply::Vertices;
use std::sync::Arc;
use viola_geometry::Pose3;

/// Eight million points with colour in binary; with [`MAX_POINTS`] below the bound of a reader's memory.
const MAX_PLY_BYTES: u64 = 120 << 20;
/// More points are thinned: 48 MB.
const MAX_POINTS: u64 = 4_000_000;
/// Bounds the time: more poses are thinned. About 20 s of one thread.
const MAX_PROJECTIONS: usize = 2_000_000_000;
/// A view of 60 x 47 degrees, narrower than most phones': the path does not tell the camera.
const VIEW: Numbers = Numbers { fx: 166.0, fy: 166.0, cx: 95.5, cy: 71.5, of: Of::Depth };
const VIEW_SIZE: (u32, u32) = (192, 144);

/// Finds the cloud in a container; returns `None` if there is none with a path.
pub(super) fn find(container: &dyn Container) -> Result<Option<Layout>, ClipError> {
    let mut found = container.names().iter().filter_map(|name| Some((name, path_beside(container, name)?)));
    let Some((cloud, path)) = found.next() else { return Ok(None) };
    if let Some((second, _)) = found.next() {
        return Err(ClipError::SeveralClips { first: cloud.clone(), second: second.clone() });
    }
    layout(container, cloud, &path).map(Some)
}

/// Returns the name of the path beside a cloud; `None` if the file is no cloud or has no path.
fn path_beside(container: &dyn Container, name: &str) -> Option<String> {
    let (stem, _) = name.rsplit_once('.').filter(|(_, ending)| ending.eq_ignore_ascii_case("ply"))?;
    let folder = &name[..name.rfind('/').map_or(0, |slash| slash + 1)];
    let paths = [format!("{stem}.txt"), format!("{folder}trajectory.txt")];
    paths.iter().find_map(|path| find_file(container, path))
}

fn layout(container: &dyn Container, name: &str, path: &str) -> Result<Layout, ClipError> {
    let (cloud, read) = read_cloud(container, name)?;
    let mut notes = vec![
        "the unit of the points is unknown: the alignment finds the scale".to_string(),
        "depth was rendered from the points with a view of 60 x 47 degrees".to_string(),
    ];
    let poses = read_poses(container, path, &mut notes)?;
    if cloud.points.len() as u64 != read {
        notes.push(format!("{} of {read} points were taken", cloud.points.len()));
    }
    let step = (poses.len() * cloud.points.len()).div_ceil(MAX_PROJECTIONS);
    let step = step.max(poses.len().div_ceil(MAX_FRAMES)).max(1);
    if step > 1 {
        notes.push(format!("one of {step} poses was taken"));
    }
    let count = poses.len().div_ceil(step);
    let cloud = Arc::new(cloud);
    let source = |(number, Timed { time_s, value: world_from_camera }): (usize, Timed<Pose3>)| {
        let depth = DepthAt::Rendered { cloud: cloud.clone(), world_from_camera, size: VIEW_SIZE };
        Source {
            time_s: Some(time_s),
            world_from_camera: Some(world_from_camera),
            ..Source::new(number as u32, ColorAt::Absent, depth)
        }
    };
    let sources = poses.into_iter().step_by(step).enumerate().map(source).collect();
    let camera = Intrinsics { name: "the view of a point cloud".to_string(), numbers: VIEW };
    Ok(Layout {
        pose_files: "the trajectory",
        depth_unit: "unit of the reconstruction (rendered)",
        metric: false,
        depth_pictures: count,
        intrinsics: "assumed: fx = fy = 166 for 192x144".to_string(),
        notes,
        ..Layout::new("points", Cameras::One(camera), sources)
    })
}

/// Returns the vertices with finite positions, thinned to [`MAX_POINTS`], and the number of vertices.
fn read_cloud(container: &dyn Container, name: &str) -> Result<(Cloud, u64), ClipError> {
    let bad = |reason: String| ClipError::BadMetadata { name: name.to_string(), reason };
    let bytes = container.read(name, MAX_PLY_BYTES)?;
    let mut vertices = Vertices::parse(&bytes).map_err(|error| bad(error.to_string()))?;
    let places = ["x", "y", "z"].map(|axis| vertices.element.place(axis));
    let [Some(x), Some(y), Some(z)] = places else {
        return Err(bad("its vertices have no x, y and z".to_string()));
    };
    let step = vertices.element.count.div_ceil(MAX_POINTS).max(1);
    let (mut cloud, mut read) = (Cloud::default(), 0);
    while let Some(values) = vertices.read().map_err(|error| bad(error.to_string()))? {
        let point = [values[x], values[y], values[z]].map(|value| value as f32);
        if read % step == 0 && point.iter().all(|value| value.is_finite()) {
            cloud.points.push(point);
        }
        read += 1;
    }
    if cloud.points.is_empty() {
        return Err(bad("it has no points".to_string()));
    }
    Ok((cloud, read))
}
