//! `/v1/objects`: the objects of all homes.

use super::App;
use super::access::Caller;
use super::error::Error;
use super::extract::{Query, invalid_query};
use super::list::{List, ListPage, ListQuery, not_a_cursor};
use super::map::scene::class;
use super::problems::CommonProblems;
use super::reply::Document;
use super::types::{self, ClassName, HomeObject};
use axum::extract::State;
use serde::Deserialize;
use viola_storage::{HomeId, ObjectFilter};

/// The filter of a list of objects.
#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
pub(super) struct ObjectsQuery {
    /// Only this class, by name.
    #[param(value_type = Option<ClassName>, example = "sofa")]
    class: Option<String>,
    /// Only objects of this home.
    #[param(value_type = Option<types::HomeId>, example = "home-42")]
    home: Option<String>,
}

/// List the objects in the current maps of all homes, by home
#[utoipa::path(get, path = "/v1/objects", tag = "map", params(ObjectsQuery, ListQuery),
    responses((status = 200, description = "One page", body = List<HomeObject>), CommonProblems))]
pub(super) async fn list_objects(
    State(app): State<App>,
    caller: Caller,
    Query(query): Query<ObjectsQuery>,
    page: ListPage,
) -> Result<Document<List<HomeObject>>, Error> {
    query.class.as_deref().map(|name| class("class", name)).transpose()?;
    let home = query.home.as_deref().map(|id| id.parse::<HomeId>());
    let home = home.transpose().map_err(|error| invalid_query("home", error.to_string()))?;
    let home = home.map(|home| caller.home(&home)).transpose()?;
    if let Some(home) = &home {
        app.storage.home(home).await?;
    }
    let tenant = if home.is_some() { &caller.tenant } else { caller.for_all_homes()? };
    let filter = ObjectFilter { class: query.class.clone(), home };
    let asked = page.page::<String>()?;
    if let (Some(home), Some(after)) = (&filter.home, &asked.after)
        && !after.starts_with(&format!("{home} "))
    {
        return Err(not_a_cursor());
    }
    let objects = app.storage.objects(tenant, &filter, &asked).await?;
    Ok(Document(page.list(objects, |object| format!("{} {}", object.home, object.object.id))?))
}
