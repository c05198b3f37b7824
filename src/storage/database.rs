//! The database: SQLite in the data folder, or PostgreSQL for many processes. One type wraps both pools, and
//! a statement has one text if both databases accept it.

mod connection;
mod fault;
mod health;
mod query;
mod tables;

pub(super) use connection::{Connection, Transaction};
pub(super) use fault::DatabaseFault;
pub(super) use query::{Query, Row, query};

use super::StorageError;
use health::{Verdict, WriteHealth};
use jiff::{SignedDuration, Timestamp};
use sqlx::ConnectOptions as _;
use sqlx::postgres::{PgConnectOptions, PgListener, PgPool, PgPoolOptions};
use sqlx::sqlite::{
    SqliteConnectOptions, SqliteJournalMode, SqlitePool, SqlitePoolOptions, SqliteSynchronous,
};
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

/// Difference of this machine's clock and the database's beyond which a process warns: leases are compared across machines.
const MAX_CLOCK_DIFFERENCE: SignedDuration = SignedDuration::from_secs(5);

/// Timeout of the write that checks whether the database can write.
const CHECK: Duration = Duration::from_secs(3);

/// A clone shares the connections.
#[derive(Clone)]
pub(super) struct Database {
    pools: Pools,
    health: Arc<WriteHealth>,
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

/// Returns the reason why PostgreSQL cannot be reached. A pool only says that it waited in vain.
async fn unreachable(options: &PgConnectOptions, error: sqlx::Error) -> StorageError {
    let source = match error {
        sqlx::Error::PoolTimedOut => match tokio::time::timeout(CHECK, options.connect()).await {
            Ok(Err(cause)) => cause,
            Ok(Ok(_)) | Err(_) => error,
        },
        error => error,
    };
    StorageError::NoDatabase { host: options.get_host().to_owned(), port: options.get_port(), source }
}

/// Warns if this machine's clock and the database's differ: processes would take each other's leases for expired.
async fn compare_clocks(pool: &PgPool) -> Result<(), StorageError> {
    let now = "SELECT CAST(EXTRACT(EPOCH FROM clock_timestamp()) * 1000 AS BIGINT)";
    let theirs_ms: i64 = sqlx::query_scalar(now).fetch_one(pool).await?;
    let ahead = SignedDuration::from_millis(Timestamp::now().as_millisecond() - theirs_ms);
    if ahead.abs() > MAX_CLOCK_DIFFERENCE {
        let seconds = ahead.as_secs_f64();
        tracing::warn!(seconds, "the clock of this machine differs from the database's; set both, as by NTP");
    }
    Ok(())
}

impl Database {
    fn new(pools: Pools) -> Database {
        Database { pools, health: Arc::default() }
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
        let writer = SqlitePoolOptions::new().max_connections(1).connect_with(options.clone()).await?;
        tables::sqlite().run(&writer).await?;
        let reader =
            SqlitePoolOptions::new().max_connections(READERS).connect_with(options.read_only(true)).await?;
        Ok(Database::new(Pools::Sqlite { writer, reader }))
    }

    /// Opens PostgreSQL. `url` is as for libpq: `postgres://user:password@host:port/database?sslmode=...`. Connections are
    /// named `viola` unless it has an `application_name`.
    pub async fn open_postgres(url: &str, connections: u32) -> Result<Database, StorageError> {
        let options = PgConnectOptions::from_str(url)?;
        let name = options.get_application_name().unwrap_or("viola").to_owned();
        let options = options
            .application_name(&name)
            .options([("lock_timeout", LOCK_TIMEOUT), ("idle_in_transaction_session_timeout", "60s")]);
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
        compare_clocks(&pool).await?;
        Ok(Database::new(Pools::Postgres(pool)))
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
        let write = async {
            let mut transaction = self.begin().await?;
            query("UPDATE change_counter SET last_seq = last_seq").execute(&mut transaction).await?;
            transaction.commit().await
        };
        tokio::time::timeout(CHECK, write).await.map_err(|_| sqlx::Error::PoolTimedOut)?
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

    pub fn name(&self) -> &'static str {
        match &self.pools {
            Pools::Sqlite { .. } => "sqlite",
            Pools::Postgres(_) => "postgresql",
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
