//! The queue on PostgreSQL, in a temporary schema.

use super::Times;
use jiff::Timestamp;
use sqlx::{AssertSqlSafe, Connection, PgConnection};
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};
use tokio_util::sync::CancellationToken;
use viola::jobs::{AlignJobError, Finished, JobParams, LevelFile, Queue, WorkerParams, work};
use viola_formats::clip::{Clip, ClipInfo};
use viola_formats::lidar::LidarMap;
use viola_geometry::progress::Progress;
use viola_storage::{
    Added, Arrived, HomeId, NewClip, NewLidarMap, PostgresParams, Storage, StorageParams, UnpackParams,
};

const SCHEMA: &str = "viola_load";
const HOMES: u64 = 200;
const CLIPS: u64 = 20;
const WORKERS: usize = 16;
/// Jobs added one by one while workers wait.
const LATE: u64 = 300;

pub async fn run(url: &str) -> anyhow::Result<()> {
    execute(url, "DROP SCHEMA IF EXISTS viola_load CASCADE").await?;
    execute(url, "CREATE SCHEMA viola_load").await?;
    let folder = tempfile::tempdir()?;
    let separator = if url.contains('?') { '&' } else { '?' };
    let schema_url = format!("{url}{separator}options=-csearch_path%3D{SCHEMA}");
    let params = StorageParams {
        data: folder.path().to_owned(),
        postgres: Some(PostgresParams { url: schema_url, connections: 16 }),
        s3: None,
        secrets_key: None,
        unpack: UnpackParams::default(),
    };
    let storage = Arc::new(Storage::open(&params).await?);
    let measured = async {
        claims(&storage).await?;
        starts(&storage, &params).await
    };
    let measured = measured.await;
    storage.close().await;
    execute(url, "DROP SCHEMA viola_load CASCADE").await?;
    measured
}

async fn execute(url: &str, statement: &str) -> anyhow::Result<()> {
    let mut connection = PgConnection::connect(url).await?;
    sqlx::query(AssertSqlSafe(statement.to_owned())).execute(&mut connection).await?;
    Ok(())
}

async fn arrived(storage: &Storage, bytes: &[u8]) -> anyhow::Result<Arrived> {
    let mut incoming = storage.incoming()?;
    incoming.write(bytes).await?;
    Ok(incoming.finish().await?)
}

async fn home(storage: &Storage, number: u64) -> anyhow::Result<HomeId> {
    let home: HomeId = format!("home-{number}").parse()?;
    storage.put_home(&home, None, |_| true, Timestamp::now()).await?;
    let map = b"x,y\n0,0\n1,0\n1,1\n0,1\n";
    let new = NewLidarMap {
        level: viola_geometry::LevelName::MAIN,
        file: arrived(storage, map).await?,
        file_name: None,
        info: LidarMap::read(map)?.info,
        from_earlier: None,
        image_png: vec![0],
    };
    storage.put_lidar_map(&home, new, None, |_| true, Timestamp::now()).await?;
    Ok(home)
}

/// Minimal clip metadata; nobody opens these clips.
fn info() -> ClipInfo {
    let text = r#"{"layout":"none","pose_convention":"none","depth_unit":"none","gravity":"none","intrinsics":"none",
        "frames":1,"frames_with_pose":1,"skipped_without_pose":0,"skipped_incomplete":0,"color_width":1,"color_height":1,
        "depth_width":1,"depth_height":1,"duration_s":null,"metric":true,"recorded_at_ms":null,"notes":[]}"#;
    serde_json::from_str(text).expect("it is written here")
}

async fn add(storage: &Storage, home: &HomeId) -> anyhow::Result<uuid::Uuid> {
    let file = arrived(storage, b"clip").await?;
    let new = NewClip {
        file,
        info: info(),
        content_sha256: None,
        idempotency_key: None,
        recorded_at: None,
        title: None,
        file_name: None,
    };
    match storage.add_clip(home, new, None, Timestamp::now()).await? {
        Added::New(clip) => Ok(clip.id),
        other => anyhow::bail!("{other:?}"),
    }
}

/// Measures claims by many workers on a backlog of many homes.
async fn claims(storage: &Arc<Storage>) -> anyhow::Result<()> {
    for number in 0..HOMES {
        let home = home(storage, number).await?;
        for _ in 0..CLIPS {
            add(storage, &home).await?;
        }
    }
    let begun = Instant::now();
    let claiming = (0..WORKERS).map(|_| {
        let storage = storage.clone();
        tokio::spawn(async move {
            let mut times = Vec::new();
            loop {
                let asked = Instant::now();
                if storage.claim(Duration::from_secs(600), Timestamp::now()).await?.is_none() {
                    return Ok::<_, anyhow::Error>(times);
                }
                times.push(asked.elapsed());
            }
        })
    });
    let mut times = Vec::new();
    for worker in claiming.collect::<Vec<_>>() {
        times.extend(worker.await??);
    }
    let a_second = times.len() as f64 / begun.elapsed().as_secs_f64();
    println!(
        "{} claims by {WORKERS} workers: {a_second:.0} a second; each {}",
        times.len(),
        Times::new(times)
    );
    Ok(())
}

/// Fails at once: the file is not a valid clip.
fn refuse(path: &Path, _: &[LevelFile], _: &JobParams, _: &dyn Progress) -> Result<Finished, AlignJobError> {
    match Clip::open(path) {
        Err(error) => Err(error.into()),
        Ok(_) => Err(AlignJobError::Cancelled),
    }
}

/// Measures the start latency of jobs added while workers of another process wait.
async fn starts(storage: &Arc<Storage>, params: &StorageParams) -> anyhow::Result<()> {
    let other = Arc::new(Storage::open(params).await?);
    let stop = CancellationToken::new();
    let (here, there) = (Arc::new(Queue::new(storage.clone())), Arc::new(Queue::new(other)));
    let mut tasks = tokio::task::JoinSet::new();
    for queue in [&here, &there] {
        tasks.spawn(queue.clone().exchange_signals(stop.clone()));
    }
    for _ in 0..2 {
        let params = WorkerParams { method: refuse, ..WorkerParams::default() };
        tasks.spawn(work(there.clone(), params, stop.clone()));
    }
    let home = home(storage, HOMES).await?;
    // Wait until both queues listen.
    tokio::time::sleep(Duration::from_secs(2)).await;
    let mut times = Vec::new();
    for _ in 0..LATE {
        let clip = add(storage, &home).await?;
        here.wake();
        let job = loop {
            let job = storage.clip(&home, clip).await?.job;
            if let Some(job) = job.filter(|job| job.state.is_final()) {
                break job;
            }
            tokio::time::sleep(Duration::from_millis(5)).await;
        };
        let started = job.started_at.unwrap_or(job.updated_at);
        times.push(started.duration_since(job.created_at).unsigned_abs());
    }
    stop.cancel();
    while tasks.join_next().await.is_some() {}
    println!("{LATE} jobs for waiting workers of another process: {}", Times::new(times));
    Ok(())
}
