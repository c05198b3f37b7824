//! Timeouts of a store on the network.
//!
//! A store answers, fails, or is silent. So that no client waits for a silent store, each operation on it
//! (write a blob or a part, read the next bytes, list a page) has a timeout. Large files take as many
//! operations as they need.

use object_store::{BackoffConfig, ClientOptions, RetryConfig};
use std::future::Future;
use std::time::Duration;

/// Retries of a failed request.
const REPEATS: usize = 4;

#[derive(Debug, Clone, Copy)]
pub(super) struct Limits {
    pub connect: Duration,
    /// One request, from connecting to the last byte of its answer. A part of a file must fit into it.
    pub request: Duration,
    /// Time after which a request is not retried.
    pub repeat: Duration,
    /// One operation, with all its requests.
    pub operation: Duration,
    /// One removal. It is short, since a sweep removes what is left.
    pub removal: Duration,
    /// The check whether the place can be used.
    pub ready: Duration,
}

const _: () = assert!(Limits::S3.operation.as_secs() + Limits::S3.removal.as_secs() < 30);

impl Limits {
    /// A failing operation and the removal of what it leaves take less than 30 s together.
    pub const S3: Limits = Limits {
        connect: Duration::from_secs(3),
        request: Duration::from_secs(15),
        repeat: Duration::from_secs(5),
        operation: Duration::from_secs(20),
        removal: Duration::from_secs(8),
        ready: Duration::from_secs(5),
    };

    /// Operations on a disk have no timeout: they cannot be cancelled.
    pub const NONE: Limits = Limits {
        connect: Duration::MAX,
        request: Duration::MAX,
        repeat: Duration::MAX,
        operation: Duration::MAX,
        removal: Duration::MAX,
        ready: Duration::from_secs(5),
    };

    pub fn client_options(&self, allow_http: bool) -> ClientOptions {
        ClientOptions::new()
            .with_connect_timeout(self.connect)
            .with_timeout(self.request)
            .with_allow_http(allow_http)
    }

    pub fn retry_config(&self) -> RetryConfig {
        let backoff = BackoffConfig {
            init_backoff: Duration::from_millis(50),
            max_backoff: Duration::from_secs(1),
            base: 2.0,
        };
        RetryConfig { backoff, max_retries: REPEATS, retry_timeout: self.repeat }
    }

    /// Runs an operation with its timeout.
    pub async fn bound<T>(
        &self,
        work: impl Future<Output = object_store::Result<T>>,
    ) -> object_store::Result<T> {
        within(self.operation, work).await
    }
}

pub(super) async fn within<T>(
    limit: Duration,
    work: impl Future<Output = object_store::Result<T>>,
) -> object_store::Result<T> {
    match tokio::time::timeout(limit, work).await {
        Ok(done) => done,
        Err(_) => {
            let source = std::io::Error::new(
                std::io::ErrorKind::TimedOut,
                format!("the store was not done within {:.1} s", limit.as_secs_f64()),
            );
            Err(object_store::Error::Generic { store: "S3", source: source.into() })
        }
    }
}
