//! `/v1/homes`

use super::App;
use super::access::Caller;
use super::bodies::to_the_end;
use super::error::Error;
use super::extract::{HomePath, Json, Query};
use super::list::{List, ListQuery, UpdatedQuery};
use super::problems::{CommonProblems, JsonProblems};
use super::types::Home;
use crate::storage::HomeId;
use axum::extract::State;
use axum::http::StatusCode;
use jiff::Timestamp;
use serde::Deserialize;

const MAX_NAME_CHARACTERS: usize = 200;

/// The settings of a home.
#[derive(Debug, Default, Deserialize, utoipa::ToSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct HomeBody {
    /// For people; at most 200 characters.
    #[serde(default)]
    #[schema(max_length = 200, example = "Flat 3, Elm Street")]
    name: Option<String>,
}

/// Create or rename a home
///
/// Repeating the request changes nothing.
#[utoipa::path(put, path = "/v1/homes/{home}", tag = "homes",
    params(HomePath), request_body = Option<HomeBody>,
    responses(
        (status = 200, description = "The home existed already", body = Home),
        (status = 201, description = "The home is new", body = Home),
        CommonProblems, JsonProblems))]
pub(super) async fn put_home(
    State(app): State<App>,
    HomePath { home }: HomePath,
    Json(body): Json<HomeBody>,
) -> Result<(StatusCode, axum::Json<Home>), Error> {
    if body.name.as_ref().is_some_and(|name| name.chars().count() > MAX_NAME_CHARACTERS) {
        return Err(Error::InvalidBody(format!("name has at most {MAX_NAME_CHARACTERS} characters")));
    }
    let (home, is_new) = app.storage.put_home(&home, body.name.as_deref(), Timestamp::now()).await?;
    app.queue.wake();
    let status = if is_new { StatusCode::CREATED } else { StatusCode::OK };
    Ok((status, axum::Json(home.into())))
}

/// Get a home
#[utoipa::path(get, path = "/v1/homes/{home}", tag = "homes", params(HomePath),
    responses((status = 200, description = "The home", body = Home), CommonProblems))]
pub(super) async fn get_home(
    State(app): State<App>,
    HomePath { home }: HomePath,
) -> Result<axum::Json<Home>, Error> {
    Ok(axum::Json(app.storage.home(&home).await?.into()))
}

/// List all homes, by id
///
/// A home's `updated_at` moves with every change of anything in the home, so `updated_after` finds all homes
/// with a change.
#[utoipa::path(get, path = "/v1/homes", tag = "homes", params(ListQuery, UpdatedQuery),
    responses((status = 200, description = "One page", body = List<Home>), CommonProblems))]
pub(super) async fn list_homes(
    State(app): State<App>,
    caller: Caller,
    Query(query): Query<ListQuery>,
    Query(updated): Query<UpdatedQuery>,
) -> Result<axum::Json<List<Home>>, Error> {
    let tenant = caller.for_all_homes()?;
    let mut page = query.page::<HomeId>()?;
    page.after = page.after.map(|id| tenant.home(&id));
    let homes = app.storage.homes(tenant, updated.updated_after()?, &page).await?;
    Ok(axum::Json(query.list(homes, |home| home.id.clone())?))
}

/// Remove a home with all its data
#[utoipa::path(delete, path = "/v1/homes/{home}", tag = "homes", params(HomePath),
    responses((status = 204, description = "The home is removed"), CommonProblems))]
pub(super) async fn delete_home(
    State(app): State<App>,
    HomePath { home }: HomePath,
) -> Result<StatusCode, Error> {
    to_the_end(async move {
        app.storage.delete_home(&home, Timestamp::now()).await?;
        app.queue.wake();
        Ok(StatusCode::NO_CONTENT)
    })
    .await
}
