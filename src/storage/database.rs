//! The database: SQLite in the data folder, or PostgreSQL for many processes. Two pools behind one type, and one text
//! for each statement wherever both understand it.

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
use sqlx::postgres::{PgConnectOptions, PgListener, PgPool, PgPoolOptions};
use sqlx::sqlite::{
    SqliteConnectOptions, SqliteJournalMode, SqlitePool, SqlitePoolOptions, SqliteSynchronous,
};
use std::path::Path;
use std::str::FromStr;
use std::sync::Arc;
use std::time::Duration;

/// Connections of SQLite that read.
const READERS: u32 = 4;

/// Connections of one process to PostgreSQL, unless it is told otherwise.
pub const POSTGRES_CONNECTIONS: u32 = 8;

/// How long a statement waits for a free connection before the caller is told that the service is busy.
const ACQUIRE: Duration = Duration::from_secs(10);

/// How long a write may take that checks whether the database can write.
const CHECK: Duration = Duration::from_secs(3);

pub(super) struct Database {
    pools: Pools,
    health: Arc<WriteHealth>,
}

enum Pools {
    /// One connection that writes, several that read.
    Sqlite {
        writer: SqlitePool,
        reader: SqlitePool,
    },
    Postgres(PgPool),
}

/// Begins a transaction in a task of its own. Whoever hangs up cancels what is under way for it; a `BEGIN` that is cut
/// off would go back to the pool as a connection within a transaction of which nobody knows.
async fn begin_whole(
    pool: &PgPool,
    statement: &'static str,
    health: Option<Arc<WriteHealth>>,
) -> Result<Transaction, sqlx::Error> {
    let pool = pool.clone();
    let begun = tokio::spawn(async move { pool.begin_with(statement).await });
    // The task ends without an answer only when the whole process does.
    Ok(Transaction::of_postgres(begun.await.map_err(|_| sqlx::Error::PoolClosed)??, health))
}

impl Database {
    fn new(pools: Pools) -> Database {
        Database { pools, health: Arc::default() }
    }

    pub async fn open_sqlite(file: &Path) -> Result<Database, StorageError> {
        // FULL: a commit that gates an acknowledgement has reached the disk.
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

    /// `url` as libpq knows it: `postgres://user:password@host:port/database?sslmode=...`.
    pub async fn open_postgres(url: &str, connections: u32) -> Result<Database, StorageError> {
        // A statement that waits for another one's lock for so long has met a fault of ours, and is ended.
        let options = PgConnectOptions::from_str(url)?
            .application_name("viola")
            .options([("lock_timeout", "10s"), ("idle_in_transaction_session_timeout", "60s")]);
        let pool = PgPoolOptions::new()
            .max_connections(connections.max(2))
            .acquire_timeout(ACQUIRE)
            .connect_with(options)
            .await?;
        tables::postgres().run(&pool).await?;
        Ok(Database::new(Pools::Postgres(pool)))
    }

    /// For one read.
    pub async fn reader(&self) -> Result<Connection, StorageError> {
        Ok(match &self.pools {
            Pools::Sqlite { reader, .. } => Connection::of_sqlite(reader.acquire().await?),
            Pools::Postgres(pool) => Connection::of_postgres(pool.acquire().await?),
        })
    }

    /// For several reads that must agree with each other.
    pub async fn snapshot(&self) -> Result<Transaction, StorageError> {
        Ok(match &self.pools {
            Pools::Sqlite { reader, .. } => Transaction::begin_sqlite(reader, "BEGIN", None).await?,
            Pools::Postgres(pool) => {
                begin_whole(pool, "BEGIN ISOLATION LEVEL REPEATABLE READ READ ONLY", None).await?
            }
        })
    }

    /// To write. SQLite's writers take turns here, and wait in `BEGIN` for those of other processes, so none ever meets
    /// a locked database later. PostgreSQL's go side by side: who changes a home or what is in it locks its row first
    /// (`homes::lock`), then jobs, then clips, then changes; in this order nobody waits in a circle.
    pub async fn begin(&self) -> Result<Transaction, StorageError> {
        let health = Some(self.health.clone());
        Ok(match &self.pools {
            Pools::Sqlite { writer, .. } => {
                Transaction::begin_sqlite(writer, "BEGIN IMMEDIATE", health).await?
            }
            Pools::Postgres(pool) => begin_whole(pool, "BEGIN", health).await?,
        })
    }

    /// Checks that the database can write. Recent writes tell; without any, one row is written.
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

    /// The pool of the one connection of SQLite that writes.
    #[cfg(test)]
    pub fn writer(&self) -> &SqlitePool {
        match &self.pools {
            Pools::Sqlite { writer, .. } => writer,
            Pools::Postgres(_) => panic!("it is PostgreSQL"),
        }
    }

    /// Hears what other processes tell; none where there is but this one.
    pub async fn listener(&self) -> Result<Option<PgListener>, StorageError> {
        Ok(match &self.pools {
            Pools::Sqlite { .. } => None,
            Pools::Postgres(pool) => Some(PgListener::connect_with(pool).await?),
        })
    }

    /// Whether other processes may be at work on it.
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
