//! Appending the bytes of one request to an upload.

use super::{Storage, UploadError, UploadKind, UploadLimits, UploadState, find_living, later};
use crate::Tenant;
use crate::database::query;
use crate::incoming::Arrived;
use jiff::Timestamp;
use uuid::Uuid;

/// The right to append to an upload, until another request takes it.
#[derive(Debug)]
pub struct UploadWriter {
    id: Uuid,
    fencing_token: i64,
    offset: u64,
    pub tenant: Tenant,
    /// `None` until the client knows it.
    pub length_bytes: Option<u64>,
}

impl UploadWriter {
    /// Returns the number of bytes from the start that are durable.
    pub fn offset(&self) -> u64 {
        self.offset
    }
}

impl Storage {
    /// Takes the right to append at `offset`, and sets the upload's length if it was unknown. The previous
    /// holder loses the right: a client that resumes must not wait until the server notices that the old
    /// connection is dead.
    pub async fn begin_append(
        &self,
        id: Uuid,
        offset: u64,
        length_bytes: Option<u64>,
        limits: &UploadLimits,
        now: Timestamp,
    ) -> Result<UploadWriter, UploadError> {
        let mut transaction = self.database.begin().await?;
        let upload = find_living(&mut transaction, id, now).await?;
        let received = upload.received_bytes;
        if upload.kind == UploadKind::Final {
            return Err(UploadError::Final);
        }
        if received != offset {
            return Err(UploadError::WrongOffset { received });
        }
        match (upload.length_bytes, length_bytes) {
            (Some(known), Some(told)) if known != told => return Err(UploadError::LengthTold),
            (None, Some(told)) if told < received => return Err(UploadError::LengthTooSmall { received }),
            _ => {}
        }
        let length_bytes = upload.length_bytes.or(length_bytes);
        if upload.state != UploadState::Arriving {
            // No bytes are missing, and a claim on the upload stays valid.
            return Ok(UploadWriter { id, fencing_token: -1, offset, tenant: upload.tenant, length_bytes });
        }
        let taken = query(
            "UPDATE uploads SET fence = fence + 1, length_bytes = $3, expires_at = $4,
                state = CASE WHEN received_bytes = $3 THEN 'arrived' ELSE 'arriving' END
            WHERE id = $1 AND received_bytes = $2 AND length_bytes IS NOT DISTINCT FROM $5 AND state = 'arriving'
            RETURNING fence",
        )
        .bind(id.to_string())
        .bind(offset as i64)
        .bind(length_bytes.map(|length| length as i64))
        .bind(later(now, limits.patience).as_millisecond())
        .bind(upload.length_bytes.map(|length| length as i64))
        .fetch_optional(&mut transaction)
        .await?;
        let fencing_token = taken.ok_or(UploadError::Overtaken)?.number("fence")?;
        transaction.commit().await?;
        Ok(UploadWriter { id, fencing_token, offset, tenant: upload.tenant, length_bytes })
    }

    /// Adds bytes at the writer's offset; on return they are durable. Nothing changes if another writer has
    /// begun since.
    pub async fn append(
        &self,
        writer: &mut UploadWriter,
        bytes: Arrived,
        limits: &UploadLimits,
        now: Timestamp,
    ) -> Result<(), UploadError> {
        let size_bytes = bytes.size_bytes;
        let key = format!("uploads/{}-{}", writer.id, Uuid::now_v7());
        self.blobs.keep_or_discard(bytes, &key).await?;
        let added = self.add_piece(writer, size_bytes, &key, limits, now).await;
        match &added {
            Ok(()) => writer.offset += size_bytes,
            // The row may exist nevertheless; a sweep decides.
            Err(UploadError::Storage(error)) if error.is_unsettled() => {}
            Err(_) => self.blobs.discard(&[key]).await,
        }
        added
    }

    async fn add_piece(
        &self,
        writer: &UploadWriter,
        size_bytes: u64,
        key: &str,
        limits: &UploadLimits,
        now: Timestamp,
    ) -> Result<(), UploadError> {
        let mut transaction = self.database.begin().await?;
        let grown = query(
            "UPDATE uploads SET received_bytes = received_bytes + $4, pieces = pieces + 1, expires_at = $5,
                state = CASE WHEN received_bytes + $4 = length_bytes THEN 'arrived' ELSE 'arriving' END
            WHERE id = $1 AND fence = $2 AND received_bytes = $3 AND state = 'arriving'
            RETURNING pieces",
        )
        .bind(writer.id.to_string())
        .bind(writer.fencing_token)
        .bind(writer.offset as i64)
        .bind(size_bytes as i64)
        .bind(later(now, limits.patience).as_millisecond())
        .fetch_optional(&mut transaction)
        .await?;
        let Some(grown) = grown else {
            find_living(&mut transaction, writer.id, now).await?;
            return Err(UploadError::Overtaken);
        };
        if grown.number("pieces")? > limits.pieces as i64 {
            return Err(UploadError::TooManyPieces { limit: limits.pieces });
        }
        query(
            "INSERT INTO upload_pieces (upload_id, first_byte, size_bytes, blob_key) VALUES ($1, $2, $3, $4)",
        )
        .bind(writer.id.to_string())
        .bind(writer.offset as i64)
        .bind(size_bytes as i64)
        .bind(key)
        .execute(&mut transaction)
        .await?;
        transaction.commit().await?;
        Ok(())
    }
}
