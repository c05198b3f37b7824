//! Lists page by cursor: an answer's `next` is the `after` of the following request.

use super::error::Error;
use super::extract::timestamp;
use crate::storage::Page;
use base64::Engine;
use base64::prelude::BASE64_URL_SAFE_NO_PAD;
use jiff::Timestamp;
use serde::{Deserialize, Serialize};
use std::str::FromStr;

const DEFAULT_LIMIT: u32 = 50;
const MAX_LIMIT: u32 = 200;

/// The query of every list.
#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
pub(super) struct ListQuery {
    /// How many items at most; 50 when not given.
    #[param(value_type = Option<u32>, minimum = 1, maximum = 200)]
    limit: Option<String>,
    /// `next` of the page before.
    #[param(min_length = 1, pattern = "^[A-Za-z0-9_-]+$")]
    after: Option<String>,
}

/// The query of lists that can be asked for what changed.
#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
pub(super) struct UpdatedQuery {
    /// Only what changed later than this. A page goes on behind an id, so what changes behind it while the pages are
    /// read is found by the next reading, or in `/v1/changes`. To be given with every page.
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
    /// Goes into `after` for the next page; null on the last.
    next: Option<String>,
}

impl ListQuery {
    /// One item more than asked for, to know whether there is a next page.
    pub fn page<Id: FromStr>(&self) -> Result<Page<Id>, Error> {
        Ok(Page { limit: self.limit()? + 1, after: self.after()? })
    }

    /// The cursor.
    pub fn after<Id: FromStr>(&self) -> Result<Option<Id>, Error> {
        self.after.as_deref().map(decode).transpose()
    }

    pub fn list<T, Id: ToString>(&self, mut items: Vec<T>, id: impl Fn(&T) -> Id) -> Result<List<T>, Error> {
        let limit = self.limit()? as usize;
        let has_more = items.len() > limit;
        items.truncate(limit);
        let next = items.last().filter(|_| has_more).map(|item| encode(&id(item).to_string()));
        Ok(List { items, next })
    }

    pub fn limit(&self) -> Result<u32, Error> {
        let Some(text) = &self.limit else { return Ok(DEFAULT_LIMIT) };
        text.parse().ok().filter(|limit| (1..=MAX_LIMIT).contains(limit)).ok_or_else(|| Error::InvalidQuery {
            field: Some("limit"),
            detail: format!("limit is a number from 1 to {MAX_LIMIT}"),
        })
    }
}

/// States by their names, with commas between them; none when not given.
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
    // Nothing is a cursor of no list, also where ids are any text.
    let text = bytes.filter(|bytes| !bytes.is_empty()).and_then(|bytes| String::from_utf8(bytes).ok());
    text.and_then(|text| text.parse().ok()).ok_or_else(|| Error::InvalidQuery {
        field: Some("after"),
        detail: "after is not a cursor that this list gave as next".to_owned(),
    })
}
