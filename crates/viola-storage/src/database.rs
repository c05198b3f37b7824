//! The database: SQLite in the data folder, or PostgreSQL for many processes. One type wraps both pools, and
//! every statement has one text, in the words of PostgreSQL: `query` has what SQLite gets in their place.

mod clock;
mod connection;
mod fault;
mod health;
mod query;
mod tables;

pub(super) use connection::{Connection, Transaction};
pub(super) use fault::DatabaseFault;
pub(super) use query::{Query, Row, Turn, listed, query, take_turns};

use super::StorageError;
use clock::Clock;
use health::{Verdict, WriteHealth};
use jiff::Timestamp;
use sqlx::ConnectOptions as _;
use sqlx::postgres::{PgConnectOptions, PgListener, PgPool, PgPoolOptions};
use sqlx::sqlite::{
    SqliteConnectOptions, SqliteJournalMode, SqlitePool, SqlitePoolOptions, SqliteSynchronous,
};
use std::io;
use std::path::Path;
use std::str::FromStr;
use std::sync::Arc;
use std::time::Duration;

/// Read connections of SQLite.
const READERS: u32 = 4;

/// Default number of connections of one process to PostgreSQL.
pub const POSTGRES_CONNECTIONS: u32 = 8;

/// Timeout for a free connection; then the service counts as busy.
const ACQUIRE: Duration = Duration::from_secs(10);

/// A statement that waits this long for a lock shows a bug of ours, and is aborted.
const LOCK_TIMEOUT: &str = "10s";

/// Timeout of the write that checks whether the database can write.
const CHECK: Duration = Duration::from_secs(3);

/// Number of connections of a process to its database.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Connections {
    /// Connections that work.
    pub used: u64,
    /// Connections that are open and free.
    pub idle: u64,
    /// Maximum number of both together.
    pub max: u64,
}

/// A clone shares the connections.
#[derive(Clone)]
pub(super) struct Database {
    pools: Pools,
    health: Arc<WriteHealth>,
    clock: Arc<Clock>,
}

#[derive(Clone)]
enum Pools {
    /// One connection that writes, several that read.
    Sqlite {
        writer: SqlitePool,
        reader: SqlitePool,
    },
    Postgres(PgPool),
}

/// Begins a transaction in a task of its own, which a disconnecting client cannot cancel. A cancelled `BEGIN`
/// would return a connection to the pool inside an unknown transaction.
async fn begin_whole(
    pool: &PgPool,
    statement: &'static str,
    health: Option<Arc<WriteHealth>>,
) -> Result<Transaction, sqlx::Error> {
    let pool = pool.clone();
    let begun = tokio::spawn(async move { pool.begin_with(statement).await });
    // The task ends without a result only when the whole process ends.
    Ok(Transaction::of_postgres(begun.await.map_err(|_| sqlx::Error::PoolClosed)??, health))
}

/// Returns the reason why PostgreSQL cannot be reached. A pool only says that it waited in vain, so this tries to connect once.
async fn unreachable(options: &PgConnectOptions, error: sqlx::Error) -> StorageError {
    let in_vain = |why: &str| {
        let waited_s = (ACQUIRE + CHECK).as_secs();
        sqlx::Error::Io(io::Error::new(io::ErrorKind::TimedOut, format!("{why} within {waited_s} s")))
    };
    let source = match error {
        sqlx::Error::PoolTimedOut => match tokio::time::timeout(CHECK, options.connect()).await {
            Ok(Err(cause)) => cause,
            Ok(Ok(_)) => in_vain("it is overloaded: it gave no connection"),
            Err(_) => in_vain("it did not answer"),
        },
        error => error,
    };
    StorageError::NoDatabase { host: options.get_host().to_owned(), port: options.get_port(), source }
}

/// Returns an error if a URL of PostgreSQL cannot be used. Connects to nothing.
pub fn check_database_url(url: &str) -> Result<(), StorageError> {
    parse_url(url).map(drop)
}

/// Parses the URL of PostgreSQL. Its words name no part that may hold a password.
fn parse_url(url: &str) -> Result<PgConnectOptions, StorageError> {
    let unusable = |why: String| StorageError::DatabaseUrl { why };
    let scheme = url.split_once("://").map_or("", |(scheme, _)| scheme);
    match scheme.to_ascii_lowercase().as_str() {
        "postgres" | "postgresql" => {}
        "sqlite" | "file" => {
            return Err(unusable(
                "SQLite has no URL: leave it out, and name the folder with --data".to_owned(),
            ));
        }
        other if !other.is_empty() && other.bytes().all(|byte| byte.is_ascii_alphanumeric()) => {
            let why =
                format!("it begins with {other}://, and the service works with PostgreSQL and SQLite only");
            return Err(unusable(why));
        }
        _ => return Err(unusable("it does not begin with postgres://".to_owned())),
    }
    PgConnectOptions::from_str(url).map_err(|error| match error {
        sqlx::Error::Configuration(why) => unusable(why.to_string()),
        error => error.into(),
    })
}

impl Database {
    fn new(pools: Pools) -> Database {
        Database { pools, health: Arc::default(), clock: Arc::default() }
    }

    pub async fn open_sqlite(file: &Path) -> Result<Database, StorageError> {
        // FULL: a commit is on the disk before it is acknowledged.
        let options = SqliteConnectOptions::new()
            .filename(file)
            .create_if_missing(true)
            .journal_mode(SqliteJournalMode::Wal)
            .synchronous(SqliteSynchronous::Full)
            .foreign_keys(true)
            .busy_timeout(Duration::from_secs(10));
        // A file does not break like a network, and a caller who leaves during the test would close the connection.
        let pool =
            |connections| SqlitePoolOptions::new().max_connections(connections).test_before_acquire(false);
        let writer = pool(1).connect_with(options.clone()).await?;
        tables::sqlite().run(&writer).await?;
        let reader = pool(READERS).connect_with(options.read_only(true)).await?;
        Ok(Database::new(Pools::Sqlite { writer, reader }))
    }

    /// Opens PostgreSQL. `url` is as for libpq: `postgres://user:password@host:port/database?sslmode=...`. Connections are
    /// named `viola` unless it has an `application_name`.
    pub async fn open_postgres(url: &str, connections: u32) -> Result<Database, StorageError> {
        let options = parse_url(url)?;
        let name = options.get_application_name().unwrap_or("viola").to_owned();
        let options = options.application_name(&name).options([
            ("lock_timeout", LOCK_TIMEOUT),
            ("idle_in_transaction_session_timeout", "60s"),
            // The driver logs notices, such as that a table exists already.
            ("client_min_messages", "warning"),
        ]);
        let pool = PgPoolOptions::new()
            .max_connections(connections.max(2))
            .acquire_timeout(ACQUIRE)
            .connect_with(options.clone())
            .await;
        let pool = match pool {
            Ok(pool) => pool,
            Err(error) => return Err(unreachable(&options, error).await),
        };
        tables::migrate_postgres(&options).await?;
        let database = Database::new(Pools::Postgres(pool));
        database.follow_clock().await?;
        Ok(database)
    }

    /// Returns the time of the service: on PostgreSQL the database's.
    pub fn now(&self) -> Timestamp {
        self.clock.now()
    }

    /// Reads the clock of PostgreSQL if the last reading is old.
    pub async fn follow_clock(&self) -> Result<(), StorageError> {
        match &self.pools {
            Pools::Postgres(pool) if self.clock.is_old() => self.clock.read(pool).await,
            Pools::Sqlite { .. } | Pools::Postgres(_) => Ok(()),
        }
    }

    /// Returns a connection for one read.
    pub async fn reader(&self) -> Result<Connection, StorageError> {
        Ok(match &self.pools {
            Pools::Sqlite { reader, .. } => Connection::of_sqlite(reader.acquire().await?),
            Pools::Postgres(pool) => Connection::of_postgres(pool.acquire().await?),
        })
    }

    /// Begins a transaction for several reads that must agree with each other.
    pub async fn snapshot(&self) -> Result<Transaction, StorageError> {
        Ok(match &self.pools {
            Pools::Sqlite { reader, .. } => Transaction::begin_sqlite(reader, "BEGIN", None).await?,
            Pools::Postgres(pool) => {
                begin_whole(pool, "BEGIN ISOLATION LEVEL REPEATABLE READ READ ONLY", None).await?
            }
        })
    }

    /// Begins a transaction that writes. SQLite's writers take turns and wait in `BEGIN` for other processes,
    /// so no later statement finds the database locked. PostgreSQL's run concurrently: to prevent deadlocks,
    /// each locks the home's row first (`homes::lock`), then its tenant's quota (`quota::check`), then jobs, then clips, then
    /// changes.
    pub async fn begin(&self) -> Result<Transaction, StorageError> {
        let health = Some(self.health.clone());
        Ok(match &self.pools {
            Pools::Sqlite { writer, .. } => {
                Transaction::begin_sqlite(writer, "BEGIN IMMEDIATE", health).await?
            }
            Pools::Postgres(pool) => begin_whole(pool, "BEGIN", health).await?,
        })
    }

    /// Checks that the database can write, from recent writes; without any, it writes one row.
    pub async fn check_writes(&self) -> Result<(), StorageError> {
        let _turn = self.health.check.lock().await;
        match self.health.verdict() {
            Verdict::Works => return Ok(()),
            Verdict::Fails(fault) => {
                return Err(StorageError::WritesFail { is_full: fault == DatabaseFault::Full });
            }
            Verdict::Unknown => {}
        }
        let write = self.execute(query("UPDATE change_counter SET last_seq = last_seq"));
        tokio::time::timeout(CHECK, write).await.map_err(|_| sqlx::Error::PoolTimedOut)?.map(drop)
    }

    /// Runs one statement in a transaction of its own; returns the number of changed rows.
    pub async fn execute(&self, statement: Query) -> Result<u64, StorageError> {
        let mut transaction = self.begin().await?;
        let rows = statement.execute(&mut transaction).await?;
        transaction.commit().await?;
        Ok(rows)
    }

    /// Returns the pool of SQLite's one write connection.
    #[cfg(test)]
    pub fn writer(&self) -> &SqlitePool {
        match &self.pools {
            Pools::Sqlite { writer, .. } => writer,
            Pools::Postgres(_) => panic!("it is PostgreSQL"),
        }
    }

    /// Returns a listener for notifications of other processes; `None` for SQLite.
    pub async fn listener(&self) -> Result<Option<PgListener>, StorageError> {
        Ok(match &self.pools {
            Pools::Sqlite { .. } => None,
            Pools::Postgres(pool) => Some(PgListener::connect_with(pool).await?),
        })
    }

    /// Returns whether other processes may share the database.
    pub fn is_shared(&self) -> bool {
        matches!(self.pools, Pools::Postgres(_))
    }

    /// Returns the state of the connections of this process.
    pub fn connections(&self) -> Connections {
        let of = |size: u32, idle: usize, max: u32| {
            let (size, idle) = (u64::from(size), idle as u64);
            Connections { used: size.saturating_sub(idle), idle, max: max.into() }
        };
        match &self.pools {
            Pools::Sqlite { writer, reader } => {
                let size = writer.size() + reader.size();
                of(size, writer.num_idle() + reader.num_idle(), 1 + READERS)
            }
            Pools::Postgres(pool) => of(pool.size(), pool.num_idle(), pool.options().get_max_connections()),
        }
    }

    pub async fn close(&self) {
        match &self.pools {
            Pools::Sqlite { writer, reader } => {
                reader.close().await;
                writer.close().await;
            }
            Pools::Postgres(pool) => pool.close().await,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use futures::poll;

    #[test]
    fn a_url_of_another_system_is_refused_in_words() {
        for good in ["postgres://u:p@db/viola", "postgresql://db", "POSTGRES://db/viola?sslmode=require"] {
            assert!(parse_url(good).is_ok(), "{good}");
        }
        let table = [
            ("mysql://u:secret@db/viola", "begins with mysql://"),
            ("mariadb://u:secret@db/viola", "begins with mariadb://"),
            ("sqlite://viola.sqlite", "--data"),
            ("secret@db/viola", "does not begin with postgres://"),
            ("", "does not begin with postgres://"),
            ("u:secret@x://db", "does not begin with postgres://"),
            ("postgres://u:secret@db:port/viola", "port"),
            ("postgres://u:secret@db/viola?sslmode=sometimes", "ssl_mode"),
        ];
        for (url, part) in table {
            let error = parse_url(url).err().map(|error| error.to_string()).unwrap_or_default();
            assert!(error.contains(part) && error.contains("--database-url"), "{url}: {error}");
            assert!(!error.contains("secret"), "{url}: {error}");
        }
    }

    /// Opening one takes milliseconds of the next request.
    #[tokio::test]
    async fn readers_whose_caller_left_are_used_again() {
        let folder = tempfile::tempdir().unwrap();
        let database = Database::open_sqlite(&folder.path().join("viola.sqlite")).await.unwrap();
        let Pools::Sqlite { reader, .. } = &database.pools else { panic!("it is SQLite") };
        let all = async || {
            let mut connections = Vec::new();
            for _ in 0..READERS {
                connections.push(reader.acquire().await.unwrap());
            }
            connections
        };
        for connection in &mut all().await {
            sqlx::query("PRAGMA cache_size = 77").execute(&mut **connection).await.unwrap();
        }
        let count = || query("SELECT COUNT(*) FROM change_counter");
        for _ in 0..3 * READERS {
            drop(poll!(Box::pin(database.snapshot())));
            let mut snapshot = database.snapshot().await.unwrap();
            drop(poll!(Box::pin(count().fetch_one(&mut snapshot))));
            let mut alone = database.reader().await.unwrap();
            drop(poll!(Box::pin(count().fetch_one(&mut alone))));
        }
        for connection in &mut all().await {
            let pages: i64 =
                sqlx::query_scalar("PRAGMA cache_size").fetch_one(&mut **connection).await.unwrap();
            assert_eq!(pages, 77, "it is another connection");
            // Fails within a transaction.
            sqlx::query("BEGIN").execute(&mut **connection).await.unwrap();
            sqlx::query("ROLLBACK").execute(&mut **connection).await.unwrap();
        }
        database.close().await;
    }

    /// Otherwise the driver logs a line for each table that exists already.
    #[tokio::test]
    async fn connections_to_postgres_get_no_notices() {
        let Some(schema) = viola_testing::postgres::Schema::new().await else { return };
        let database = Database::open_postgres(&schema.url(), 2).await.unwrap();
        let Pools::Postgres(pool) = &database.pools else { panic!("it is PostgreSQL") };
        let level: String = sqlx::query_scalar("SHOW client_min_messages").fetch_one(pool).await.unwrap();
        assert_eq!(level, "warning");
        database.close().await;
        schema.remove().await;
    }
}
