//! Merges a home's clips into its next map.

mod describing;
mod error;
mod process;
mod revision;
mod running;
mod sources;
mod wire;
mod work;

pub use describing::{Described, Earlier, describe};
pub use process::serve_merge;

use super::child::{ChildParams, KilledOnDrop, Leash};
use super::limits::{JobLimits, merge_limits};
use super::params::WorkerParams;
use super::{Queue, give_way, metrics};
pub(super) use error::MergeError;
use process::tend;
use running::Running;
use sources::Sources;
use std::sync::Arc;
use std::thread;
use std::time::{Duration, Instant};
use tokio::sync::oneshot;
use tokio_util::sync::CancellationToken;
use tracing::{Span, error, info, warn};
use viola_geometry::progress;
use viola_home::Manifest;
use viola_reconstruct::label::SurfaceNetwork;
use viola_storage::{MergeClaim, Storage, StorageError};
use work::{Log, Made, Order, ThreadLink, WorkerEnd, make};

/// The network that labels the surface of a home; `None` labels it by its planes.
pub type SurfaceLabels = Option<Arc<SurfaceNetwork>>;

/// The place where the work of a merge is done.
struct Site {
    /// The child process; without it the work is done in this one, with `surface`.
    child: Option<ChildParams>,
    surface: SurfaceLabels,
    /// Limit of the child's memory, in addition to its network.
    memory_bytes: u64,
}

/// Merges one home; gives it back after an error, at its limit of time, and when `stop` comes first. A merge that ends early
/// has the grace period of the worker for it.
pub(super) async fn merge(
    queue: &Queue,
    claim: &MergeClaim,
    params: &WorkerParams,
    stop: &CancellationToken,
) {
    let (begun, running) = (Instant::now(), Arc::new(Running::default()));
    let WorkerParams { lease, grace, merge_child, align, .. } = params;
    let JobLimits { time: limit, memory_bytes } = merge_limits(&params.limits, claim.members.len());
    let surface = align.align.label.surface.clone();
    let site = Site { child: merge_child.clone(), surface, memory_bytes };
    let early = async {
        tokio::select! {
            () = hold(&queue.storage, claim, *lease) => Ok(Merged::Lost),
            () = stop.cancelled() => Ok(Merged::Stopped),
            () = running.too_long(limit) => Err(MergeError::TookTooLong { limit }),
        }
    };
    let merged = match running.end(try_merge(&queue.storage, claim, &site, &running), early, *grace).await {
        // Its process was asked to stop before this one was, or it alone.
        Err(MergeError::Cancelled) => Ok(Merged::Stopped),
        merged => merged,
    };
    let took = begun.elapsed();
    let outcome = match &merged {
        Ok(Merged::Revision { .. }) => "revision",
        Ok(Merged::Nothing) => "nothing",
        Ok(Merged::Lost) => "lost",
        Ok(Merged::Stopped) => "stopped",
        Err(_) => "failed",
    };
    metrics::merged(outcome, took);
    let (seconds, clips) = (took.as_secs_f64(), claim.members.len());
    match merged {
        Ok(Merged::Revision { tiles }) => info!(home = %claim.home, clips, tiles, seconds, "map merged"),
        Ok(Merged::Nothing) => info!(home = %claim.home, clips, seconds, "the map is as it was"),
        Ok(Merged::Lost) => info!(home = %claim.home, "the map is due again"),
        Ok(Merged::Stopped) => {
            info!(home = %claim.home, "the merge ends with the worker");
            let released = queue.storage.give_back_merge(claim, queue.storage.now()).await;
            log_failed_release(claim, released);
        }
        Err(cause) => {
            error!(home = %claim.home, %cause, "a map could not be merged");
            let damaged = if let MergeError::DamagedClip { clip } = cause { Some(clip) } else { None };
            let released = queue.storage.fail_merge(claim, damaged, queue.storage.now()).await;
            log_failed_release(claim, released);
        }
    }
}

/// Logs that a claim could not be given back; its lease expires.
fn log_failed_release(claim: &MergeClaim, released: Result<(), StorageError>) {
    if let Err(error) = released {
        error!(home = %claim.home, %error, "a merge could not be given back");
    }
}

/// Runs `work` on a thread of its own, which the end of the process does not wait for.
pub(super) fn on_own_thread<T: Send + 'static>(
    work: impl FnOnce() -> T + Send + 'static,
) -> Result<oneshot::Receiver<T>, MergeError> {
    let (ended, end) = oneshot::channel();
    let span = Span::current();
    let work = move || {
        let _entered = span.entered();
        give_way();
        let done = work();
        // The worker may have given up the merge.
        let _ = ended.send(done);
    };
    thread::Builder::new().name("merge".to_owned()).spawn(work).map_err(MergeError::NotStarted)?;
    Ok(end)
}

/// Renews the lease until the home is no longer this worker's.
async fn hold(storage: &Storage, claim: &MergeClaim, lease: Duration) {
    loop {
        tokio::time::sleep(lease / 3).await;
        match storage.renew_merge(claim, lease, storage.now()).await {
            Ok(true) => {}
            Ok(false) => return,
            Err(error) => error!(home = %claim.home, %error, "a merge's lease could not be renewed"),
        }
    }
}

enum Merged {
    Revision {
        tiles: usize,
    },
    Nothing,
    Lost,
    /// The worker ends.
    Stopped,
}

/// Merges from the last map; from the clips alone if its files are damaged.
async fn try_merge(
    storage: &Storage,
    claim: &MergeClaim,
    site: &Site,
    running: &Arc<Running>,
) -> Result<Merged, MergeError> {
    let last = match storage.last_manifest(claim).await {
        // The map can be made without it.
        Err(damage @ StorageError::Column { .. }) => {
            error!(home = %claim.home, %damage, "a file of the last map is left out");
            Manifest::default()
        }
        last => last?,
    };
    match merge_from(&last, storage, claim, site, running).await {
        Err(damage @ MergeError::DamagedMap) => {
            error!(home = %claim.home, %damage, "the map is made again from its clips");
            merge_from(&Manifest::default(), storage, claim, site, running).await
        }
        merged => merged,
    }
}

/// Merges without damaged clips, if they are few: one of them must not keep the others from a map. The next merge reads them
/// again.
async fn merge_from(
    last: &Manifest,
    storage: &Storage,
    claim: &MergeClaim,
    site: &Site,
    running: &Arc<Running>,
) -> Result<Merged, MergeError> {
    let mut claim = claim.clone();
    let min_clips = (claim.members.len() - claim.members.len().div_ceil(10)).max(1);
    loop {
        match merge_members(last, storage, &claim, site, running).await {
            Err(damage @ MergeError::DamagedClip { clip }) if claim.members.len() > min_clips => {
                warn!(home = %claim.home, %damage, "a clip is left out of the map");
                claim.leave_out(clip);
            }
            merged => return merged,
        }
    }
}

async fn merge_members(
    last: &Manifest,
    storage: &Storage,
    claim: &MergeClaim,
    site: &Site,
    running: &Arc<Running>,
) -> Result<Merged, MergeError> {
    let sources = Sources::read(storage, claim, last).await?;
    let order = Order { last: last.clone(), members: claim.members.clone() };
    let made = work(storage, order, site, &sources, running).await?;
    let Some(Made { revision: mut new, log }) = made else {
        let kept = storage.finish_merge(claim, None, storage.now()).await?;
        return Ok(if kept { Merged::Nothing } else { Merged::Lost });
    };
    tell(&log);
    sources.complete(&mut new);
    let tiles = new.tiles.len();
    running.begin_to_write();
    let kept = storage.finish_merge(claim, Some(&new), storage.now()).await?;
    Ok(if kept { Merged::Revision { tiles } } else { Merged::Lost })
}

fn tell(log: &Log) {
    for clip in &log.without_features {
        warn!(%clip, "the features of a clip are damaged; it is merged without matches");
    }
    if let Some(failure) = &log.network_failure {
        warn!(%failure, "the surface network failed: parts of the map have the labels of the clips and of the shapes");
    }
    info!(windows = log.windows, "the map is labelled");
}

/// Does the work in a process, or on a thread if there is no command for it, and answers what it asks for.
async fn work(
    storage: &Storage,
    order: Order,
    site: &Site,
    sources: &Sources<'_>,
    running: &Arc<Running>,
) -> Result<Option<Made>, MergeError> {
    // The stop may have come to earlier work of this merge, which ended otherwise.
    progress::check(running.as_ref())?;
    let (mut link, WorkerEnd { mut requests, answers }) = ThreadLink::new();
    let leash = Arc::new(Leash::default());
    let end = match site.child.clone() {
        Some(child) => {
            let (said, limit_bytes, leash) = (storage.scratch_file()?, site.memory_bytes, leash.clone());
            on_own_thread(move || tend(&child, &order, limit_bytes, said, &mut link, &leash))
        }
        None => {
            let (surface, running) = (site.surface.clone(), running.clone());
            on_own_thread(move || make(order, &mut link, surface.as_deref(), &*running))
        }
    }?;
    let leash = KilledOnDrop(leash);
    loop {
        let request = tokio::select! {
            request = requests.recv() => request,
            () = running.stopped() => {
                leash.0.kill();
                continue;
            }
        };
        let Some(request) = request else { break };
        // The work waits for each answer, unless it has ended.
        let _ = answers.send(sources.answer(request).await?);
    }
    end.await.unwrap_or(Err(MergeError::Panicked))
}
