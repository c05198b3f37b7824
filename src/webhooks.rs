//! Sending of webhooks: Standard Webhooks (https://www.standardwebhooks.com), version 1. Storage holds the
//! messages, their addresses and retries.
//!
//! The addresses come from tenants, so they must not reach this service's own network: see `address`.

mod address;
mod send;
mod sign;
mod target;

pub use target::{WebhookParams, check_url};

use metrics::{counter, describe_counter};
use send::Sender;
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::{Notify, Semaphore};
use tokio::task::JoinSet;
use tokio_util::sync::CancellationToken;
use tracing::{error, info, warn};
use viola_storage::{Sending, Sent, Storage, StorageError};

/// Lease of a webhook, longer than a batch takes.
const LEASE: Duration = Duration::from_secs(60);
/// Messages that are sent to one address at a time.
const AT_ONCE: u32 = 16;
/// Addresses that are served at a time by one process; one that never answers takes a place for 15 s.
const SENDERS: usize = 32;
/// Polling interval for changes and due deliveries.
const POLL: Duration = Duration::from_secs(1);

const DELIVERIES: &str = "viola_webhook_deliveries_total";

/// Registers the descriptions of the metrics.
pub fn describe_metrics() {
    describe_counter!(DELIVERIES, "Attempts to deliver to a webhook, by how they ended");
    for outcome in ["delivered", "failed", "gone"] {
        counter!(DELIVERIES, "outcome" => outcome).increment(0);
    }
}

/// Sends due deliveries until `stop`; `changed` signals changes by this process or another.
pub async fn deliver(
    storage: Arc<Storage>,
    params: WebhookParams,
    changed: Arc<Notify>,
    stop: CancellationToken,
) {
    let sender = match Sender::new(params) {
        Ok(sender) => Arc::new(sender),
        Err(error) => return error!(%error, "this process sends no webhooks"),
    };
    let fan_out = async {
        loop {
            let mut notified = std::pin::pin!(changed.notified());
            // Listening begins before reading, so that no change is missed.
            notified.as_mut().enable();
            match storage.fan_out(storage.now()).await {
                Ok(true) => continue,
                Ok(false) => {}
                Err(error) => warn!(%error, "changes could not be prepared for webhooks; they wait"),
            }
            let _ = tokio::time::timeout(POLL, notified).await;
        }
    };
    tokio::select! {
        () = stop.cancelled() => {}
        () = fan_out => {}
        () = send_for_ever(&storage, &sender) => {}
    }
}

/// Claims webhooks with due deliveries, one after the other, and sends to several at a time.
async fn send_for_ever(storage: &Arc<Storage>, sender: &Arc<Sender>) {
    let places = Arc::new(Semaphore::new(SENDERS));
    let mut batches = JoinSet::new();
    loop {
        let place = places.clone().acquire_owned().await.expect("the semaphore is never closed");
        while batches.try_join_next().is_some() {}
        match storage.claim_deliveries(AT_ONCE, LEASE, storage.now()).await {
            Ok(Some(sending)) => {
                let (storage, sender) = (storage.clone(), sender.clone());
                batches.spawn(async move {
                    let _place = place;
                    if let Err(error) = send_batch(&storage, &sender, &sending).await {
                        warn!(%error, "webhooks could not be sent; they wait");
                    }
                });
                continue;
            }
            Ok(None) => {}
            Err(error) => warn!(%error, "webhooks could not be claimed; they wait"),
        }
        // The end of a batch frees its webhook, which may have more deliveries.
        tokio::select! {
            Some(_) = batches.join_next() => {}
            () = tokio::time::sleep(POLL) => {}
        }
    }
}

/// Sends the claimed deliveries of one webhook.
async fn send_batch(storage: &Storage, sender: &Sender, sending: &Sending) -> Result<(), StorageError> {
    let attempts = sending.deliveries.iter().map(async |delivery| {
        let sent = sender.send(sending, delivery).await;
        log_attempt(sending, delivery.id, &sent);
        storage.note_attempt(sending, delivery, &sent, storage.now()).await
    });
    let noted = futures::future::join_all(attempts).await;
    storage.release_webhook(sending, storage.now()).await?;
    noted.into_iter().collect()
}

/// Counts and logs an attempt. The address is not logged: it may hold a password.
fn log_attempt(sending: &Sending, delivery: uuid::Uuid, sent: &Sent) {
    let webhook = sending.webhook;
    let outcome = match sent {
        Sent::Delivered { status } => {
            info!(%webhook, %delivery, outcome = "delivered", status, "webhook");
            "delivered"
        }
        Sent::Failed { status, error, .. } => {
            warn!(%webhook, %delivery, outcome = "failed", status, "a webhook was not delivered: {error}");
            "failed"
        }
        Sent::Gone => {
            let told = "a webhook is disabled: its address answered 410 (Gone); a test or a retry of a delivery enables it";
            warn!(%webhook, %delivery, outcome = "gone", status = 410, "{told}");
            "gone"
        }
    };
    counter!(DELIVERIES, "outcome" => outcome).increment(1);
}
