//! How long a store on the network may take.
//!
//! A store answers, fails, or is silent. So that nobody who waits for us waits on for a silent one, each operation on
//! it (a blob or a part of one written, the next bytes of one read, a page listed) ends in time, with an error if need
//! be. Large files take as many operations as they need.

use object_store::{BackoffConfig, ClientOptions, RetryConfig};
use std::future::Future;
use std::time::Duration;

/// How often a request that failed is repeated.
const REPEATS: usize = 4;

#[derive(Debug, Clone, Copy)]
pub(super) struct Limits {
    pub connect: Duration,
    /// One request, from connecting to the last byte of its answer. A part of a file has to get through in it.
    pub request: Duration,
    /// After so long no request is repeated.
    pub repeat: Duration,
    /// All that one operation does.
    pub operation: Duration,
    /// The same of a removal: nobody has to wait for it, since a sweep removes what it leaves.
    pub removal: Duration,
    /// Whether the place can be used.
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

    /// A disk is not left in the middle of something: it could not be told to stop.
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

    /// An operation.
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
