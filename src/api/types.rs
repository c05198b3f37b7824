//! The answers of the API, one type per document: the types below `api` may change without changing the JSON.

mod alignment;
mod change;
mod clip;
mod correction;
mod home;
mod home_map;
mod job;
mod lidar_map;
mod messages;
mod names;
mod reason_code;
mod upload;
mod webhook;

pub(super) use change::{Change, ChangeKind};
pub(super) use clip::{Clip, ClipInfo, ClipScan, ClipState, Estimate};
pub(super) use correction::{
    CorrectedObject, CorrectedRoom, Corrections, GoneObject, GoneReason, LostObject, LostReason, MapChanges,
    MovedObject,
};
pub(super) use home::Home;
pub(super) use home_map::{Coverage, HomeMap, HomeObject, LeftOut, MapObject, MapState, Room};
pub(super) use job::{Job, JobState};
pub(super) use lidar_map::{LidarInfo, LidarMapRevision, PictureFrame};
pub(super) use messages::{HomeEvent, JobEvent, WebhookMessage, WebhookTest};
pub(super) use names::{ClassName, HomeId, LevelName, Pose2, Role};
pub(super) use reason_code::{READERS, ReasonCode};
pub(super) use upload::{UploadKind, UploadState};
pub(super) use webhook::{Delivery, Webhook};

use jiff::Timestamp;
use std::collections::BTreeMap;
use uuid::Uuid;

/// Declares an answer with the fields, or the variants, of a type below `api`, and its conversion from that type.
macro_rules! answer {
    ($(#[$attribute:meta])* struct $name:ident from $($source:ident)::+ {
        $($(#[$field_attribute:meta])* $field:ident: $type:ty,)+
    }) => {
        $(#[$attribute])*
        #[derive(Debug, Clone, PartialEq, serde::Serialize, utoipa::ToSchema)]
        pub(in crate::api) struct $name {
            $($(#[$field_attribute])* pub $field: $type,)+
        }

        impl From<$($source)::+> for $name {
            fn from(source: $($source)::+) -> $name {
                $name { $($field: crate::api::types::Answer::answer(source.$field),)+ }
            }
        }

        impl crate::api::types::Answer<$($source)::+> for $name {
            fn answer(source: $($source)::+) -> $name {
                source.into()
            }
        }
    };
    ($(#[$attribute:meta])* enum $name:ident from $($source:ident)::+ {
        $($(#[$variant_attribute:meta])* $variant:ident,)+
    }) => {
        $(#[$attribute])*
        #[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize, utoipa::ToSchema)]
        #[serde(rename_all = "snake_case")]
        pub(in crate::api) enum $name {
            $($(#[$variant_attribute])* $variant,)+
        }

        impl From<$($source)::+> for $name {
            fn from(source: $($source)::+) -> $name {
                type Source = $($source)::+;
                match source {
                    $(Source::$variant => $name::$variant,)+
                }
            }
        }

        impl crate::api::types::Answer<$($source)::+> for $name {
            fn answer(source: $($source)::+) -> $name {
                source.into()
            }
        }
    };
}
use answer;

/// [`From`] that also converts the values in options and lists.
trait Answer<Source> {
    fn answer(source: Source) -> Self;
}

impl<Source, A: Answer<Source>> Answer<Option<Source>> for Option<A> {
    fn answer(source: Option<Source>) -> Option<A> {
        source.map(A::answer)
    }
}

impl<Source, A: Answer<Source>> Answer<Vec<Source>> for Vec<A> {
    fn answer(source: Vec<Source>) -> Vec<A> {
        source.into_iter().map(A::answer).collect()
    }
}

/// Declares types whose values are sent unchanged.
macro_rules! plain {
    ($($type:ty),+ $(,)?) => {
        $(impl Answer<$type> for $type {
            fn answer(source: $type) -> $type {
                source
            }
        })+
    };
}

plain!(bool, u32, i64, u64, usize, f64, String, Uuid, Timestamp, BTreeMap<String, f64>);
plain!([f32; 2], [f32; 3], [f64; 2], [f64; 3], [[f64; 2]; 2], [[f64; 3]; 3], [[f64; 4]; 4]);
