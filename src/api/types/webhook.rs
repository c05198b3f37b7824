//! A webhook and its deliveries.

use super::answer;
use super::change::ChangeKind;
use jiff::Timestamp;
use uuid::Uuid;

answer! {
    /// A URL that receives messages about changes.
    struct Webhook from viola_storage::Webhook {
        #[schema(example = "01a1f766-7b11-7a07-8a2d-94cf1a0f2b11")]
        id: Uuid,
        #[schema(example = "https://fleet.example/hooks/viola")]
        url: String,
        /// Kinds of change that it receives.
        kinds: Vec<ChangeKind>,
        created_at: Timestamp,
        /// Time at which it was disabled because it answered 410.
        disabled_at: Option<Timestamp>,
    }
}

answer! {
    /// State of a delivery:
    /// - `pending`: it is to be sent at `due_at`.
    /// - `delivered`: the address answered 2xx.
    /// - `failed`: it is not retried any more. Repair the receiver, then send it again by `.../retry`.
    enum DeliveryState from viola_storage::DeliveryState {
        Pending,
        Delivered,
        Failed,
    }
}

answer! {
    /// One message to a webhook and its state.
    struct Delivery from viola_storage::Delivery {
        /// Sent as `webhook-id`; the same in every attempt.
        #[schema(example = "01a1f766-7c20-7f53-9f0d-5b4d8fd9a1c2")]
        id: Uuid,
        /// The `type` of the message.
        #[schema(example = "clip.changed")]
        event: String,
        state: DeliveryState,
        #[schema(example = 1)]
        attempts: u32,
        /// Time of the next attempt, while it is pending.
        due_at: Option<Timestamp>,
        /// HTTP status of the answer to the last attempt, if there was one.
        #[schema(example = 503)]
        status: Option<i64>,
        /// Reason for the failure of the last attempt.
        #[schema(example = "the address answered 503 (Service Unavailable)")]
        error: Option<String>,
        created_at: Timestamp,
        updated_at: Timestamp,
    }
}
