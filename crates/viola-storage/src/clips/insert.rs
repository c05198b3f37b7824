//! New clips.

use super::{Added, NewClip, find};
use crate::changes::{self, Changed};
use crate::columns::to_json;
use crate::database::{Connection, Transaction, query};
use crate::incoming::Arrived;
use crate::jobs::{self, Priority};
use crate::quota::{self, QuotaCheck};
use crate::{ClipState, HomeId, StorageError, homes, idempotency, lidar_maps};
use jiff::Timestamp;
use uuid::Uuid;
use viola_formats::clip::ClipInfo;
use viola_reconstruct::Reason;

pub(crate) struct NewRow {
    id: Uuid,
    size_bytes: u64,
    sha256: String,
    content_sha256: Option<String>,
    info: ClipInfo,
    idempotency_key: Option<String>,
    recorded_at: Option<Timestamp>,
    title: Option<String>,
    file_name: Option<String>,
}

impl NewRow {
    /// Splits a new clip into its file and its row.
    pub fn of(id: Uuid, new: NewClip) -> (Arrived, NewRow) {
        let row = NewRow {
            id,
            size_bytes: new.file.size_bytes,
            sha256: new.file.sha256.clone(),
            content_sha256: new.content_sha256,
            info: new.info,
            idempotency_key: new.idempotency_key,
            recorded_at: new.recorded_at,
            title: new.title,
            file_name: new.file_name,
        };
        (new.file, row)
    }
}

/// Inserts the row of a stored file, and its job if the home has a LiDAR map; neither if its key was used.
pub(crate) async fn insert(
    transaction: &mut Transaction,
    home: &HomeId,
    new: NewRow,
    quota: QuotaCheck,
    now: Timestamp,
) -> Result<Added, StorageError> {
    homes::lock_existing(transaction, home).await?;
    if let Some(key) = &new.idempotency_key
        && let Some(used) = idempotency::find(transaction, home, key).await?
    {
        let content = new.content_sha256.as_deref();
        return if used.sha256 == new.sha256 || has_content(transaction, used.clip, content).await? {
            Ok(Added::Replayed(find(transaction, home, used.clip).await?))
        } else {
            Ok(Added::KeyReused)
        };
    }
    quota::check(transaction, home.tenant(), new.size_bytes, quota).await?;
    let reasons = [no_lidar_map()];
    query(
        "INSERT INTO clips (id, home_id, size_bytes, sha256, info, state, reasons, recorded_at, created_at,
            updated_at, title, file_name, content_sha256)
        VALUES ($1, $2, $3, $4, $5, $6, $7, $8, $9, $9, $10, $11, $12)",
    )
    .bind(new.id.to_string())
    .bind(home.key())
    .bind(new.size_bytes as i64)
    .bind(&new.sha256)
    .bind(to_json(&new.info))
    .bind(ClipState::Uploaded.name())
    .bind(to_json(&reasons))
    .bind(new.recorded_at.map(Timestamp::as_millisecond))
    .bind(now.as_millisecond())
    .bind(&new.title)
    .bind(&new.file_name)
    .bind(&new.content_sha256)
    .execute(transaction)
    .await?;
    homes::grow(transaction, home, new.size_bytes as i64).await?;
    if let Some(key) = &new.idempotency_key {
        idempotency::insert(transaction, home, key, &new.sha256, new.id, now).await?;
    }
    match lidar_maps::newest(transaction, home).await? {
        Some(map) => {
            jobs::enqueue(transaction, home, new.id, map.id(), Priority::Uploaded, now).await?;
        }
        None => {
            let added = Changed::Clip { id: new.id, state: ClipState::Uploaded };
            changes::record(transaction, home, added, now).await?;
        }
    }
    let clip = find(transaction, home, new.id).await?;
    Ok(Added::New(clip))
}

/// Returns whether the recording of a clip is an archive with this content, whatever its bytes. Not of a failed clip: its archive
/// may be damaged where the sums do not tell, and the other one whole.
async fn has_content(
    connection: &mut Connection,
    clip: Uuid,
    content_sha256: Option<&str>,
) -> Result<bool, StorageError> {
    let Some(content_sha256) = content_sha256 else { return Ok(false) };
    let row = query("SELECT content_sha256 FROM clips WHERE id = $1 AND state <> 'failed'")
        .bind(clip.to_string())
        .fetch_optional(connection)
        .await?;
    let known = row.map(|row| row.maybe_text("content_sha256")).transpose()?.flatten();
    Ok(known.as_deref() == Some(content_sha256))
}

fn no_lidar_map() -> Reason {
    Reason::new("no_lidar_map", "the home has no LiDAR map yet; the clip is queued when one is put")
}
