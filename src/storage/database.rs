//! The SQLite database: one connection that writes, several that read.

use super::StorageError;
use sqlx::sqlite::{
    SqliteConnectOptions, SqliteJournalMode, SqlitePool, SqlitePoolOptions, SqliteSynchronous,
};
use std::path::Path;
use std::time::Duration;

const READERS: u32 = 4;

pub(super) type Connection = sqlx::SqliteConnection;
pub(super) type Transaction = sqlx::Transaction<'static, sqlx::Sqlite>;
pub(super) type Query<'q> = sqlx::query::Query<'q, sqlx::Sqlite, sqlx::sqlite::SqliteArguments>;
pub(super) type Row = sqlx::sqlite::SqliteRow;

pub(super) struct Database {
    writer: SqlitePool,
    reader: SqlitePool,
}

impl Database {
    pub async fn open(file: &Path) -> Result<Database, StorageError> {
        // FULL: a commit that gates an acknowledgement has reached the disk.
        let options = SqliteConnectOptions::new()
            .filename(file)
            .create_if_missing(true)
            .journal_mode(SqliteJournalMode::Wal)
            .synchronous(SqliteSynchronous::Full)
            .foreign_keys(true)
            .busy_timeout(Duration::from_secs(10));
        let writer = SqlitePoolOptions::new().max_connections(1).connect_with(options.clone()).await?;
        sqlx::migrate!().run(&writer).await?;
        let reader =
            SqlitePoolOptions::new().max_connections(READERS).connect_with(options.read_only(true)).await?;
        Ok(Database { writer, reader })
    }

    pub fn reader(&self) -> &SqlitePool {
        &self.reader
    }

    /// For several reads that must agree with each other.
    pub async fn snapshot(&self) -> Result<Transaction, StorageError> {
        Ok(self.reader.begin().await?)
    }

    /// Writers take turns here, so none ever meets a locked database.
    pub async fn begin(&self) -> Result<Transaction, StorageError> {
        Ok(self.writer.begin().await?)
    }

    pub async fn close(&self) {
        self.reader.close().await;
        self.writer.close().await;
    }
}
