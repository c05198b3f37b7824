//! Schemas of messages as a `FileDescriptorSet` of Protocol Buffers, by which a reader of MCAP decodes them.

use prost::Message;
use prost_types::field_descriptor_proto::{Label, Type};
use prost_types::{
    DescriptorProto, Duration, EnumDescriptorProto, EnumValueDescriptorProto, FieldDescriptorProto,
    FileDescriptorProto, FileDescriptorSet, Timestamp,
};

/// A Rust type of fields, as a schema has it.
pub trait Kind {
    const TYPE: Type;
    const LABEL: Label = Label::Optional;
    /// Full name of a message; empty for other types.
    const MESSAGE: &'static str = "";
}

macro_rules! kinds {
    ($($type:ty: $kind:ident $($message:literal)?),+) => {
        $(impl Kind for $type {
            const TYPE: Type = Type::$kind;
            $(const MESSAGE: &'static str = $message;)?
        })+
    };
}

kinds! {
    f64: Double, u32: Fixed32, i32: Enum, bool: Bool, String: String, Vec<u8>: Bytes,
    Timestamp: Message "google.protobuf.Timestamp", Duration: Message "google.protobuf.Duration"
}

impl<K: Kind> Kind for Option<K> {
    const TYPE: Type = K::TYPE;
    const MESSAGE: &'static str = K::MESSAGE;
}

impl<K: Kind> Kind for Vec<K> {
    const TYPE: Type = K::TYPE;
    const LABEL: Label = Label::Repeated;
    const MESSAGE: &'static str = K::MESSAGE;
}

/// Enums: the message that they are in, their name, and their values, which are numbered from 0.
#[rustfmt::skip]
const ENUMS: &[(&str, &str, &[&str])] = &[
    ("PackedElementField", "NumericType", &["UNKNOWN", "UINT8", "INT8", "UINT16", "INT16", "UINT32", "INT32", "FLOAT32", "FLOAT64"]),
    ("LinePrimitive", "Type", &["LINE_STRIP", "LINE_LOOP", "LINE_LIST"]),
    ("SceneEntityDeletion", "Type", &["MATCHING_ID", "ALL"]),
];

/// Returns the schemas of messages of the package `foxglove`, with those of times.
pub fn descriptors(messages: Vec<DescriptorProto>) -> Vec<u8> {
    let time = |name: &str, of_message: &str| {
        let fields = vec![unnumbered("seconds", Type::Int64), unnumbered("nanos", Type::Int32)];
        file(format!("google/protobuf/{name}.proto"), "google.protobuf", vec![message(of_message, fields)])
    };
    let times = [time("timestamp", "Timestamp"), time("duration", "Duration")];
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

/// Returns the schema of a message, whose fields are numbered from 1. A field that is an enum has the message's own one.
pub fn message(name: &str, mut fields: Vec<FieldDescriptorProto>) -> DescriptorProto {
    let own = ENUMS.iter().find(|(message, ..)| *message == name);
    for (number, field) in (1..).zip(&mut fields) {
        field.number = Some(number);
        if field.r#type() == Type::Enum {
            field.type_name = own.map(|(_, name_of_enum, _)| format!(".foxglove.{name}.{name_of_enum}"));
        }
    }
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
        field: fields,
        enum_type: enum_type.into_iter().collect(),
        ..Default::default()
    }
}

/// Returns a field for [`message`]. `name` may be a raw identifier.
pub fn field<K: Kind>(name: &str) -> FieldDescriptorProto {
    FieldDescriptorProto {
        label: Some(K::LABEL as i32),
        type_name: (!K::MESSAGE.is_empty()).then(|| format!(".{}", K::MESSAGE)),
        ..unnumbered(name.trim_start_matches("r#"), K::TYPE)
    }
}

fn unnumbered(name: &str, kind: Type) -> FieldDescriptorProto {
    FieldDescriptorProto {
        name: Some(name.to_owned()),
        label: Some(Label::Optional as i32),
        r#type: Some(kind as i32),
        ..Default::default()
    }
}
