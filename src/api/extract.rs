//! axum's extractors with our own refusals: axum answers in plain text.

use super::error::Error;
use crate::storage::HomeId;
use axum::extract::path::ErrorKind;
use axum::extract::rejection::{JsonRejection, PathRejection};
use axum::extract::{FromRequest, FromRequestParts, Request};
use axum::http::request::Parts;
use serde::Deserialize;
use serde::de::DeserializeOwned;
use uuid::Uuid;

/// A path to a home.
#[derive(Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Path)]
pub(super) struct HomePath {
    /// Chosen by the client.
    pub home: HomeId,
}

/// A path to a clip.
#[derive(Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Path)]
pub(super) struct ClipPath {
    pub home: HomeId,
    pub clip: Uuid,
}

/// A path to a job.
#[derive(Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Path)]
pub(super) struct JobPath {
    pub job: Uuid,
}

/// The variable parts of the path.
pub(super) struct Path<T>(pub T);

impl<S: Send + Sync, T: DeserializeOwned + Send> FromRequestParts<S> for Path<T> {
    type Rejection = Error;

    async fn from_request_parts(parts: &mut Parts, state: &S) -> Result<Path<T>, Error> {
        match axum::extract::Path::from_request_parts(parts, state).await {
            Ok(axum::extract::Path(value)) => Ok(Path(value)),
            Err(PathRejection::FailedToDeserializePathParams(error)) => {
                let field = match error.kind() {
                    ErrorKind::ParseErrorAtKey { key, .. }
                    | ErrorKind::DeserializeError { key, .. }
                    | ErrorKind::InvalidUtf8InPathParam { key } => Some(key.clone()),
                    _ => None,
                };
                let detail = match error.kind() {
                    ErrorKind::DeserializeError { message, .. } | ErrorKind::Message(message) => {
                        message.clone()
                    }
                    other => other.to_string(),
                };
                Err(Error::InvalidPath { field, detail })
            }
            Err(other) => Err(Error::InvalidPath { field: None, detail: other.body_text() }),
        }
    }
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

/// A JSON body. Without a body and its media type, the default.
pub(super) struct Json<T>(pub T);

impl<S: Send + Sync, T: DeserializeOwned + Default> FromRequest<S> for Json<T> {
    type Rejection = Error;

    async fn from_request(request: Request, state: &S) -> Result<Json<T>, Error> {
        match Option::<axum::Json<T>>::from_request(request, state).await {
            Ok(body) => Ok(Json(body.map(|axum::Json(value)| value).unwrap_or_default())),
            Err(rejection) => Err(refused_json(&rejection)),
        }
    }
}

fn refused_json(rejection: &JsonRejection) -> Error {
    let detail = rejection.body_text();
    match rejection {
        JsonRejection::JsonDataError(_) => Error::InvalidBody(detail),
        JsonRejection::JsonSyntaxError(_) => Error::MalformedJson(detail),
        JsonRejection::MissingJsonContentType(_) => Error::UnsupportedMediaType(detail),
        other if other.status() == axum::http::StatusCode::PAYLOAD_TOO_LARGE => {
            Error::BodyTooLarge { limit: super::MAX_JSON_BYTES as u64 }
        }
        _ => Error::BodyIncomplete(detail),
    }
}

/// The `Idempotency-Key` header, when there is one: 1 to 255 visible ASCII characters.
pub(super) struct IdempotencyKey(pub Option<String>);

impl<S: Send + Sync> FromRequestParts<S> for IdempotencyKey {
    type Rejection = Error;

    async fn from_request_parts(parts: &mut Parts, _state: &S) -> Result<IdempotencyKey, Error> {
        let Some(value) = parts.headers.get("idempotency-key") else { return Ok(IdempotencyKey(None)) };
        let bytes = value.as_bytes();
        if bytes.is_empty() || bytes.len() > 255 || !bytes.iter().all(u8::is_ascii_graphic) {
            let detail = "an Idempotency-Key is 1 to 255 visible ASCII characters".to_owned();
            return Err(Error::InvalidHeader { field: "Idempotency-Key", detail });
        }
        Ok(IdempotencyKey(Some(String::from_utf8_lossy(bytes).into_owned())))
    }
}
