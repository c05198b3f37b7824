//! Webhooks: addresses that are notified of changes in a tenant's homes. `fan_out` turns the changes feed
//! into deliveries, and `deliveries` has their leases and retries.
//!
//! A webhook is a reader of the feed with a stored cursor. The feed has only the newest change of each item,
//! so an address that is unreachable for long gets fewer messages.

mod deliveries;
mod fan_out;
mod secrets;

pub use deliveries::{Delivery, DeliveryState, RETRY_AFTER, Sending, Sent, ToSend};

use super::changes::ChangeKind;
use super::columns::to_json;
use super::database::{Connection, Row, Turn, query, take_turns};
use super::{Storage, StorageError, Tenant};
use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use jiff::Timestamp;
use std::fmt;
use uuid::Uuid;

/// Most webhooks of one tenant.
pub const MAX_WEBHOOKS: i64 = 10;

/// Prefix of a secret (Standard Webhooks).
const PREFIX: &str = "whsec_";
/// Standard Webhooks asks for 24 to 64 bytes.
const SECRET_BYTES: usize = 32;

/// An address that is notified of changes.
#[derive(Debug, Clone, PartialEq)]
pub struct Webhook {
    pub id: Uuid,
    pub url: String,
    /// Kinds of change that it is notified of.
    pub kinds: Vec<ChangeKind>,
    pub created_at: Timestamp,
    /// Time since when it is not notified, because it answered 410.
    pub disabled_at: Option<Timestamp>,
}

/// Secret that signs deliveries. It is never logged.
#[derive(Clone, PartialEq, Eq)]
pub struct WebhookSecret(String);

impl fmt::Debug for WebhookSecret {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str("WebhookSecret")
    }
}

impl WebhookSecret {
    fn new() -> Result<WebhookSecret, StorageError> {
        let mut bytes = [0; SECRET_BYTES];
        getrandom::fill(&mut bytes).map_err(|error| StorageError::Randomness(error.to_string()))?;
        Ok(WebhookSecret(format!("{PREFIX}{}", BASE64_STANDARD.encode(bytes))))
    }

    /// Returns the secret in plain text, to be shown to its owner.
    pub fn show(&self) -> &str {
        &self.0
    }

    /// Returns the key of the HMAC; empty only for a row that was tampered with.
    pub fn bytes(&self) -> Vec<u8> {
        let encoded = self.0.strip_prefix(PREFIX).unwrap_or_default();
        BASE64_STANDARD.decode(encoded).unwrap_or_default()
    }
}

/// Result of creating a webhook.
#[derive(Debug)]
pub enum WebhookMade {
    Made(Webhook, WebhookSecret),
    /// The tenant has [`MAX_WEBHOOKS`] already.
    TooMany,
}

fn from_row(row: &Row) -> Result<Webhook, StorageError> {
    Ok(Webhook {
        id: row.id("id")?,
        url: row.text("url")?,
        kinds: row.json("kinds")?,
        created_at: row.time("created_at")?,
        disabled_at: row.maybe_time("disabled_at")?,
    })
}

impl Storage {
    /// Creates a webhook, notified of changes from now on. Only this call returns the secret.
    pub async fn create_webhook(
        &self,
        tenant: &Tenant,
        url: &str,
        kinds: &[ChangeKind],
        now: Timestamp,
    ) -> Result<WebhookMade, StorageError> {
        self.number_changes().await?;
        let (id, secret) = (Uuid::now_v7(), WebhookSecret::new()?);
        let mut transaction = self.database.begin().await?;
        // Two cannot pass the count together.
        take_turns(&mut transaction, Turn::Webhooks, tenant.name()).await?;
        let made = query(
            "INSERT INTO webhooks (id, tenant, url, kinds, secret, seq, created_at)
            SELECT $1, $2, $3, $4, $5, last_seq, $6 FROM change_counter
            WHERE (SELECT COUNT(*) FROM webhooks WHERE tenant = $2) < $7",
        )
        .bind(id.to_string())
        .bind(tenant.name())
        .bind(url)
        .bind(to_json(&kinds))
        .bind(self.seal(secret.show(), &id.to_string())?)
        .bind(now.as_millisecond())
        .bind(MAX_WEBHOOKS)
        .execute(&mut transaction)
        .await?;
        if made == 0 {
            return Ok(WebhookMade::TooMany);
        }
        let webhook = find(&mut transaction, tenant, id).await?.ok_or(StorageError::NoSuchWebhook)?;
        transaction.commit().await?;
        Ok(WebhookMade::Made(webhook, secret))
    }

    /// Returns a tenant's webhooks, oldest first.
    pub async fn webhooks(&self, tenant: &Tenant) -> Result<Vec<Webhook>, StorageError> {
        let rows = query("SELECT * FROM webhooks WHERE tenant = $1 ORDER BY id").bind(tenant.name());
        rows.fetch_all(&mut self.database.reader().await?).await?.iter().map(from_row).collect()
    }

    pub async fn webhook(&self, tenant: &Tenant, id: Uuid) -> Result<Webhook, StorageError> {
        let found = find(&mut self.database.reader().await?, tenant, id).await?;
        found.ok_or(StorageError::NoSuchWebhook)
    }

    /// Removes a webhook with its log. A message that is being sent still arrives.
    pub async fn delete_webhook(&self, tenant: &Tenant, id: Uuid) -> Result<(), StorageError> {
        let delete = query("DELETE FROM webhooks WHERE tenant = $1 AND id = $2");
        let deleted = self.database.execute(delete.bind(tenant.name()).bind(id.to_string())).await?;
        if deleted > 0 { Ok(()) } else { Err(StorageError::NoSuchWebhook) }
    }
}

async fn find(
    connection: &mut Connection,
    tenant: &Tenant,
    id: Uuid,
) -> Result<Option<Webhook>, StorageError> {
    let row = query("SELECT * FROM webhooks WHERE tenant = $1 AND id = $2");
    let row = row.bind(tenant.name()).bind(id.to_string()).fetch_optional(connection).await?;
    row.as_ref().map(from_row).transpose()
}
