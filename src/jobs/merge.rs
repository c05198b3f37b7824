//! Makes a home's next map out of its clips.

use super::Queue;
use crate::home::{
    self, AssembleParams, Assembly, MAP_VOXEL_M, Member, NotOurs, Share, read_cloud_ply, read_views,
};
use crate::storage::{MergeClaim, NewRevision, Storage, StorageError, result_file};
use jiff::Timestamp;
use std::sync::Arc;
use std::time::{Duration, Instant};
use tokio::runtime::Handle;
use tracing::{error, info};

/// How long a home whose merge broke is left alone.
const PAUSE: Duration = Duration::from_secs(5);

/// Merges one home; an error gives it back.
pub(super) async fn merge(queue: &Queue, claim: &MergeClaim, lease: Duration) {
    let begun = Instant::now();
    let merged = tokio::select! {
        merged = try_merge(&queue.storage, claim) => merged,
        () = hold(&queue.storage, claim, lease) => Ok(Merged::Lost),
    };
    let seconds = begun.elapsed().as_secs_f64();
    let clips = claim.members.len();
    match merged {
        Ok(Merged::Revision { tiles }) => info!(home = %claim.home, clips, tiles, seconds, "map merged"),
        Ok(Merged::Nothing) => info!(home = %claim.home, clips, seconds, "the map is as it was"),
        Ok(Merged::Lost) => info!(home = %claim.home, "the map is due again"),
        Err(cause) => {
            error!(home = %claim.home, %cause, "a map could not be merged");
            // A clip that went meanwhile is no fault, and waiting would not bring it back.
            let pause = if matches!(cause, MergeError::Gone) { Duration::ZERO } else { PAUSE };
            let given_back = queue.storage.give_back_merge(claim, Timestamp::now() + pause).await;
            if let Err(error) = given_back {
                // Its lease runs out, and it is merged again.
                error!(home = %claim.home, %error, "a merge could not be given back");
            }
        }
    }
}

/// Renews the lease for as long as the home is ours; returns when it is not.
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

/// Why a map could not be merged.
#[derive(Debug, thiserror::Error)]
enum MergeError {
    #[error(transparent)]
    Storage(#[from] StorageError),
    #[error("the merge panicked")]
    Panicked,
    #[error("what is kept of the clip or the map is damaged: {0}")]
    Damaged(#[from] NotOurs),
    #[error("a clip was removed or aligned anew meanwhile")]
    Gone,
}

async fn try_merge(storage: &Arc<Storage>, claim: &MergeClaim) -> Result<Merged, MergeError> {
    let last = storage.last_manifest(claim).await?;
    let assembly = {
        let (storage, members, last) = (storage.clone(), claim.members.clone(), last.clone());
        let runtime = Handle::current();
        blocking(move || {
            let mut load = |member: &Member| runtime.block_on(share(&storage, member));
            home::assemble(&last, members, &mut load, &AssembleParams::default())
        })
        .await?
    };
    if claim.last_revision > 0 && !claim.has_new_lidar_map() && assembly.manifest == last {
        let kept = storage.finish_merge(claim, None, Timestamp::now()).await?;
        return Ok(if kept { Merged::Nothing } else { Merged::Lost });
    }
    let Assembly { manifest, changed } = assembly;
    let tiles = changed.len();
    let new = blocking(move || {
        let tiles = changed.into_iter().map(|(key, tile)| (key, tile.map(|tile| tile.to_bytes()))).collect();
        Ok(NewRevision { manifest, tiles, files: Vec::new(), objects: Vec::new() })
    })
    .await?;
    let kept = storage.finish_merge(claim, Some(&new), Timestamp::now()).await?;
    Ok(if kept { Merged::Revision { tiles } } else { Merged::Lost })
}

/// What a clip brings.
async fn share(storage: &Storage, member: &Member) -> Result<Share, MergeError> {
    let cloud = storage.member_file(member, result_file::CLOUD).await?.ok_or(MergeError::Gone)?;
    let views = storage.member_file(member, result_file::VIEWS).await?.ok_or(MergeError::Gone)?;
    Ok(Share { cloud_in_clip: read_cloud_ply(&cloud, MAP_VOXEL_M)?, views: read_views(&views)? })
}

async fn blocking<T: Send + 'static>(
    work: impl FnOnce() -> Result<T, MergeError> + Send + 'static,
) -> Result<T, MergeError> {
    tokio::task::spawn_blocking(work).await.unwrap_or(Err(MergeError::Panicked))
}
