//! Lists page by cursor: an answer's `next` is the `after` of the following request.

use super::error::Error;
use super::extract::timestamp;
use base64::Engine;
use base64::prelude::BASE64_URL_SAFE_NO_PAD;
use jiff::Timestamp;
use serde::{Deserialize, Serialize};
use std::str::FromStr;
use viola_storage::Page;

const DEFAULT_LIMIT: u32 = 50;
const MAX_LIMIT: u32 = 200;

/// The query of every list.
#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
pub(super) struct ListQuery {
    /// Maximum number of items; default 50.
    #[param(value_type = Option<u32>, minimum = 1, maximum = 200)]
    limit: Option<String>,
    /// `next` of the previous page.
    #[param(min_length = 1, pattern = "^[A-Za-z0-9_-]+$")]
    after: Option<String>,
}

/// The query of lists that can be filtered by the time of the last change.
#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
pub(super) struct UpdatedQuery {
    /// Only items that changed after this time; send it for every page. Pages are ordered by id: the change
    /// of an item on an earlier page is found by the next reading, or in `/v1/changes`.
    #[param(value_type = Option<Timestamp>, example = "2026-03-14T15:09:26Z")]
    updated_after: Option<String>,
}

impl UpdatedQuery {
    pub fn updated_after(&self) -> Result<Option<Timestamp>, Error> {
        self.updated_after.as_deref().map(|text| timestamp("updated_after", text)).transpose()
    }
}

/// One page of a list.
#[derive(Debug, Serialize, utoipa::ToSchema)]
pub(super) struct List<T> {
    items: Vec<T>,
    /// Cursor for `after` in the request of the next page; null on the last page.
    next: Option<String>,
}

impl ListQuery {
    /// Returns the page to read, with one item more than asked for, to know whether there is a next page.
    pub fn page<Id: FromStr>(&self) -> Result<Page<Id>, Error> {
        Ok(Page { limit: self.limit()? + 1, after: self.after()? })
    }

    /// Returns the decoded cursor.
    pub fn after<Id: FromStr>(&self) -> Result<Option<Id>, Error> {
        self.after.as_deref().map(decode).transpose()
    }

    pub fn list<Record, T: From<Record>, Id: ToString>(
        &self,
        mut records: Vec<Record>,
        id: impl Fn(&Record) -> Id,
    ) -> Result<List<T>, Error> {
        let limit = self.limit()? as usize;
        let has_more = records.len() > limit;
        records.truncate(limit);
        let next = records.last().filter(|_| has_more).map(|last| encode(&id(last).to_string()));
        Ok(List { items: records.into_iter().map(T::from).collect(), next })
    }

    pub fn limit(&self) -> Result<u32, Error> {
        let Some(text) = &self.limit else { return Ok(DEFAULT_LIMIT) };
        text.parse().ok().filter(|limit| (1..=MAX_LIMIT).contains(limit)).ok_or_else(|| Error::InvalidQuery {
            field: Some("limit"),
            detail: format!("limit is a number from 1 to {MAX_LIMIT}"),
        })
    }
}

/// Parses names of states, separated by commas; returns none if `asked` is absent.
pub(super) fn states<S: Copy>(
    asked: Option<&str>,
    all: &[S],
    name: impl Fn(S) -> &'static str,
) -> Result<Vec<S>, Error> {
    let names = asked.iter().flat_map(|text| text.split(','));
    let found =
        names.map(|asked| all.iter().copied().find(|state| name(*state) == asked)).collect::<Option<_>>();
    found.ok_or_else(|| {
        let all: Vec<&str> = all.iter().map(|state| name(*state)).collect();
        let detail = format!("state is of {}, with commas between them", all.join(", "));
        Error::InvalidQuery { field: Some("state"), detail }
    })
}

pub(super) fn encode(id: &str) -> String {
    BASE64_URL_SAFE_NO_PAD.encode(id)
}

fn decode<Id: FromStr>(cursor: &str) -> Result<Id, Error> {
    let bytes = BASE64_URL_SAFE_NO_PAD.decode(cursor).ok();
    // An empty cursor is invalid in every list, even if its ids are any text.
    let text = bytes.filter(|bytes| !bytes.is_empty()).and_then(|bytes| String::from_utf8(bytes).ok());
    text.and_then(|text| text.parse().ok()).ok_or_else(|| Error::InvalidQuery {
        field: Some("after"),
        detail: "after is not a cursor that this list gave as next".to_owned(),
    })
}
