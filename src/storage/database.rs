//! The database: SQLite in the data folder, or PostgreSQL for many processes. Two pools behind one type, and one text
//! for each statement wherever both understand it.

mod query;
mod tables;

pub(super) use query::{Query, Row, query};

use super::StorageError;
use sqlx::postgres::{PgConnectOptions, PgListener, PgPool, PgPoolOptions};
use sqlx::sqlite::{
    SqliteConnectOptions, SqliteJournalMode, SqlitePool, SqlitePoolOptions, SqliteSynchronous,
};
use sqlx::{PgConnection, Postgres, Sqlite, SqliteConnection};
use std::ops::{Deref, DerefMut};
use std::path::Path;
use std::str::FromStr;
use std::time::Duration;

/// Connections of SQLite that read.
const READERS: u32 = 4;

/// Connections of one process to PostgreSQL, unless it is told otherwise.
pub const POSTGRES_CONNECTIONS: u32 = 8;

/// How long a statement waits for a free connection before the caller is told that the service is busy.
const ACQUIRE: Duration = Duration::from_secs(10);

pub(super) enum Database {
    /// One connection that writes, several that read.
    Sqlite {
        writer: SqlitePool,
        reader: SqlitePool,
    },
    Postgres(PgPool),
}

/// A connection, in a transaction or not.
pub(super) enum Connection {
    Sqlite(sqlx::Transaction<'static, Sqlite>),
    Postgres(sqlx::Transaction<'static, Postgres>),
    /// Reads one thing, so that it needs no transaction.
    PostgresAlone(sqlx::pool::PoolConnection<Postgres>),
}

/// A connection whose statements take effect together, with [`Transaction::commit`], or not at all.
pub(super) struct Transaction(Connection);

enum Executor<'c> {
    Sqlite(&'c mut SqliteConnection),
    Postgres(&'c mut PgConnection),
}

impl Connection {
    fn executor(&mut self) -> Executor<'_> {
        match self {
            Connection::Sqlite(transaction) => Executor::Sqlite(transaction),
            Connection::Postgres(transaction) => Executor::Postgres(transaction),
            Connection::PostgresAlone(connection) => Executor::Postgres(connection),
        }
    }

    /// The text of a statement that the two must be told differently.
    pub fn either<T>(&self, sqlite: T, postgres: T) -> T {
        match self {
            Connection::Sqlite(_) => sqlite,
            Connection::Postgres(_) | Connection::PostgresAlone(_) => postgres,
        }
    }
}

impl Transaction {
    pub async fn commit(self) -> Result<(), sqlx::Error> {
        match self.0 {
            Connection::Sqlite(transaction) => transaction.commit().await,
            Connection::Postgres(transaction) => transaction.commit().await,
            // Never made.
            Connection::PostgresAlone(_) => Ok(()),
        }
    }
}

impl Deref for Transaction {
    type Target = Connection;

    fn deref(&self) -> &Connection {
        &self.0
    }
}

impl DerefMut for Transaction {
    fn deref_mut(&mut self) -> &mut Connection {
        &mut self.0
    }
}

/// Begins a transaction in a task of its own. Whoever hangs up cancels what is under way for it; a `BEGIN` that is cut
/// off would go back to the pool as a connection within a transaction of which nobody knows.
async fn begin_whole(pool: &PgPool, statement: Option<&'static str>) -> Result<Connection, StorageError> {
    let pool = pool.clone();
    let begun = tokio::spawn(async move {
        match statement {
            Some(statement) => pool.begin_with(statement).await,
            None => pool.begin().await,
        }
    });
    // The task ends without an answer only when the whole process does.
    Ok(Connection::Postgres(begun.await.map_err(|_| sqlx::Error::PoolClosed)??))
}

impl Database {
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
        Ok(Database::Sqlite { writer, reader })
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
        Ok(Database::Postgres(pool))
    }

    /// For one read.
    pub async fn reader(&self) -> Result<Connection, StorageError> {
        Ok(match self {
            Database::Sqlite { reader, .. } => Connection::Sqlite(reader.begin().await?),
            Database::Postgres(pool) => Connection::PostgresAlone(pool.acquire().await?),
        })
    }

    /// For several reads that must agree with each other.
    pub async fn snapshot(&self) -> Result<Transaction, StorageError> {
        Ok(Transaction(match self {
            Database::Sqlite { reader, .. } => Connection::Sqlite(reader.begin().await?),
            Database::Postgres(pool) => {
                begin_whole(pool, Some("BEGIN ISOLATION LEVEL REPEATABLE READ READ ONLY")).await?
            }
        }))
    }

    /// To write. SQLite's writers take turns here, so none ever meets a locked database. PostgreSQL's go side by side:
    /// who changes a home or what is in it locks its row first (`homes::lock`), then jobs, then clips, then changes;
    /// in this order nobody waits in a circle.
    pub async fn begin(&self) -> Result<Transaction, StorageError> {
        Ok(Transaction(match self {
            Database::Sqlite { writer, .. } => Connection::Sqlite(writer.begin().await?),
            Database::Postgres(pool) => begin_whole(pool, None).await?,
        }))
    }

    /// Hears what other processes tell; none where there is but this one.
    pub async fn listener(&self) -> Result<Option<PgListener>, StorageError> {
        Ok(match self {
            Database::Sqlite { .. } => None,
            Database::Postgres(pool) => Some(PgListener::connect_with(pool).await?),
        })
    }

    /// Whether other processes may be at work on it.
    pub fn is_shared(&self) -> bool {
        matches!(self, Database::Postgres(_))
    }

    pub fn name(&self) -> &'static str {
        match self {
            Database::Sqlite { .. } => "sqlite",
            Database::Postgres(_) => "postgresql",
        }
    }

    pub async fn close(&self) {
        match self {
            Database::Sqlite { writer, reader } => {
                reader.close().await;
                writer.close().await;
            }
            Database::Postgres(pool) => pool.close().await,
        }
    }
}
