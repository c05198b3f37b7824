//! Messages that the service sends by itself: events of streams and messages to webhooks. The types describe them.

use super::change::Change;
use super::job::Job;
use jiff::Timestamp;

/// One server-sent event of `GET /v1/jobs/{job}/events`: its fields.
#[derive(Debug, utoipa::ToSchema)]
#[expect(dead_code, reason = "it only describes the events")]
pub(in crate::api) struct JobEvent {
    event: JobEventName,
    /// The job's version, which a client that reconnects sends as `Last-Event-ID`; absent if the job was removed.
    #[schema(example = "5")]
    id: Option<String>,
    /// The whole job; null if it was removed with its clip.
    data: Option<Job>,
}

/// Name of an event of a job:
/// - `job`: the job is queued or running.
/// - `end`: the job has ended or was removed. It is the last event.
#[derive(Debug, utoipa::ToSchema)]
#[serde(rename_all = "lowercase")]
#[expect(dead_code, reason = "it only describes the events")]
pub(in crate::api) enum JobEventName {
    Job,
    End,
}

/// One server-sent event of `GET /v1/homes/{home}/events`: its fields.
#[derive(Debug, utoipa::ToSchema)]
#[expect(dead_code, reason = "it only describes the events")]
pub(in crate::api) struct HomeEvent {
    event: HomeEventName,
    /// Place in the feed, which a client that reconnects sends as `Last-Event-ID`: a text, and not a number.
    #[schema(example = "4711.01a1f7667a9777479dbb391e0eeccb64")]
    id: String,
    data: Change,
}

/// Name of an event of a home:
/// - `change`: the home or something in it changed.
#[derive(Debug, utoipa::ToSchema)]
#[serde(rename_all = "lowercase")]
#[expect(dead_code, reason = "it only describes the events")]
pub(in crate::api) enum HomeEventName {
    Change,
}

/// The body of a message to a webhook, as Standard Webhooks has it.
#[derive(Debug, utoipa::ToSchema)]
#[expect(dead_code, reason = "it only describes the messages")]
pub(in crate::api) struct WebhookMessage {
    #[serde(rename = "type")]
    kind: WebhookMessageType,
    /// Time of the change.
    timestamp: Timestamp,
    /// The item of the feed; the message with the higher `seq` is newer.
    data: Change,
}

/// Type of a message: the kind of the change, and whether the resource was removed.
#[derive(Debug, utoipa::ToSchema)]
#[expect(dead_code, reason = "it only describes the messages")]
pub(in crate::api) enum WebhookMessageType {
    #[serde(rename = "home.changed")]
    HomeChanged,
    #[serde(rename = "home.deleted")]
    HomeDeleted,
    #[serde(rename = "lidar_map.changed")]
    LidarMapChanged,
    #[serde(rename = "lidar_map.deleted")]
    LidarMapDeleted,
    #[serde(rename = "clip.changed")]
    ClipChanged,
    #[serde(rename = "clip.deleted")]
    ClipDeleted,
    #[serde(rename = "map.changed")]
    MapChanged,
    #[serde(rename = "map.deleted")]
    MapDeleted,
    #[serde(rename = "objects.changed")]
    ObjectsChanged,
    #[serde(rename = "objects.deleted")]
    ObjectsDeleted,
}

/// The body of a message that `POST .../test` sends.
#[derive(Debug, utoipa::ToSchema)]
#[expect(dead_code, reason = "it only describes the messages")]
pub(in crate::api) struct WebhookTest {
    #[serde(rename = "type")]
    kind: WebhookTestType,
    timestamp: Timestamp,
    /// It has no members.
    #[schema(value_type = Object)]
    data: serde_json::Value,
}

/// Type of the message of a test.
#[derive(Debug, utoipa::ToSchema)]
#[expect(dead_code, reason = "it only describes the messages")]
pub(in crate::api) enum WebhookTestType {
    #[serde(rename = "webhook.test")]
    Test,
}
