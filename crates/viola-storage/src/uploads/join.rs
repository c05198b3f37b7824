//! Joining partial uploads into a final one.

use super::{
    NewUpload, Storage, Upload, UploadError, UploadKind, UploadLimits, UploadState, check_counts, find,
    insert, later,
};
use crate::database::{Transaction, query};
use crate::{HomeId, Tenant, homes};
use jiff::Timestamp;
use uuid::Uuid;

/// Partial uploads to be joined, in order.
#[derive(Debug, Clone)]
pub struct Joining {
    pub parts: Vec<Uuid>,
    pub tenant: Tenant,
    pub home: HomeId,
    pub metadata: String,
    /// As the client sent it.
    pub concat: String,
    /// Limit of all parts together.
    pub max_bytes: u64,
}

impl Storage {
    /// Joins partial uploads, all or none, into a final one, which takes over their bytes. The same parts
    /// again return the same final upload, so that a client whose answer was lost can retry.
    pub async fn join_uploads(
        &self,
        joining: &Joining,
        limits: &UploadLimits,
        now: Timestamp,
    ) -> Result<Upload, UploadError> {
        let mut transaction = self.database.begin().await?;
        // Of two equal concurrent requests, the second finds the upload of the first.
        homes::lock(&mut transaction, &joining.home).await?;
        if let Some(earlier) = joined_earlier(&mut transaction, joining, now).await? {
            return Ok(earlier);
        }
        let parts = joining.parts.len() as u64;
        check_counts(&mut transaction, &joining.tenant, Some(&joining.home), parts, limits, now).await?;
        let id = Uuid::now_v7();
        let new = NewUpload {
            kind: UploadKind::Final,
            tenant: joining.tenant.clone(),
            home: Some(joining.home.clone()),
            metadata: joining.metadata.clone(),
            concat: Some(joining.concat.clone()),
            length_bytes: None,
            content_key: None,
            is_stored: false,
        };
        let expires_at = later(now, limits.patience);
        insert(&mut transaction, id, &new, expires_at, now).await?;
        let into = Into { id, tenant: &new.tenant, expires_at };
        let mut length: u64 = 0;
        for part in &joining.parts {
            let bytes = take_over(&mut transaction, *part, &into, length, now).await?;
            length = length.saturating_add(bytes);
            if length > joining.max_bytes {
                return Err(UploadError::TooLarge { limit: joining.max_bytes });
            }
        }
        query(
            "UPDATE uploads SET state = 'arrived', length_bytes = $2, received_bytes = $2,
                pieces = (SELECT COUNT(*) FROM upload_pieces WHERE upload_id = $1)
            WHERE id = $1",
        )
        .bind(id.to_string())
        .bind(length as i64)
        .execute(&mut transaction)
        .await?;
        let upload = find(&mut transaction, id).await?.ok_or(UploadError::NotFound)?;
        transaction.commit().await?;
        Ok(upload)
    }
}

/// Returns the final upload that was made of exactly these parts, if there is one.
async fn joined_earlier(
    transaction: &mut Transaction,
    joining: &Joining,
    now: Timestamp,
) -> Result<Option<Upload>, UploadError> {
    let Some(first) = joining.parts.first() else { return Ok(None) };
    let row = query("SELECT joined_into FROM uploads WHERE id = $1").bind(first.to_string());
    let row = row.fetch_optional(transaction).await?;
    let Some(earlier) = row.map(|row| row.maybe_id("joined_into")).transpose()?.flatten() else {
        return Ok(None);
    };
    let earlier =
        find(transaction, earlier).await?.filter(|upload| upload.is_due() || upload.expires_at > now);
    Ok(earlier.filter(|upload| {
        upload.concat.as_ref() == Some(&joining.concat) && upload.home.as_ref() == Some(&joining.home)
    }))
}

/// The final upload that takes over.
struct Into<'a> {
    id: Uuid,
    tenant: &'a Tenant,
    expires_at: Timestamp,
}

/// Moves the pieces of a partial upload behind the first `at` bytes of a final one; returns their size.
async fn take_over(
    transaction: &mut Transaction,
    part: Uuid,
    into: &Into<'_>,
    at: u64,
    now: Timestamp,
) -> Result<u64, UploadError> {
    let upload = find(transaction, part).await?.filter(|upload| upload.tenant == *into.tenant);
    let upload = upload.ok_or(UploadError::PartNotFound { id: part })?;
    if upload.kind != UploadKind::Partial {
        return Err(UploadError::NotPartial { id: part });
    }
    if upload.is_gone(now) {
        return Err(UploadError::PartGone { id: part });
    }
    if upload.state != UploadState::Arrived {
        return Err(UploadError::PartUnfinished { id: part });
    }
    let taken = query(
        "UPDATE uploads SET state = 'joined', joined_into = $2, expires_at = $3 WHERE id = $1 AND state = 'arrived'",
    )
    .bind(part.to_string())
    .bind(into.id.to_string())
    .bind(into.expires_at.as_millisecond())
    .execute(transaction)
    .await?;
    if taken != 1 {
        return Err(UploadError::PartGone { id: part });
    }
    query("UPDATE upload_pieces SET upload_id = $2, first_byte = first_byte + $3 WHERE upload_id = $1")
        .bind(part.to_string())
        .bind(into.id.to_string())
        .bind(at as i64)
        .execute(transaction)
        .await?;
    Ok(upload.received_bytes)
}
