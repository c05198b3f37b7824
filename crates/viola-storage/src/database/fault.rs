//! Classes of database errors.

use sqlx::error::DatabaseError;
use sqlx::sqlite::SqliteError;

/// SQLSTATE of PostgreSQL for "cached plan must not change result type": a newer process added a column.
const OLD_STATEMENT: &str = "0A000";

/// Class of a database error, which decides whether a retry may help.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DatabaseFault {
    /// The disk is full.
    Full,
    /// The operating system failed: I/O, memory, file descriptors.
    System,
    /// The connection was lost, a lock was not granted, or the transaction had to give way to another one.
    Passing,
    /// The file is damaged, or is no database.
    Damaged,
    /// A retry would fail too.
    Lasting,
}

impl DatabaseFault {
    pub fn of(error: &sqlx::Error) -> DatabaseFault {
        use sqlx::Error as E;
        match error {
            E::Database(error) => DatabaseFault::of_answer(error.as_ref()),
            E::Io(_) | E::Tls(_) | E::Protocol(_) | E::PoolClosed | E::PoolTimedOut | E::WorkerCrashed => {
                DatabaseFault::Passing
            }
            _ => DatabaseFault::Lasting,
        }
    }

    /// Returns whether a prepared statement is of before its tables changed.
    pub fn is_of_old_statement(error: &sqlx::Error) -> bool {
        error.as_database_error().and_then(|error| error.code()).is_some_and(|code| code == OLD_STATEMENT)
    }

    fn of_answer(error: &dyn DatabaseError) -> DatabaseFault {
        let code = error.code().unwrap_or_default();
        match error.try_downcast_ref::<SqliteError>() {
            Some(_) => DatabaseFault::of_sqlite(code.parse().unwrap_or_default()),
            None => DatabaseFault::of_postgres(&code),
        }
    }

    /// Classifies a result code of SQLite, whose low byte is the primary code.
    fn of_sqlite(code: i32) -> DatabaseFault {
        match code & 0xff {
            // SQLITE_FULL
            13 => DatabaseFault::Full,
            // SQLITE_NOMEM, SQLITE_READONLY, SQLITE_IOERR, SQLITE_CANTOPEN
            7 | 8 | 10 | 14 => DatabaseFault::System,
            // SQLITE_CORRUPT, SQLITE_NOTADB
            11 | 26 => DatabaseFault::Damaged,
            // SQLITE_BUSY, SQLITE_LOCKED, SQLITE_INTERRUPT, SQLITE_PROTOCOL
            5 | 6 | 9 | 15 => DatabaseFault::Passing,
            _ => DatabaseFault::Lasting,
        }
    }

    /// Classifies an SQLSTATE, whose first two characters are the class.
    fn of_postgres(code: &str) -> DatabaseFault {
        match (code, code.get(..2).unwrap_or_default()) {
            // disk_full
            ("53100", _) => DatabaseFault::Full,
            // Insufficient resources, system error.
            (_, "53" | "58") => DatabaseFault::System,
            // lock_not_available; read_only_sql_transaction, as on a standby after a failover; connection lost, transaction
            // rolled back, operator intervention.
            ("55P03" | "25006" | OLD_STATEMENT, _) | (_, "08" | "40" | "57") => DatabaseFault::Passing,
            _ => DatabaseFault::Lasting,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_of_sqlite_have_their_classes() {
        // SQLITE_IOERR_WRITE, SQLITE_IOERR_NOMEM, SQLITE_BUSY_SNAPSHOT, SQLITE_CONSTRAINT_FOREIGNKEY
        let classes = [
            (13, DatabaseFault::Full),
            (778, DatabaseFault::System),
            (3082, DatabaseFault::System),
            (7, DatabaseFault::System),
            (8, DatabaseFault::System),
            (5, DatabaseFault::Passing),
            (517, DatabaseFault::Passing),
            (6, DatabaseFault::Passing),
            (787, DatabaseFault::Lasting),
            (1, DatabaseFault::Lasting),
        ];
        for (code, class) in classes {
            assert_eq!(DatabaseFault::of_sqlite(code), class, "{code}");
        }
    }

    #[test]
    fn codes_of_postgres_have_their_classes() {
        let classes = [
            ("53100", DatabaseFault::Full),
            ("53200", DatabaseFault::System),
            ("58030", DatabaseFault::System),
            ("40001", DatabaseFault::Passing),
            ("57P01", DatabaseFault::Passing),
            ("55P03", DatabaseFault::Passing),
            ("25006", DatabaseFault::Passing),
            ("0A000", DatabaseFault::Passing),
            ("55000", DatabaseFault::Lasting),
            ("23503", DatabaseFault::Lasting),
            ("", DatabaseFault::Lasting),
        ];
        for (code, class) in classes {
            assert_eq!(DatabaseFault::of_postgres(code), class, "{code}");
        }
    }
}
