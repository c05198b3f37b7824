//! Merges the clips of a home into its map.

use super::Queue;
use crate::home::{HomeMapInfo, MAP_VOXEL_M, MapMerge, cloud_ply, read_cloud_ply};
use crate::storage::{MergeClaim, StorageError};
use jiff::Timestamp;
use std::time::{Duration, Instant};
use tracing::{error, info};

/// How long a home whose merge broke is left alone.
const PAUSE: Duration = Duration::from_secs(5);

/// Merges one home; an error gives it back.
pub(super) async fn merge(queue: &Queue, claim: &MergeClaim) {
    let begun = Instant::now();
    match try_merge(queue, claim).await {
        Ok(true) => {
            info!(home = %claim.home, clips = claim.clips(), seconds = begun.elapsed().as_secs_f64(), "map merged");
        }
        Ok(false) => info!(home = %claim.home, "the map is due again"),
        Err(cause) => {
            error!(home = %claim.home, %cause, "a map could not be merged");
            let given_back = queue.storage.give_back_merge(claim, Timestamp::now() + PAUSE).await;
            if let Err(error) = given_back {
                // Its lease runs out, and it is merged again.
                error!(home = %claim.home, %error, "a merge could not be given back");
            }
        }
    }
}

/// Why a map could not be merged.
#[derive(Debug, thiserror::Error)]
enum MergeError {
    #[error(transparent)]
    Storage(#[from] StorageError),
    #[error("the merge panicked")]
    Panicked,
    #[error("the cloud of a clip is damaged")]
    Damaged,
}

/// False when the set of clips changed meanwhile, or the claim was lost.
async fn try_merge(queue: &Queue, claim: &MergeClaim) -> Result<bool, MergeError> {
    let mut merge = MapMerge::default();
    for place in 0..claim.clips() {
        let Some(bytes) = queue.storage.merge_cloud(claim, place).await? else {
            queue.storage.give_back_merge(claim, Timestamp::now()).await?;
            return Ok(false);
        };
        merge = blocking(move || {
            let cloud = read_cloud_ply(&bytes, MAP_VOXEL_M).map_err(|_| MergeError::Damaged)?;
            merge.add(&cloud);
            Ok(merge)
        })
        .await?;
    }
    let (info, ply) = blocking(move || {
        let cloud = merge.cloud_in_map();
        Ok((HomeMapInfo::of(&cloud), cloud_ply(&cloud, Some(&crate::geometry::Pose2::IDENTITY))))
    })
    .await?;
    Ok(queue.storage.finish_merge(claim, &info, ply, Timestamp::now()).await?)
}

async fn blocking<T: Send + 'static>(
    work: impl FnOnce() -> Result<T, MergeError> + Send + 'static,
) -> Result<T, MergeError> {
    tokio::task::spawn_blocking(work).await.unwrap_or(Err(MergeError::Panicked))
}
