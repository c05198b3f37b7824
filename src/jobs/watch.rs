//! Streams of the changes of homes and of jobs. One reader in each process notifies the streams of a changed home or job,
//! and the readers of its tenant's feed, so a change costs the same however many wait for others. The streams that a change
//! wakes read in turns, for there may be thousands.

use super::{POLL, Queue};
use futures::{Stream, StreamExt};
use std::collections::{BTreeSet, HashMap};
use std::hash::Hash;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};
use tokio::sync::Notify;
use tokio::time::timeout;
use tokio_util::sync::CancellationToken;
use tracing::warn;
use uuid::Uuid;
use viola_storage::{Change, ChangeKind, HomeId, Job, StorageError};

/// The things that streams wait for.
pub(super) struct Watched<K> {
    things: Mutex<HashMap<K, Weak<Notify>>>,
}

impl<K> Default for Watched<K> {
    fn default() -> Watched<K> {
        Watched { things: Mutex::default() }
    }
}

impl<K: Clone + Eq + Hash> Watched<K> {
    fn things(&self) -> MutexGuard<'_, HashMap<K, Weak<Notify>>> {
        self.things.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Returns the notification of a thing's changes.
    pub(super) fn watch(&self, thing: &K) -> Arc<Notify> {
        let mut things = self.things();
        if let Some(known) = things.get(thing).and_then(Weak::upgrade) {
            return known;
        }
        let notify = Arc::new(Notify::new());
        things.insert(thing.clone(), Arc::downgrade(&notify));
        notify
    }

    /// Returns what streams wait for, and forgets the rest.
    fn list(&self) -> Vec<K> {
        let mut things = self.things();
        things.retain(|_, notify| notify.strong_count() > 0);
        things.keys().cloned().collect()
    }

    fn notify(&self, thing: &K) {
        if let Some(notify) = self.things().get(thing).and_then(Weak::upgrade) {
            notify.notify_waiters();
        }
    }
}

/// Positions that the reader read last.
#[derive(Default)]
struct Seen {
    /// Position of the changes feed; none while nobody waits for it.
    feed: Option<i64>,
    /// Versions of the jobs that streams wait for.
    jobs: HashMap<Uuid, i64>,
}

impl Queue {
    /// Streams the changes of a home after a position of the feed, until the home is removed. Each reading waits for a
    /// `turn`, and holds it.
    pub fn watch_home<F: Future>(
        self: Arc<Queue>,
        home: HomeId,
        after: i64,
        turn: impl Fn() -> F + Clone,
    ) -> impl Stream<Item = Result<Change, StorageError>> {
        let changed = self.watched_homes.watch(&home);
        let parts = futures::stream::unfold(Some(after), move |after| {
            let (queue, home, changed, turn) = (self.clone(), home.clone(), changed.clone(), turn.clone());
            async move {
                let changes = queue.next_changes(&home, &changed, after?, turn).await;
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
    async fn next_changes<F: Future>(
        &self,
        home: &HomeId,
        changed: &Notify,
        after: i64,
        turn: impl Fn() -> F,
    ) -> Result<Vec<Change>, StorageError> {
        loop {
            let mut notified = std::pin::pin!(changed.notified());
            // Listening begins before reading, so that no change is missed.
            notified.as_mut().enable();
            let held = turn().await;
            let changes = self.storage.home_changes(home, after).await?;
            drop(held);
            if !changes.is_empty() {
                return Ok(changes);
            }
            notified.await;
        }
    }

    /// Streams the job now, unless its version is `seen`, and again after every change, up to its final
    /// state. `None` in the stream: the job was removed with its clip. Turns as in [`Queue::watch_home`].
    pub fn watch<F: Future>(
        self: Arc<Queue>,
        id: Uuid,
        seen: i64,
        turn: impl Fn() -> F + Clone,
    ) -> impl Stream<Item = Result<Option<Job>, StorageError>> {
        let changed = self.watched_jobs.watch(&id);
        futures::stream::unfold(Some(seen), move |seen| {
            let (queue, changed, turn) = (self.clone(), changed.clone(), turn.clone());
            async move {
                let job = queue.next_version(id, &changed, seen?, turn).await;
                let goes_on = matches!(&job, Ok(Some(job)) if !job.state.is_final());
                let seen = job.as_ref().ok().and_then(|job| job.as_ref()).map(|job| job.version);
                Some((job, seen.filter(|_| goes_on)))
            }
        })
    }

    /// Waits until the job's version differs from `seen`.
    async fn next_version<F: Future>(
        &self,
        id: Uuid,
        changed: &Notify,
        seen: i64,
        turn: impl Fn() -> F,
    ) -> Result<Option<Job>, StorageError> {
        loop {
            let mut notified = std::pin::pin!(changed.notified());
            // As in `next_changes`.
            notified.as_mut().enable();
            let held = turn().await;
            match self.storage.job(id).await? {
                Some(job) if job.version == seen => drop(held),
                other => return Ok(other),
            }
            notified.await;
        }
    }

    /// Notifies the streams of changes, until `stop`.
    pub async fn notify_watchers(self: Arc<Queue>, stop: CancellationToken) {
        let mut seen = Seen::default();
        loop {
            let mut changed = std::pin::pin!(self.changed.notified());
            // As in `next_changes`.
            changed.as_mut().enable();
            for result in [
                self.notify_feed_watchers(&mut seen.feed).await,
                self.notify_job_watchers(&mut seen.jobs).await,
            ] {
                if let Err(error) = result {
                    warn!(%error, "event streams wait, for changes cannot be read for now");
                }
            }
            tokio::select! {
                () = stop.cancelled() => return,
                _ = timeout(POLL, changed) => {}
            }
        }
    }

    /// Notifies the streams of changed homes and the readers of their tenants' feeds, from one read of the feed.
    async fn notify_feed_watchers(&self, seen: &mut Option<i64>) -> Result<(), StorageError> {
        let (homes, tenants) = (self.watched_homes.list(), self.watched_tenants.list());
        if homes.is_empty() && tenants.is_empty() {
            *seen = None;
            return Ok(());
        }
        let last = self.storage.last_change().await?;
        let changed = match *seen {
            Some(after) if after == last => Vec::new(),
            Some(after) if after < last => self.storage.changed_homes(after).await?,
            // Nobody read the feed before, or the database was restored from a copy.
            _ => {
                // Those that came while the position was read are notified, too.
                self.watched_tenants.list().iter().for_each(|tenant| self.watched_tenants.notify(tenant));
                self.watched_homes.list()
            }
        };
        changed.iter().for_each(|home| self.watched_homes.notify(home));
        let tenants: BTreeSet<String> = changed.iter().map(|home| home.tenant().to_owned()).collect();
        tenants.iter().for_each(|tenant| self.watched_tenants.notify(tenant));
        *seen = Some(last);
        Ok(())
    }

    async fn notify_job_watchers(&self, seen: &mut HashMap<Uuid, i64>) -> Result<(), StorageError> {
        let watched = self.watched_jobs.list();
        if watched.is_empty() {
            seen.clear();
            return Ok(());
        }
        let versions = self.storage.job_versions(&watched).await?;
        // A job that was not watched before counts as changed: it may have changed since its stream read it.
        let changed = watched.iter().filter(|id| !seen.contains_key(id) || seen.get(id) != versions.get(id));
        changed.for_each(|id| self.watched_jobs.notify(id));
        *seen = versions;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use futures::{FutureExt, poll};
    use std::pin::pin;
    use tokio::sync::Semaphore;
    use viola_storage::{Storage, StorageParams, Tenant};

    #[tokio::test]
    async fn a_change_wakes_only_those_that_wait_for_its_tenant() {
        let folder = tempfile::tempdir().unwrap();
        let storage = Arc::new(Storage::open(&StorageParams::in_folder(folder.path())).await.unwrap());
        let queue = Queue::new(storage.clone());
        let tenants = ["acme", "bolt"];
        let watched = tenants.map(|tenant| queue.watched_tenants.watch(&tenant.to_owned()));
        let (mut seen, mut woken) = (None, Vec::new());
        for changed in ["acme", "bolt", "acme"] {
            let tenant: Tenant = changed.parse().unwrap();
            let home = tenant.home(&format!("h{}", woken.len()).parse().unwrap());
            let mut notified = watched.each_ref().map(|notify| Box::pin(notify.notified()));
            notified.iter_mut().for_each(|notified| _ = notified.as_mut().enable());
            storage.put_home(&home, None, |_| true, storage.now()).await.unwrap();
            queue.notify_feed_watchers(&mut seen).await.unwrap();
            woken.push(notified.map(|notified| notified.now_or_never().is_some()));
        }
        // The first reading of the feed knows no earlier one.
        assert_eq!(woken, [[true, true], [false, true], [true, false]]);
        storage.close().await;
    }

    #[tokio::test]
    async fn streams_read_in_turns() {
        let folder = tempfile::tempdir().unwrap();
        let storage = Arc::new(Storage::open(&StorageParams::in_folder(folder.path())).await.unwrap());
        let home = "acme".parse::<Tenant>().unwrap().home(&"h".parse().unwrap());
        storage.put_home(&home, None, |_| true, storage.now()).await.unwrap();
        let turns = Arc::new(Semaphore::new(0));
        let turn = {
            let turns = turns.clone();
            move || turns.clone().acquire_owned()
        };
        let queue = Arc::new(Queue::new(storage.clone()));
        let mut changes = pin!(queue.clone().watch_home(home, 0, turn.clone()));
        let mut job = pin!(queue.watch(Uuid::nil(), 0, turn));
        assert!(poll!(changes.next()).is_pending() && poll!(job.next()).is_pending());
        turns.add_permits(1);
        assert!(changes.next().await.unwrap().unwrap().kind == ChangeKind::Home);
        assert!(job.next().await.unwrap().unwrap().is_none(), "the turn ended with the reading");
        storage.close().await;
    }

    #[test]
    fn only_the_streams_of_a_thing_are_told_of_it() {
        let watched = Watched::<HomeId>::default();
        let [changed, still]: [HomeId; 2] = ["changed", "still"].map(|id| id.parse().unwrap());
        let notifications = [&changed, &changed, &still].map(|home| watched.watch(home));
        let mut notified = notifications.each_ref().map(|notify| Box::pin(notify.notified()));
        notified.iter_mut().for_each(|notified| _ = notified.as_mut().enable());
        watched.notify(&changed);
        assert_eq!(notified.map(|notified| notified.now_or_never().is_some()), [true, true, false]);
        assert_eq!(watched.list().len(), 2);
        drop(notifications);
        assert!(watched.list().is_empty() && watched.things().is_empty());
    }
}
