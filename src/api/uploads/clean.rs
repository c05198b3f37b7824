//! Clean-up of uploads: idle ones expire, and complete ones whose last request was cut off become clips.

use super::finish::finish_if_free;
use crate::api::App;
use futures::FutureExt;
use std::collections::{BTreeMap, HashMap};
use std::panic::AssertUnwindSafe;
use std::sync::Arc;
use tokio::sync::Semaphore;
use tokio::task::{AbortHandle, JoinSet};
use tokio::time::sleep;
use tracing::{error, info, warn};
use uuid::Uuid;
use viola_storage::{HomeId, Tenant};

/// Maximum number of uploads of one tenant that are made into clips one after the other.
const OF_TENANT: u32 = 100;

/// Maximum number of uploads that are made into clips at once. Tenants take turns.
const AT_ONCE: usize = 8;

/// Cleans at the start and then periodically until the server stops. Several processes may do so at once. A pass that the
/// stop cuts off is repeated by any process: claims have leases, and deletions are recorded.
pub(in crate::api) async fn clean(app: App) {
    // Complete uploads do not wait for a store that deletes nothing.
    tokio::select! {
        () = app.stop.cancelled() => {}
        () = make_clips(&app) => {}
        () = delete(&app) => {}
    }
}

/// Makes complete uploads into clips, periodically.
async fn make_clips(app: &App) {
    let mut tasks = TenantTasks::new(AT_ONCE);
    loop {
        match app.storage.due_uploads(OF_TENANT, app.storage.now()).await {
            Ok(due) => {
                let app = app.clone();
                tasks.begin(due, move |id| make_clip(app.clone(), id));
            }
            Err(error) => warn!(%error, "complete uploads could not be found; it is tried again"),
        }
        sleep(app.uploads.clean_every).await;
    }
}

async fn make_clip(app: App, id: Uuid) {
    // A refusal is stored with the upload; after a fault, a later pass retries.
    match finish_if_free(&app, id).await {
        Ok(false) => {}
        Ok(true) => info!(upload = %id, "an upload that was left alone is a clip"),
        // No request is there to be told.
        Err(error) if error.is_refusal() => {
            let owner = app.storage.upload_owner(id).await.ok().flatten();
            let (tenant, home) = owner.unzip();
            let (tenant, home) = (tenant.as_ref().map(Tenant::name), home.flatten());
            let home = home.as_ref().map(HomeId::as_str);
            warn!(upload = %id, tenant, home, %error, "an acknowledged upload cannot become a clip");
        }
        Err(error) => info!(upload = %id, %error, "an upload that was left alone is not a clip yet"),
    }
}

/// One task for each tenant with complete uploads, so that slow files of one tenant do not delay those of others. Dropping
/// the value ends the tasks.
struct TenantTasks {
    tasks: JoinSet<()>,
    running: HashMap<Tenant, AbortHandle>,
    places: Arc<Semaphore>,
}

impl TenantTasks {
    fn new(at_once: usize) -> TenantTasks {
        TenantTasks {
            tasks: JoinSet::new(),
            running: HashMap::new(),
            places: Arc::new(Semaphore::new(at_once)),
        }
    }

    /// Starts a task for each tenant that has none. It calls `make` for the tenant's uploads, one after the other.
    fn begin<F: Future<Output = ()> + Send + 'static>(
        &mut self,
        due: Vec<(Tenant, Uuid)>,
        make: impl Fn(Uuid) -> F + Clone + Send + 'static,
    ) {
        while self.tasks.try_join_next().is_some() {}
        self.running.retain(|_, task| !task.is_finished());
        let mut of_tenants: BTreeMap<Tenant, Vec<Uuid>> = BTreeMap::new();
        for (tenant, id) in due {
            if !self.running.contains_key(&tenant) {
                of_tenants.entry(tenant).or_default().push(id);
            }
        }
        for (tenant, ids) in of_tenants {
            let (make, places) = (make.clone(), self.places.clone());
            let task = self.tasks.spawn(async move {
                for id in ids {
                    let _place = places.acquire().await;
                    // A reader that panics loses its claim, which counts as a lost attempt. The others continue.
                    let made = AssertUnwindSafe(make(id)).catch_unwind();
                    if made.await.is_err() {
                        error!(upload = %id, "making a clip of an upload panicked");
                    }
                }
            });
            self.running.insert(tenant, task);
        }
    }
}

/// Removes idle uploads, and the files of earlier deletions whose store failed, periodically.
async fn delete(app: &App) {
    loop {
        match app.storage.expire_uploads(app.storage.now()).await {
            Ok(0) => {}
            Ok(expired) => info!(expired, "uploads expired"),
            Err(error) => warn!(%error, "uploads could not expire; it is tried again"),
        }
        match app.storage.finish_deletions().await {
            Ok(0) => {}
            Ok(finished) => info!(finished, "files of what had been deleted are gone now"),
            Err(error) => warn!(%error, "files of what had been deleted are still there; it is tried again"),
        }
        sleep(app.uploads.clean_every).await;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tokio::sync::mpsc;

    fn tenant(name: &str) -> Tenant {
        name.parse().unwrap()
    }

    #[tokio::test]
    async fn a_panic_and_slow_files_of_one_tenant_leave_others_their_turns() {
        let [slow, panics, next, other, late] = [0; 5].map(|_| Uuid::now_v7());
        let (made, mut done) = mpsc::unbounded_channel();
        let make = move |id: Uuid| {
            let made = made.clone();
            async move {
                assert!(id != panics, "a reader panics");
                if id == slow {
                    std::future::pending().await
                }
                made.send(id).unwrap();
            }
        };
        let [acme, bolt, core] = ["acme", "bolt", "core"].map(tenant);
        let mut tasks = TenantTasks::new(2);
        tasks.begin(vec![(acme.clone(), slow), (bolt.clone(), panics), (bolt.clone(), next)], make.clone());
        assert_eq!(done.recv().await, Some(next));
        // A tenant whose task still runs gets no second one.
        tasks.begin(vec![(acme.clone(), late), (core.clone(), other)], make);
        assert_eq!(done.recv().await, Some(other));
        assert!(tasks.running.contains_key(&acme) && !tasks.running[&acme].is_finished());
        drop(tasks);
        assert_eq!(done.recv().await, None, "no task is left");
    }
}
