//! A connection, and a transaction on it.
//!
//! SQLite rolls a transaction back by itself when the disk is full, memory runs out or I/O fails. The driver
//! counts transactions and does not see this: its next ones are savepoints of one that is never committed.
//! SQLite's transactions therefore begin and end here by plain statements: `BEGIN` fails within a
//! transaction, and `COMMIT` without one. A connection returns to its pool only if every statement on it
//! succeeded. Any other one is closed, which rolls back; the pool opens a new one. A reader whose caller left returns, too:
//! SQLite ends its statement, and opening takes milliseconds of a request of somebody else.

use super::fault::DatabaseFault;
use super::health::WriteHealth;
use crate::StorageError;
use sqlx::pool::PoolConnection;
use sqlx::{Connection as _, PgConnection, Postgres, Sqlite, SqliteConnection, SqlitePool};
use std::ops::{Deref, DerefMut};
use std::sync::Arc;

/// A connection, in a transaction or not. After a failed or cancelled statement it refuses all others.
pub struct Connection {
    /// `None` once the transaction has ended.
    link: Option<Link>,
    state: State,
    /// True if a statement changed rows.
    has_changed: bool,
    /// Set for connections that write.
    health: Option<Arc<WriteHealth>>,
}

#[derive(Clone, Copy, PartialEq)]
enum State {
    /// All statements so far succeeded.
    Sound,
    /// A statement runs, or its caller left.
    Running,
    Failed,
}

enum Link {
    Sqlite {
        connection: PoolConnection<Sqlite>,
        in_transaction: bool,
    },
    Postgres(sqlx::Transaction<'static, Postgres>),
    /// For a single read, which needs no transaction.
    PostgresAlone(PoolConnection<Postgres>),
}

/// A connection whose statements take effect together, with [`Transaction::commit`], or not at all.
pub struct Transaction(pub(super) Connection);

pub(super) enum Executor<'c> {
    Sqlite(&'c mut SqliteConnection),
    Postgres(&'c mut PgConnection),
}

impl Connection {
    fn new(link: Link, health: Option<Arc<WriteHealth>>) -> Connection {
        Connection { link: Some(link), state: State::Sound, has_changed: false, health }
    }

    /// Returns a connection for single statements.
    pub(super) fn of_sqlite(connection: PoolConnection<Sqlite>) -> Connection {
        Connection::new(Link::Sqlite { connection, in_transaction: false }, None)
    }

    /// Returns a connection for single statements.
    pub(super) fn of_postgres(connection: PoolConnection<Postgres>) -> Connection {
        Connection::new(Link::PostgresAlone(connection), None)
    }

    /// Returns the connection for one statement, whose result goes to [`Connection::ended`]. A cancelled
    /// statement leaves the connection running.
    pub(super) fn executor(&mut self) -> Result<Executor<'_>, sqlx::Error> {
        let is_sound = self.state == State::Sound;
        if is_sound {
            self.state = State::Running;
        }
        match &mut self.link {
            Some(link) if is_sound => Ok(match link {
                Link::Sqlite { connection, .. } => Executor::Sqlite(connection),
                Link::Postgres(transaction) => Executor::Postgres(transaction),
                Link::PostgresAlone(connection) => Executor::Postgres(connection),
            }),
            _ => Err(undone()),
        }
    }

    /// Records the result of a statement.
    pub(super) async fn ended<T>(&mut self, result: Result<T, sqlx::Error>) -> Result<T, sqlx::Error> {
        match &result {
            Ok(_) => self.state = State::Sound,
            Err(error) => {
                self.state = State::Failed;
                note(self.health.as_deref(), error);
            }
        }
        if result.as_ref().err().is_some_and(DatabaseFault::is_of_old_statement) {
            self.forget_statements().await;
        }
        result
    }

    /// Forgets the prepared statements of PostgreSQL. The driver keeps one whose tables have changed, so each use of it on
    /// this connection would fail.
    async fn forget_statements(&mut self) {
        let connection: &mut PgConnection = match &mut self.link {
            Some(Link::Postgres(transaction)) => transaction,
            Some(Link::PostgresAlone(connection)) => connection,
            _ => return,
        };
        if let Err(error) = connection.clear_cached_statements().await {
            tracing::warn!(%error, "the statements of a connection could not be forgotten");
        }
    }

    pub(super) fn changed(&mut self, rows: u64) {
        self.has_changed |= rows > 0;
    }

    async fn commit(&mut self) -> Result<(), sqlx::Error> {
        self.state = State::Running;
        match &mut self.link {
            Some(Link::Sqlite { connection, in_transaction: in_transaction @ true }) => {
                sqlx::query("COMMIT").execute(&mut **connection).await?;
                *in_transaction = false;
                Ok(())
            }
            Some(Link::Postgres(_)) => match self.link.take() {
                Some(Link::Postgres(transaction)) => transaction.commit().await,
                _ => Err(undone()),
            },
            _ => Err(undone()),
        }
    }

    /// Returns whether other transactions may write at the same time, as on PostgreSQL.
    pub fn is_shared(&self) -> bool {
        !matches!(self.link, Some(Link::Sqlite { .. }))
    }
}

impl Drop for Connection {
    fn drop(&mut self) {
        // The driver of PostgreSQL rolls back by itself, and tests a connection before it is used again.
        let Some(Link::Sqlite { mut connection, in_transaction }) = self.link.take() else { return };
        let is_of_reader = self.health.is_none();
        if self.state == State::Failed || self.state == State::Running && !is_of_reader {
            connection.close_on_drop();
        } else if in_transaction {
            tokio::spawn(async move {
                if let Err(error) = sqlx::query("ROLLBACK").execute(&mut *connection).await {
                    tracing::warn!(%error, "a transaction could not be rolled back; its connection is closed");
                    connection.close_on_drop();
                }
            });
        }
    }
}

impl Transaction {
    /// Begins on SQLite by a statement that fails if the connection is already in a transaction.
    pub(super) async fn begin_sqlite(
        pool: &SqlitePool,
        statement: &'static str,
        health: Option<Arc<WriteHealth>>,
    ) -> Result<Transaction, sqlx::Error> {
        let connection = pool.acquire().await;
        let connection = connection.inspect_err(|error| note(health.as_deref(), error))?;
        let mut begun = Connection::new(Link::Sqlite { connection, in_transaction: false }, health);
        begun.state = State::Running;
        if let Some(Link::Sqlite { connection, in_transaction }) = &mut begun.link {
            // The statement takes effect even if the caller leaves now.
            *in_transaction = true;
            let ran = sqlx::query(statement).execute(&mut **connection).await;
            *in_transaction = ran.is_ok();
            begun.ended(ran).await?;
        }
        Ok(Transaction(begun))
    }

    pub(super) fn of_postgres(
        transaction: sqlx::Transaction<'static, Postgres>,
        health: Option<Arc<WriteHealth>>,
    ) -> Transaction {
        Transaction(Connection::new(Link::Postgres(transaction), health))
    }

    /// Commits. After [`StorageError::Unsettled`] the statements may have taken effect; after any other error
    /// they have not, and never will.
    pub async fn commit(mut self) -> Result<(), StorageError> {
        let connection = &mut self.0;
        if connection.state != State::Sound {
            return Err(undone().into());
        }
        let committed = connection.commit().await;
        match connection.ended(committed).await {
            Ok(()) => {
                if let Some(health) = connection.health.as_ref().filter(|_| connection.has_changed) {
                    health.committed();
                }
                Ok(())
            }
            Err(error)
                if matches!(DatabaseFault::of(&error), DatabaseFault::Full | DatabaseFault::Lasting) =>
            {
                Err(error.into())
            }
            Err(error) => Err(StorageError::Unsettled(error)),
        }
    }
}

fn note(health: Option<&WriteHealth>, error: &sqlx::Error) {
    if let Some(health) = health {
        health.failed(error);
    }
}

/// Returns the error of a statement or commit after one that failed or was cancelled. The database may have
/// rolled the transaction back by then, so each later statement would be a transaction of its own.
fn undone() -> sqlx::Error {
    sqlx::Error::Protocol("the transaction was rolled back after a statement in it failed".to_owned())
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
