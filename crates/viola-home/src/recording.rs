//! One level of a home's map as a recording: an MCAP file with messages of Foxglove's schemas.
//!
//! All messages have one time: a map is a state and has no course. Points are written in parts, so that memory does
//! not grow with the map.

mod grid;
mod mcap;
mod messages;
mod schema;

use crate::light::shown;
use crate::{MapPoint, UprightBox};
use mcap::Mcap;
use messages::{
    CubePrimitive, FLOAT32, FrameTransform, FrameTransforms, Grid, KeyValuePair, PointCloud, Pose,
    PosesInFrame, SceneEntity, SceneUpdate, TextPrimitive, UINT8, UINT16, Vector3, color, fields, in_space,
};
use prost_types::Timestamp;
use std::io::{self, Write};
use uuid::Uuid;
use viola_formats::lidar::LidarMap;
use viola_geometry::taxonomy::Class;
use viola_geometry::{LevelName, Pose2, Pose3};

/// The frame of everything but the clips.
const MAP_FRAME: &str = "map";
/// Maximum number of points of a message. Viewers show the last message of a topic, so each part has a topic.
const PART_POINTS: usize = 200_000;
const POINT_BYTES: usize = 24;
/// Maximum number of camera poses of a clip's path.
const MAX_PATH_POSES: usize = 500;
/// Height of the letters of an object's name.
const LETTERS_M: f64 = 0.12;

/// The way of a clip's camera.
#[derive(Debug, Clone, PartialEq)]
pub struct ClipPath {
    pub clip: Uuid,
    pub map_from_clip: Pose2,
    /// Height of the clip frame's origin above the floor there.
    pub rise_m: f64,
    /// At most [`MAX_PATH_POSES`].
    clip_from_cameras: Vec<Pose3>,
}

impl ClipPath {
    /// Keeps evenly spaced poses if there are too many.
    pub fn new(clip: Uuid, map_from_clip: Pose2, rise_m: f64, clip_from_cameras: &[Pose3]) -> ClipPath {
        let every = clip_from_cameras.len().div_ceil(MAX_PATH_POSES).max(1);
        let clip_from_cameras = clip_from_cameras.iter().step_by(every).copied().collect();
        ClipPath { clip, map_from_clip, rise_m, clip_from_cameras }
    }

    fn in_space(&self) -> Pose3 {
        in_space(&self.map_from_clip, self.rise_m)
    }
}

/// An object of a recording.
#[derive(Debug, Clone, PartialEq)]
pub struct RecordedObject<'a> {
    pub id: &'a str,
    /// Name that a person gave it.
    pub name: Option<&'a str>,
    pub class: Class,
    pub confidence: f64,
    pub bounds: UprightBox,
}

/// One level of a home's map, apart from its points.
pub struct Recording<'a> {
    pub level: LevelName,
    /// Time of all messages since 1970, in milliseconds.
    pub time_ms: i64,
    pub paths: &'a [ClipPath],
    pub objects: &'a [RecordedObject<'a>],
    pub lidar: Option<&'a LidarMap>,
}

impl Recording<'_> {
    /// Maximum number of clips whose path has cameras: each has a topic, and is in memory.
    pub const MAX_PATHS: usize = 1000;

    /// Writes an MCAP file.
    pub fn write<W: Write>(
        &self,
        out: W,
        points: impl IntoIterator<Item = io::Result<MapPoint>>,
    ) -> io::Result<()> {
        let time_ns = u64::try_from(self.time_ms).unwrap_or_default().saturating_mul(1_000_000);
        let mut file = Mcap::new(out, time_ns, schema::descriptors(messages::schemas()))?;
        file.message("/tf", &self.transforms())?;
        if let Some(lidar) = self.lidar {
            let grid = Grid {
                timestamp: Some(self.timestamp()),
                frame_id: MAP_FRAME.to_owned(),
                ..grid::grid(lidar)
            };
            file.message("/lidar_map", &grid)?;
        }
        file.message("/objects", &self.scene())?;
        let is_known = |path: &&ClipPath| !path.clip_from_cameras.is_empty();
        for path in self.paths.iter().filter(is_known).take(Recording::MAX_PATHS) {
            file.message(&format!("/clips/{}/path", path.clip), &self.path(path))?;
        }
        let count = self.write_points(&mut file, points)?;
        file.metadata("viola", &self.about(count))?;
        file.finish()
    }

    /// Writes the points in parts and returns their number.
    fn write_points<W: Write>(
        &self,
        file: &mut Mcap<W>,
        points: impl IntoIterator<Item = io::Result<MapPoint>>,
    ) -> io::Result<usize> {
        let mut count = 0;
        let mut points = points.into_iter().peekable();
        for part in 1.. {
            let mut data = Vec::new();
            for point in points.by_ref().take(PART_POINTS) {
                data.extend_from_slice(&point_bytes(&point?));
            }
            count += data.len() / POINT_BYTES;
            let topic = if part == 1 { "/map/points".to_owned() } else { format!("/map/points/{part}") };
            file.message(&topic, &self.cloud(data))?;
            if points.peek().is_none() {
                break;
            }
        }
        Ok(count)
    }

    fn timestamp(&self) -> Timestamp {
        let time_ms = self.time_ms.max(0);
        Timestamp { seconds: time_ms / 1000, nanos: (time_ms % 1000) as i32 * 1_000_000 }
    }

    fn transforms(&self) -> FrameTransforms {
        let transform = |path: &ClipPath| {
            let Pose { position, orientation } = Pose::from(&path.in_space());
            FrameTransform {
                timestamp: Some(self.timestamp()),
                parent_frame_id: MAP_FRAME.to_owned(),
                child_frame_id: format!("clip/{}", path.clip),
                translation: position,
                rotation: orientation,
            }
        };
        FrameTransforms { transforms: self.paths.iter().map(transform).collect() }
    }

    fn path(&self, path: &ClipPath) -> PosesInFrame {
        let map_from_clip = path.in_space();
        let pose = |clip_from_camera: &Pose3| Pose::from(&(map_from_clip * clip_from_camera));
        PosesInFrame {
            timestamp: Some(self.timestamp()),
            frame_id: MAP_FRAME.to_owned(),
            poses: path.clip_from_cameras.iter().map(pose).collect(),
        }
    }

    fn scene(&self) -> SceneUpdate {
        let entities = self.objects.iter().map(|object| self.entity(object)).collect();
        SceneUpdate { entities, ..SceneUpdate::default() }
    }

    /// Returns an object as its box, with its name above it.
    fn entity(&self, object: &RecordedObject) -> SceneEntity {
        let UprightBox { centre_m: [x, y, _], size_m, yaw_rad } = object.bounds;
        let at = |z_m: f64| Some(Pose::from(&in_space(&Pose2::new(x, y, yaw_rad), z_m)));
        let pair = |key: &str, value: &str| KeyValuePair { key: key.to_owned(), value: value.to_owned() };
        let name = object.name.map(|name| pair("name", name));
        let [length, width, height] = size_m;
        SceneEntity {
            timestamp: Some(self.timestamp()),
            frame_id: MAP_FRAME.to_owned(),
            id: object.id.to_owned(),
            frame_locked: true,
            metadata: [
                pair("class", object.class.name()),
                pair("confidence", &format!("{:.3}", object.confidence)),
            ]
            .into_iter()
            .chain(name)
            .collect(),
            cubes: vec![CubePrimitive {
                pose: at(object.bounds.centre_m[2]),
                size: Some(Vector3 { x: length, y: width, z: height }),
                color: Some(color(object.class.color(), 0.35)),
            }],
            texts: vec![TextPrimitive {
                pose: at(object.bounds.top_m() + LETTERS_M),
                billboard: true,
                font_size: LETTERS_M,
                scale_invariant: false,
                color: Some(color([255; 3], 1.0)),
                text: object.name.unwrap_or(object.id).to_owned(),
            }],
            ..SceneEntity::default()
        }
    }

    fn cloud(&self, data: Vec<u8>) -> PointCloud {
        PointCloud {
            timestamp: Some(self.timestamp()),
            frame_id: MAP_FRAME.to_owned(),
            pose: Some(Pose::from(&Pose3::identity())),
            point_stride: POINT_BYTES as u32,
            fields: fields(&[
                ("x", 0, FLOAT32),
                ("y", 4, FLOAT32),
                ("z", 8, FLOAT32),
                ("red", 12, UINT8),
                ("green", 13, UINT8),
                ("blue", 14, UINT8),
                ("alpha", 15, UINT8),
                ("probability", 16, FLOAT32),
                ("clip", 20, UINT16),
                ("label", 22, UINT8),
            ]),
            data,
        }
    }

    /// Returns the notes on the file.
    fn about(&self, points: usize) -> [(&'static str, String); 4] {
        [
            ("level", self.level.as_str().to_owned()),
            ("frame", "map: frame of the LiDAR map, metres, z up, 0 on the floor".to_owned()),
            ("labels", crate::points::class_list()),
            ("points", points.to_string()),
        ]
    }
}

/// Returns a point as an element of [`Recording::cloud`].
fn point_bytes(MapPoint { point, clip }: &MapPoint) -> [u8; POINT_BYTES] {
    let mut bytes = [0; POINT_BYTES];
    for (axis, c) in point.position_m.iter().enumerate() {
        bytes[axis * 4..axis * 4 + 4].copy_from_slice(&c.to_le_bytes());
    }
    bytes[12..15].copy_from_slice(&shown(point.color));
    bytes[15] = 255;
    bytes[16..20].copy_from_slice(&point.label.probability().to_le_bytes());
    bytes[20..22].copy_from_slice(&clip.to_le_bytes());
    bytes[22] = point.label.class.id() as u8;
    bytes
}

#[cfg(test)]
mod tests;
