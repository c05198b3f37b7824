//! How webhooks are sent.

use std::time::Duration;

/// How long one address may take to answer.
pub(super) const ANSWER: Duration = Duration::from_secs(15);

/// How webhooks are sent.
#[derive(Debug, Clone, Copy, Default)]
pub struct WebhookParams {
    /// Let them go to addresses of private networks and of this machine, and by plain http.
    pub private_addresses: bool,
}
