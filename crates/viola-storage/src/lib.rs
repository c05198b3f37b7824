//! Records and blobs: the only place that knows SQL and object stores.
//!
//! Records live in a database, files in a blob store. A row refers to a blob by its key, and a blob never
//! changes. The order is always: the blob is durable, the row is committed, the call returns. A blob without
//! a row is therefore a leftover of an interrupted write, and [`Storage::sweep`] removes it.
//!
//! Time is an argument everywhere, so that tests need no clock.

mod blobs;
mod changes;
mod choice;
mod choices;
mod clip_list;
mod clip_state;
mod clips;
mod clock;
mod columns;
#[cfg(test)]
mod conformance;
mod copies;
mod corrections;
mod damage;
mod database;
mod error;
mod folder_lock;
mod home_maps;
mod homes;
mod idempotency;
mod incoming;
mod job_list;
mod jobs;
mod keys;
mod leases;
mod lidar_maps;
mod open;
mod params;
mod pending_deletes;
mod placement;
mod quota;
pub mod result_file;
mod scratch;
mod seal;
mod sessions;
mod signals;
mod start;
mod store_identity;
mod sweep;
mod tenants;
pub mod tls;
mod uploads;
mod webhooks;

pub use blobs::{BlobParts, BlobPlace, BlobReader, LocalFile, S3Params};
pub use changes::{Change, ChangeKind, Changes, ChangesCursor, FeedPosition};
pub use choice::Choice;
pub use choices::{ChoiceError, Chosen};
pub use clip_list::ClipFilter;
pub use clip_state::ClipState;
pub use clips::{Added, Clip, ClipEdit, LastAnswer, NewClip};
pub use corrections::{
    CorrectionError, CorrectionState, Corrections, Kept, MAX_CORRECTIONS, ObjectChange, RoomChange,
};
pub use database::{Connections, POSTGRES_CONNECTIONS, check_database_url};
pub use error::StorageError;
pub use folder_lock::FolderLock;
pub use home_maps::{
    HomeMap, HomeObject, KEPT_REVISIONS, LeftOut, LevelSurface, MESH_POINTS, MapClip, MapFile, MapHistory,
    MapLevel, MapObject, MapRoom, MapScene, MapState, MergeClaim, NewRevision, ObjectFilter, map_file,
};
pub use homes::{Home, HomeFilter, HomeId, InvalidHomeId, InvalidTenant, LevelCoverage, Tenant};
pub use incoming::{Arrived, Incoming};
pub use jobs::{Job, JobState, QueueState};
pub use keys::{ApiKey, NewKey, Role, Secret};
pub use leases::{AttemptEnd, Claim, Fault, JobProgress, RetryPolicy};
pub use lidar_maps::{FromEarlier, LidarMapRevision, NewLidarMap};
pub use open::Storage;
pub use params::{Page, PostgresParams, StorageParams, UnpackParams};
pub use placement::{Placement, reasons_of_placement, state_by_others};
pub use seal::{InvalidSecretsKey, SecretsKey};
pub use sessions::{SESSION_LIFE, SessionToken};
pub use signals::{Signal, Signals};
pub use sweep::SweepLimit;
pub use tenants::{Removed, TenantLimits};
pub use uploads::{
    Joining, NewUpload, Upload, UploadClaim, UploadError, UploadKind, UploadLimits, UploadState, UploadWriter,
};
pub use webhooks::{
    Delivery, DeliveryState, MAX_WEBHOOKS, RETRY_AFTER, Sending, Sent, ToSend, Webhook, WebhookMade,
    WebhookSecret,
};
