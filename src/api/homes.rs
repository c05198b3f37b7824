//! `/v1/homes`

use super::App;
use super::access::Caller;
use super::bodies::to_the_end;
use super::clips::flag;
use super::error::{Error, Problem};
use super::extract::{HomePath, Json, Query};
use super::list::{List, ListQuery, UpdatedQuery};
use super::names;
use super::problems::{CommonProblems, JsonProblems};
use super::reply::{Document, may_change, unmet};
use super::types::Home;
use crate::storage::{self, HomeFilter, HomeId, StorageError};
use axum::extract::State;
use axum::http::{HeaderMap, StatusCode, header};
use jiff::Timestamp;
use serde::Deserialize;

/// The settings of a home.
#[derive(Debug, Default, Deserialize, utoipa::ToSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct HomeBody {
    /// For people; 1 to 200 characters on one line.
    #[serde(default)]
    #[schema(
        min_length = 1,
        max_length = 200,
        pattern = "^[^\\x00-\\x1f\\x7f-\\x9f]*$",
        example = "Flat 3, Elm Street"
    )]
    name: Option<String>,
}

/// Create or rename a home
///
/// Repeating the request changes nothing.
#[utoipa::path(put, path = "/v1/homes/{home}", tag = "homes",
    params(HomePath,
        ("If-Match" = Option<String>, Header, description = "The `ETag` of the home that is renamed"),
        ("If-None-Match" = Option<String>, Header, description = "`*` if the home must be new")),
    request_body = Option<HomeBody>,
    responses(
        (status = 200, description = "The home existed already", body = Home),
        (status = 201, description = "The home is new", body = Home),
        (status = 412, description = "The home was changed since it was read, or exists: `changed-meanwhile`",
            body = Problem, content_type = "application/problem+json"),
        CommonProblems, JsonProblems))]
pub(super) async fn put_home(
    State(app): State<App>,
    HomePath { home }: HomePath,
    headers: HeaderMap,
    Json(body): Json<HomeBody>,
) -> Result<(StatusCode, Document<Home>), Error> {
    if body.name.as_ref().is_some_and(|name| !names::is_title(name)) {
        let detail = "name has 1 to 200 characters, and no control characters; null removes it".to_owned();
        return Err(Error::InvalidMember { field: "name", detail });
    }
    let is_expected = |home: Option<&storage::Home>| {
        may_change(&headers, home.map(|home| Home::from(home.clone())).as_ref())
    };
    let name = body.name.as_deref();
    let put = app.storage.put_home(&home, name, is_expected, Timestamp::now()).await;
    let (home, is_new) = put.map_err(|error| unmet(&headers, error))?;
    app.queue.wake();
    let status = if is_new { StatusCode::CREATED } else { StatusCode::OK };
    Ok((status, Document(home.into())))
}

/// Get a home
#[utoipa::path(get, path = "/v1/homes/{home}", tag = "homes", params(HomePath),
    responses((status = 200, description = "The home", body = Home), CommonProblems))]
pub(super) async fn get_home(
    State(app): State<App>,
    HomePath { home }: HomePath,
) -> Result<Document<Home>, Error> {
    Ok(Document(app.storage.home(&home).await?.into()))
}

/// The filter of a list of homes.
#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
pub(super) struct HomesQuery {
    /// Only homes with this text in their id or name, in upper or lower case.
    #[param(min_length = 1, max_length = 200, pattern = "^[^\\x00-\\x1f\\x7f-\\x9f]*$", example = "elm")]
    q: Option<String>,
    /// With `true`, only homes that a person should look at: with clips that wait, are ambiguous or failed.
    #[param(value_type = Option<bool>, example = true)]
    needs_attention: Option<String>,
}

/// List all homes, by id
///
/// A home's `updated_at` moves with every change of anything in the home, so `updated_after` finds all homes
/// with a change.
#[utoipa::path(get, path = "/v1/homes", tag = "homes", params(ListQuery, UpdatedQuery, HomesQuery),
    responses((status = 200, description = "One page", body = List<Home>), CommonProblems))]
pub(super) async fn list_homes(
    State(app): State<App>,
    caller: Caller,
    Query(query): Query<ListQuery>,
    Query(updated): Query<UpdatedQuery>,
    Query(asked): Query<HomesQuery>,
) -> Result<Document<List<Home>>, Error> {
    let tenant = caller.for_all_homes()?;
    let mut page = query.page::<HomeId>()?;
    page.after = page.after.map(|id| tenant.home(&id));
    let filter = HomeFilter {
        updated_after: updated.updated_after()?,
        text: names::search(asked.q)?,
        needs_attention: flag("needs_attention", asked.needs_attention.as_deref())?,
    };
    let homes = app.storage.homes(tenant, &filter, &page).await?;
    Ok(Document(query.list(homes, |home| home.id.clone())?))
}

/// Remove a home with all its data
#[utoipa::path(delete, path = "/v1/homes/{home}", tag = "homes", params(HomePath,
        ("If-Match" = Option<String>, Header, description = "The `ETag` of the home as it was read")),
    responses(
        (status = 204, description = "The home is removed"),
        (status = 412, description = "The home was changed since it was read: `changed-meanwhile`", body = Problem,
            content_type = "application/problem+json"),
        CommonProblems))]
pub(super) async fn delete_home(
    State(app): State<App>,
    HomePath { home }: HomePath,
    headers: HeaderMap,
) -> Result<StatusCode, Error> {
    if headers.contains_key(header::IF_MATCH) {
        let current = Home::from(app.storage.home(&home).await?);
        if !may_change(&headers, Some(&current)) {
            return Err(StorageError::Changed { what: "home" }.into());
        }
    }
    to_the_end(async move {
        app.storage.delete_home(&home, Timestamp::now()).await?;
        app.queue.wake();
        Ok(StatusCode::NO_CONTENT)
    })
    .await
}
