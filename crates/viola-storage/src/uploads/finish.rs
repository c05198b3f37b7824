//! Conversion of complete uploads into clips, by the client's last request, or by the cleaner if that was cut
//! off. A claim prevents two conversions at once, and only one can win the last transaction.

use super::{Storage, Upload, UploadError, from_row, later, owner, piece_keys};
use crate::clips::{self, Added, NewClip};
use crate::columns::to_json;
use crate::database::{Transaction, query};
use crate::quota::QuotaCheck;
use crate::{Arrived, HomeId, StorageError, Tenant, clock, pending_deletes};
use futures::TryStreamExt;
use jiff::Timestamp;
use std::time::Duration;
use uuid::Uuid;

/// Claim on an upload that this process makes into a clip.
#[derive(Debug)]
pub struct UploadClaim {
    pub upload: Upload,
    pub home: HomeId,
    /// Number of earlier claims that were lost.
    pub lost_attempts: u32,
    fencing_token: i64,
}

impl Storage {
    /// Claims an upload to make a clip of it; returns `None` if another process has it or it is not due.
    pub async fn claim_upload(
        &self,
        id: Uuid,
        lease: Duration,
        now: Timestamp,
    ) -> Result<Option<UploadClaim>, StorageError> {
        let mut transaction = self.database.begin().await?;
        let row = query(
            "UPDATE uploads SET fence = fence + 1, attempts = attempts + 1, lease_until = $3
            WHERE id = $1 AND state = 'arrived' AND kind <> 'partial'
                AND (lease_until IS NULL OR lease_until <= $2 OR lease_until > $4)
            RETURNING *",
        )
        .bind(id.to_string())
        .bind(now.as_millisecond())
        .bind(later(now, lease).as_millisecond())
        .bind(clock::no_lease_after(now))
        .fetch_optional(&mut transaction)
        .await?;
        transaction.commit().await?;
        let Some(row) = row else { return Ok(None) };
        let upload = from_row(&row)?;
        let lost_attempts = row.count::<u32>("attempts")?.saturating_sub(1);
        Ok(Some(UploadClaim {
            upload,
            home: row.home("home_id")?,
            lost_attempts,
            fencing_token: row.number("fence")?,
        }))
    }

    /// Renews the lease of a claim; returns whether it was still held.
    pub async fn renew_upload(
        &self,
        claim: &UploadClaim,
        lease: Duration,
        now: Timestamp,
    ) -> Result<bool, StorageError> {
        let renew =
            query("UPDATE uploads SET lease_until = $3 WHERE id = $1 AND fence = $2 AND state = 'arrived'")
                .bind(claim.upload.id.to_string())
                .bind(claim.fencing_token)
                .bind(later(now, lease).as_millisecond());
        Ok(self.database.execute(renew).await? > 0)
    }

    /// Returns complete uploads that wait to become clips and that no process has claimed: at most `limit` of each tenant,
    /// those first that nobody has tried, or whose last attempt was longest ago.
    pub async fn due_uploads(&self, limit: u32, now: Timestamp) -> Result<Vec<(Tenant, Uuid)>, StorageError> {
        let rows = query(
            "SELECT tenant, id FROM (
                SELECT tenant, id, ROW_NUMBER() OVER (
                    PARTITION BY tenant ORDER BY COALESCE(lease_until, 0), expires_at, id) AS place
                FROM uploads
                WHERE state = 'arrived' AND kind <> 'partial'
                    AND (lease_until IS NULL OR lease_until <= $1 OR lease_until > $3)
            ) AS due
            WHERE place <= $2 ORDER BY place, tenant",
        );
        let rows = rows.bind(now.as_millisecond()).bind(i64::from(limit)).bind(clock::no_lease_after(now));
        let rows = rows.fetch_all(&mut self.database.reader().await?).await?;
        rows.iter().map(|row| Ok((row.tenant("tenant")?, row.id("id")?))).collect()
    }

    /// Assembles the file from its pieces.
    pub async fn assemble_upload(&self, claim: &UploadClaim) -> Result<Arrived, UploadError> {
        let keys = piece_keys(&mut self.database.reader().await?, claim.upload.id).await?;
        let mut file = self.incoming()?;
        for key in &keys {
            let mut piece = self.blobs.read(key).await?.ok_or(UploadError::Lost)?.stream;
            while let Some(bytes) = piece.try_next().await? {
                file.write(&bytes).await?;
            }
        }
        let file = file.finish().await?;
        if file.size_bytes == claim.upload.received_bytes { Ok(file) } else { Err(UploadError::Lost) }
    }

    /// Stores the clip and ends the upload, in one transaction; returns `None` if the claim was lost.
    pub async fn finish_upload(
        &self,
        claim: &UploadClaim,
        new: NewClip,
        record: Duration,
        now: Timestamp,
    ) -> Result<Option<Added>, StorageError> {
        let id = Uuid::now_v7();
        let (file, row) = clips::NewRow::of(id, new);
        self.blobs.keep_or_discard(file, &clips::file_key(id)).await?;
        let ended = self.end_with_clip(claim, row, record, now).await;
        let is_new = |(added, _): &(Option<Added>, _)| matches!(added, Some(Added::New(_)));
        self.discard_unless(&[clips::file_key(id)], &ended, is_new).await;
        let (added, pieces) = ended?;
        self.discard_pending(&owner(claim.upload.id), &pieces).await;
        Ok(added)
    }

    async fn end_with_clip(
        &self,
        claim: &UploadClaim,
        row: clips::NewRow,
        record: Duration,
        now: Timestamp,
    ) -> Result<(Option<Added>, Vec<String>), StorageError> {
        let id = claim.upload.id;
        let mut transaction = self.database.begin().await?;
        let added = clips::insert(&mut transaction, &claim.home, row, QuotaCheck::Counted, now).await?;
        let clip = match &added {
            Added::New(clip) | Added::Replayed(clip) => clip.id,
            // The upload does not end here: the caller refuses it.
            Added::KeyReused => return Ok((Some(added), vec![])),
        };
        let ended = query(
            "UPDATE uploads SET state = 'finished', clip_id = $3, expires_at = $4, lease_until = NULL
            WHERE id = $1 AND fence = $2 AND state = 'arrived'",
        )
        .bind(id.to_string())
        .bind(claim.fencing_token)
        .bind(clip.to_string())
        .bind(later(now, record).as_millisecond());
        if ended.execute(&mut transaction).await? == 0 {
            return Ok((None, vec![]));
        }
        let pieces = take_pieces(&mut transaction, id, now).await?;
        transaction.commit().await?;
        Ok((Some(added), pieces))
    }

    /// Ends an upload that cannot become a clip, with a problem document, and removes its bytes.
    pub async fn refuse_upload(
        &self,
        claim: &UploadClaim,
        problem: &serde_json::Value,
        record: Duration,
        now: Timestamp,
    ) -> Result<(), StorageError> {
        let mut transaction = self.database.begin().await?;
        let ended = query(
            "UPDATE uploads SET state = 'refused', problem = $3, expires_at = $4, lease_until = NULL
            WHERE id = $1 AND fence = $2 AND state = 'arrived'",
        )
        .bind(claim.upload.id.to_string())
        .bind(claim.fencing_token)
        .bind(to_json(problem))
        .bind(later(now, record).as_millisecond());
        if ended.execute(&mut transaction).await? == 0 {
            return Ok(());
        }
        let pieces = take_pieces(&mut transaction, claim.upload.id, now).await?;
        transaction.commit().await?;
        self.discard_pending(&owner(claim.upload.id), &pieces).await;
        Ok(())
    }

    /// Gives a claim back, due again after `pause`: the service failed, and not because of the file.
    pub async fn give_back_upload(
        &self,
        claim: &UploadClaim,
        pause: Duration,
        now: Timestamp,
    ) -> Result<(), StorageError> {
        let give_back = query(
            "UPDATE uploads SET lease_until = $3, attempts = attempts - 1
            WHERE id = $1 AND fence = $2 AND state = 'arrived'",
        )
        .bind(claim.upload.id.to_string())
        .bind(claim.fencing_token)
        .bind(later(now, pause).as_millisecond());
        self.database.execute(give_back).await.map(drop)
    }
}

/// Removes the rows of an upload's pieces, and records their blobs as pending deletes.
async fn take_pieces(
    transaction: &mut Transaction,
    upload: Uuid,
    now: Timestamp,
) -> Result<Vec<String>, StorageError> {
    let keys = piece_keys(transaction, upload).await?;
    pending_deletes::add(transaction, &owner(upload), &keys, now).await?;
    query("DELETE FROM upload_pieces WHERE upload_id = $1")
        .bind(upload.to_string())
        .execute(transaction)
        .await?;
    Ok(keys)
}
