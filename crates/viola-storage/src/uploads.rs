//! Resumable uploads: files that arrive in parts, over several connections, processes and restarts.
//!
//! The acknowledged bytes are a list of pieces, each a blob that never changes. An append writes a new blob,
//! then adds it to the list in a transaction, if the list still ends at the writer's offset and no newer
//! writer has begun. So nothing is locked while bytes arrive, nothing is ever truncated, and any process can
//! serve any request.

mod append;
mod begun;
mod delete;
mod expire;
mod finish;
mod join;

pub use append::UploadWriter;
pub use finish::UploadClaim;
pub use join::Joining;

use super::database::{Connection, Row, Transaction, query};
use super::quota::{self, QuotaCheck};
use super::{HomeId, Storage, StorageError, Tenant, homes};
use jiff::{SignedDuration, Timestamp};
use serde::{Deserialize, Serialize};
use std::time::Duration;
use uuid::Uuid;

/// Kind of an upload.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum UploadKind {
    /// One file.
    Whole,
    /// A part of a file; a final upload joins it with others.
    Partial,
    /// Joined from partial ones.
    Final,
}

/// State of an upload.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum UploadState {
    /// Bytes are missing.
    Arriving,
    /// Every byte has arrived and is durable.
    Arrived,
    /// A final upload took it over.
    Joined,
    /// It became a clip.
    Finished,
    /// It cannot become a clip; its bytes are gone.
    Refused,
}

impl UploadKind {
    fn name(self) -> &'static str {
        match self {
            UploadKind::Whole => "whole",
            UploadKind::Partial => "partial",
            UploadKind::Final => "final",
        }
    }
}

/// A file that arrives in parts.
#[derive(Debug, Clone, PartialEq)]
pub struct Upload {
    pub id: Uuid,
    pub kind: UploadKind,
    pub state: UploadState,
    pub tenant: Tenant,
    /// `None` for partial uploads, whose home is that of the final one.
    pub home: Option<HomeId>,
    /// Metadata from the client, as sent.
    pub metadata: String,
    /// `Upload-Concat` from the client, as sent.
    pub concat: Option<String>,
    /// `None` until the client knows it.
    pub length_bytes: Option<u64>,
    /// Bytes from the start that are durable.
    pub received_bytes: u64,
    pub clip: Option<Uuid>,
    /// Problem document of the refusal.
    pub problem: Option<serde_json::Value>,
    pub created_at: Timestamp,
    pub expires_at: Timestamp,
}

impl Upload {
    /// Returns whether the upload is complete and waits to become a clip.
    pub fn is_due(&self) -> bool {
        self.state == UploadState::Arrived && self.kind != UploadKind::Partial
    }

    /// Returns whether it can no longer be continued or used. A complete file is kept until it is a clip.
    fn is_gone(&self, now: Timestamp) -> bool {
        let ended = matches!(self.state, UploadState::Joined | UploadState::Refused);
        ended || (!self.is_due() && self.expires_at <= now)
    }
}

/// An upload to create.
#[derive(Debug, Clone)]
pub struct NewUpload {
    /// [`UploadKind::Whole`] or [`UploadKind::Partial`].
    pub kind: UploadKind,
    pub tenant: Tenant,
    pub home: Option<HomeId>,
    pub metadata: String,
    pub concat: Option<String>,
    pub length_bytes: Option<u64>,
    /// Names the bytes of the file, if its sender knows their SHA-256: equal requests with it have one upload.
    pub content_key: Option<String>,
    /// The home has a clip of this key, at least as large: the upload repeats it, and needs no room.
    pub is_stored: bool,
}

/// Limits of uploads.
#[derive(Debug, Clone)]
pub struct UploadLimits {
    /// Unfinished uploads of one home ...
    pub in_home: u64,
    /// ... and of one tenant, if it has no limit of its own.
    pub in_tenant: u64,
    /// Most pieces of one upload, so that a file cannot come byte by byte.
    pub pieces: u64,
    /// Time after which an idle unfinished upload expires.
    pub patience: Duration,
    /// Time that the record of a finished or refused upload is kept.
    pub record: Duration,
}

impl Default for UploadLimits {
    fn default() -> UploadLimits {
        let day = Duration::from_secs(24 * 60 * 60);
        UploadLimits { in_home: 64, in_tenant: 1024, pieces: 10_000, patience: day, record: 7 * day }
    }
}

/// Reason why an upload cannot be begun, continued or joined.
#[derive(Debug, thiserror::Error)]
pub enum UploadError {
    #[error(transparent)]
    Storage(#[from] StorageError),
    #[error("no upload has this id; begin a new one by POST to /v1/uploads")]
    NotFound,
    #[error(
        "the upload expired, was joined into another one, or was refused; GET it: its `state` and `problem` tell whether to begin a new one"
    )]
    Gone,
    #[error("the upload has {received} bytes; resume there")]
    WrongOffset { received: u64 },
    #[error("another request has gone on with this upload meanwhile; ask for its offset and resume there")]
    Overtaken,
    #[error("the length of the upload was told before, and is another one")]
    LengthTold,
    #[error("the upload has {received} bytes already, more than this length")]
    LengthTooSmall { received: u64 },
    #[error("a final upload is joined of partial ones and takes no bytes of its own")]
    Final,
    #[error("{limit} uploads are unfinished {place}; finish or delete some, or wait until they expire")]
    TooMany { limit: u64, place: &'static str },
    #[error("the upload came in {limit} pieces, which is the limit; begin a new one and send more at a time")]
    TooManyPieces { limit: u64 },
    #[error("{id} is not a partial upload")]
    NotPartial { id: Uuid },
    #[error("partial upload {id} is not there")]
    PartNotFound { id: Uuid },
    #[error("partial upload {id} has expired, or was joined already; each goes into one final upload, once")]
    PartGone { id: Uuid },
    #[error("bytes of partial upload {id} are missing; finish it first")]
    PartUnfinished { id: Uuid },
    #[error("together the parts are larger than the limit of {limit} bytes")]
    TooLarge { limit: u64 },
    #[error("bytes of the upload were lost; send the file again")]
    Lost,
}

impl From<sqlx::Error> for UploadError {
    fn from(error: sqlx::Error) -> UploadError {
        UploadError::Storage(error.into())
    }
}

fn from_row(row: &Row) -> Result<Upload, StorageError> {
    Ok(Upload {
        id: row.id("id")?,
        kind: row.name("kind")?,
        state: row.name("state")?,
        tenant: row.tenant("tenant")?,
        home: row.maybe_home("home_id")?,
        metadata: row.text("metadata")?,
        concat: row.maybe_text("concat")?,
        length_bytes: row.maybe_count("length_bytes")?,
        received_bytes: row.count("received_bytes")?,
        clip: row.maybe_id("clip_id")?,
        problem: row.maybe_json("problem")?,
        created_at: row.time("created_at")?,
        expires_at: row.time("expires_at")?,
    })
}

async fn find(connection: &mut Connection, id: Uuid) -> Result<Option<Upload>, StorageError> {
    let row = query("SELECT * FROM uploads WHERE id = $1").bind(id.to_string());
    row.fetch_optional(connection).await?.as_ref().map(from_row).transpose()
}

/// Returns an upload that can still be continued or used.
async fn find_living(connection: &mut Connection, id: Uuid, now: Timestamp) -> Result<Upload, UploadError> {
    let upload = find(connection, id).await?.ok_or(UploadError::NotFound)?;
    if upload.is_gone(now) { Err(UploadError::Gone) } else { Ok(upload) }
}

/// Returns `now + wait`, at most the latest possible time.
fn later(now: Timestamp, wait: Duration) -> Timestamp {
    let wait = SignedDuration::try_from(wait).unwrap_or(SignedDuration::MAX);
    now.checked_add(wait).unwrap_or(Timestamp::MAX)
}

impl Storage {
    /// Begins an upload. Concurrent requests may exceed the limits on the number of uploads. `max_bytes` limits the files of
    /// a tenant without a limit of its own; `None` means unlimited.
    pub async fn create_upload(
        &self,
        new: NewUpload,
        limits: &UploadLimits,
        max_bytes: Option<u64>,
        now: Timestamp,
    ) -> Result<Upload, UploadError> {
        let mut transaction = self.database.begin().await?;
        check_counts(&mut transaction, &new.tenant, new.home.as_ref(), 0, limits, now).await?;
        let announced_bytes = new.length_bytes.unwrap_or(0);
        let quota = if new.is_stored { QuotaCheck::Counted } else { QuotaCheck::Enforce { max_bytes } };
        quota::check(&mut transaction, new.tenant.name(), announced_bytes, quota).await?;
        let id = Uuid::now_v7();
        insert(&mut transaction, id, &new, later(now, limits.patience), now).await?;
        let upload = find(&mut transaction, id).await?.ok_or(UploadError::NotFound)?;
        transaction.commit().await?;
        Ok(upload)
    }

    /// Returns an upload, even a refused or joined one; `None` if its record has expired.
    pub async fn upload(&self, id: Uuid, now: Timestamp) -> Result<Option<Upload>, StorageError> {
        let upload = find(&mut self.database.reader().await?, id).await?;
        Ok(upload.filter(|upload| upload.is_due() || upload.expires_at > now))
    }

    /// Returns the tenant of an upload and its home, if it has one; `None` if there is no such upload.
    pub async fn upload_owner(&self, id: Uuid) -> Result<Option<(Tenant, Option<HomeId>)>, StorageError> {
        let row = query("SELECT tenant, home_id FROM uploads WHERE id = $1").bind(id.to_string());
        let row = row.fetch_optional(&mut self.database.reader().await?).await?;
        row.map(|row| Ok((row.tenant("tenant")?, row.maybe_home("home_id")?))).transpose()
    }

    /// Returns an upload that can still be continued or used.
    pub async fn living_upload(&self, id: Uuid, now: Timestamp) -> Result<Upload, UploadError> {
        find_living(&mut self.database.reader().await?, id, now).await
    }
}

/// Refuses a new upload beyond the limits. It takes the place of `joined` parts of the tenant.
async fn check_counts(
    transaction: &mut Transaction,
    tenant: &Tenant,
    home: Option<&HomeId>,
    joined: u64,
    limits: &UploadLimits,
    now: Timestamp,
) -> Result<(), UploadError> {
    // Expired ones are removed later.
    let of_tenant = query(
        "SELECT COUNT(*) AS uploads, (SELECT max_uploads FROM tenant_limits WHERE tenant = $1) AS own FROM uploads
        WHERE tenant = $1 AND (state = 'arrived' OR (state = 'arriving' AND expires_at > $2))",
    );
    let of_tenant = of_tenant.bind(tenant.name()).bind(now.as_millisecond()).fetch_one(transaction).await?;
    let limit = of_tenant.maybe_count("own")?.unwrap_or(limits.in_tenant);
    if of_tenant.count::<u64>("uploads")?.saturating_sub(joined) >= limit {
        return Err(UploadError::TooMany { limit, place: "of this tenant" });
    }
    let Some(home) = home else { return Ok(()) };
    homes::lock_existing(transaction, home).await?;
    let of_home = query(
        "SELECT COUNT(*) AS uploads FROM uploads WHERE home_id = $1
        AND (state = 'arrived' OR (state = 'arriving' AND expires_at > $2))",
    );
    let of_home = of_home.bind(home.key()).bind(now.as_millisecond());
    let in_home: u64 = of_home.fetch_one(transaction).await?.count("uploads")?;
    if in_home >= limits.in_home {
        return Err(UploadError::TooMany { limit: limits.in_home, place: "in this home" });
    }
    Ok(())
}

async fn insert(
    transaction: &mut Transaction,
    id: Uuid,
    new: &NewUpload,
    expires_at: Timestamp,
    now: Timestamp,
) -> Result<(), StorageError> {
    query(
        "INSERT INTO uploads (id, home_id, kind, state, metadata, concat, length_bytes, received_bytes, pieces, fence,
            attempts, created_at, expires_at, tenant, content_key)
        VALUES ($1, $2, $3, 'arriving', $4, $5, $6, 0, 0, 0, 0, $7, $8, $9, $10)",
    )
    .bind(id.to_string())
    .bind(new.home.as_ref().map(HomeId::key))
    .bind(new.kind.name())
    .bind(&new.metadata)
    .bind(&new.concat)
    .bind(new.length_bytes.map(|length| length as i64))
    .bind(now.as_millisecond())
    .bind(expires_at.as_millisecond())
    .bind(new.tenant.name())
    .bind(&new.content_key)
    .execute(transaction)
    .await?;
    Ok(())
}

/// Returns the name under which the pending deletes of an upload are recorded.
fn owner(id: Uuid) -> String {
    format!("upload:{id}")
}

async fn piece_keys(connection: &mut Connection, upload: Uuid) -> Result<Vec<String>, StorageError> {
    let rows = query("SELECT blob_key FROM upload_pieces WHERE upload_id = $1 ORDER BY first_byte");
    let rows = rows.bind(upload.to_string()).fetch_all(connection).await?;
    rows.iter().map(|row| row.text("blob_key")).collect()
}

/// Selects the uploads whose column `$of` has a value, and their pieces.
macro_rules! uploads_of {
    ($of:literal) => {
        [
            concat!("SELECT id FROM uploads WHERE ", $of, " = $1 ORDER BY id FOR UPDATE"),
            concat!(
                "SELECT blob_key FROM upload_pieces
                WHERE upload_id IN (SELECT id FROM uploads WHERE ",
                $of,
                " = $1)"
            ),
        ]
    };
}

/// Returns the pieces of a tenant's uploads, and locks these: no piece is added until the transaction ends.
pub(super) async fn blob_keys_of_tenant(
    connection: &mut Connection,
    tenant: &Tenant,
) -> Result<Vec<String>, StorageError> {
    lock_pieces(connection, uploads_of!("tenant"), tenant.name()).await
}

/// Returns the pieces of the uploads to a home, and locks these: no piece is added until the transaction ends.
pub(super) async fn blob_keys_of_home(
    connection: &mut Connection,
    home: &HomeId,
) -> Result<Vec<String>, StorageError> {
    lock_pieces(connection, uploads_of!("home_id"), home.key()).await
}

async fn lock_pieces(
    connection: &mut Connection,
    [lock, pieces]: [&'static str; 2],
    of: &str,
) -> Result<Vec<String>, StorageError> {
    query(lock).bind(of).fetch_all(connection).await?;
    let rows = query(pieces).bind(of).fetch_all(connection).await?;
    rows.iter().map(|row| row.text("blob_key")).collect()
}
