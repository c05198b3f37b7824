//! Messages of Foxglove's schemas (package `foxglove`), and their schemas.
//!
//! Messages that a recording lacks, but that are part of one it has, are here too: viewers expect all fields.

use super::schema::{Kind, field, message};
use prost::Message;
use prost_types::field_descriptor_proto::Type;
use prost_types::{DescriptorProto, Duration, Timestamp};
use viola_geometry::{Pose2, Pose3, Vector3 as Vector};

/// Defines messages by their fields, which are numbered from 1; a field has the encoding of `prost` and its type.
macro_rules! messages {
    ($($message:ident { $(($($encoding:tt)+) $field:ident: $type:ty),+ $(,)? })+) => {
        $(
            #[derive(Clone, PartialEq, Message)]
            pub struct $message {
                $(#[prost($($encoding)+)] pub $field: $type,)+
            }

            impl Kind for $message {
                const TYPE: Type = Type::Message;
                const MESSAGE: &'static str = concat!("foxglove.", stringify!($message));
            }
        )+

        /// Returns the schemas of all messages.
        pub fn schemas() -> Vec<DescriptorProto> {
            vec![$(message(stringify!($message), vec![$(field::<$type>(stringify!($field))),+])),+]
        }
    };
}

messages! {
    Vector2 { (double) x: f64, (double) y: f64 }
    Vector3 { (double) x: f64, (double) y: f64, (double) z: f64 }
    Point3 { (double) x: f64, (double) y: f64, (double) z: f64 }
    Quaternion { (double) x: f64, (double) y: f64, (double) z: f64, (double) w: f64 }
    Pose { (message, optional) position: Option<Vector3>, (message, optional) orientation: Option<Quaternion> }
    Color { (double) r: f64, (double) g: f64, (double) b: f64, (double) a: f64 }
    PackedElementField { (string) name: String, (fixed32) offset: u32, (int32) r#type: i32 }
    PointCloud {
        (message, optional) timestamp: Option<Timestamp>, (string) frame_id: String, (message, optional) pose: Option<Pose>,
        (fixed32) point_stride: u32, (message, repeated) fields: Vec<PackedElementField>, (bytes = "vec") data: Vec<u8>,
    }
    Grid {
        (message, optional) timestamp: Option<Timestamp>, (string) frame_id: String, (message, optional) pose: Option<Pose>,
        (fixed32) column_count: u32, (message, optional) cell_size: Option<Vector2>, (fixed32) row_stride: u32,
        (fixed32) cell_stride: u32, (message, repeated) fields: Vec<PackedElementField>, (bytes = "vec") data: Vec<u8>,
    }
    PosesInFrame {
        (message, optional) timestamp: Option<Timestamp>, (string) frame_id: String, (message, repeated) poses: Vec<Pose>,
    }
    FrameTransform {
        (message, optional) timestamp: Option<Timestamp>, (string) parent_frame_id: String, (string) child_frame_id: String,
        (message, optional) translation: Option<Vector3>, (message, optional) rotation: Option<Quaternion>,
    }
    FrameTransforms { (message, repeated) transforms: Vec<FrameTransform> }
    KeyValuePair { (string) key: String, (string) value: String }
    ArrowPrimitive {
        (message, optional) pose: Option<Pose>, (double) shaft_length: f64, (double) shaft_diameter: f64,
        (double) head_length: f64, (double) head_diameter: f64, (message, optional) color: Option<Color>,
    }
    CubePrimitive {
        (message, optional) pose: Option<Pose>, (message, optional) size: Option<Vector3>,
        (message, optional) color: Option<Color>,
    }
    SpherePrimitive {
        (message, optional) pose: Option<Pose>, (message, optional) size: Option<Vector3>,
        (message, optional) color: Option<Color>,
    }
    CylinderPrimitive {
        (message, optional) pose: Option<Pose>, (message, optional) size: Option<Vector3>, (double) bottom_scale: f64,
        (double) top_scale: f64, (message, optional) color: Option<Color>,
    }
    LinePrimitive {
        (int32) r#type: i32, (message, optional) pose: Option<Pose>, (double) thickness: f64, (bool) scale_invariant: bool,
        (message, repeated) points: Vec<Point3>, (message, optional) color: Option<Color>,
        (message, repeated) colors: Vec<Color>, (fixed32, repeated) indices: Vec<u32>,
    }
    TriangleListPrimitive {
        (message, optional) pose: Option<Pose>, (message, repeated) points: Vec<Point3>,
        (message, optional) color: Option<Color>, (message, repeated) colors: Vec<Color>,
        (fixed32, repeated) indices: Vec<u32>,
    }
    TextPrimitive {
        (message, optional) pose: Option<Pose>, (bool) billboard: bool, (double) font_size: f64,
        (bool) scale_invariant: bool, (message, optional) color: Option<Color>, (string) text: String,
    }
    ModelPrimitive {
        (message, optional) pose: Option<Pose>, (message, optional) scale: Option<Vector3>,
        (message, optional) color: Option<Color>, (bool) override_color: bool, (string) url: String,
        (string) media_type: String, (bytes = "vec") data: Vec<u8>,
    }
    SceneEntity {
        (message, optional) timestamp: Option<Timestamp>, (string) frame_id: String, (string) id: String,
        (message, optional) lifetime: Option<Duration>, (bool) frame_locked: bool,
        (message, repeated) metadata: Vec<KeyValuePair>, (message, repeated) arrows: Vec<ArrowPrimitive>,
        (message, repeated) cubes: Vec<CubePrimitive>, (message, repeated) spheres: Vec<SpherePrimitive>,
        (message, repeated) cylinders: Vec<CylinderPrimitive>, (message, repeated) lines: Vec<LinePrimitive>,
        (message, repeated) triangles: Vec<TriangleListPrimitive>, (message, repeated) texts: Vec<TextPrimitive>,
        (message, repeated) models: Vec<ModelPrimitive>,
    }
    SceneEntityDeletion {
        (message, optional) timestamp: Option<Timestamp>, (int32) r#type: i32, (string) id: String,
    }
    SceneUpdate {
        (message, repeated) deletions: Vec<SceneEntityDeletion>, (message, repeated) entities: Vec<SceneEntity>,
    }
}

/// Numeric types of [`PackedElementField`].
pub const UINT8: i32 = 1;
pub const UINT16: i32 = 3;
pub const FLOAT32: i32 = 7;

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

/// Returns a pose of the plane, `z_m` above it.
pub fn in_space(pose: &Pose2, z_m: f64) -> Pose3 {
    Pose3::new(Vector::new(pose.x_m, pose.y_m, z_m), Vector::new(0.0, 0.0, pose.yaw_rad))
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
