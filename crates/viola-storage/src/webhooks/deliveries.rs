//! Deliveries: sent under the webhook's lease, retried by the schedule of Standard Webhooks, and kept as a
//! log. A delivery is sent at least once: if a process dies after sending and before recording it, it is sent
//! again with the same id.

use super::super::database::{Connection, Row, Transaction, query};
use super::super::{Page, Storage, StorageError, Tenant, clock};
use super::{WebhookSecret, fan_out};
use jiff::{SignedDuration, Timestamp};
use serde::{Deserialize, Serialize};
use std::time::Duration;
use uuid::Uuid;

/// Delays after failed attempts, as Standard Webhooks recommends: about three days in total. There is no
/// retry after the last one.
pub const RETRY_AFTER: [SignedDuration; 9] = [
    SignedDuration::from_secs(5),
    SignedDuration::from_mins(5),
    SignedDuration::from_mins(30),
    SignedDuration::from_hours(2),
    SignedDuration::from_hours(5),
    SignedDuration::from_hours(10),
    SignedDuration::from_hours(14),
    SignedDuration::from_hours(20),
    SignedDuration::from_hours(24),
];

/// The `type` of test messages.
const TEST: &str = "webhook.test";

/// Most pending test messages of one webhook: an address that does not answer gets no message for each further request.
const MAX_PENDING_TESTS: i64 = 10;

/// State of a delivery.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum DeliveryState {
    /// To be sent at `due_at`.
    Pending,
    /// The address answered 2xx.
    Delivered,
    /// It is not retried any more.
    Failed,
}

/// One message to a webhook, and its result.
#[derive(Debug, Clone, PartialEq)]
pub struct Delivery {
    /// Sent as `webhook-id`; the same in every attempt.
    pub id: Uuid,
    /// The `type` of the message.
    pub event: String,
    pub state: DeliveryState,
    pub attempts: u32,
    /// Time of the next attempt, while it is pending.
    pub due_at: Option<Timestamp>,
    /// HTTP status of the last attempt, if the address answered.
    pub status: Option<i64>,
    /// Reason why the last attempt failed.
    pub error: Option<String>,
    pub created_at: Timestamp,
    pub updated_at: Timestamp,
}

/// Due deliveries, and a lease on their webhook.
#[derive(Debug)]
pub struct Sending {
    pub webhook: Uuid,
    pub url: String,
    pub secret: WebhookSecret,
    pub deliveries: Vec<ToSend>,
    fencing_token: i64,
}

/// A message that is due.
#[derive(Debug, Clone)]
pub struct ToSend {
    pub id: Uuid,
    pub body: String,
    attempts: i64,
    due_at: Timestamp,
}

/// Result of an attempt.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Sent {
    Delivered {
        status: u16,
    },
    /// `wait` is the delay that the address asks for.
    Failed {
        status: Option<u16>,
        error: String,
        wait: Option<Duration>,
    },
    /// The address wants no more messages: 410.
    Gone,
}

fn from_row(row: &Row) -> Result<Delivery, StorageError> {
    let state = row.name("state")?;
    Ok(Delivery {
        id: row.id("id")?,
        event: row.text("event")?,
        state,
        attempts: row.count("attempts")?,
        due_at: Some(row.time("due_at")?).filter(|_| state == DeliveryState::Pending),
        status: row.maybe_number("status")?,
        error: row.maybe_text("error")?,
        created_at: row.time("created_at")?,
        updated_at: row.time("updated_at")?,
    })
}

/// Takes the webhook with a due delivery that was served longest ago.
const CLAIM: &str = "UPDATE webhooks SET lease_until = $2, fence = fence + 1
    WHERE id = (SELECT id FROM webhooks WHERE disabled_at IS NULL AND (lease_until <= $1 OR lease_until > $3)
        AND EXISTS (SELECT 1 FROM webhook_deliveries
            WHERE webhook_id = webhooks.id AND state = 'pending' AND (due_at <= $1 OR due_at > $4))
        ORDER BY lease_until, id LIMIT 1 FOR NO KEY UPDATE SKIP LOCKED)
    RETURNING id, url, secret, fence";

impl Storage {
    /// Claims a webhook with at most `limit` of its due deliveries, oldest first. No other process sends to
    /// it until the lease expires or [`Storage::release_webhook`] is called.
    pub async fn claim_deliveries(
        &self,
        limit: u32,
        lease: Duration,
        now: Timestamp,
    ) -> Result<Option<Sending>, StorageError> {
        let mut transaction = self.database.begin().await?;
        let row = query(CLAIM)
            .bind(now.as_millisecond())
            .bind((now + lease).as_millisecond())
            .bind(clock::no_lease_after(now))
            .bind(clock::no_delivery_after(now))
            .fetch_optional(&mut transaction)
            .await?;
        let Some(row) = row else { return Ok(None) };
        let webhook = row.id("id")?;
        let due = query(
            "SELECT id, body, attempts, due_at FROM webhook_deliveries
            WHERE webhook_id = $1 AND state = 'pending' AND (due_at <= $2 OR due_at > $4)
            ORDER BY due_at, id LIMIT $3",
        );
        let due = due
            .bind(webhook.to_string())
            .bind(now.as_millisecond())
            .bind(i64::from(limit))
            .bind(clock::no_delivery_after(now))
            .fetch_all(&mut transaction)
            .await?;
        let to_send = |row: &Row| {
            Ok(ToSend {
                id: row.id("id")?,
                body: row.text("body")?,
                attempts: row.number("attempts")?,
                due_at: row.time("due_at")?,
            })
        };
        let deliveries = due.iter().map(to_send).collect::<Result<_, StorageError>>()?;
        // Committed before the secret is opened: if its key is missing, other webhooks still have their turns.
        transaction.commit().await?;
        let secret = WebhookSecret(self.unseal(&row.text("secret")?, &webhook.to_string())?);
        let (url, fencing_token) = (row.text("url")?, row.number("fence")?);
        Ok(Some(Sending { webhook, url, secret, deliveries, fencing_token }))
    }

    /// Records the result of an attempt, unless the lease was lost meanwhile. A retry that was asked for during the attempt stays
    /// due, unless the message was delivered.
    pub async fn note_attempt(
        &self,
        sending: &Sending,
        delivery: &ToSend,
        sent: &Sent,
        now: Timestamp,
    ) -> Result<(), StorageError> {
        let mut transaction = self.database.begin().await?;
        if !holds(&mut transaction, sending).await? {
            return Ok(());
        }
        let (state, due_at, status, error) = after(delivery, sent, now);
        let noted = query(
            "UPDATE webhook_deliveries SET state = $2, attempts = attempts + 1, due_at = $3, status = $4,
                error = $5, updated_at = $6
            WHERE id = $1 AND state = 'pending' AND ($2 = 'delivered' OR (attempts = $7 AND due_at = $8))",
        )
        .bind(delivery.id.to_string())
        .bind(state)
        .bind(due_at.as_millisecond())
        .bind(status.map(i64::from))
        .bind(error)
        .bind(now.as_millisecond())
        .bind(delivery.attempts)
        .bind(delivery.due_at.as_millisecond())
        .execute(&mut transaction)
        .await?;
        if *sent == Sent::Gone && noted > 0 {
            query("UPDATE webhooks SET disabled_at = $2 WHERE id = $1")
                .bind(sending.webhook.to_string())
                .bind(now.as_millisecond())
                .execute(&mut transaction)
                .await?;
        }
        transaction.commit().await
    }

    /// Ends the lease on the webhook.
    pub async fn release_webhook(&self, sending: &Sending, now: Timestamp) -> Result<(), StorageError> {
        let release = query("UPDATE webhooks SET lease_until = $3 WHERE id = $1 AND fence = $2")
            .bind(sending.webhook.to_string())
            .bind(sending.fencing_token)
            .bind(now.as_millisecond());
        self.database.execute(release).await.map(drop)
    }

    /// Returns a page of the log of a webhook, newest first.
    pub async fn deliveries(
        &self,
        tenant: &Tenant,
        webhook: Uuid,
        page: &Page<Uuid>,
    ) -> Result<Vec<Delivery>, StorageError> {
        self.webhook(tenant, webhook).await?;
        // Sorts after every id.
        let before = page.after.map_or("~".to_owned(), |id| id.to_string());
        let rows = query(
            "SELECT * FROM webhook_deliveries WHERE webhook_id = $1 AND id < $2 ORDER BY id DESC LIMIT $3",
        );
        let rows = rows.bind(webhook.to_string()).bind(before).bind(i64::from(page.limit));
        rows.fetch_all(&mut self.database.reader().await?).await?.iter().map(from_row).collect()
    }

    /// Makes a delivery pending again, in any state, from the beginning of its schedule. Enables a disabled
    /// webhook.
    pub async fn retry_delivery(
        &self,
        tenant: &Tenant,
        webhook: Uuid,
        delivery: Uuid,
        now: Timestamp,
    ) -> Result<Delivery, StorageError> {
        let mut transaction = self.database.begin().await?;
        enable(&mut transaction, tenant, webhook).await?;
        let retried = retry(&mut transaction, webhook, delivery, now).await?;
        transaction.commit().await?;
        Ok(retried)
    }

    /// Queues an empty test message; if there are many already, retries the newest of them. Enables a disabled webhook.
    pub async fn test_webhook(
        &self,
        tenant: &Tenant,
        webhook: Uuid,
        now: Timestamp,
    ) -> Result<Delivery, StorageError> {
        let mut transaction = self.database.begin().await?;
        enable(&mut transaction, tenant, webhook).await?;
        let pending = query(
            "SELECT COUNT(*) AS tests, MAX(id) AS newest FROM webhook_deliveries
            WHERE webhook_id = $1 AND state = 'pending' AND event = $2",
        );
        let pending = pending.bind(webhook.to_string()).bind(TEST).fetch_one(&mut transaction).await?;
        let is_full = pending.number("tests")? >= MAX_PENDING_TESTS;
        let test = match pending.maybe_id("newest")? {
            Some(newest) if is_full => retry(&mut transaction, webhook, newest, now).await?,
            _ => {
                let id = fan_out::insert(&mut transaction, webhook, TEST, &now, "{}".to_owned(), now).await?;
                find(&mut transaction, webhook, id).await?.ok_or(StorageError::NoSuchDelivery)?
            }
        };
        transaction.commit().await?;
        Ok(test)
    }
}

/// Makes a delivery pending, in any state, from the beginning of its schedule.
async fn retry(
    transaction: &mut Transaction,
    webhook: Uuid,
    delivery: Uuid,
    now: Timestamp,
) -> Result<Delivery, StorageError> {
    query(
        "UPDATE webhook_deliveries SET state = 'pending', attempts = 0, due_at = $3, updated_at = $3
        WHERE id = $1 AND webhook_id = $2",
    )
    .bind(delivery.to_string())
    .bind(webhook.to_string())
    .bind(now.as_millisecond())
    .execute(transaction)
    .await?;
    find(transaction, webhook, delivery).await?.ok_or(StorageError::NoSuchDelivery)
}

/// Returns whether the lease is still this process's; if so, locks it until the transaction ends.
async fn holds(transaction: &mut Transaction, sending: &Sending) -> Result<bool, StorageError> {
    let row = query("SELECT id FROM webhooks WHERE id = $1 AND fence = $2 FOR NO KEY UPDATE");
    let row = row.bind(sending.webhook.to_string()).bind(sending.fencing_token);
    Ok(row.fetch_optional(transaction).await?.is_some())
}

async fn enable(transaction: &mut Transaction, tenant: &Tenant, webhook: Uuid) -> Result<(), StorageError> {
    let enabled = query("UPDATE webhooks SET disabled_at = NULL WHERE tenant = $1 AND id = $2")
        .bind(tenant.name())
        .bind(webhook.to_string())
        .execute(transaction)
        .await?;
    if enabled > 0 { Ok(()) } else { Err(StorageError::NoSuchWebhook) }
}

async fn find(
    connection: &mut Connection,
    webhook: Uuid,
    id: Uuid,
) -> Result<Option<Delivery>, StorageError> {
    let row = query("SELECT * FROM webhook_deliveries WHERE webhook_id = $1 AND id = $2");
    let row = row.bind(webhook.to_string()).bind(id.to_string()).fetch_optional(connection).await?;
    row.as_ref().map(from_row).transpose()
}

/// Returns the row's state, its next due time, and the status and error of the attempt.
fn after<'a>(
    delivery: &ToSend,
    sent: &'a Sent,
    now: Timestamp,
) -> (&'static str, Timestamp, Option<u16>, Option<&'a str>) {
    match sent {
        Sent::Delivered { status } => ("delivered", now, Some(*status), None),
        Sent::Gone => {
            ("failed", now, Some(410), Some("the address answered 410 and is told nothing any more"))
        }
        Sent::Failed { status, error, wait } => {
            let next = usize::try_from(delivery.attempts).ok().and_then(|made| RETRY_AFTER.get(made));
            let Some(delay) = next else { return ("failed", now, *status, Some(error)) };
            let asked = wait.and_then(|wait| SignedDuration::try_from(wait).ok()).unwrap_or_default();
            let longest = RETRY_AFTER[RETRY_AFTER.len() - 1];
            ("pending", now + (*delay).max(asked.min(longest)), *status, Some(error))
        }
    }
}
