//! `/v1/classes`

use super::problems::CommonProblems;
use super::reply::Document;
use axum::http::{HeaderName, header};
use serde::Serialize;
use viola_geometry::taxonomy;

/// A class of points and objects
#[derive(Serialize, utoipa::ToSchema)]
pub(super) struct Class {
    /// The `label` of a point in a PLY file. Stable.
    #[schema(example = 11)]
    id: u16,
    /// Stable.
    #[schema(example = "desk")]
    name: &'static str,
    /// Colour of the class in every picture of the service.
    #[schema(example = "#d97b00")]
    color: String,
    /// True if objects of the class are built in, or too heavy to be moved from day to day.
    is_fixed: bool,
}

/// All classes, by id
#[derive(Serialize, utoipa::ToSchema)]
pub(super) struct Classes {
    classes: Vec<Class>,
}

/// List the classes of points and objects
#[utoipa::path(get, path = "/v1/classes", tag = "service",
    responses((status = 200, description = "All classes, by id", body = Classes), CommonProblems))]
pub(super) async fn list_classes() -> ([(HeaderName, &'static str); 1], Document<Classes>) {
    let classes = taxonomy::Class::ALL.iter().map(|&class| {
        let [red, green, blue] = class.color();
        let color = format!("#{red:02x}{green:02x}{blue:02x}");
        Class { id: class.id(), name: class.name(), color, is_fixed: class.is_fixed() }
    });
    // The classes change only with the program.
    ([(header::CACHE_CONTROL, "no-cache")], Document(Classes { classes: classes.collect() }))
}
