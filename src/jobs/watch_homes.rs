//! Streams of the changes of homes. One reader of the feed for each process tells the streams of a home that it changed, so
//! that a change costs the same however many streams wait for others.

use super::{POLL, Queue};
use crate::storage::{Change, ChangeKind, HomeId, StorageError};
use futures::{Stream, StreamExt};
use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};
use tokio::sync::Notify;
use tokio::time::timeout;
use tokio_util::sync::CancellationToken;
use tracing::warn;

/// The homes that streams wait for.
#[derive(Default)]
pub(super) struct Watched {
    homes: Mutex<HashMap<HomeId, Weak<Notify>>>,
}

impl Watched {
    fn homes(&self) -> MutexGuard<'_, HashMap<HomeId, Weak<Notify>>> {
        self.homes.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Returns the notification of a home's changes.
    fn watch(&self, home: &HomeId) -> Arc<Notify> {
        let mut homes = self.homes();
        if let Some(known) = homes.get(home).and_then(Weak::upgrade) {
            return known;
        }
        let notify = Arc::new(Notify::new());
        homes.insert(home.clone(), Arc::downgrade(&notify));
        notify
    }

    /// Forgets the homes that no stream waits for any more. Returns whether others are left.
    fn tidy(&self) -> bool {
        let mut homes = self.homes();
        homes.retain(|_, notify| notify.strong_count() > 0);
        !homes.is_empty()
    }

    fn tell(&self, home: &HomeId) {
        if let Some(notify) = self.homes().get(home).and_then(Weak::upgrade) {
            notify.notify_waiters();
        }
    }

    fn tell_all(&self) {
        self.homes().values().filter_map(Weak::upgrade).for_each(|notify| notify.notify_waiters());
    }
}

impl Queue {
    /// Streams the changes of a home after a position of the feed, until the home is removed.
    pub fn watch_home(
        self: Arc<Queue>,
        home: HomeId,
        after: i64,
    ) -> impl Stream<Item = Result<Change, StorageError>> {
        let changed = self.watched.watch(&home);
        let parts = futures::stream::unfold(Some(after), move |after| {
            let (queue, home, changed) = (self.clone(), home.clone(), changed.clone());
            async move {
                let changes = queue.next_changes(&home, &changed, after?).await;
                let last = changes.as_ref().ok().and_then(|changes| changes.last()).map(|change| change.seq);
                let is_removed = |change: &Change| change.kind == ChangeKind::Home && change.deleted;
                let ends = changes.as_ref().is_ok_and(|changes| changes.iter().any(is_removed));
                let items = match changes {
                    Ok(changes) => changes.into_iter().map(Ok).collect(),
                    Err(error) => vec![Err(error)],
                };
                Some((futures::stream::iter(items), last.filter(|_| !ends)))
            }
        });
        parts.flatten()
    }

    /// Waits until there are changes of a home after a position.
    async fn next_changes(
        &self,
        home: &HomeId,
        changed: &Notify,
        after: i64,
    ) -> Result<Vec<Change>, StorageError> {
        loop {
            let mut told = std::pin::pin!(changed.notified());
            // Listening begins before reading, so that no change is missed.
            told.as_mut().enable();
            let changes = self.storage.home_changes(home, after).await?;
            if !changes.is_empty() {
                return Ok(changes);
            }
            told.await;
        }
    }

    /// Reads the feed and tells the streams of the homes that changed, until `stop`.
    pub async fn tell_watchers(self: Arc<Queue>, stop: CancellationToken) {
        let mut seen = None;
        loop {
            let mut changed = std::pin::pin!(self.changed.notified());
            // As in `next_changes`.
            changed.as_mut().enable();
            if let Err(error) = self.tell_of_homes(&mut seen).await {
                warn!(%error, "the changes of homes cannot be read for now");
            }
            tokio::select! {
                () = stop.cancelled() => return,
                _ = timeout(POLL, changed) => {}
            }
        }
    }

    /// Tells of the changes after `seen`, the position of the feed that was read last; none if nobody waited.
    async fn tell_of_homes(&self, seen: &mut Option<i64>) -> Result<(), StorageError> {
        if !self.watched.tidy() {
            *seen = None;
            return Ok(());
        }
        let last = self.storage.last_change().await?;
        match *seen {
            Some(after) if after == last => {}
            // The database was restored from a copy, or nobody read the feed before.
            Some(after) if after > last => self.watched.tell_all(),
            None => self.watched.tell_all(),
            Some(after) => {
                let homes = self.storage.changed_homes(after).await?;
                homes.iter().for_each(|home| self.watched.tell(home));
            }
        }
        *seen = Some(last);
        Ok(())
    }
}
