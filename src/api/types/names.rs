//! Types that answers of several resources share.

use super::{Answer, answer};
use serde::Serialize;
use utoipa::openapi::{ObjectBuilder, RefOr, Schema, Type};
use utoipa::{PartialSchema, ToSchema};
use viola_geometry::taxonomy::Class;

answer! {
    /// A rigid motion of the plane, SE(2): rotate by `yaw_rad`, then move by `(x_m, y_m)`.
    struct Pose2 from viola_geometry::Pose2 {
        x_m: f64,
        y_m: f64,
        /// Counter-clockwise, in (-pi, pi] when it comes from this crate.
        yaw_rad: f64,
    }
}

answer! {
    /// Role of a key.
    enum Role from viola_storage::Role {
        /// Upload clips and follow their jobs: for an app on a phone.
        Uploader,
        /// Read everything except webhooks, change nothing.
        Reader,
        /// Everything.
        Admin,
    }
}

/// The id of a home, without its tenant.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(transparent)]
pub(in crate::api) struct HomeId(String);

impl PartialSchema for HomeId {
    fn schema() -> RefOr<Schema> {
        ObjectBuilder::new()
            .schema_type(Type::String)
            .description(Some("The id of a home, chosen by the client; not `.` or `..`"))
            .min_length(Some(1))
            .max_length(Some(64))
            .pattern(Some("^[A-Za-z0-9._-]{1,64}$"))
            .examples(["home-42"])
            .into()
    }
}

impl ToSchema for HomeId {}

impl HomeId {
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

impl From<viola_storage::HomeId> for HomeId {
    fn from(source: viola_storage::HomeId) -> HomeId {
        HomeId(source.as_str().to_owned())
    }
}

impl Answer<viola_storage::HomeId> for HomeId {
    fn answer(source: viola_storage::HomeId) -> HomeId {
        source.into()
    }
}

/// The name of a level of a home.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(transparent)]
pub(in crate::api) struct LevelName(viola_geometry::LevelName);

impl PartialSchema for LevelName {
    fn schema() -> RefOr<Schema> {
        ObjectBuilder::new()
            .schema_type(Type::String)
            .description(Some(
                "The name of a level of a home, chosen by the client: each storey has a LiDAR map of its own. `main` \
                 is the level of a home with one map.",
            ))
            .min_length(Some(1))
            .max_length(Some(32))
            .pattern(Some("^[a-z0-9_-]{1,32}$"))
            .examples(["main"])
            .into()
    }
}

impl ToSchema for LevelName {}

impl Answer<viola_geometry::LevelName> for LevelName {
    fn answer(source: viola_geometry::LevelName) -> LevelName {
        LevelName(source)
    }
}

/// The name of a class.
pub(in crate::api) struct ClassName;

impl PartialSchema for ClassName {
    fn schema() -> RefOr<Schema> {
        ObjectBuilder::new()
            .schema_type(Type::String)
            .description(Some(
                "The class of a point. Ids and names are stable: they are in stored maps and in label pictures.",
            ))
            .enum_values(Some(Class::ALL.iter().map(|class| class.name())))
            .into()
    }
}

impl ToSchema for ClassName {}

impl Answer<Class> for String {
    fn answer(source: Class) -> String {
        source.name().to_owned()
    }
}
