//! A server for one test, on a free port and a fresh data folder.

use jiff::Timestamp;
use reqwest::header::HeaderMap;
use sqlx::Connection;
use std::any::Any;
use std::ops::Deref;
use std::path::PathBuf;
use std::sync::OnceLock;
use tempfile::TempDir;
use tokio::task::JoinHandle;
use tokio_util::sync::CancellationToken;
use viola::api::{ServeParams, serve};
use viola::webhooks::WebhookParams;
use viola_storage::{ApiKey, NewKey, PostgresParams, Role, S3Params, Secret, Storage, StorageParams, Tenant};
use viola_testing::client::Client;
use viola_testing::postgres::{Schema, Schemas};
use viola_testing::s3_server::{ACCESS_KEY_ID, BUCKET, PREFIX, REGION, S3Server, SECRET_ACCESS_KEY};
use viola_testing::skipped;

/// Storage of the servers of one run of this suite.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Store {
    /// SQLite and local files.
    Embedded,
    /// PostgreSQL and local files.
    Postgres,
    /// PostgreSQL and S3.
    PostgresAndS3,
}

impl Store {
    const VARIABLE: &str = "VIOLA_TEST_STORE";

    pub fn of_this_run() -> Store {
        match std::env::var(Store::VARIABLE).as_deref() {
            Err(_) => Store::Embedded,
            Ok("postgres") => Store::Postgres,
            Ok("postgres-s3") => Store::PostgresAndS3,
            Ok(other) => panic!("{} is {other}", Store::VARIABLE),
        }
    }
}

/// Runs the suite on another store, in a process of its own, since the environment applies to all of it.
async fn on_another_store(name: &str) {
    // The number of database connections is limited, and each server of a suite takes some.
    static ONE_AT_A_TIME: tokio::sync::Mutex<()> = tokio::sync::Mutex::const_new(());
    let _turn = ONE_AT_A_TIME.lock().await;
    if Store::of_this_run() != Store::Embedded {
        return;
    }
    let Some(schemas) = Schemas::new() else {
        skipped(&format!("the API on {name}"), "set VIOLA_TEST_POSTGRES to the address of a database");
        return;
    };
    let mut suite = tokio::process::Command::new(std::env::current_exe().unwrap());
    let (variable, prefix) = schemas.variable();
    let suite = suite.env(Store::VARIABLE, name).env(variable, prefix).output();
    let suite = suite.await.unwrap();
    schemas.remove().await;
    let told = String::from_utf8_lossy(&suite.stdout);
    // Its failures come last. The list of passed tests before them is long, and a log may be cut.
    let failures = told.find("\nfailures:").map_or(&*told, |at| &told[at..]);
    assert!(suite.status.success(), "the suite on {name}: {}{failures}", suite.status);
}

#[tokio::test]
async fn the_whole_suite_passes_on_postgres() {
    on_another_store("postgres").await;
}

#[tokio::test]
async fn the_whole_suite_passes_on_postgres_and_s3() {
    on_another_store("postgres-s3").await;
}

fn bucket() -> &'static S3Server {
    static SERVER: OnceLock<S3Server> = OnceLock::new();
    SERVER.get_or_init(S3Server::start)
}

/// Returns the bucket of this run, below a prefix of its own.
fn s3_of_this_run() -> Option<S3Params> {
    (Store::of_this_run() == Store::PostgresAndS3).then(|| S3Params {
        bucket: BUCKET.to_owned(),
        prefix: format!("{PREFIX}/{}", uuid::Uuid::now_v7()),
        endpoint: Some(bucket().endpoint()),
        region: REGION.to_owned(),
        access_key_id: ACCESS_KEY_ID.to_owned(),
        secret_access_key: SECRET_ACCESS_KEY.to_owned(),
        allow_http: true,
        path_style: true,
    })
}

pub struct Server {
    client: Client,
    storage: StorageParams,

    folder: TempDir,
    stop: CancellationToken,
    running: JoinHandle<()>,
}

impl Server {
    pub async fn start() -> Server {
        Server::with(|_| {}).await
    }

    /// Starts a server without workers: jobs stay queued.
    pub async fn without_workers() -> Server {
        Server::with(|params| params.workers = 0).await
    }

    pub async fn with(change: impl FnOnce(&mut ServeParams)) -> Server {
        Server::in_folder(TempDir::new().unwrap(), change).await
    }

    /// Stops the server and starts another one on its data folder, without its database on PostgreSQL.
    pub async fn restart_on(self, listen: &str) -> Server {
        let Server { folder, stop, running, .. } = self;
        stop.cancel();
        running.await.unwrap();
        Server::in_folder(folder, |params| params.listen = listen.parse().unwrap()).await
    }

    async fn in_folder(folder: TempDir, change: impl FnOnce(&mut ServeParams)) -> Server {
        let schema = match Store::of_this_run() {
            Store::Embedded => None,
            Store::Postgres | Store::PostgresAndS3 => {
                Some(Schema::new().await.expect("a database for the tests is named"))
            }
        };
        let postgres = schema.as_ref().map(|schema| PostgresParams { url: schema.url(), connections: 4 });
        let storage =
            StorageParams { postgres, s3: s3_of_this_run(), ..StorageParams::in_folder(folder.path()) };
        let mut params = ServeParams {
            webhooks: WebhookParams { private_addresses: true },
            max_upload_bytes: 64 << 20,
            ..ServeParams::new("127.0.0.1:0".parse().unwrap(), storage)
        };
        change(&mut params);
        let storage = params.storage.clone();
        let (told, address) = tokio::sync::oneshot::channel();
        let stop = CancellationToken::new();
        let stopped = stop.clone();
        let running = tokio::spawn(async move {
            serve(params, stopped, |address| told.send(address).unwrap()).await.unwrap();
        });
        let client = Client::new(format!("http://{}", address.await.unwrap()));
        Server { client, storage, folder, stop, running }
    }

    /// Creates a key, as `viola keys create` does.
    pub async fn key(&self, tenant: &str, role: Role, home: Option<&str>) -> (ApiKey, Secret) {
        let tenant: Tenant = tenant.parse().unwrap();
        let home = home.map(|id| tenant.home(&id.parse().unwrap()));
        let new = NewKey { tenant, role, home, label: String::new(), expires_at: None };
        let storage = Storage::administer(&self.storage).await.unwrap();
        let made = storage.create_key(new, Timestamp::now()).await.unwrap();
        storage.close().await;
        made
    }

    /// Returns a client with a new key.
    pub async fn client(&self, tenant: &str, role: Role, home: Option<&str>) -> Client {
        self.client_with(&self.key(tenant, role, home).await.1)
    }

    pub fn client_with(&self, secret: &Secret) -> Client {
        let mut headers = HeaderMap::new();
        headers.insert("authorization", format!("Bearer {}", secret.show()).parse().unwrap());
        let http = reqwest::Client::builder().no_proxy().default_headers(headers).build().unwrap();
        Client { base: self.client.base.clone(), http }
    }

    pub async fn administer(&self) -> Storage {
        Storage::administer(&self.storage).await.unwrap()
    }

    /// Runs statements on the service's own database; returns the connection.
    async fn connection_after(&self, statements: &str) -> Box<dyn Any> {
        let statements = sqlx::raw_sql(sqlx::AssertSqlSafe(statements.to_owned()));
        match &self.storage.postgres {
            Some(postgres) => {
                let mut connection = sqlx::PgConnection::connect(&postgres.url).await.unwrap();
                statements.execute(&mut connection).await.unwrap();
                Box::new(connection)
            }
            None => {
                let file = format!("sqlite:{}", self.storage.data.join("viola.sqlite").display());
                let mut connection = sqlx::SqliteConnection::connect(&file).await.unwrap();
                statements.execute(&mut connection).await.unwrap();
                Box::new(connection)
            }
        }
    }

    /// Runs a statement on the service's own database.
    pub async fn execute(&self, statement: &str) {
        self.connection_after(statement).await;
    }

    /// Keeps everybody from changing jobs until the returned connection is dropped.
    pub async fn lock_jobs(&self) -> Box<dyn Any> {
        self.connection_after(match &self.storage.postgres {
            Some(_) => "BEGIN; LOCK TABLE jobs IN EXCLUSIVE MODE",
            None => "BEGIN IMMEDIATE",
        })
        .await
    }

    /// Keeps everybody from reading a table until the returned connection is dropped; `None` for SQLite, which has no such lock.
    pub async fn lock_reads(&self, table: &str) -> Option<Box<dyn Any>> {
        self.storage.postgres.as_ref()?;
        Some(self.connection_after(&format!("BEGIN; LOCK TABLE {table} IN ACCESS EXCLUSIVE MODE")).await)
    }

    /// Returns every file of the blob store, including arriving ones, without the one with the store's id.
    pub fn blobs(&self) -> Vec<PathBuf> {
        let mut files = Vec::new();
        let mut folders = match &self.storage.s3 {
            None => vec![self.folder.path().join("blobs")],
            Some(s3) => {
                let below = s3.prefix.rsplit('/').next().unwrap();
                vec![bucket().path_of(below), self.folder.path().join("incoming")]
            }
        };
        while let Some(folder) = folders.pop() {
            // The prefix has no folder in the bucket before its first object, and a store removes a folder with its last file.
            let entries = match std::fs::read_dir(&folder) {
                Err(_) if !folder.exists() => continue,
                entries => entries.unwrap(),
            };
            for entry in entries {
                let path = entry.unwrap().path();
                if path.is_dir() { folders.push(path) } else { files.push(path) }
            }
        }
        files.retain(|path| !path.ends_with("viola-store-id"));
        files
    }

    /// Stops as on SIGTERM and waits for the end.
    pub async fn stop(self) {
        self.stop.cancel();
        self.running.await.unwrap();
    }
}

impl Deref for Server {
    type Target = Client;

    fn deref(&self) -> &Client {
        &self.client
    }
}
