//! Options of webhooks.

use std::time::Duration;

/// Timeout of the answer of one address.
pub(super) const ANSWER: Duration = Duration::from_secs(15);

/// Options of webhooks.
#[derive(Debug, Clone, Copy, Default)]
pub struct WebhookParams {
    /// True if webhooks may use addresses of private networks and of this machine, and plain http.
    pub private_addresses: bool,
}
