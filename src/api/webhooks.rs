//! `/v1/webhooks`

use super::App;
use super::access::Caller;
use super::error::Error;
use super::extract::{DeliveryPath, Json, WebhookPath};
use super::list::{List, ListPage, ListQuery};
use super::problems::{CommonProblems, JsonProblems};
use super::reply::Document;
use super::types::{self, Delivery, Webhook};
use crate::webhooks::check_url;
use axum::extract::State;
use axum::http::{StatusCode, header};
use axum::response::IntoResponse;
use jiff::Timestamp;
use serde::{Deserialize, Serialize};
use uuid::Uuid;
use viola_storage::{ChangeKind, WebhookMade};

/// The settings of a webhook.
#[derive(Debug, Default, Deserialize, utoipa::ToSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct WebhookBody {
    /// URL to which messages are posted: https, and not an address of a private network.
    #[serde(default)]
    #[schema(required, format = "uri", max_length = 2048, example = "https://fleet.example/hooks/viola")]
    url: String,
    /// Kinds of change to send; default: all. A duplicate is ignored.
    #[serde(default)]
    #[schema(min_items = 1)]
    kinds: Option<Vec<types::ChangeKind>>,
}

/// A webhook with its secret.
#[derive(Debug, Serialize, utoipa::ToSchema)]
pub(super) struct NewWebhook {
    #[serde(flatten)]
    webhook: Webhook,
    /// Secret that signs the messages; it is not shown again.
    #[schema(example = "whsec_MfKQ9r8GKYqrTwjUPD8ILPZIo2LaLaSw0000000000A=")]
    secret: String,
}

/// All webhooks of the tenant.
#[derive(Debug, Serialize, utoipa::ToSchema)]
pub(super) struct Webhooks {
    items: Vec<Webhook>,
}

/// Create a webhook
///
/// Messages follow Standard Webhooks 1.0 (https://www.standardwebhooks.com), whose libraries verify them: a
/// POST of `{"type", "timestamp", "data"}`, where `data` is an item of `/v1/changes` and `type` its kind with
/// `.changed` or `.deleted`, as in `clip.changed`. The secret signs the headers `webhook-id` and
/// `webhook-timestamp` and the body; `webhook-signature` has the signature. Messages arrive at least once,
/// and not always in order: the one with the higher `seq` is newer.
///
/// Every answer except 2xx is retried after 5 s, 5 min, 30 min, 2 h, 5 h, 10 h, 14 h, 20 h and 24 h; 410
/// disables the webhook until a test or a retry of a delivery. Redirects are not followed. A
/// `Retry-After` in seconds lengthens the pause, to at most 24 h. With 1000 pending messages, new ones are
/// delayed until the queue is shorter; the feed keeps only the newest change of each resource. A receiver
/// without answers for three days reads `/v1/changes` from its own cursor; after 30 days from the beginning.
///
/// A repeated request makes another webhook: after a lost answer, list the webhooks and delete the unknown one.
#[utoipa::path(post, path = "/v1/webhooks", tag = "webhooks", request_body = WebhookBody,
    responses(
        (status = 201, description = "The webhook and its secret", body = NewWebhook,
            headers(("Location" = String, description = "The webhook's path"))),
        (status = 409, description = "The tenant has ten webhooks already: `too-many-webhooks`"),
        CommonProblems, JsonProblems))]
pub(super) async fn create_webhook(
    State(app): State<App>,
    caller: Caller,
    Json(body): Json<WebhookBody>,
) -> Result<impl IntoResponse, Error> {
    let tenant = caller.for_all_homes()?;
    let invalid =
        |detail: String, field: &'static str| Error::InvalidBody { field: Some(field.into()), detail };
    if body.url.is_empty() {
        return Err(invalid("url is missing".to_owned(), "url"));
    }
    let url = check_url(&body.url, &app.webhooks).map_err(|error| invalid(error.to_string(), "url"))?;
    let mut kinds = body
        .kinds
        .map_or_else(|| ChangeKind::ALL.to_vec(), |kinds| kinds.into_iter().map(ChangeKind::from).collect());
    let mut seen = Vec::new();
    kinds.retain(|kind| {
        !seen.contains(kind) && {
            seen.push(*kind);
            true
        }
    });
    if kinds.is_empty() {
        return Err(invalid("kinds names at least one kind of change, or is left out".to_owned(), "kinds"));
    }
    match app.storage.create_webhook(tenant, url.as_str(), &kinds, app.storage.now()).await? {
        WebhookMade::Made(webhook, secret) => {
            let location = format!("/v1/webhooks/{}", webhook.id);
            let made = NewWebhook { webhook: webhook.into(), secret: secret.show().to_owned() };
            Ok((StatusCode::CREATED, [(header::LOCATION, location)], Document(made)))
        }
        WebhookMade::TooMany => Err(Error::TooManyWebhooks),
    }
}

/// List the webhooks
#[utoipa::path(get, path = "/v1/webhooks", tag = "webhooks",
    responses((status = 200, description = "All, at most ten", body = Webhooks), CommonProblems))]
pub(super) async fn list_webhooks(
    State(app): State<App>,
    caller: Caller,
) -> Result<Document<Webhooks>, Error> {
    let webhooks = app.storage.webhooks(caller.for_all_homes()?).await?;
    Ok(Document(Webhooks { items: webhooks.into_iter().map(Webhook::from).collect() }))
}

/// Get a webhook
#[utoipa::path(get, path = "/v1/webhooks/{webhook}", tag = "webhooks", params(WebhookPath),
    responses((status = 200, description = "The webhook", body = Webhook), CommonProblems))]
pub(super) async fn get_webhook(
    State(app): State<App>,
    caller: Caller,
    WebhookPath { webhook }: WebhookPath,
) -> Result<Document<Webhook>, Error> {
    Ok(Document(app.storage.webhook(caller.for_all_homes()?, webhook).await?.into()))
}

/// Remove a webhook and its log
#[utoipa::path(delete, path = "/v1/webhooks/{webhook}", tag = "webhooks", params(WebhookPath),
    responses((status = 204, description = "The webhook is removed"), CommonProblems))]
pub(super) async fn delete_webhook(
    State(app): State<App>,
    caller: Caller,
    WebhookPath { webhook }: WebhookPath,
) -> Result<StatusCode, Error> {
    app.storage.delete_webhook(caller.for_all_homes()?, webhook).await?;
    Ok(StatusCode::NO_CONTENT)
}

/// Send a message of the type `webhook.test`
///
/// Its `data` is empty. A webhook that was disabled by 410 is enabled again.
#[utoipa::path(post, path = "/v1/webhooks/{webhook}/test", tag = "webhooks", params(WebhookPath),
    responses((status = 201, description = "The delivery; its state is in the log", body = Delivery), CommonProblems))]
pub(super) async fn test_webhook(
    State(app): State<App>,
    caller: Caller,
    WebhookPath { webhook }: WebhookPath,
) -> Result<(StatusCode, Document<Delivery>), Error> {
    // As the times of the feed, that of the message has milliseconds.
    let now = app.storage.now();
    let now = Timestamp::from_millisecond(now.as_millisecond()).unwrap_or(now);
    let delivery = app.storage.test_webhook(caller.for_all_homes()?, webhook, now).await?;
    Ok((StatusCode::CREATED, Document(delivery.into())))
}

/// List the deliveries of a webhook, newest first
///
/// Deliveries that have ended are kept for 30 days.
#[utoipa::path(get, path = "/v1/webhooks/{webhook}/deliveries", tag = "webhooks", params(WebhookPath, ListQuery),
    responses((status = 200, description = "One page", body = List<Delivery>), CommonProblems))]
pub(super) async fn list_deliveries(
    State(app): State<App>,
    caller: Caller,
    WebhookPath { webhook }: WebhookPath,
    query: ListPage,
) -> Result<Document<List<Delivery>>, Error> {
    let page = query.page::<Uuid>()?;
    let deliveries = app.storage.deliveries(caller.for_all_homes()?, webhook, &page).await?;
    Ok(Document(query.list(deliveries, |delivery| delivery.id)?))
}

/// Retry a delivery
///
/// The message is sent immediately and, if necessary, by the whole schedule again, whatever its state was.
#[utoipa::path(post, path = "/v1/webhooks/{webhook}/deliveries/{delivery}/retry", tag = "webhooks", params(DeliveryPath),
    responses((status = 200, description = "The delivery, which is pending now", body = Delivery), CommonProblems))]
pub(super) async fn retry_delivery(
    State(app): State<App>,
    caller: Caller,
    DeliveryPath { webhook, delivery }: DeliveryPath,
) -> Result<Document<Delivery>, Error> {
    let tenant = caller.for_all_homes()?;
    let delivery = app.storage.retry_delivery(tenant, webhook, delivery, app.storage.now()).await?;
    Ok(Document(delivery.into()))
}
