//! The JSON of a Valetudo map. Unused data is skipped without being stored, and every list that is stored is
//! bounded.

use crate::lidar::MAX_POINTS;
use crate::lidar::marks::MAX_CORNERS;
use serde::de::{Deserialize, Deserializer, Error, IgnoredAny, SeqAccess, Unexpected, Visitor};
use std::fmt;
use std::marker::PhantomData;

const MAX_LAYERS: usize = 1_000;
const MAX_ENTITIES: usize = 10_000;
/// A pixel or a run is at most three numbers, and no map may have more cells than [`MAX_POINTS`].
const MAX_NUMBERS: usize = 3 * MAX_POINTS;

/// The members that tell a map from the state of a robot and from other JSON.
#[derive(serde::Deserialize)]
pub(super) struct Head {
    pub size: Option<IgnoredAny>,
    pub layers: Option<IgnoredAny>,
    pub map: Option<IgnoredAny>,
}

/// The state of a robot (`GET /api/v2/robot/state`).
#[derive(serde::Deserialize)]
pub(super) struct State {
    pub map: MapFile,
}

#[derive(serde::Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct MapFile {
    pub size: Size,
    pub pixel_size: i64,
    pub layers: Bounded<Layer, MAX_LAYERS>,
    #[serde(default)]
    pub entities: Bounded<Entity, MAX_ENTITIES>,
}

#[derive(serde::Deserialize)]
pub(super) struct Size {
    pub x: i64,
    pub y: i64,
}

#[derive(serde::Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Layer {
    #[serde(rename = "type")]
    pub kind: String,
    #[serde(default)]
    pub meta_data: LayerMetaData,
    /// Version 1: x, y of every pixel.
    #[serde(default)]
    pub pixels: Bounded<Whole, MAX_NUMBERS>,
    /// Version 2: x, y of a run's first pixel, and the run's length to the right.
    #[serde(default)]
    pub compressed_pixels: Bounded<Whole, MAX_NUMBERS>,
}

#[derive(serde::Deserialize, Default)]
#[serde(rename_all = "camelCase", default)]
pub(super) struct LayerMetaData {
    pub segment_id: Option<Label>,
    pub name: Option<String>,
    pub material: Option<String>,
}

/// An identifier: a string, or a number in early versions.
pub(super) enum Label {
    Text(String),
    Number(i64),
}

/// Not `untagged`, which would keep any other value before it is refused, at sixteen times its size.
impl<'de> Deserialize<'de> for Label {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Id;
        impl Visitor<'_> for Id {
            type Value = Label;
            fn expecting(&self, formatter: &mut fmt::Formatter) -> fmt::Result {
                formatter.write_str("a text or a whole number")
            }
            fn visit_str<E>(self, text: &str) -> Result<Label, E> {
                Ok(Label::Text(text.to_string()))
            }
            fn visit_i64<E>(self, number: i64) -> Result<Label, E> {
                Ok(Label::Number(number))
            }
            fn visit_u64<E: Error>(self, number: u64) -> Result<Label, E> {
                let own = i64::try_from(number).map(Label::Number);
                own.map_err(|_| E::invalid_value(Unexpected::Unsigned(number), &self))
            }
        }
        deserializer.deserialize_any(Id)
    }
}

#[derive(serde::Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Entity {
    #[serde(rename = "type")]
    pub kind: String,
    #[serde(default)]
    pub points: FirstPoints,
    #[serde(default)]
    pub meta_data: EntityMetaData,
}

#[derive(serde::Deserialize, Default)]
#[serde(default)]
pub(super) struct EntityMetaData {
    pub angle: Option<f64>,
    pub label: Option<String>,
}

/// A whole number, clamped to 32 bits; a clamped number is refused where it is used.
#[derive(Debug, Clone, Copy)]
pub(super) struct Whole(pub i32);

impl<'de> Deserialize<'de> for Whole {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let value = i64::deserialize(deserializer)?;
        Ok(Whole(value.clamp(i64::from(i32::MIN), i64::from(i32::MAX)) as i32))
    }
}

/// A list of at most `MAX` items; a longer one is an error at the first item too many.
pub(super) struct Bounded<T, const MAX: usize>(pub Vec<T>);

impl<T, const MAX: usize> Default for Bounded<T, MAX> {
    fn default() -> Self {
        Bounded(Vec::new())
    }
}

impl<'de, T: Deserialize<'de>, const MAX: usize> Deserialize<'de> for Bounded<T, MAX> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Items<T, const MAX: usize>(PhantomData<T>);
        impl<'de, T: Deserialize<'de>, const MAX: usize> Visitor<'de> for Items<T, MAX> {
            type Value = Bounded<T, MAX>;
            fn expecting(&self, formatter: &mut fmt::Formatter) -> fmt::Result {
                write!(formatter, "a list of at most {MAX} items")
            }
            fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Self::Value, A::Error> {
                let mut items = Vec::new();
                while let Some(item) = list.next_element()? {
                    if items.len() == MAX {
                        return Err(A::Error::invalid_length(MAX + 1, &self));
                    }
                    items.push(item);
                }
                Ok(Bounded(items))
            }
        }
        deserializer.deserialize_seq(Items(PhantomData))
    }
}

/// x and y of an entity's first points: one more than a zone may have, so that too many are detected. Paths
/// have thousands that are not used.
#[derive(Default)]
pub(super) struct FirstPoints {
    pub points: Vec<[f64; 2]>,
}

impl<'de> Deserialize<'de> for FirstPoints {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Numbers;
        impl<'de> Visitor<'de> for Numbers {
            type Value = FirstPoints;
            fn expecting(&self, formatter: &mut fmt::Formatter) -> fmt::Result {
                formatter.write_str("a list of numbers")
            }
            fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Self::Value, A::Error> {
                let mut points = Vec::new();
                while points.len() <= MAX_CORNERS
                    && let Some(x) = list.next_element()?
                    && let Some(y) = list.next_element()?
                {
                    points.push([x, y]);
                }
                while list.next_element::<IgnoredAny>()?.is_some() {}
                Ok(FirstPoints { points })
            }
        }
        deserializer.deserialize_seq(Numbers)
    }
}
