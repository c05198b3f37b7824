//! Lists of clips: `/v1/homes/{home}/clips` and, of all homes, `/v1/clips`.

use super::App;
use super::access::Caller;
use super::error::Error;
use super::extract::{HomePath, Query, invalid_query};
use super::homes::search;
use super::list::{List, ListPage, ListQuery, UpdatedQuery, states};
use super::problems::CommonProblems;
use super::reply::Document;
use super::types::{Clip, ClipState, ReasonCode};
use axum::extract::State;
use serde::Deserialize;
use viola_storage::ClipFilter;

/// The filter of a list of clips.
#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
pub(super) struct ClipsQuery {
    /// Only clips in one of these states, separated by commas. Send it with the request of every page.
    #[param(value_type = Option<Vec<ClipState>>, style = Form, explode = false, min_items = 1, example = json!(["ambiguous", "failed"]))]
    state: Option<String>,
    /// Only clips with one of these codes among their reasons: at most 4, separated by commas. Send it with the request of
    /// every page.
    #[param(value_type = Option<Vec<ReasonCode>>, style = Form, explode = false, min_items = 1, max_items = 4, example = json!(["several_modes"]))]
    code: Option<String>,
}

impl ClipsQuery {
    fn filter(&self, updated: &UpdatedQuery) -> Result<ClipFilter, Error> {
        let all = &viola_storage::ClipState::ALL;
        Ok(ClipFilter {
            states: states(self.state.as_deref(), all, viola_storage::ClipState::name)?,
            codes: codes(self.code.as_deref())?,
            updated_after: updated.updated_after()?,
        })
    }
}

/// Parses codes of reasons, separated by commas; returns none if `asked` is absent.
fn codes(asked: Option<&str>) -> Result<Vec<String>, Error> {
    let codes: Vec<&str> = asked.iter().flat_map(|text| text.split(',')).collect();
    if codes.len() > ClipFilter::MAX_CODES {
        return Err(invalid_query("code", format!("code has at most {} codes", ClipFilter::MAX_CODES)));
    }
    if !codes.iter().all(|code| ReasonCode::is_known(code)) {
        let detail =
            "code is of the codes of reasons, with commas between them; the schema ReasonCode lists them";
        return Err(invalid_query("code", detail));
    }
    Ok(codes.into_iter().map(str::to_owned).collect())
}

/// List the clips of a home, oldest first
#[utoipa::path(get, path = "/v1/homes/{home}/clips", tag = "clips",
    params(HomePath, ListQuery, UpdatedQuery, ClipsQuery),
    responses((status = 200, description = "One page", body = List<Clip>), CommonProblems))]
pub(super) async fn list_clips(
    State(app): State<App>,
    HomePath { home }: HomePath,
    query: ListPage,
    Query(updated): Query<UpdatedQuery>,
    Query(asked): Query<ClipsQuery>,
) -> Result<Document<List<Clip>>, Error> {
    let clips = app.storage.clips(&home, &asked.filter(&updated)?, &query.page()?).await?;
    Ok(Document(query.list(clips, |clip| clip.id)?))
}

/// List the clips of all homes, oldest first
///
/// `state=failed,ambiguous` selects the clips that a person should look at, `code` those with a reason, in whatever home.
#[utoipa::path(get, path = "/v1/clips", tag = "clips", params(ListQuery, UpdatedQuery, ClipsQuery),
    responses((status = 200, description = "One page", body = List<Clip>), CommonProblems))]
pub(super) async fn list_all_clips(
    State(app): State<App>,
    caller: Caller,
    query: ListPage,
    Query(updated): Query<UpdatedQuery>,
    Query(asked): Query<ClipsQuery>,
) -> Result<Document<List<Clip>>, Error> {
    let tenant = caller.for_all_homes()?;
    let (filter, page) = (asked.filter(&updated)?, query.page()?);
    let (storage, owner) = (app.storage.clone(), tenant.clone());
    // It may read all clips of the tenant.
    let found = async move { storage.clips_of_tenant(&owner, &filter, &page).await };
    let clips = search(&app.searches, tenant, found).await?;
    Ok(Document(query.list(clips, |clip| clip.id)?))
}

#[cfg(test)]
mod tests {
    use super::codes;

    #[test]
    fn codes_are_known_ones() {
        assert!(codes(None).unwrap().is_empty());
        assert_eq!(codes(Some("no_floor,bad_picture")).unwrap(), ["no_floor", "bad_picture"]);
        for bad in
            ["", "no_floor,", "No_floor", "no-floor", "x", "no_floor,no_floor,no_floor,no_floor,no_floor"]
        {
            assert_eq!(codes(Some(bad)).unwrap_err().problem().field.as_deref(), Some("code"), "{bad}");
        }
    }
}
