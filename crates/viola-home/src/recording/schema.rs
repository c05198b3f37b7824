//! Foxglove's schemas as a `FileDescriptorSet` of Protocol Buffers, by which a reader of MCAP decodes messages.
//!
//! Messages that a recording lacks, but that are part of one it has, are here too: viewers expect all fields.

use Kind::{Bool, Bytes, Double, Enum, Fixed32, Fixed32s, Many, One, Text};
use prost::Message;
use prost_types::field_descriptor_proto::{Label, Type};
use prost_types::{
    DescriptorProto, EnumDescriptorProto, EnumValueDescriptorProto, FieldDescriptorProto,
    FileDescriptorProto, FileDescriptorSet,
};

/// Type of a field.
#[derive(Clone, Copy)]
enum Kind {
    Double,
    Fixed32,
    Bool,
    Text,
    Bytes,
    /// A message by its name.
    One(&'static str),
    /// A list of messages.
    Many(&'static str),
    Fixed32s,
    /// An enum by its name.
    Enum(&'static str),
}

const TIMESTAMP: Kind = One(".google.protobuf.Timestamp");
const DURATION: Kind = One(".google.protobuf.Duration");
const POSE: Kind = One(".foxglove.Pose");
const VECTOR_3: Kind = One(".foxglove.Vector3");
const COLOR: Kind = One(".foxglove.Color");

/// Messages with their fields, which are numbered from 1.
#[rustfmt::skip]
const MESSAGES: &[(&str, &[(&str, Kind)])] = &[
    ("Vector2", &[("x", Double), ("y", Double)]),
    ("Vector3", &[("x", Double), ("y", Double), ("z", Double)]),
    ("Point3", &[("x", Double), ("y", Double), ("z", Double)]),
    ("Quaternion", &[("x", Double), ("y", Double), ("z", Double), ("w", Double)]),
    ("Pose", &[("position", VECTOR_3), ("orientation", One(".foxglove.Quaternion"))]),
    ("Color", &[("r", Double), ("g", Double), ("b", Double), ("a", Double)]),
    ("PackedElementField", &[("name", Text), ("offset", Fixed32), ("type", Enum(".foxglove.PackedElementField.NumericType"))]),
    ("PointCloud", &[("timestamp", TIMESTAMP), ("frame_id", Text), ("pose", POSE), ("point_stride", Fixed32),
        ("fields", Many(".foxglove.PackedElementField")), ("data", Bytes)]),
    ("Grid", &[("timestamp", TIMESTAMP), ("frame_id", Text), ("pose", POSE), ("column_count", Fixed32),
        ("cell_size", One(".foxglove.Vector2")), ("row_stride", Fixed32), ("cell_stride", Fixed32),
        ("fields", Many(".foxglove.PackedElementField")), ("data", Bytes)]),
    ("PosesInFrame", &[("timestamp", TIMESTAMP), ("frame_id", Text), ("poses", Many(".foxglove.Pose"))]),
    ("FrameTransform", &[("timestamp", TIMESTAMP), ("parent_frame_id", Text), ("child_frame_id", Text),
        ("translation", VECTOR_3), ("rotation", One(".foxglove.Quaternion"))]),
    ("FrameTransforms", &[("transforms", Many(".foxglove.FrameTransform"))]),
    ("KeyValuePair", &[("key", Text), ("value", Text)]),
    ("ArrowPrimitive", &[("pose", POSE), ("shaft_length", Double), ("shaft_diameter", Double), ("head_length", Double),
        ("head_diameter", Double), ("color", COLOR)]),
    ("CubePrimitive", &[("pose", POSE), ("size", VECTOR_3), ("color", COLOR)]),
    ("SpherePrimitive", &[("pose", POSE), ("size", VECTOR_3), ("color", COLOR)]),
    ("CylinderPrimitive", &[("pose", POSE), ("size", VECTOR_3), ("bottom_scale", Double), ("top_scale", Double), ("color", COLOR)]),
    ("LinePrimitive", &[("type", Enum(".foxglove.LinePrimitive.Type")), ("pose", POSE), ("thickness", Double),
        ("scale_invariant", Bool), ("points", Many(".foxglove.Point3")), ("color", COLOR), ("colors", Many(".foxglove.Color")),
        ("indices", Fixed32s)]),
    ("TriangleListPrimitive", &[("pose", POSE), ("points", Many(".foxglove.Point3")), ("color", COLOR),
        ("colors", Many(".foxglove.Color")), ("indices", Fixed32s)]),
    ("TextPrimitive", &[("pose", POSE), ("billboard", Bool), ("font_size", Double), ("scale_invariant", Bool), ("color", COLOR),
        ("text", Text)]),
    ("ModelPrimitive", &[("pose", POSE), ("scale", VECTOR_3), ("color", COLOR), ("override_color", Bool), ("url", Text),
        ("media_type", Text), ("data", Bytes)]),
    ("SceneEntity", &[("timestamp", TIMESTAMP), ("frame_id", Text), ("id", Text), ("lifetime", DURATION), ("frame_locked", Bool),
        ("metadata", Many(".foxglove.KeyValuePair")), ("arrows", Many(".foxglove.ArrowPrimitive")),
        ("cubes", Many(".foxglove.CubePrimitive")), ("spheres", Many(".foxglove.SpherePrimitive")),
        ("cylinders", Many(".foxglove.CylinderPrimitive")), ("lines", Many(".foxglove.LinePrimitive")),
        ("triangles", Many(".foxglove.TriangleListPrimitive")), ("texts", Many(".foxglove.TextPrimitive")),
        ("models", Many(".foxglove.ModelPrimitive"))]),
    ("SceneEntityDeletion", &[("timestamp", TIMESTAMP), ("type", Enum(".foxglove.SceneEntityDeletion.Type")), ("id", Text)]),
    ("SceneUpdate", &[("deletions", Many(".foxglove.SceneEntityDeletion")), ("entities", Many(".foxglove.SceneEntity"))]),
];

/// Enums: the message that they are in, their name, and their values, which are numbered from 0.
#[rustfmt::skip]
const ENUMS: &[(&str, &str, &[&str])] = &[
    ("PackedElementField", "NumericType", &["UNKNOWN", "UINT8", "INT8", "UINT16", "INT16", "UINT32", "INT32", "FLOAT32", "FLOAT64"]),
    ("LinePrimitive", "Type", &["LINE_STRIP", "LINE_LOOP", "LINE_LIST"]),
    ("SceneEntityDeletion", "Type", &["MATCHING_ID", "ALL"]),
];

/// Returns the schemas of all messages of a recording.
pub fn descriptors() -> Vec<u8> {
    let time = |name: &str, message: &str| {
        let path = format!("google/protobuf/{name}.proto");
        let fields = vec![
            FieldDescriptorProto { r#type: Some(Type::Int64 as i32), ..field(1, "seconds", Double) },
            FieldDescriptorProto { r#type: Some(Type::Int32 as i32), ..field(2, "nanos", Double) },
        ];
        let message = DescriptorProto { name: Some(message.to_owned()), field: fields, ..Default::default() };
        file(path, "google.protobuf", vec![message])
    };
    let times = [time("timestamp", "Timestamp"), time("duration", "Duration")];
    let messages = MESSAGES.iter().map(|(name, fields)| message(name, fields)).collect();
    let foxglove = FileDescriptorProto {
        dependency: times.iter().filter_map(|file| file.name.clone()).collect(),
        ..file("foxglove.proto".to_owned(), "foxglove", messages)
    };
    FileDescriptorSet { file: times.into_iter().chain([foxglove]).collect() }.encode_to_vec()
}

fn file(name: String, package: &str, message_type: Vec<DescriptorProto>) -> FileDescriptorProto {
    FileDescriptorProto {
        name: Some(name),
        package: Some(package.to_owned()),
        message_type,
        syntax: Some("proto3".to_owned()),
        ..Default::default()
    }
}

fn message(name: &str, fields: &[(&str, Kind)]) -> DescriptorProto {
    let own = ENUMS.iter().filter(|(message, ..)| *message == name);
    let value = |(number, name): (i32, &&str)| EnumValueDescriptorProto {
        name: Some((*name).to_owned()),
        number: Some(number),
        options: None,
    };
    let enum_type = own.map(|(_, name, values)| EnumDescriptorProto {
        name: Some((*name).to_owned()),
        value: (0..).zip(*values).map(value).collect(),
        ..Default::default()
    });
    DescriptorProto {
        name: Some(name.to_owned()),
        field: (1..).zip(fields).map(|(number, (name, kind))| field(number, name, *kind)).collect(),
        enum_type: enum_type.collect(),
        ..Default::default()
    }
}

fn field(number: i32, name: &str, kind: Kind) -> FieldDescriptorProto {
    let (label, scalar, type_name) = match kind {
        Double => (Label::Optional, Type::Double, None),
        Fixed32 => (Label::Optional, Type::Fixed32, None),
        Fixed32s => (Label::Repeated, Type::Fixed32, None),
        Bool => (Label::Optional, Type::Bool, None),
        Text => (Label::Optional, Type::String, None),
        Bytes => (Label::Optional, Type::Bytes, None),
        One(name) => (Label::Optional, Type::Message, Some(name)),
        Many(name) => (Label::Repeated, Type::Message, Some(name)),
        Enum(name) => (Label::Optional, Type::Enum, Some(name)),
    };
    FieldDescriptorProto {
        name: Some(name.to_owned()),
        number: Some(number),
        label: Some(label as i32),
        r#type: Some(scalar as i32),
        type_name: type_name.map(str::to_owned),
        ..Default::default()
    }
}
