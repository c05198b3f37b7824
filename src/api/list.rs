//! Lists page by cursor: an answer's `next` is the `after` of the following request.

use super::error::Error;
use super::extract::{Query, invalid_query, query_number, timestamp};
use axum::extract::FromRequestParts;
use axum::http::request::Parts;
use base64::Engine;
use base64::prelude::BASE64_URL_SAFE_NO_PAD;
use jiff::Timestamp;
use serde::{Deserialize, Serialize};
use std::fmt::Display;
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
    /// Returns the cursor of the feed of changes. It names no list, because clients keep it for days.
    pub fn position<Position: FromStr>(&self) -> Result<Option<Position>, Error> {
        let parse = |cursor: &str| decode(cursor)?.parse::<Position>().ok();
        self.after.as_deref().map(|cursor| parse(cursor).ok_or_else(not_a_cursor)).transpose()
    }

    pub fn limit(&self) -> Result<u32, Error> {
        let (limits, what) = (1..=MAX_LIMIT, format!("a number from 1 to {MAX_LIMIT}"));
        let limit = query_number("limit", self.limit.as_deref(), |limit| limits.contains(limit), &what)?;
        Ok(limit.unwrap_or(DEFAULT_LIMIT))
    }
}

/// The page that a request asks for. Its cursors name the list, because an id of one list is a wrong place in another.
pub(super) struct ListPage {
    query: ListQuery,
    /// Path of the list.
    list: String,
}

impl<S: Send + Sync> FromRequestParts<S> for ListPage {
    type Rejection = Error;

    async fn from_request_parts(parts: &mut Parts, state: &S) -> Result<ListPage, Error> {
        let Query(query) = Query::<ListQuery>::from_request_parts(parts, state).await?;
        Ok(ListPage { query, list: parts.uri.path().to_owned() })
    }
}

impl ListPage {
    /// Returns the page to read, with one item more than asked for, to know whether there is a next page.
    pub fn page<Id: FromStr>(&self) -> Result<Page<Id>, Error> {
        let after = self.query.after.as_deref().map(|cursor| self.id(cursor).ok_or_else(not_a_cursor));
        Ok(Page { limit: self.query.limit()? + 1, after: after.transpose()? })
    }

    /// Returns the id in a cursor; `None` if the cursor is not one of this list.
    fn id<Id: FromStr>(&self, cursor: &str) -> Option<Id> {
        // A path has no space.
        let text = decode(cursor)?;
        let id = text.strip_prefix(self.list.as_str())?.strip_prefix(' ')?;
        // PostgreSQL fails on a text with a NUL.
        if id.is_empty() || id.contains('\0') { None } else { id.parse().ok() }
    }

    pub fn list<Record, T: From<Record>, Id: Display>(
        &self,
        mut records: Vec<Record>,
        id: impl Fn(&Record) -> Id,
    ) -> Result<List<T>, Error> {
        let limit = self.query.limit()? as usize;
        let has_more = records.len() > limit;
        records.truncate(limit);
        let next = records.last().filter(|_| has_more);
        let next = next.map(|last| encode(&format!("{} {}", self.list, id(last))));
        Ok(List { items: records.into_iter().map(T::from).collect(), next })
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
        invalid_query("state", format!("state is of {}, with commas between them", all.join(", ")))
    })
}

pub(super) fn encode(text: &str) -> String {
    BASE64_URL_SAFE_NO_PAD.encode(text)
}

fn decode(cursor: &str) -> Option<String> {
    String::from_utf8(BASE64_URL_SAFE_NO_PAD.decode(cursor).ok()?).ok()
}

/// Returns the refusal of a cursor.
pub(super) fn not_a_cursor() -> Error {
    invalid_query("after", "after is not a cursor that this list gave as next; begin again without after")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn page(list: &str, after: Option<String>) -> ListPage {
        ListPage { query: ListQuery { limit: Some("1".to_owned()), after }, list: list.to_owned() }
    }

    #[test]
    fn a_cursor_belongs_to_one_list() {
        let ids = vec![7_i64, 8];
        let first: List<i64> = page("/v1/a", None).list(ids, |id| *id).unwrap();
        assert_eq!(first.items, [7]);
        let next = first.next.unwrap();
        assert_eq!(page("/v1/a", Some(next.clone())).page::<i64>().unwrap().after, Some(7));
        for other in ["/v1/b", "/v1", "/v1/a/b", ""] {
            let refused = page(other, Some(next.clone())).page::<i64>().map(|page| page.after).unwrap_err();
            assert_eq!(refused.problem().field.as_deref(), Some("after"), "{other}");
        }
        // Those of the feed, of earlier versions, and without an id.
        for text in ["7", "4711.1773500966535", "", "/v1/a", "/v1/a ", "/v1/a7", "/v1/a x"] {
            assert!(page("/v1/a", Some(encode(text))).page::<i64>().is_err(), "{text}");
        }
        assert!(page("/v1/a", Some("*".to_owned())).page::<i64>().is_err());
        for (text, is_good) in [("/v1/a h sofa-1", true), ("/v1/a h sofa\0", false)] {
            assert_eq!(page("/v1/a", Some(encode(text))).page::<String>().is_ok(), is_good, "{text:?}");
        }
    }
}
