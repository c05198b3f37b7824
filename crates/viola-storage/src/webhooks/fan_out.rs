//! Conversion of the changes feed into deliveries for each webhook.

use super::super::changes::{self, Change, ChangeKind};
use super::super::columns::to_json;
use super::super::database::{Transaction, query};
use super::super::{Storage, StorageError};
use jiff::{SignedDuration, Timestamp};
use serde_json::json;
use uuid::Uuid;

/// Changes that are read from the feed at a time.
const AT_ONCE: i64 = 200;

/// Most pending deliveries of one webhook. Later changes wait in the feed, which combines those of one item.
const MAX_PENDING: i64 = 1_000;

/// Time that an ended delivery stays in the log.
const LOG_LIFE: SignedDuration = SignedDuration::from_hours(30 * 24);

impl Storage {
    /// Creates deliveries for the changes that webhooks have not had yet; returns whether there are more.
    pub async fn fan_out(&self, now: Timestamp) -> Result<bool, StorageError> {
        if !self.has_webhooks().await? {
            return Ok(false);
        }
        self.number_changes().await?;
        let behind = query(
            "SELECT id FROM webhooks WHERE disabled_at IS NULL
                AND EXISTS (SELECT 1 FROM changes WHERE changes.tenant = webhooks.tenant AND changes.seq > webhooks.seq)
                AND (SELECT COUNT(*) FROM webhook_deliveries
                    WHERE webhook_id = webhooks.id AND state = 'pending') < $1",
        );
        let behind = behind.bind(MAX_PENDING).fetch_all(&mut self.database.reader().await?).await?;
        let mut has_more = false;
        for row in &behind {
            let id = row.id("id")?;
            let mut transaction = self.database.begin().await?;
            match fan_out_one(&mut transaction, id, now).await {
                Ok(more) => {
                    transaction.commit().await?;
                    has_more |= more;
                }
                // The other webhooks have their messages.
                Err(unreadable @ StorageError::Column { .. }) => {
                    tracing::error!(webhook = %id, %unreadable, "a webhook gets no messages");
                }
                Err(error) => return Err(error),
            }
        }
        if !behind.is_empty() {
            self.forget_deliveries(now).await?;
        }
        Ok(has_more)
    }

    async fn has_webhooks(&self) -> Result<bool, StorageError> {
        let row = query("SELECT id FROM webhooks LIMIT 1");
        Ok(row.fetch_optional(&mut self.database.reader().await?).await?.is_some())
    }

    async fn forget_deliveries(&self, now: Timestamp) -> Result<(), StorageError> {
        let old = query(
            "DELETE FROM webhook_deliveries WHERE id IN (SELECT id FROM webhook_deliveries
                WHERE state <> 'pending' AND updated_at < $1 FOR UPDATE SKIP LOCKED)",
        );
        self.database.execute(old.bind((now - LOG_LIFE).as_millisecond())).await.map(drop)
    }
}

/// Creates the deliveries of one webhook; returns whether there are more changes.
async fn fan_out_one(transaction: &mut Transaction, id: Uuid, now: Timestamp) -> Result<bool, StorageError> {
    let row = query("SELECT * FROM webhooks WHERE id = $1 FOR NO KEY UPDATE SKIP LOCKED");
    // Another process has the lock, or the webhook was removed.
    let Some(row) = row.bind(id.to_string()).fetch_optional(transaction).await? else { return Ok(false) };
    let kinds: Vec<ChangeKind> = row.json("kinds")?;
    let rows = query("SELECT * FROM changes WHERE tenant = $1 AND seq > $2 ORDER BY seq LIMIT $3")
        .bind(row.text("tenant")?)
        .bind(row.number("seq")?)
        .bind(AT_ONCE)
        .fetch_all(transaction)
        .await?;
    let Some(last) = rows.last() else { return Ok(false) };
    let last = last.number("seq")?;
    for row in &rows {
        let change = changes::from_row(row)?;
        if kinds.contains(&change.kind) {
            let event = event_name(&change);
            insert(transaction, id, &event, &change.at, to_json(&change), now).await?;
        }
    }
    query("UPDATE webhooks SET seq = $2 WHERE id = $1")
        .bind(id.to_string())
        .bind(last)
        .execute(transaction)
        .await?;
    Ok(rows.len() as i64 == AT_ONCE)
}

fn event_name(change: &Change) -> String {
    let kind = match change.kind {
        ChangeKind::Home => "home",
        ChangeKind::LidarMap => "lidar_map",
        ChangeKind::Clip => "clip",
        ChangeKind::Map => "map",
        ChangeKind::Objects => "objects",
    };
    format!("{kind}.{}", if change.deleted { "deleted" } else { "changed" })
}

/// Adds a delivery; the body is what Standard Webhooks calls the payload.
pub(super) async fn insert(
    transaction: &mut Transaction,
    webhook: Uuid,
    event: &str,
    at: &Timestamp,
    data: String,
    now: Timestamp,
) -> Result<Uuid, StorageError> {
    let id = Uuid::now_v7();
    // `data` is JSON already.
    let body = format!("{{\"type\":{},\"timestamp\":{},\"data\":{data}}}", json!(event), json!(at));
    query(
        "INSERT INTO webhook_deliveries (id, webhook_id, event, body, state, due_at, created_at, updated_at)
        VALUES ($1, $2, $3, $4, 'pending', $5, $5, $5)",
    )
    .bind(id.to_string())
    .bind(webhook.to_string())
    .bind(event)
    .bind(body)
    .bind(now.as_millisecond())
    .execute(transaction)
    .await?;
    Ok(id)
}
