//! Merges a home's clips into its next map.

mod assembling;
mod describing;

pub use describing::{Described, Earlier, describe};

use super::align_clip::LevelFile;
use super::{Queue, metrics};
use crate::storage::{LevelCoverage, MapScene, MergeClaim, NewRevision, Storage, StorageError, map_file};
use assembling::assemble;
use bytes::Bytes;
use jiff::Timestamp;
use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::{Duration, Instant};
use tracing::{error, info};
use viola_align::LevelMap;
use viola_formats::lidar::{LidarError, LidarMap};
use viola_geometry::LevelName;
use viola_home::{Assembly, Coverage, LabelledMap, Manifest, NotOurs, Tile, TileKey};
use viola_reconstruct::label::SurfaceNetwork;

/// Pause of a home after a failed merge.
const PAUSE: Duration = Duration::from_secs(5);

/// The network that labels the surface of a home; `None` labels it by its planes.
pub(super) type SurfaceLabels = Option<Arc<SurfaceNetwork>>;

/// Merges one home; gives it back after an error.
pub(super) async fn merge(queue: &Queue, claim: &MergeClaim, surface: SurfaceLabels, lease: Duration) {
    let begun = Instant::now();
    let merged = tokio::select! {
        merged = try_merge(&queue.storage, claim, surface) => merged,
        () = hold(&queue.storage, claim, lease) => Ok(Merged::Lost),
    };
    let took = begun.elapsed();
    let outcome = match &merged {
        Ok(Merged::Revision { .. }) => "revision",
        Ok(Merged::Nothing) => "nothing",
        Ok(Merged::Lost) => "lost",
        Err(_) => "failed",
    };
    metrics::merged(outcome, took);
    let seconds = took.as_secs_f64();
    let clips = claim.members.len();
    match merged {
        Ok(Merged::Revision { tiles }) => info!(home = %claim.home, clips, tiles, seconds, "map merged"),
        Ok(Merged::Nothing) => info!(home = %claim.home, clips, seconds, "the map is as it was"),
        Ok(Merged::Lost) => info!(home = %claim.home, "the map is due again"),
        Err(cause) => {
            error!(home = %claim.home, %cause, "a map could not be merged");
            // A clip that was removed meanwhile is no fault, and waiting would not bring it back.
            let pause = if matches!(cause, MergeError::Gone) { Duration::ZERO } else { PAUSE };
            let given_back = queue.storage.give_back_merge(claim, Timestamp::now() + pause).await;
            if let Err(error) = given_back {
                // The lease expires, and the home is merged again.
                error!(home = %claim.home, %error, "a merge could not be given back");
            }
        }
    }
}

/// Renews the lease until the home is no longer this worker's.
async fn hold(storage: &Storage, claim: &MergeClaim, lease: Duration) {
    loop {
        tokio::time::sleep(lease / 3).await;
        match storage.renew_merge(claim, lease, Timestamp::now()).await {
            Ok(true) => {}
            Ok(false) => return,
            Err(error) => error!(home = %claim.home, %error, "a merge's lease could not be renewed"),
        }
    }
}

enum Merged {
    Revision { tiles: usize },
    Nothing,
    Lost,
}

/// Reason why a map could not be merged.
#[derive(Debug, thiserror::Error)]
enum MergeError {
    #[error(transparent)]
    Storage(#[from] StorageError),
    #[error("the merge panicked")]
    Panicked,
    #[error("no thread could be started for the merge: {0}")]
    NoThread(std::io::Error),
    #[error("a stored file of the clip or of the map is damaged: {0}")]
    Damaged(#[from] NotOurs),
    #[error("the LiDAR map cannot be read any more: {0}")]
    Lidar(#[from] LidarError),
    #[error("a clip was removed or aligned anew meanwhile")]
    Gone,
    #[error("nobody waits for the merge any more")]
    Abandoned,
}

async fn try_merge(
    storage: &Arc<Storage>,
    claim: &MergeClaim,
    surface: SurfaceLabels,
) -> Result<Merged, MergeError> {
    let manifest = storage.last_manifest(claim).await?;
    let assembly = assemble(storage, &manifest, &claim.members).await?;
    let scenes = storage.last_scenes(claim).await?;
    let corrections = scenes.values().next().map_or(0, |scene| scene.history().corrections);
    let is_same = assembly.manifest == manifest && corrections == claim.corrections.version;
    if claim.last_revision > 0 && !claim.has_new_lidar_map() && is_same {
        let kept = storage.finish_merge(claim, None, Timestamp::now()).await?;
        return Ok(if kept { Merged::Nothing } else { Merged::Lost });
    }
    let kept = kept_tiles(storage, claim, &assembly).await?;
    let levels = levels(storage, claim, &manifest, scenes).await?;
    let label = move || label(assembly, kept, surface.as_deref());
    let new = tokio::task::spawn_blocking(move || revision(label()?, &levels));
    let new = new.await.unwrap_or(Err(MergeError::Panicked))?;
    let tiles = new.tiles.len();
    let kept = storage.finish_merge(claim, Some(&new), Timestamp::now()).await?;
    Ok(if kept { Merged::Revision { tiles } } else { Merged::Lost })
}

/// Returns the tiles of the last revision that the next one keeps.
async fn kept_tiles(
    storage: &Storage,
    claim: &MergeClaim,
    assembly: &Assembly,
) -> Result<Vec<(TileKey, Bytes)>, MergeError> {
    let mut kept = Vec::new();
    for file in storage.last_tiles(claim).await? {
        let Some(key) = file.tile.filter(|key| !assembly.changed.contains_key(key)) else { continue };
        kept.push((key, storage.map_file_bytes(&file).await?.ok_or(MergeError::Gone)?));
    }
    Ok(kept)
}

/// A level of the home, as the description needs it.
struct Level {
    file: LevelFile,
    last: Earlier,
}

/// Returns the levels with a LiDAR map.
async fn levels(
    storage: &Storage,
    claim: &MergeClaim,
    last: &Manifest,
    mut scenes: BTreeMap<LevelName, MapScene>,
) -> Result<Vec<Level>, MergeError> {
    let mut levels = Vec::new();
    for map in &claim.lidar_maps {
        let clips = last.clips.iter().filter(|clip| clip.level_name == map.level).cloned().collect();
        let last = Earlier {
            clips,
            scene: scenes.remove(&map.level),
            corrections: claim.corrections.on_level(map.level),
            left_lidar_map: claim.left_lidar_map(map),
        };
        let bytes = storage.lidar_map_file(map.id()).await?;
        levels.push(Level { file: LevelFile { level: map.level, bytes }, last });
    }
    Ok(levels)
}

/// Adds the tiles that the next revision keeps, and labels the whole map.
fn label(
    assembly: Assembly,
    kept: Vec<(TileKey, Bytes)>,
    surface: Option<&SurfaceNetwork>,
) -> Result<LabelledMap, MergeError> {
    let read = |(key, bytes): (TileKey, Bytes)| Ok((key, Tile::read(&bytes)?));
    let kept = kept.into_iter().map(read).collect::<Result<_, NotOurs>>()?;
    Ok(assembly.label(kept, surface))
}

/// Returns the next revision with all its files.
fn revision(map: LabelledMap, levels: &[Level]) -> Result<NewRevision, MergeError> {
    let LabelledMap { manifest, tiles, changed, mut looked } = map;
    let mut new = NewRevision { manifest, ..NewRevision::default() };
    new.tiles.extend(changed.iter().map(|key| (*key, tiles.get(key).map(Tile::to_bytes))));
    let mut of_levels: BTreeMap<LevelName, Vec<Tile>> = BTreeMap::new();
    for (key, tile) in tiles {
        of_levels.entry(key.level).or_default().push(tile);
    }
    for Level { file: LevelFile { level, bytes }, last } in levels {
        let tiles = of_levels.remove(level).unwrap_or_default();
        let looked = looked.remove(level).unwrap_or_default();
        let map = LevelMap { level: *level, lidar: &LidarMap::read(bytes)? };
        let Described { scene, plan, has_object_changes } =
            describe(map, &tiles, &new.manifest.clips, &looked, last);
        new.files.extend(plan.map(|(name, bytes)| (*level, name, bytes)));
        new.files.push((*level, map_file::SCENE, serde_json::to_vec(&scene).unwrap_or_default()));
        let Coverage { seen, floor_seen, .. } = scene.coverage;
        new.coverage.push(LevelCoverage { level: *level, seen, floor_seen });
        new.objects.extend(scene.objects);
        new.has_object_changes |= has_object_changes;
    }
    Ok(new)
}
