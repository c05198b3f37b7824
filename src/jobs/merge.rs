//! Merges a home's clips into its next map.

mod assembling;
mod describing;
mod error;
mod revision;
mod running;

pub use describing::{Described, Earlier, LeftMap, describe};

use super::align_clip::LevelFile;
use super::limits::{JobLimitParams, merge_limit};
use super::{Queue, give_way, metrics};
use assembling::assemble;
use bytes::Bytes;
use describing::{loses_objects, removed_levels};
pub(super) use error::MergeError;
use futures::stream::{self, StreamExt, TryStreamExt};
use revision::{Level, label, revision};
use running::Running;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::thread;
use std::time::{Duration, Instant};
use tokio::sync::oneshot;
use tokio_util::sync::CancellationToken;
use tracing::{Span, error, info, warn};
use viola_geometry::{LevelName, Pose2};
use viola_home::{Assembly, Manifest, TileKey};
use viola_reconstruct::label::SurfaceNetwork;
use viola_storage::{LidarMapRevision, MapFile, MapScene, MergeClaim, NewRevision, Storage, StorageError};

/// Files that are read at a time: a store far away waits more than it works.
const FILES_AT_A_TIME: usize = 8;

/// The network that labels the surface of a home; `None` labels it by its planes.
pub(super) type SurfaceLabels = Option<Arc<SurfaceNetwork>>;

/// Merges one home; gives it back after an error, at its limit of time, and when `stop` comes first. A merge that ends early
/// has the time `grace` for it.
pub(super) async fn merge(
    queue: &Queue,
    claim: &MergeClaim,
    surface: SurfaceLabels,
    limits: &JobLimitParams,
    (lease, grace): (Duration, Duration),
    stop: &CancellationToken,
) {
    let (begun, running) = (Instant::now(), Arc::new(Running::default()));
    let limit = merge_limit(limits, claim.members.len());
    let early = async {
        tokio::select! {
            () = hold(&queue.storage, claim, lease) => Ok(Merged::Lost),
            () = stop.cancelled() => Ok(Merged::Stopped),
            () = running.too_long(limit) => Err(MergeError::TookTooLong { limit }),
        }
    };
    let merged = running.end(try_merge(&queue.storage, claim, surface, &running), early, grace).await;
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
    thread::Builder::new().name("merge".to_owned()).spawn(work).map_err(MergeError::NoThread)?;
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
    storage: &Arc<Storage>,
    claim: &MergeClaim,
    surface: SurfaceLabels,
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
    match merge_from(&last, storage, claim, surface.clone(), running).await {
        Err(damage @ MergeError::DamagedMap) => {
            error!(home = %claim.home, %damage, "the map is made again from its clips");
            merge_from(&Manifest::default(), storage, claim, surface, running).await
        }
        merged => merged,
    }
}

async fn merge_from(
    manifest: &Manifest,
    storage: &Arc<Storage>,
    claim: &MergeClaim,
    surface: SurfaceLabels,
    running: &Arc<Running>,
) -> Result<Merged, MergeError> {
    let (claim, assembly) = assemble_readable(storage, claim, manifest, running).await?;
    let claim = &claim;
    let scenes = storage.last_scenes(claim).await?;
    let described = (claim.corrections.version, claim.home_name.as_deref());
    let is_described = |level: &LevelName| {
        scenes.get(level).is_some_and(|scene| (scene.corrections(), scene.home_name()) == described)
    };
    let last_tiles = storage.last_tiles(claim).await?;
    // A map whose manifest was left out has more tiles than that.
    let is_same = assembly.manifest == *manifest
        && claim.lidar_maps.iter().all(|map| is_described(&map.level))
        && last_tiles.len() == manifest.tiles.len();
    if claim.last_revision > 0 && !claim.has_new_lidar_map() && is_same {
        let kept = storage.finish_merge(claim, None, storage.now()).await?;
        return Ok(if kept { Merged::Nothing } else { Merged::Lost });
    }
    let loses_objects = loses_objects(&scenes, |level| claim.lidar_maps.iter().any(|map| map.level == level));
    let mut levels = levels(storage, claim, manifest, scenes).await?;
    let is_labelled = assembly.is_labelled_by(surface.as_deref());
    for level in &mut levels {
        level.is_same = is_labelled && level.last.is_described() && !assembly.touches(level.file.level);
    }
    let kept = kept_tiles(storage, &last_tiles, &assembly, &levels).await?;
    let progress = running.clone();
    let make = move || {
        let map = label(assembly, kept, surface.as_deref(), &*progress)?;
        revision(map, &levels, &*progress)
    };
    let mut new = on_own_thread(make)?.await.unwrap_or(Err(MergeError::Panicked))?;
    new.has_object_changes |= loses_objects;
    remove_others(&mut new, &last_tiles);
    let tiles = new.tiles.len();
    running.begin_to_write();
    let kept = storage.finish_merge(claim, Some(&new), storage.now()).await?;
    Ok(if kept { Merged::Revision { tiles } } else { Merged::Lost })
}

/// Assembles the map without damaged clips, if they are few: one of them must not keep the others from a map. The next merge
/// reads them again. The claim has the clips of the map.
async fn assemble_readable(
    storage: &Storage,
    claim: &MergeClaim,
    last: &Manifest,
    running: &Arc<Running>,
) -> Result<(MergeClaim, Assembly), MergeError> {
    let mut claim = claim.clone();
    let min_clips = (claim.members.len() - claim.members.len().div_ceil(10)).max(1);
    loop {
        match assemble(storage, &claim, last, running.clone()).await {
            Err(damage @ MergeError::DamagedClip { clip }) if claim.members.len() > min_clips => {
                warn!(home = %claim.home, %damage, "a clip is left out of the map");
                claim.leave_out(clip);
            }
            assembly => return Ok((claim, assembly?)),
        }
    }
}

/// Returns the tiles of the last revision that the next one keeps, without those of levels that stay as they were.
async fn kept_tiles(
    storage: &Storage,
    last_tiles: &[MapFile],
    assembly: &Assembly,
    levels: &[Level],
) -> Result<Vec<(TileKey, Bytes)>, MergeError> {
    let is_needed = |key: &TileKey| {
        let stays = levels.iter().any(|level| level.is_same && level.file.level == key.level);
        !stays && assembly.keeps(key)
    };
    let needed = last_tiles.iter().filter_map(|file| Some((file.tile.filter(is_needed)?, file)));
    let read = |(key, file): (TileKey, &MapFile)| {
        let file = file.clone();
        async move { Ok((key, storage.map_file_bytes(&file).await?.ok_or(MergeError::DamagedMap)?)) }
    };
    let reads: Vec<_> = needed.map(read).collect();
    stream::iter(reads).buffered(FILES_AT_A_TIME).try_collect().await
}

/// Removes the tiles of the last revision that a map made from the clips alone does not know.
fn remove_others(new: &mut NewRevision, last_tiles: &[MapFile]) {
    let there: BTreeSet<TileKey> = new.manifest.tiles.iter().map(|(key, _)| *key).collect();
    let told: BTreeSet<TileKey> = new.tiles.iter().map(|(key, _)| *key).collect();
    let others = last_tiles.iter().filter_map(|file| file.tile);
    let others = others.filter(|key| !there.contains(key) && !told.contains(key));
    new.tiles.extend(others.map(|key| (key, None)));
}

/// Returns the levels with a LiDAR map.
async fn levels(
    storage: &Storage,
    claim: &MergeClaim,
    last: &Manifest,
    mut scenes: BTreeMap<LevelName, MapScene>,
) -> Result<Vec<Level>, MergeError> {
    let removed = removed_levels(&scenes, |level| claim.lidar_maps.iter().any(|map| map.level == level));
    let mut levels = Vec::new();
    for map in &claim.lidar_maps {
        let clips = last.clips.iter().filter(|clip| clip.level == map.level).cloned().collect();
        let last = Earlier {
            clips,
            scene: scenes.remove(&map.level),
            corrections: claim.corrections.on_level(map.level),
            home_name: claim.home_name.clone(),
            left: left_map(storage, claim, map).await?,
            removed_levels: removed.clone(),
        };
        let bytes = storage.lidar_map_file(map.id()).await?;
        levels.push(Level { file: LevelFile { level: map.level, bytes }, last, is_same: false });
    }
    Ok(levels)
}

/// Returns a level's LiDAR map of the last revision, if the level has another one now.
async fn left_map(
    storage: &Storage,
    claim: &MergeClaim,
    now: &LidarMapRevision,
) -> Result<Option<LeftMap>, MergeError> {
    let Some(revision) = claim.left_lidar_map(now) else { return Ok(None) };
    let (mut now_from_map, mut map) = (Pose2::IDENTITY, Some(now.clone()));
    while let Some(step) = map.and_then(|map| map.from_earlier) {
        now_from_map = now_from_map.compose(&step.map_from_earlier);
        if step.revision == revision {
            return Ok(Some(LeftMap { revision, now_from_left: Some(now_from_map) }));
        }
        map = storage.lidar_map_revision(&claim.home, now.level, step.revision).await?;
    }
    Ok(Some(LeftMap { revision, now_from_left: None }))
}
