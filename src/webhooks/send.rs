//! Sending of one message to one address.
//!
//! The host name is resolved for each connection, once for those that begin at the same time, and the connection uses only the
//! addresses that were checked then. So a name that is public when the webhook is created and private later is refused. Redirects
//! are not followed, the environment's proxies are not used, and only the head of the answer is read.

use super::address::is_public;
use super::sign::signature;
use super::target::{WebhookParams, check_url};
use futures::FutureExt;
use futures::future::{BoxFuture, Shared};
use jiff::Timestamp;
use reqwest::StatusCode;
use reqwest::dns::{Addrs, Name, Resolve, Resolving};
use reqwest::header::{CONTENT_TYPE, HeaderMap, RETRY_AFTER};
use std::collections::HashMap;
use std::error::Error;
use std::io;
use std::iter;
use std::net::SocketAddr;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use tracing::warn;
use viola_storage::tls::use_ring;
use viola_storage::{Sending, Sent, ToSend};

/// Timeout of the answer of one address.
const ANSWER: Duration = Duration::from_secs(15);

/// Function from a name to its addresses.
type Lookup = fn(String) -> BoxFuture<'static, io::Result<Vec<SocketAddr>>>;

/// Resolves a name as the system does.
fn resolve(name: String) -> BoxFuture<'static, io::Result<Vec<SocketAddr>>> {
    Box::pin(async move { Ok(tokio::net::lookup_host((name, 0)).await?.collect()) })
}

/// The addresses of a name, for all who wait for them.
type Finding = Shared<BoxFuture<'static, Result<Vec<SocketAddr>, Arc<io::Error>>>>;

/// The lookups that run, one of each name. A lookup blocks a thread until the system gives up, even if nobody waits any more, and
/// the files of the service are read by threads of the same pool.
#[derive(Clone, Default)]
struct Lookups(Arc<Mutex<HashMap<String, Finding>>>);

impl Lookups {
    fn running(&self) -> MutexGuard<'_, HashMap<String, Finding>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Returns the lookup of a name; starts it if none runs.
    fn find(&self, name: &str, lookup: Lookup) -> Finding {
        let mut running = self.running();
        if let Some(finding) = running.get(name).filter(|finding| finding.peek().is_none()) {
            return finding.clone();
        }
        let (lookups, of_task) = (self.clone(), name.to_owned());
        let task = tokio::spawn(async move {
            let found = lookup(of_task.clone()).await;
            lookups.running().remove(&of_task);
            found
        });
        let found = async move {
            let found = match task.await {
                Ok(found) => found,
                Err(error) => Err(io::Error::other(error)),
            };
            found.map_err(Arc::new)
        };
        let finding = found.boxed().shared();
        running.insert(name.to_owned(), finding.clone());
        finding
    }
}

pub struct Sender {
    client: reqwest::Client,
    params: WebhookParams,
}

#[derive(Debug, thiserror::Error)]
#[error("{name} leads to an address of a private network or of a machine itself")]
struct NotPublic {
    name: String,
}

struct Checked {
    lookup: Lookup,
    lookups: Lookups,
    private_addresses: bool,
}

impl Resolve for Checked {
    fn resolve(&self, name: Name) -> Resolving {
        let name = name.as_str().to_owned();
        let (found, private_addresses) = (self.lookups.find(&name, self.lookup), self.private_addresses);
        Box::pin(async move {
            let found = found.await?;
            let refused = found.iter().map(SocketAddr::ip).find(|address| !is_public(*address));
            if let Some(address) = refused.filter(|_| !private_addresses) {
                // The log of deliveries is its tenant's, and must not tell what private names lead to.
                warn!(name, %address, "a webhook leads to an address that is not public");
                return Err(NotPublic { name }.into());
            }
            Ok(Box::new(found.into_iter()) as Addrs)
        })
    }
}

impl Sender {
    pub fn new(params: WebhookParams) -> Result<Sender, reqwest::Error> {
        use_ring();
        let private_addresses = params.private_addresses;
        let resolver = Checked { lookup: resolve, lookups: Lookups::default(), private_addresses };
        let client = reqwest::Client::builder()
            .user_agent(concat!("viola/", env!("CARGO_PKG_VERSION")))
            .timeout(ANSWER)
            .redirect(reqwest::redirect::Policy::none())
            .no_proxy()
            .dns_resolver(resolver)
            .build()?;
        Ok(Sender { client, params })
    }

    pub async fn send(&self, sending: &Sending, delivery: &ToSend) -> Sent {
        let url = match check_url(&sending.url, &self.params) {
            Ok(url) => url,
            Err(error) => return Sent::Failed { status: None, error: error.to_string(), wait: None },
        };
        let timestamp_s = Timestamp::now().as_second();
        let answer = self
            .client
            .post(url)
            .header(CONTENT_TYPE, "application/json")
            .header("webhook-id", delivery.id.to_string())
            .header("webhook-timestamp", timestamp_s)
            .header("webhook-signature", signature(&sending.secret, delivery.id, timestamp_s, &delivery.body))
            .body(delivery.body.clone())
            .send()
            .await;
        match answer {
            Ok(answer) => outcome(answer.status(), answer.headers()),
            Err(error) => Sent::Failed { status: None, error: cause(&error), wait: None },
        }
    }
}

fn outcome(status: StatusCode, headers: &HeaderMap) -> Sent {
    let number = status.as_u16();
    if status.is_success() {
        return Sent::Delivered { status: number };
    }
    if status == StatusCode::GONE {
        return Sent::Gone;
    }
    let meaning = status.canonical_reason().map(|reason| format!(" ({reason})")).unwrap_or_default();
    let rule = if status.is_redirection() { "; redirects are not followed" } else { "" };
    let error = format!("the address answered {number}{meaning}{rule}");
    let wait = headers.get(RETRY_AFTER).and_then(|value| value.to_str().ok()?.parse().ok());
    Sent::Failed { status: Some(number), error, wait: wait.map(Duration::from_secs) }
}

/// Returns the innermost cause, without the address.
fn cause(error: &reqwest::Error) -> String {
    if error.is_timeout() {
        return format!("the address did not answer in {} s", ANSWER.as_secs());
    }
    let innermost = iter::successors(error.source(), |&cause| cause.source()).last();
    innermost.map_or_else(|| "the message could not be sent".to_owned(), ToString::to_string)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::{AtomicUsize, Ordering};

    /// Resolves a name to a public address first, then to a link-local one.
    fn rebinding(_: String) -> BoxFuture<'static, io::Result<Vec<SocketAddr>>> {
        static ASKED: AtomicUsize = AtomicUsize::new(0);
        let first = ASKED.fetch_add(1, Ordering::SeqCst) == 0;
        let address = if first { [93, 184, 215, 14] } else { [169, 254, 169, 254] };
        Box::pin(async move { Ok(vec![SocketAddr::from((address, 0))]) })
    }

    /// Resolves a name to a public address and a private one.
    fn mixed(_: String) -> BoxFuture<'static, io::Result<Vec<SocketAddr>>> {
        let both = [[93, 184, 215, 14], [10, 0, 0, 1]].map(|address| SocketAddr::from((address, 0)));
        Box::pin(async move { Ok(both.to_vec()) })
    }

    async fn resolved(lookup: Lookup, private_addresses: bool) -> Result<usize, String> {
        use_ring();
        let resolver = Checked { lookup, lookups: Lookups::default(), private_addresses };
        let found = resolver.resolve("hooks.example".parse().unwrap()).await;
        found.map(Iterator::count).map_err(|error| error.to_string())
    }

    #[tokio::test]
    async fn a_name_is_checked_at_every_resolution() {
        assert_eq!(resolved(rebinding, false).await, Ok(1));
        let refused = resolved(rebinding, false).await.unwrap_err();
        assert!(refused.contains("hooks.example leads to an address of a private network"), "{refused}");
        assert!(resolved(mixed, false).await.is_err(), "one private address spoils all");
        assert_eq!(resolved(mixed, true).await, Ok(2));
    }

    #[tokio::test]
    async fn a_name_without_an_answer_blocks_one_thread() {
        static ASKED: AtomicUsize = AtomicUsize::new(0);
        let lookup = |_: String| -> BoxFuture<'static, io::Result<Vec<SocketAddr>>> {
            ASKED.fetch_add(1, Ordering::SeqCst);
            Box::pin(std::future::pending())
        };
        use_ring();
        let resolver = Checked { lookup, lookups: Lookups::default(), private_addresses: false };
        // The requests of a batch end before the lookup, and the next batch comes.
        for _ in 0..3 {
            let resolve = |_| resolver.resolve("hooks.example".parse().unwrap());
            for mut waiting in (0..16).map(resolve).collect::<Vec<_>>() {
                assert!(futures::poll!(&mut waiting).is_pending());
                tokio::task::yield_now().await;
            }
        }
        assert_eq!(ASKED.load(Ordering::SeqCst), 1);
    }

    #[test]
    fn an_answer_decides_what_becomes_of_a_message() {
        let cases = [
            (200, "delivered"),
            (204, "delivered"),
            (301, "redirects are not followed"),
            (400, "answered 400 (Bad Request)"),
            (410, "gone"),
            (429, "answered 429 (Too Many Requests)"),
            (503, "answered 503 (Service Unavailable)"),
            (599, "answered 599"),
        ];
        let headers = HeaderMap::from_iter([(RETRY_AFTER, "120".parse().unwrap())]);
        for (status, expected) in cases {
            match outcome(StatusCode::from_u16(status).unwrap(), &headers) {
                Sent::Delivered { .. } => assert_eq!(expected, "delivered"),
                Sent::Gone => assert_eq!(expected, "gone"),
                Sent::Failed { error, wait, .. } => {
                    assert!(error.contains(expected), "{error}");
                    assert_eq!(wait, Some(Duration::from_secs(120)));
                }
            }
        }
    }
}
