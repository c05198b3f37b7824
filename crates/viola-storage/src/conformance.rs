//! Tests that every pair of database and blob store must pass, as functions over [`Storage`]. Another pair
//! needs one module in [`on_every_back_end`].

mod changes;
mod choices;
mod clock;
mod corrections;
mod damage;
mod deletions;
mod fairness;
mod faults;
mod full_disk;
mod home_maps;
mod kept_revisions;
mod keys;
mod last_answers;
mod leases;
mod levels;
mod limits;
mod lists;
mod local_files;
mod lost_database;
mod merge_faults;
mod merge_waits;
mod meshes;
mod plans;
mod records;
mod seal;
mod sessions;
mod tenants;
mod upgrade;
mod uploads;
mod webhooks;

use super::*;
use futures::TryStreamExt;
use jiff::Timestamp;
use sqlx::AssertSqlSafe;
use std::path::Path;
use std::time::Duration;
use uuid::Uuid;
use viola_align::{Alignment, AlignmentState};
use viola_formats::clip::ClipInfo;
use viola_formats::lidar::LidarInfo;
use viola_geometry::LevelName;
use viola_geometry::progress::Stage;
use viola_reconstruct::Reason;
use viola_testing::postgres::Schema;
use viola_testing::s3_server::{ACCESS_KEY_ID, BUCKET, PREFIX, REGION, S3Server, SECRET_ACCESS_KEY};

const LEASE: Duration = Duration::from_secs(30);

macro_rules! on_every_back_end {
    ($($case:ident),* $(,)?) => {
        mod sqlite_and_local_files {
            $(
                #[tokio::test]
                async fn $case() {
                    let folder = tempfile::tempdir().unwrap();
                    super::$case(crate::conformance::in_folder(folder.path()).await).await;
                }
            )*
        }

        mod postgres_and_local_files {
            $(
                #[tokio::test]
                async fn $case() {
                    let Some(postgres) = viola_testing::postgres::Schema::new().await else { return };
                    let folder = tempfile::tempdir().unwrap();
                    let storage = crate::conformance::on(&postgres, folder.path(), None).await;
                    super::$case(storage).await;
                    postgres.remove().await;
                }
            )*
        }

        mod postgres_and_s3 {
            $(
                #[tokio::test]
                async fn $case() {
                    let Some(postgres) = viola_testing::postgres::Schema::new().await else { return };
                    let folder = tempfile::tempdir().unwrap();
                    let s3 = viola_testing::s3_server::S3Server::start();
                    let place = Some(crate::conformance::bucket(&s3));
                    let storage = crate::conformance::on(&postgres, folder.path(), place).await;
                    super::$case(storage).await;
                    postgres.remove().await;
                }
            )*
        }
    };
}
use on_every_back_end;

/// Opens storage on PostgreSQL with files or a bucket.
async fn on(postgres: &Schema, folder: &Path, s3: Option<S3Params>) -> Storage {
    let postgres = Some(PostgresParams { url: postgres.url(), connections: 8 });
    let data = folder.to_owned();
    Storage::open(&StorageParams { data, postgres, s3, ..StorageParams::default() }).await.unwrap()
}

/// Returns the bucket of a test's S3 endpoint.
pub(crate) fn bucket(server: &S3Server) -> S3Params {
    S3Params {
        bucket: BUCKET.to_owned(),
        prefix: PREFIX.to_owned(),
        endpoint: Some(server.endpoint()),
        region: REGION.to_owned(),
        access_key_id: ACCESS_KEY_ID.to_owned(),
        secret_access_key: SECRET_ACCESS_KEY.to_owned(),
        allow_http: true,
        path_style: true,
    }
}

/// Opens storage on SQLite and files, in one folder.
async fn in_folder(folder: &Path) -> Storage {
    Storage::open(&StorageParams::in_folder(folder)).await.unwrap()
}

/// Returns the time this many seconds after an arbitrary one.
fn at(seconds: i64) -> Timestamp {
    Timestamp::from_second(1_800_000_000 + seconds).unwrap()
}

fn home(id: &str) -> HomeId {
    id.parse().unwrap()
}

/// Runs a statement with one value, as a process of another version or a person would.
async fn execute(storage: &Storage, statement: &'static str, value: &str) {
    storage.database.execute(database::query(statement).bind(value)).await.unwrap();
}

async fn arrived(storage: &Storage, bytes: &[u8]) -> Arrived {
    let mut incoming = storage.incoming().unwrap();
    for piece in bytes.chunks(3) {
        incoming.write(piece).await.unwrap();
    }
    incoming.finish().await.unwrap()
}

/// Returns the number of rows of a table that meet a condition, which may have one value.
async fn count(storage: &Storage, table: &str, condition: &str, value: Option<&str>) -> i64 {
    let rows = AssertSqlSafe(format!("SELECT COUNT(*) AS n FROM {table} WHERE {condition}"));
    let rows = value.into_iter().fold(database::query(rows), database::Query::bind);
    let row = rows.fetch_one(&mut storage.database.reader().await.unwrap()).await.unwrap();
    row.number("n").unwrap()
}

/// Ends an attempt at a job with the default policy of retries; returns whether the claim was held.
async fn end_attempt(storage: &Storage, claim: &Claim, ending: AttemptEnd, seconds: i64) -> bool {
    storage.finish(claim, &ending, &RetryPolicy::default(), at(seconds)).await.unwrap()
}

fn new_clip(file: Arrived) -> NewClip {
    NewClip {
        file,
        info: clip_info(),
        content_sha256: None,
        idempotency_key: None,
        recorded_at: None,
        title: None,
        file_name: None,
    }
}

fn new_lidar_map(level: LevelName, file: Arrived) -> NewLidarMap {
    let (info, image_png) = (lidar_info(), b"picture".to_vec());
    NewLidarMap { level, file, file_name: None, info, from_earlier: None, image_png }
}

fn new_upload(kind: UploadKind, tenant: &Tenant, length_bytes: Option<u64>) -> NewUpload {
    NewUpload {
        kind,
        tenant: tenant.clone(),
        home: None,
        metadata: String::new(),
        concat: None,
        length_bytes,
        content_key: None,
        is_stored: false,
    }
}

async fn add_with_key(storage: &Storage, home: &HomeId, bytes: &[u8], key: Option<&str>) -> Added {
    add_content(storage, home, bytes, None, key).await
}

async fn add_content(
    storage: &Storage,
    home: &HomeId,
    bytes: &[u8],
    content: Option<&str>,
    key: Option<&str>,
) -> Added {
    let new = NewClip {
        content_sha256: content.map(str::to_owned),
        idempotency_key: key.map(str::to_owned),
        ..new_clip(arrived(storage, bytes).await)
    };
    storage.add_clip(home, new, None, at(0)).await.unwrap()
}

async fn add(storage: &Storage, home: &HomeId, bytes: &[u8]) -> Clip {
    match add_with_key(storage, home, bytes, None).await {
        Added::New(clip) => clip,
        other => panic!("{other:?}"),
    }
}

async fn put_map(storage: &Storage, home: &HomeId, bytes: &[u8]) -> (LidarMapRevision, bool) {
    put_level(storage, home, LevelName::MAIN, bytes).await.unwrap()
}

async fn put_level(
    storage: &Storage,
    home: &HomeId,
    level: LevelName,
    bytes: &[u8],
) -> Result<(LidarMapRevision, bool), StorageError> {
    put_registered(storage, home, level, bytes, None).await
}

/// Puts a map whose frame is known from the one that it replaces.
async fn put_registered(
    storage: &Storage,
    home: &HomeId,
    level: LevelName,
    bytes: &[u8],
    from_earlier: Option<FromEarlier>,
) -> Result<(LidarMapRevision, bool), StorageError> {
    let new = NewLidarMap { from_earlier, ..new_lidar_map(level, arrived(storage, bytes).await) };
    storage.put_lidar_map(home, new, None, |_| true, at(0)).await
}

/// Creates a home with a map and one queued clip.
async fn one_job(storage: &Storage) -> (HomeId, Clip) {
    let home = home("h");
    storage.put_home(&home, None, |_| true, at(0)).await.unwrap();
    put_map(storage, &home, b"map").await;
    let clip = add(storage, &home, b"clip").await;
    (home, clip)
}

async fn bytes_of(blob: Option<BlobReader>) -> Vec<u8> {
    let blob = blob.expect("the blob is there");
    let size_bytes = blob.size_bytes;
    let bytes: Vec<bytes::Bytes> = blob.stream.try_collect().await.unwrap();
    let bytes = bytes.concat();
    assert_eq!(bytes.len() as u64, size_bytes);
    bytes
}

fn job_progress(stage: Option<Stage>, progress: f64) -> JobProgress {
    JobProgress { stage, progress, early_pose: None }
}

fn reason(code: &str) -> Reason {
    Reason::new(code, format!("because of {code}"))
}

fn answer(state: AlignmentState) -> AttemptEnd {
    AttemptEnd::Answered(Box::new(Alignment {
        level: LevelName::MAIN,
        state,
        probability: None,
        map_from_clip: None,
        covariance: None,
        loss_m: Some(0.25),
        inliers: None,
        coverage: None,
        alternatives: vec![],
        spread: None,
        scale: None,
        scale_std: None,
        scale_rival_gaps_m: Vec::new(),
        better_scale: None,
        reasons: vec![reason("two_modes")],
        hits: 7,
        key_frames: 2,
        labels: None,
        completion: None,
        floor: None,
        reference_camera: None,
        seconds: [("fuse".to_owned(), 0.5)].into(),
    }))
}

fn clip_info() -> ClipInfo {
    ClipInfo {
        layout: "scannet".to_owned(),
        pose_convention: "camera-to-world".to_owned(),
        depth_unit: "millimetres".to_owned(),
        gravity: "unknown".to_owned(),
        intrinsics: "intrinsic".to_owned(),
        frames: 60,
        frames_with_pose: 59,
        skipped_without_pose: 1,
        skipped_incomplete: 0,
        color_width: 640,
        color_height: 480,
        depth_width: 320,
        depth_height: 240,
        duration_s: Some(2.5),
        metric: true,
        recorded_at_ms: None,
        notes: vec!["a note".to_owned()],
    }
}

fn lidar_info() -> LidarInfo {
    LidarInfo {
        format: "csv_points".to_owned(),
        frame: "as in the file".to_owned(),
        cell_m: None,
        occupied_points: 3,
        free_cells: 0,
        free_area_m2: 0.0,
        min_m: [0.0, -1.0],
        max_m: [4.0, 2.5],
        rooms: vec![],
        charger: None,
        marks: Default::default(),
        notes: vec![],
    }
}

impl Storage {
    /// Returns the keys of all existing blobs, sorted.
    async fn blobs_that_exist(&self) -> Vec<String> {
        let mut keys = self.blobs.keys().await.unwrap();
        keys.sort();
        keys
    }

    /// Returns the keys of all blobs that rows refer to, sorted. Not every result file need exist.
    async fn blob_keys_that_matter(&self) -> Vec<String> {
        let reader = &mut self.database.reader().await.unwrap();
        let mut keys = Vec::new();
        for row in database::query("SELECT blob_key FROM upload_pieces").fetch_all(reader).await.unwrap() {
            keys.push(row.text("blob_key").unwrap());
        }
        for row in database::query("SELECT id FROM homes").fetch_all(reader).await.unwrap() {
            let home = row.home("id").unwrap();
            keys.extend(clips::blob_keys(reader, &home).await.unwrap());
            keys.extend(lidar_maps::blob_keys(reader, &home).await.unwrap());
            keys.extend(crate::home_maps::blob_keys(reader, &home).await.unwrap());
        }
        keys.sort();
        keys
    }

    /// Checks that rows refer to all existing blobs.
    async fn check_no_blob_is_left(&self, what: &str) {
        let (exist, named) = (self.blobs_that_exist().await, self.blob_keys_that_matter().await);
        let left: Vec<_> = exist.iter().filter(|key| !named.contains(key)).collect();
        assert!(left.is_empty(), "{what}: {left:?}");
    }
}
