//! Foxglove's message types, as its SDK defines them, and three of our own for what it has no type for:
//! steering and pedals, the inertial unit, and what a map tells of the place.
//!
//! Our own are defined by one table, from which the log's definitions are made.

use foxglove::{
    Encode,
    messages::{
        CameraCalibration, CompressedImage, FrameTransforms, LocationFix, Odometry, PointCloud,
        PosesInFrame, Quaternion, SceneUpdate, Vector3,
    },
};
use prost::Message as _;
use prost_types::{
    DescriptorProto, FieldDescriptorProto, FileDescriptorProto, FileDescriptorSet, Timestamp,
    field_descriptor_proto::{Label, Type},
};

use crate::log::encode::{Definition, Endian, Message};

/// Steering and pedals.
#[derive(Clone, PartialEq, prost::Message)]
pub struct Control {
    #[prost(message, optional, tag = "1")]
    pub timestamp: Option<Timestamp>,
    #[prost(string, tag = "2")]
    pub frame_id: String,
    /// In [-1, 1], positive = right.
    #[prost(float, tag = "3")]
    pub steer: f32,
    /// In [0, 1].
    #[prost(float, tag = "4")]
    pub throttle: f32,
    #[prost(float, tag = "5")]
    pub brake: f32,
}

/// What an inertial unit measures.
#[derive(Clone, PartialEq, prost::Message)]
pub struct Imu {
    #[prost(message, optional, tag = "1")]
    pub timestamp: Option<Timestamp>,
    #[prost(string, tag = "2")]
    pub frame_id: String,
    #[prost(message, optional, tag = "3")]
    pub orientation: Option<Quaternion>,
    /// Rad/s.
    #[prost(message, optional, tag = "4")]
    pub angular_velocity: Option<Vector3>,
    /// With what holds the unit up against gravity, m/s2.
    #[prost(message, optional, tag = "5")]
    pub linear_acceleration: Option<Vector3>,
}

/// What a map and a route tell of the place where the car is.
#[derive(Clone, PartialEq, prost::Message)]
pub struct Situation {
    #[prost(message, optional, tag = "1")]
    pub timestamp: Option<Timestamp>,
    #[prost(string, tag = "2")]
    pub frame_id: String,
    #[prost(bool, tag = "3")]
    pub in_junction: bool,
    #[prost(float, tag = "4")]
    pub speed_limit_mps: f32,
    /// As [`crate::frame::Command`] names it.
    #[prost(string, tag = "5")]
    pub command: String,
}

/// Fields of our own types: name, number, type; a type in capitals is a message's.
type Fields = &'static [(&'static str, i32, Type, &'static str)];

const TIMESTAMP: &str = ".google.protobuf.Timestamp";
const QUATERNION: &str = ".foxglove.Quaternion";
const VECTOR: &str = ".foxglove.Vector3";

const TYPES: [(&str, Fields); 3] = [
    (
        "Control",
        &[
            ("timestamp", 1, Type::Message, TIMESTAMP),
            ("frame_id", 2, Type::String, ""),
            ("steer", 3, Type::Float, ""),
            ("throttle", 4, Type::Float, ""),
            ("brake", 5, Type::Float, ""),
        ],
    ),
    (
        "Imu",
        &[
            ("timestamp", 1, Type::Message, TIMESTAMP),
            ("frame_id", 2, Type::String, ""),
            ("orientation", 3, Type::Message, QUATERNION),
            ("angular_velocity", 4, Type::Message, VECTOR),
            ("linear_acceleration", 5, Type::Message, VECTOR),
        ],
    ),
    (
        "Situation",
        &[
            ("timestamp", 1, Type::Message, TIMESTAMP),
            ("frame_id", 2, Type::String, ""),
            ("in_junction", 3, Type::Bool, ""),
            ("speed_limit_mps", 4, Type::Float, ""),
            ("command", 5, Type::String, ""),
        ],
    ),
];

/// Descriptors of our own types and of those that they use.
fn own_descriptors() -> Option<Vec<u8>> {
    let files_of = |schema: Option<foxglove::Schema>| {
        FileDescriptorSet::decode(&*schema?.data).ok().map(|set| set.file)
    };
    let mut file = files_of(FrameTransforms::get_schema())?;
    let field = |(name, number, kind, type_name): &(&str, i32, Type, &str)| FieldDescriptorProto {
        name: Some((*name).to_string()),
        number: Some(*number),
        label: Some(Label::Optional as i32),
        r#type: Some(*kind as i32),
        type_name: Some((*type_name).to_string()).filter(|name| !name.is_empty()),
        json_name: None,
        ..FieldDescriptorProto::default()
    };
    let message = |(name, fields): &(&str, Fields)| DescriptorProto {
        name: Some((*name).to_string()),
        field: fields.iter().map(field).collect(),
        ..DescriptorProto::default()
    };
    file.push(FileDescriptorProto {
        name: Some("pmp/messages.proto".to_string()),
        package: Some("pmp".to_string()),
        dependency: file.iter().filter_map(|file| file.name.clone()).collect(),
        message_type: TYPES.iter().map(message).collect(),
        syntax: Some("proto3".to_string()),
        ..FileDescriptorProto::default()
    });
    Some(FileDescriptorSet { file }.encode_to_vec())
}

fn protobuf(data: Vec<u8>) -> Definition {
    Definition { schema_encoding: "protobuf", message_encoding: "protobuf", data }
}

macro_rules! messages {
    ($($name:ty = $schema:literal, $descriptors:expr;)*) => {$(
        impl Message for $name {
            fn schema(&self) -> &'static str {
                $schema
            }

            fn definition(&self) -> Option<Definition> {
                $descriptors.map(protobuf)
            }

            fn encode(&self, _endian: Endian) -> Vec<u8> {
                prost::Message::encode_to_vec(self)
            }
        }
    )*};
}

fn descriptors<T: Encode>() -> Option<Vec<u8>> {
    Some(T::get_schema()?.data.into_owned())
}

messages! {
    CameraCalibration = "foxglove.CameraCalibration", descriptors::<Self>();
    CompressedImage = "foxglove.CompressedImage", descriptors::<Self>();
    FrameTransforms = "foxglove.FrameTransforms", descriptors::<Self>();
    LocationFix = "foxglove.LocationFix", descriptors::<Self>();
    Odometry = "foxglove.Odometry", descriptors::<Self>();
    PointCloud = "foxglove.PointCloud", descriptors::<Self>();
    PosesInFrame = "foxglove.PosesInFrame", descriptors::<Self>();
    SceneUpdate = "foxglove.SceneUpdate", descriptors::<Self>();
    Control = "pmp.Control", own_descriptors();
    Imu = "pmp.Imu", own_descriptors();
    Situation = "pmp.Situation", own_descriptors();
}
