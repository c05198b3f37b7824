//! A disk that becomes full and is freed again: after a kill acknowledged writes exist, refused ones do not,
//! and `/readyz` reports the state meanwhile.

use futures::FutureExt;
use serde_json::Value;
use std::panic::AssertUnwindSafe;
use tempfile::TempDir;
use viola_testing::client::{Answer, Client};
use viola_testing::disk::{Disk, LimitedDisk, SmallDisk};
use viola_testing::postgres::Schema;
use viola_testing::process::Process;
use viola_testing::{eventually, room, zips};

/// Homes and clips by the answers to their writes.
#[derive(Default)]
struct Written {
    acknowledged: Vec<String>,
    refused: Vec<String>,
}

impl Written {
    async fn home(&mut self, client: &Client, id: &str) -> Answer {
        let path = format!("/v1/homes/{id}");
        let answer = client.put(&path, "").await;
        if answer.status == 201 { &mut self.acknowledged } else { &mut self.refused }.push(path);
        answer
    }

    /// Writes until a write is refused. A full disk may have room for a few.
    async fn until_refused(&mut self, client: &Client, name: &str) -> Answer {
        for number in 0..1000 {
            let answer = self.home(client, &format!("{name}-{number}")).await;
            if answer.status != 201 {
                return answer;
            }
        }
        panic!("a thousand homes were written on a full disk");
    }

    /// Sends a hundred writes, and in between requests whose transactions are rolled back.
    async fn hundred(&mut self, client: &Client) {
        let clip = zips::zip(&room::clip(2));
        for number in 0..100 {
            if number % 10 == 0 {
                let nowhere = client.put("/v1/homes/nowhere/lidar-map", room::lidar_csv()).await;
                nowhere.problem(404, "home-not-found");
                self.acknowledged.push(client.add_clip("/v1/homes/before", clip.clone()).await);
            } else {
                self.home(client, &format!("after-{number}")).await.ok(201);
            }
        }
    }

    async fn check(&self, client: &Client) {
        for path in &self.acknowledged {
            assert_eq!(client.get(path).await.status, 200, "{path} was acknowledged");
        }
        for path in &self.refused {
            assert_eq!(client.get(path).await.status, 404, "{path} was refused");
        }
        assert!(self.acknowledged.len() > 100 && !self.refused.is_empty());
    }
}

async fn unready(client: &Client, what: &[&str]) {
    let problem = eventually("the service is not ready", || async {
        let answer = client.get("/readyz").await;
        (answer.status == 503).then_some(answer)
    });
    let problem = problem.await.problem(503, "not-ready");
    assert!(what.contains(&problem["field"].as_str().unwrap()), "{problem}");
}

async fn ready(client: &Client) -> Value {
    eventually("the service is ready", || async {
        let answer = client.get("/readyz").await;
        (answer.status == 200).then(|| answer.json())
    })
    .await
}

/// Tests SQLite and files on one disk. `refusal` is the answer to a write that needs the database alone.
async fn nothing_is_lost(disk: &dyn Disk, refusal: (u16, &str), what: &str) {
    let server = Process::serve_on(disk, &["--workers", "0"]);
    let client = &server.client;
    ready(client).await;
    let mut written = Written::default();
    written.home(client, "before").await.ok(201);

    disk.fill(server.id());
    let answer = written.until_refused(client, "full").await;
    answer.problem(refusal.0, refusal.1);
    let clip = zips::zip(&room::clip(2));
    client.post("/v1/homes/before/clips", clip).await.problem(507, "storage-full");
    unready(client, &[what]).await;
    written.until_refused(client, "still-full").await.problem(refusal.0, refusal.1);
    // Reads still work.
    client.get("/v1/homes/before").await.ok(200);

    disk.free(server.id());
    ready(client).await;
    written.hundred(client).await;
    written.check(client).await;
    server.kill();
    let server = Process::serve_on(disk, &["--workers", "0"]);
    written.check(&server.client).await;
    let clips = std::fs::read_dir(disk.seen().join("blobs/clips")).unwrap().count();
    assert_eq!(clips, 10, "no file is there of what was refused");
}

#[tokio::test]
async fn a_full_disk_loses_nothing_on_sqlite() {
    let folder = TempDir::new().unwrap();
    let Some(disk) = SmallDisk::mount(folder.path(), 288) else { return };
    nothing_is_lost(&disk, (507, "storage-full"), "disk").await;
}

#[tokio::test]
async fn writes_that_fail_lose_nothing_on_sqlite() {
    let folder = TempDir::new().unwrap();
    let Some(disk) = LimitedDisk::new(folder.path()) else { return };
    nothing_is_lost(&disk, (503, "unavailable"), "database").await;
}

/// Tests a server on PostgreSQL whose disk for rows is full, and is freed again.
async fn nothing_is_lost_on_postgres(schema: &Schema, fill: impl AsyncFn(), free: impl AsyncFn()) {
    let folder = TempDir::new().unwrap();
    let url = schema.url();
    let serve = || {
        let settings = [("VIOLA_DATABASE_URL", url.as_str()), ("VIOLA_WORKERS", "0")];
        Process::serve_with(folder.path(), &settings)
    };
    let server = serve();
    let client = &server.client;
    ready(client).await;
    schema.prepare_full_disk().await;
    let mut written = Written::default();
    written.home(client, "before").await.ok(201);

    fill().await;
    written.until_refused(client, "full").await.problem(507, "storage-full");
    unready(client, &["disk"]).await;
    let clip = zips::zip(&room::clip(2));
    let mut clips = 0;
    // Some may fit: the rows are small.
    loop {
        let answer = client.post("/v1/homes/before/clips", clip.clone()).await;
        if answer.status != 201 {
            answer.problem(507, "storage-full");
            break;
        }
        clips += 1;
        written.acknowledged.push(answer.header("location").to_owned());
    }

    free().await;
    ready(client).await;
    written.hundred(client).await;
    server.kill();
    let server = serve();
    written.check(&server.client).await;
    let files = std::fs::read_dir(folder.path().join("blobs/clips")).unwrap().count();
    assert_eq!(files, clips + 10, "no file is there of what was refused");
}

#[tokio::test]
async fn a_refusal_for_want_of_room_loses_nothing_on_postgresql() {
    let Some(schema) = Schema::new().await else { return };
    let fill = async || schema.fill_disk().await;
    nothing_is_lost_on_postgres(&schema, fill, async || schema.free_disk().await).await;
    schema.remove().await;
}

#[tokio::test]
async fn a_full_tablespace_loses_nothing_on_postgresql() {
    let Some(space) = viola_testing::tablespace::Tablespace::new().await else { return };
    let fill = async || space.fill().await;
    let test = nothing_is_lost_on_postgres(space.schema(), fill, async || space.free().await);
    // A tablespace whose folder is gone would break every later test on this database.
    let tested = AssertUnwindSafe(test).catch_unwind().await;
    space.remove().await;
    if let Err(panic) = tested {
        std::panic::resume_unwind(panic);
    }
}
