//! The blocking readers of uploaded files: a bounded number at once, of a process and of each tenant, so that slow files of
//! one tenant do not stall the uploads of others.

use super::places::FairPlaces;
use crate::api::error::Defence;
use crate::jobs::give_way;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::thread;
use std::time::Duration;
use tokio::sync::oneshot;
use tokio::time::timeout;

/// Limits of readers.
#[derive(Debug, Clone, Copy)]
pub struct ReaderParams {
    /// Maximum number of files that a process opens at once: it bounds the memory of readers.
    pub most: usize,
    /// Maximum number of files of one tenant that are opened at once.
    pub most_of_tenant: usize,
    /// Timeout for waiting in the queue.
    pub wait: Duration,
    /// Timeout for opening a file.
    pub work: Duration,
}

impl Default for ReaderParams {
    fn default() -> ReaderParams {
        ReaderParams {
            most: 4,
            most_of_tenant: 2,
            wait: Duration::from_secs(60),
            work: Duration::from_secs(120),
        }
    }
}

pub(in crate::api) struct Readers {
    params: ReaderParams,
    places: FairPlaces,
}

impl Readers {
    pub fn new(params: ReaderParams) -> Readers {
        Readers { params, places: FairPlaces::new(params.most, params.most_of_tenant) }
    }

    /// Runs a blocking reader on a thread of its own, once the tenant and the process have a place. The place is free when
    /// the reader has ended, even if nobody waits for it any more.
    pub async fn run<T: Send + 'static>(
        &self,
        tenant: &str,
        read: impl FnOnce() -> T + Send + 'static,
    ) -> Result<T, Defence> {
        let place = timeout(self.params.wait, self.places.take(tenant)).await;
        let place = place.map_err(|_| Defence::ReadersBusy { wait: self.params.wait })?;
        let busy = || Defence::ReadersBusy { wait: self.params.wait };
        let (ended, end) = oneshot::channel();
        let reader = move || {
            let _place = place;
            give_way();
            let done = catch_unwind(AssertUnwindSafe(read));
            // The request may be over.
            let _ = ended.send(done);
        };
        thread::Builder::new().name("reader".to_owned()).spawn(reader).map_err(|_| busy())?;
        match timeout(self.params.work, end).await {
            Ok(Ok(Ok(value))) => Ok(value),
            Ok(Ok(Err(panic))) => resume_unwind(panic),
            Ok(Err(_)) => Err(busy()),
            Err(_) => Err(Defence::TookTooLong { limit: self.params.work }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::{Arc, mpsc};

    fn readers(most: usize, most_of_tenant: usize) -> Arc<Readers> {
        let second = Duration::from_secs(1);
        let params = ReaderParams { most, most_of_tenant, wait: 60 * second, work: 60 * second };
        Arc::new(Readers::new(params))
    }

    /// Begins a reader that ends when the returned sender is dropped, and waits until it runs.
    async fn slow(
        readers: &Arc<Readers>,
        tenant: &'static str,
    ) -> (mpsc::Sender<()>, tokio::task::JoinHandle<()>) {
        let (end, ended) = mpsc::channel::<()>();
        let (begin, begun) = tokio::sync::oneshot::channel();
        let readers = readers.clone();
        let read = move || {
            let _ = begin.send(());
            let _ = ended.recv();
        };
        let waiting = tokio::spawn(async move {
            let _ = readers.run(tenant, read).await;
        });
        begun.await.unwrap();
        (end, waiting)
    }

    #[tokio::test]
    async fn slow_files_of_one_tenant_leave_places_for_others() {
        let readers = readers(3, 2);
        let slow = [slow(&readers, "acme").await, slow(&readers, "acme").await];
        let mut third = std::pin::pin!(readers.run("acme", || 3));
        assert!(futures::poll!(&mut third).is_pending());
        assert_eq!(readers.run("bolt", || 7).await.unwrap(), 7);
        drop(slow);
        assert_eq!(third.await.unwrap(), 3);
    }

    #[tokio::test]
    async fn a_reader_keeps_its_place_until_it_ends() {
        let readers = readers(1, 1);
        let (end, waiting) = slow(&readers, "acme").await;
        waiting.abort();
        assert!(waiting.await.unwrap_err().is_cancelled());
        let mut next = std::pin::pin!(readers.run("bolt", || 7));
        assert!(futures::poll!(&mut next).is_pending(), "the work of the dropped request still runs");
        drop(end);
        assert_eq!(next.await.unwrap(), 7);
    }

    #[tokio::test]
    async fn waiting_and_working_have_limits() {
        let short = Duration::from_millis(1);
        let long = Duration::from_secs(60);
        let params = ReaderParams { most: 1, most_of_tenant: 1, wait: short, work: long };
        let readers = Arc::new(Readers::new(params));
        let (end, _waiting) = slow(&readers, "acme").await;
        assert!(matches!(readers.run("acme", || ()).await, Err(Defence::ReadersBusy { .. })));
        assert!(matches!(readers.run("bolt", || ()).await, Err(Defence::ReadersBusy { .. })));
        drop(end);
        let readers = Readers::new(ReaderParams { wait: long, work: short, ..params });
        let (_end, ended) = mpsc::channel::<()>();
        let late = readers.run("acme", move || ended.recv().is_ok()).await;
        assert!(matches!(late, Err(Defence::TookTooLong { .. })));
    }
}
