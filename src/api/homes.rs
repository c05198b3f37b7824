//! `/v1/homes`

use super::App;
use super::access::Caller;
use super::bodies::to_the_end;
use super::clips::flag;
use super::error::Error;
use super::extract::{HomePath, Json, Query};
use super::fairness::FairPlaces;
use super::list::{List, ListPage, ListQuery, UpdatedQuery};
use super::names;
use super::problems::{CommonProblems, JsonProblems};
use super::reply::{Document, Resource, is_expected, may_change, may_repeat, unmet};
use super::types::Home;
use axum::extract::State;
use axum::http::{HeaderMap, StatusCode};
use serde::Deserialize;
use std::future::Future;
use viola_storage::{HomeFilter, HomeId, Tenant};

/// Number of searches of a process and of a tenant at once. SQLite has four connections that read, and a search may read
/// all homes of the tenant.
const SEARCHES: usize = 2;
const SEARCHES_OF_TENANT: usize = 1;

/// The settings of a home.
#[derive(Debug, Default, Deserialize, utoipa::ToSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct HomeBody {
    /// For people; 1 to 200 characters on one line. Absent or null: no name.
    #[serde(default)]
    #[schema(
        min_length = 1,
        max_length = 200,
        pattern = "^[^\\x00-\\x1f\\x7f-\\x9f]*[^\\s\\x00-\\x1f\\x7f-\\x9f][^\\x00-\\x1f\\x7f-\\x9f]*$",
        example = "Flat 3, Elm Street"
    )]
    name: Option<String>,
}

/// Create or rename a home
///
/// Repeating the request changes nothing. Without `name`, the home has no name afterwards. With `If-None-Match: *` the request
/// only creates; 412 means that the home exists.
#[utoipa::path(put, path = "/v1/homes/{home}", tag = "homes",
    params(HomePath,
        ("If-Match" = Option<String>, Header, description = "The `ETag` of the home that is renamed"),
        ("If-None-Match" = Option<String>, Header, description = "`*` if the home must be new")),
    request_body = Option<HomeBody>,
    responses(
        (status = 200, description = "The home existed already", body = Home,
            headers(("ETag" = String, description = "For `If-Match` of the next change"))),
        (status = 201, description = "The home is new", body = Home,
            headers(("ETag" = String, description = "For `If-Match` of the next change"))),
        (status = 412, description = "The home was changed since it was read, or exists: `changed-meanwhile`"),
        CommonProblems, JsonProblems))]
pub(super) async fn put_home(
    State(app): State<App>,
    HomePath { home }: HomePath,
    headers: HeaderMap,
    Json(body): Json<HomeBody>,
) -> Result<(StatusCode, Resource<Home>), Error> {
    if body.name.as_ref().is_some_and(|name| !names::is_title(name)) {
        let detail =
            "name has 1 to 200 characters, no control characters, and not only spaces; null removes it";
        return Err(Error::InvalidBody { field: Some("name".into()), detail: detail.to_owned() });
    }
    let name = body.name.as_deref();
    let is_expected = |home: Option<&viola_storage::Home>| {
        let is_same = home.is_some_and(|home| home.name.as_deref() == name);
        is_same && may_repeat(&headers)
            || may_change(&headers, home.map(|home| Home::from(home.clone())).as_ref())
    };
    let put = app.storage.put_home(&home, name, is_expected, app.storage.now()).await;
    let (home, is_new) = put.map_err(|error| unmet(&headers, error))?;
    app.queue.wake();
    let status = if is_new { StatusCode::CREATED } else { StatusCode::OK };
    Ok((status, Resource(home.into())))
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
    /// With `true`, only homes that a person should look at: with clips that wait, met a fault of the service, are ambiguous
    /// or failed, or with a map that cannot be made.
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
    query: ListPage,
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
    let homes = if filter.text.is_none() && !filter.needs_attention {
        app.storage.homes(tenant, &filter, &page).await?
    } else {
        let (storage, owner) = (app.storage.clone(), tenant.clone());
        let found = async move { storage.homes(&owner, &filter, &page).await };
        search(&app.searches, tenant, found).await?
    };
    Ok(Document(query.list(homes, |home| home.id.clone())?))
}

/// Returns the places of searches.
pub(super) fn searches() -> FairPlaces {
    FairPlaces::new(SEARCHES, SEARCHES_OF_TENANT)
}

/// Runs a search in a place of the tenant. It keeps the place if its client leaves, because its statement runs on.
pub(super) async fn search<T: Send + 'static>(
    searches: &FairPlaces,
    tenant: &Tenant,
    found: impl Future<Output = T> + Send + 'static,
) -> T {
    let place = searches.take(tenant.name()).await;
    to_the_end(async move {
        let _place = place;
        found.await
    })
    .await
}

/// Remove a home with all its data
#[utoipa::path(delete, path = "/v1/homes/{home}", tag = "homes", params(HomePath,
        ("If-Match" = Option<String>, Header, description = "The `ETag` of the home as it was read")),
    responses(
        (status = 204, description = "The home is removed"),
        (status = 412, description = "The home was changed since it was read: `changed-meanwhile`"),
        CommonProblems))]
pub(super) async fn delete_home(
    State(app): State<App>,
    HomePath { home }: HomePath,
    headers: HeaderMap,
) -> Result<StatusCode, Error> {
    to_the_end(async move {
        app.storage
            .delete_home(&home, is_expected::<Home, viola_storage::Home>(headers), app.storage.now())
            .await?;
        app.queue.wake();
        Ok(StatusCode::NO_CONTENT)
    })
    .await
}

#[cfg(test)]
mod tests {
    use super::*;
    use futures::poll;
    use std::pin::pin;
    use tokio::sync::oneshot;

    #[tokio::test]
    async fn a_search_keeps_its_place_when_its_client_leaves() {
        let (searches, tenant) = (searches(), Tenant::default());
        let (end, ended) = oneshot::channel::<()>();
        let mut left = Box::pin(search(&searches, &tenant, ended));
        assert!(poll!(&mut left).is_pending());
        drop(left);
        let mut next = pin!(search(&searches, &tenant, async { 7 }));
        assert!(poll!(&mut next).is_pending());
        let other: Tenant = "bolt".parse().unwrap();
        assert_eq!(search(&searches, &other, async { 3 }).await, 3);
        assert!(poll!(&mut next).is_pending(), "the statement of the client that left still runs");
        end.send(()).unwrap();
        assert_eq!(next.await, 7);
    }
}
