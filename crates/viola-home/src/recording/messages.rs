//! Messages of Foxglove's schemas (package `foxglove`) that a recording has.

use prost::Message;
use prost_types::{Duration, Timestamp};
use viola_geometry::{Pose2, Pose3, Vector3 as Vector};

#[derive(Clone, PartialEq, Message)]
pub struct Vector2 {
    #[prost(double, tag = "1")]
    pub x: f64,
    #[prost(double, tag = "2")]
    pub y: f64,
}

#[derive(Clone, PartialEq, Message)]
pub struct Vector3 {
    #[prost(double, tag = "1")]
    pub x: f64,
    #[prost(double, tag = "2")]
    pub y: f64,
    #[prost(double, tag = "3")]
    pub z: f64,
}

#[derive(Clone, PartialEq, Message)]
pub struct Quaternion {
    #[prost(double, tag = "1")]
    pub x: f64,
    #[prost(double, tag = "2")]
    pub y: f64,
    #[prost(double, tag = "3")]
    pub z: f64,
    #[prost(double, tag = "4")]
    pub w: f64,
}

#[derive(Clone, PartialEq, Message)]
pub struct Pose {
    #[prost(message, optional, tag = "1")]
    pub position: Option<Vector3>,
    #[prost(message, optional, tag = "2")]
    pub orientation: Option<Quaternion>,
}

#[derive(Clone, PartialEq, Message)]
pub struct Color {
    #[prost(double, tag = "1")]
    pub r: f64,
    #[prost(double, tag = "2")]
    pub g: f64,
    #[prost(double, tag = "3")]
    pub b: f64,
    #[prost(double, tag = "4")]
    pub a: f64,
}

/// Numeric types of [`PackedElementField`].
pub const UINT8: i32 = 1;
pub const UINT16: i32 = 3;
pub const FLOAT32: i32 = 7;

#[derive(Clone, PartialEq, Message)]
pub struct PackedElementField {
    #[prost(string, tag = "1")]
    pub name: String,
    #[prost(fixed32, tag = "2")]
    pub offset: u32,
    #[prost(int32, tag = "3")]
    pub r#type: i32,
}

#[derive(Clone, PartialEq, Message)]
pub struct PointCloud {
    #[prost(message, optional, tag = "1")]
    pub timestamp: Option<Timestamp>,
    #[prost(string, tag = "2")]
    pub frame_id: String,
    #[prost(message, optional, tag = "3")]
    pub pose: Option<Pose>,
    #[prost(fixed32, tag = "4")]
    pub point_stride: u32,
    #[prost(message, repeated, tag = "5")]
    pub fields: Vec<PackedElementField>,
    #[prost(bytes = "vec", tag = "6")]
    pub data: Vec<u8>,
}

#[derive(Clone, PartialEq, Message)]
pub struct Grid {
    #[prost(message, optional, tag = "1")]
    pub timestamp: Option<Timestamp>,
    #[prost(string, tag = "2")]
    pub frame_id: String,
    #[prost(message, optional, tag = "3")]
    pub pose: Option<Pose>,
    #[prost(fixed32, tag = "4")]
    pub column_count: u32,
    #[prost(message, optional, tag = "5")]
    pub cell_size: Option<Vector2>,
    #[prost(fixed32, tag = "6")]
    pub row_stride: u32,
    #[prost(fixed32, tag = "7")]
    pub cell_stride: u32,
    #[prost(message, repeated, tag = "8")]
    pub fields: Vec<PackedElementField>,
    #[prost(bytes = "vec", tag = "9")]
    pub data: Vec<u8>,
}

#[derive(Clone, PartialEq, Message)]
pub struct PosesInFrame {
    #[prost(message, optional, tag = "1")]
    pub timestamp: Option<Timestamp>,
    #[prost(string, tag = "2")]
    pub frame_id: String,
    #[prost(message, repeated, tag = "3")]
    pub poses: Vec<Pose>,
}

#[derive(Clone, PartialEq, Message)]
pub struct FrameTransform {
    #[prost(message, optional, tag = "1")]
    pub timestamp: Option<Timestamp>,
    #[prost(string, tag = "2")]
    pub parent_frame_id: String,
    #[prost(string, tag = "3")]
    pub child_frame_id: String,
    #[prost(message, optional, tag = "4")]
    pub translation: Option<Vector3>,
    #[prost(message, optional, tag = "5")]
    pub rotation: Option<Quaternion>,
}

#[derive(Clone, PartialEq, Message)]
pub struct FrameTransforms {
    #[prost(message, repeated, tag = "1")]
    pub transforms: Vec<FrameTransform>,
}

#[derive(Clone, PartialEq, Message)]
pub struct KeyValuePair {
    #[prost(string, tag = "1")]
    pub key: String,
    #[prost(string, tag = "2")]
    pub value: String,
}

#[derive(Clone, PartialEq, Message)]
pub struct CubePrimitive {
    #[prost(message, optional, tag = "1")]
    pub pose: Option<Pose>,
    #[prost(message, optional, tag = "2")]
    pub size: Option<Vector3>,
    #[prost(message, optional, tag = "3")]
    pub color: Option<Color>,
}

#[derive(Clone, PartialEq, Message)]
pub struct TextPrimitive {
    #[prost(message, optional, tag = "1")]
    pub pose: Option<Pose>,
    #[prost(bool, tag = "2")]
    pub billboard: bool,
    #[prost(double, tag = "3")]
    pub font_size: f64,
    #[prost(bool, tag = "4")]
    pub scale_invariant: bool,
    #[prost(message, optional, tag = "5")]
    pub color: Option<Color>,
    #[prost(string, tag = "6")]
    pub text: String,
}

#[derive(Clone, PartialEq, Message)]
pub struct SceneEntity {
    #[prost(message, optional, tag = "1")]
    pub timestamp: Option<Timestamp>,
    #[prost(string, tag = "2")]
    pub frame_id: String,
    #[prost(string, tag = "3")]
    pub id: String,
    #[prost(message, optional, tag = "4")]
    pub lifetime: Option<Duration>,
    #[prost(bool, tag = "5")]
    pub frame_locked: bool,
    #[prost(message, repeated, tag = "6")]
    pub metadata: Vec<KeyValuePair>,
    #[prost(message, repeated, tag = "8")]
    pub cubes: Vec<CubePrimitive>,
    #[prost(message, repeated, tag = "13")]
    pub texts: Vec<TextPrimitive>,
}

#[derive(Clone, PartialEq, Message)]
pub struct SceneUpdate {
    #[prost(message, repeated, tag = "2")]
    pub entities: Vec<SceneEntity>,
}

impl From<Vector> for Vector3 {
    fn from(vector: Vector) -> Vector3 {
        Vector3 { x: vector.x, y: vector.y, z: vector.z }
    }
}

impl From<&Pose3> for Pose {
    fn from(pose: &Pose3) -> Pose {
        let turn = pose.rotation;
        Pose {
            position: Some(pose.translation.vector.into()),
            orientation: Some(Quaternion { x: turn.i, y: turn.j, z: turn.k, w: turn.w }),
        }
    }
}

/// Returns a motion of the plane as one of space.
pub fn in_space(pose: &Pose2) -> Pose3 {
    Pose3::new(Vector::new(pose.x_m, pose.y_m, 0.0), Vector::new(0.0, 0.0, pose.yaw_rad))
}

/// Returns fields of packed elements by name, offset in bytes and numeric type.
pub fn fields(fields: &[(&str, u32, i32)]) -> Vec<PackedElementField> {
    let field = |(name, offset, r#type): &(&str, u32, i32)| PackedElementField {
        name: (*name).to_owned(),
        offset: *offset,
        r#type: *r#type,
    };
    fields.iter().map(field).collect()
}

/// Returns a colour of 8 bits a channel.
pub fn color(rgb: [u8; 3], a: f64) -> Color {
    let [r, g, b] = rgb.map(|channel| f64::from(channel) / 255.0);
    Color { r, g, b, a }
}
