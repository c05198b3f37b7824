//! axum's extractors with our own refusals, since axum's refusals are plain text.

mod object;

use super::App;
use super::access;
use super::bodies::media_type;
use super::error::Error;
use super::types;
use axum::extract::rejection::JsonRejection;
use axum::extract::{FromRequest, FromRequestParts, RawPathParams, Request};
use axum::http::request::Parts;
use axum::http::{HeaderMap, header};
use jiff::Timestamp;
use object::Object;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Deserializer};
use serde_json::Value;
use std::borrow::Cow;
use std::fmt::Display;
use std::str::FromStr;
use uuid::Uuid;
use viola_geometry::LevelName;
use viola_storage::{HomeId, UploadError};

/// Maximum characters of a media type, or of the path of a repeated member, that an answer repeats.
const MAX_SHOWN_CHARACTERS: usize = 64;

/// A path to a home.
#[derive(utoipa::IntoParams)]
#[into_params(parameter_in = Path)]
pub(super) struct HomePath {
    /// Chosen by the client.
    #[param(value_type = types::HomeId)]
    pub home: HomeId,
}

/// A path to the LiDAR map of a level.
#[derive(utoipa::IntoParams)]
#[into_params(parameter_in = Path)]
pub(super) struct LevelPath {
    #[param(value_type = types::HomeId)]
    pub home: HomeId,
    /// Chosen by the client.
    #[param(value_type = types::LevelName)]
    pub level: LevelName,
}

/// A path to a revision of the LiDAR map of a level.
#[derive(utoipa::IntoParams)]
#[into_params(parameter_in = Path)]
pub(super) struct LevelRevisionPath {
    #[param(value_type = types::HomeId)]
    pub home: HomeId,
    #[param(value_type = types::LevelName)]
    pub level: LevelName,
    /// Number of the revision.
    #[param(minimum = 1, example = 1)]
    pub revision: i64,
}

/// A path to a clip.
#[derive(utoipa::IntoParams)]
#[into_params(parameter_in = Path)]
pub(super) struct ClipPath {
    #[param(value_type = types::HomeId)]
    pub home: HomeId,
    pub clip: Uuid,
}

/// A path to an object of a home's map.
#[derive(utoipa::IntoParams)]
#[into_params(parameter_in = Path)]
pub(super) struct ObjectPath {
    #[param(value_type = types::HomeId)]
    pub home: HomeId,
    /// Id of the object.
    #[param(pattern = "^[^\\x00]+$", example = "sofa-1")]
    pub object: String,
}

/// A path to a room of a home's map.
#[derive(utoipa::IntoParams)]
#[into_params(parameter_in = Path)]
pub(super) struct RoomPath {
    #[param(value_type = types::HomeId)]
    pub home: HomeId,
    /// Id of the room.
    #[param(pattern = "^[^\\x00]+$", example = "1")]
    pub room: String,
}

/// Extracts the paths below a home. Each further part is read by a method of [`Path`].
macro_rules! paths_below_home {
    ($($name:ident { $($part:ident: $read:ident),* })*) => {
        $(impl<S: Send + Sync> FromRequestParts<S> for $name {
            type Rejection = Error;

            async fn from_request_parts(parts: &mut Parts, state: &S) -> Result<$name, Error> {
                let path = Path::of(parts, state).await?;
                let home = access::of(parts)?.home(&path.part("home")?)?;
                Ok($name { home, $($part: path.$read(stringify!($part))?),* })
            }
        })*
    };
}

paths_below_home! {
    HomePath {}
    LevelPath { level: part }
    LevelRevisionPath { level: part, revision: number }
    ClipPath { clip: id }
    ObjectPath { object: id_in_map }
    RoomPath { room: id_in_map }
}

/// A path to an upload.
#[derive(utoipa::IntoParams)]
#[into_params(parameter_in = Path)]
pub(super) struct UploadPath {
    pub upload: Uuid,
}

/// A path to a job.
#[derive(utoipa::IntoParams)]
#[into_params(parameter_in = Path)]
pub(super) struct JobPath {
    pub job: Uuid,
}

/// A path to a webhook.
#[derive(utoipa::IntoParams)]
#[into_params(parameter_in = Path)]
pub(super) struct WebhookPath {
    pub webhook: Uuid,
}

/// A path to a message of a webhook.
#[derive(utoipa::IntoParams)]
#[into_params(parameter_in = Path)]
pub(super) struct DeliveryPath {
    pub webhook: Uuid,
    pub delivery: Uuid,
}

impl<S: Send + Sync> FromRequestParts<S> for WebhookPath {
    type Rejection = Error;

    async fn from_request_parts(parts: &mut Parts, state: &S) -> Result<WebhookPath, Error> {
        Ok(WebhookPath { webhook: Path::of(parts, state).await?.id("webhook")? })
    }
}

impl<S: Send + Sync> FromRequestParts<S> for DeliveryPath {
    type Rejection = Error;

    async fn from_request_parts(parts: &mut Parts, state: &S) -> Result<DeliveryPath, Error> {
        let path = Path::of(parts, state).await?;
        Ok(DeliveryPath { webhook: path.id("webhook")?, delivery: path.id("delivery")? })
    }
}

/// Refuses an upload that the caller may not access; the handler refuses one that does not exist.
impl FromRequestParts<App> for UploadPath {
    type Rejection = Error;

    async fn from_request_parts(parts: &mut Parts, app: &App) -> Result<UploadPath, Error> {
        let upload = Path::of(parts, app).await?.id("upload")?;
        let caller = access::of(parts)?;
        if let Some((tenant, home)) = app.storage.upload_owner(upload).await?
            && !(caller.tenant == tenant && home.is_none_or(|home| caller.may_know(&home)))
        {
            return Err(UploadError::NotFound.into());
        }
        Ok(UploadPath { upload })
    }
}

/// Refuses a job that the caller may not access; the handler refuses one that does not exist.
impl FromRequestParts<App> for JobPath {
    type Rejection = Error;

    async fn from_request_parts(parts: &mut Parts, app: &App) -> Result<JobPath, Error> {
        let job = Path::of(parts, app).await?.id("job")?;
        let caller = access::of(parts)?;
        match app.storage.job_home(job).await? {
            Some(home) if !caller.may_know(&home) => Err(Error::NoSuchJob),
            _ => Ok(JobPath { job }),
        }
    }
}

/// The variable parts of a path, decoded.
struct Path(RawPathParams);

impl Path {
    /// The names of all variable parts.
    const NAMES: [&str; 10] =
        ["clip", "delivery", "home", "job", "level", "object", "revision", "room", "upload", "webhook"];

    async fn of<S: Send + Sync>(parts: &mut Parts, state: &S) -> Result<Path, Error> {
        match RawPathParams::from_request_parts(parts, state).await {
            Ok(params) => Ok(Path(params)),
            Err(rejection) => {
                let detail = rejection.body_text();
                let field = Path::NAMES.into_iter().find(|name| detail.contains(&format!("`{name}`")));
                Err(Error::InvalidPath { field, detail })
            }
        }
    }

    fn part<T: FromStr<Err: Display>>(&self, name: &'static str) -> Result<T, Error> {
        self.text(name).parse().map_err(|error: T::Err| invalid(name, format!("{name}: {error}")))
    }

    fn id(&self, name: &'static str) -> Result<Uuid, Error> {
        let what = "is a UUID, for example 01a1f766-7a97-7747-9dbb-391e0eeccb64";
        self.text(name).parse().map_err(|_| invalid(name, format!("{name} {what}")))
    }

    /// Returns the id of an object or a room. PostgreSQL fails on a text with a NUL.
    fn id_in_map(&self, name: &'static str) -> Result<String, Error> {
        let id = self.text(name);
        if id.contains('\0') {
            return Err(invalid(name, format!("{name} is an id of the map, and has a NUL character")));
        }
        Ok(id.to_owned())
    }

    fn number(&self, name: &'static str) -> Result<i64, Error> {
        let number = self.text(name).parse().ok().filter(|number| *number > 0);
        number.ok_or_else(|| invalid(name, format!("{name} is a whole number from 1")))
    }

    fn text(&self, name: &str) -> &str {
        self.0.iter().find(|(other, _)| *other == name).map_or("", |(_, text)| text)
    }
}

fn invalid(field: &'static str, detail: String) -> Error {
    Error::InvalidPath { field: Some(field), detail }
}

/// The query parameters.
pub(super) struct Query<T>(pub T);

impl<S: Send + Sync, T: DeserializeOwned> FromRequestParts<S> for Query<T> {
    type Rejection = Error;

    async fn from_request_parts(parts: &mut Parts, state: &S) -> Result<Query<T>, Error> {
        match axum::extract::Query::from_request_parts(parts, state).await {
            Ok(axum::extract::Query(value)) => Ok(Query(value)),
            Err(rejection) => Err(Error::InvalidQuery { field: None, detail: rejection.body_text() }),
        }
    }
}

/// Returns the refusal of a query parameter.
pub(super) fn invalid_query(field: impl Into<Cow<'static, str>>, detail: impl Into<String>) -> Error {
    Error::InvalidQuery { field: Some(field.into()), detail: detail.into() }
}

/// Parses the number of a query parameter. `what` says which numbers are accepted.
pub(super) fn query_number<T: FromStr>(
    field: &'static str,
    text: Option<&str>,
    is_accepted: impl Fn(&T) -> bool,
    what: &str,
) -> Result<Option<T>, Error> {
    let parse = |text: &str| text.parse().ok().filter(&is_accepted);
    text.map(|text| parse(text).ok_or_else(|| invalid_query(field, format!("{field} is {what}")))).transpose()
}

/// Parses the time of a query parameter.
pub(super) fn timestamp(field: &'static str, text: &str) -> Result<Timestamp, Error> {
    rfc3339(field, text)
        .map_err(|detail| invalid_query(field, format!("{detail}; in a query, + is written %2B")))
}

/// Parses a time; an error is its explanation.
pub(super) fn rfc3339(field: &'static str, text: &str) -> Result<Timestamp, String> {
    text.parse().map_err(|error: jiff::Error| {
        format!("{field} is a time of RFC 3339 as 2026-03-14T15:09:26Z ({error})")
    })
}

/// A JSON object as the body; the default if the body is `null` or absent.
pub(super) struct Json<T>(pub T);

impl<T: DeserializeOwned + Default> FromRequest<App> for Json<T> {
    type Rejection = Error;

    async fn from_request(request: Request, app: &App) -> Result<Json<T>, Error> {
        if !has_body(request.headers()) {
            return Ok(Json(T::default()));
        }
        // axum ignores a body without a media type.
        if !request.headers().contains_key(header::CONTENT_TYPE) {
            let detail = "the body has no media type: add the header `Content-Type: application/json`";
            return Err(Error::UnsupportedMediaType(detail.to_owned()));
        }
        let sent = media_type(request.headers());
        // Parsed as an object first, because serde also accepts an array for a struct.
        let read = Option::<axum::Json<Option<Object>>>::from_request(request, app);
        let late = |_| {
            let limit = app.bodies.json;
            Error::BodyStalled(format!("JSON must be complete within {} s", limit.as_secs_f64()))
        };
        match tokio::time::timeout(app.bodies.json, read).await.map_err(late)? {
            Ok(None | Some(axum::Json(None))) => Ok(Json(T::default())),
            Ok(Some(axum::Json(Some(object)))) => parsed(object).map(Json),
            Err(rejection) => Err(refused_json(&rejection, &sent)),
        }
    }
}

/// Returns whether a body follows the headers of a request (RFC 9112, section 6.3).
pub(super) fn has_body(headers: &HeaderMap) -> bool {
    let length = headers.get(header::CONTENT_LENGTH).is_some_and(|length| length != "0");
    length || headers.contains_key(header::TRANSFER_ENCODING)
}

/// Parses a JSON object; a refusal names the member at fault.
fn parsed<T: DeserializeOwned>(object: Object) -> Result<T, Error> {
    if let Some(path) = object.repeated {
        let field: String = path.chars().take(MAX_SHOWN_CHARACTERS).collect();
        let detail = format!("{field}: the body has this member twice; send it once");
        return Err(Error::MalformedJson { field: Some(field), detail });
    }
    serde_path_to_error::deserialize(Value::Object(object.members)).map_err(|error| {
        let path = Some(error.path().to_string()).filter(|path| path != ".");
        let reason = error.inner().to_string();
        let detail = path.as_ref().map_or_else(|| reason.clone(), |path| format!("{path}: {reason}"));
        // The path ends at the object without the member.
        let missing = || Some(reason.strip_prefix("missing field `")?.split_once('`')?.0.to_owned());
        Error::InvalidBody { field: path.or_else(missing).map(Cow::from), detail }
    })
}

/// A member of a JSON Merge Patch (RFC 7396): absent, null or a value, which is parsed by hand, so that a
/// refusal names the member at fault.
pub(super) type Member = Option<Option<Value>>;

pub(super) fn member<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Member, D::Error> {
    Option::<Value>::deserialize(deserializer).map(Some)
}

/// Returns the refusal of a member's value, in words of what it may be.
pub(super) fn wrong(field: &'static str, what: &str) -> Error {
    Error::InvalidBody { field: Some(field.into()), detail: format!("{field} is {what}") }
}

/// `sent` is the media type of the body.
fn refused_json(rejection: &JsonRejection, sent: &str) -> Error {
    let detail = rejection.body_text();
    match rejection {
        JsonRejection::JsonDataError(_) => {
            Error::InvalidBody { field: None, detail: "the body is a JSON object".to_owned() }
        }
        JsonRejection::JsonSyntaxError(_) => Error::MalformedJson { field: None, detail },
        JsonRejection::MissingJsonContentType(_) => {
            let sent: String = sent.chars().take(MAX_SHOWN_CHARACTERS).collect();
            Error::UnsupportedMediaType(format!(
                "the body came as `{sent}`, and this operation takes JSON: send it as `Content-Type: application/json`"
            ))
        }
        other if other.status() == axum::http::StatusCode::PAYLOAD_TOO_LARGE => {
            Error::BodyTooLarge { limit: super::MAX_JSON_BYTES as u64 }
        }
        _ => Error::BodyIncomplete(detail),
    }
}

/// The `Idempotency-Key` header, if there is one: 1 to 255 visible ASCII characters.
pub(super) struct IdempotencyKey(pub Option<String>);

impl<S: Send + Sync> FromRequestParts<S> for IdempotencyKey {
    type Rejection = Error;

    async fn from_request_parts(parts: &mut Parts, _state: &S) -> Result<IdempotencyKey, Error> {
        const FIELD: &str = "Idempotency-Key";
        let mut values = parts.headers.get_all(FIELD).iter();
        let Some(value) = values.next() else { return Ok(IdempotencyKey(None)) };
        if values.next().is_some() {
            return Err(Error::InvalidHeader { field: FIELD, detail: format!("{FIELD} was sent twice") });
        }
        let bytes = value.as_bytes();
        if !is_idempotency_key(bytes) {
            let detail = "an Idempotency-Key is 1 to 255 visible ASCII characters".to_owned();
            return Err(Error::InvalidHeader { field: FIELD, detail });
        }
        Ok(IdempotencyKey(Some(String::from_utf8_lossy(bytes).into_owned())))
    }
}

pub(super) fn is_idempotency_key(bytes: &[u8]) -> bool {
    (1..=255).contains(&bytes.len()) && bytes.iter().all(u8::is_ascii_graphic)
}
