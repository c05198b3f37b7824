//! Words for errors of the database's driver that say too little, or nothing of what to do.

use sqlx::migrate::MigrateError;
use uuid::Uuid;

/// Returns the words for an error of the driver.
pub(super) fn of_driver(error: &sqlx::Error) -> String {
    match error {
        sqlx::Error::PoolTimedOut => {
            "no connection became free within 10 s. Either the database does not answer, or this process has too few \
             connections for its work (--database-connections, for PostgreSQL)"
                .to_owned()
        }
        sqlx::Error::PoolClosed => "the process ends, and its connections are closed".to_owned(),
        other => other.to_string(),
    }
}

/// Returns the words for an error of a migration.
pub(super) fn of_migration(error: &MigrateError) -> String {
    match error {
        MigrateError::VersionMismatch(number) => format!(
            "migration {number} was applied with other statements than this program has, so another build made the tables. \
             Start that build again, or restore a backup of before it and start this one"
        ),
        MigrateError::Dirty(number) => {
            format!("migration {number} was cut off halfway. Restore a backup of before it and start again")
        }
        MigrateError::Execute(error) | MigrateError::ExecuteMigration(error, _) => of_driver(error),
        other => other.to_string(),
    }
}

/// Returns what is known of the store of a database.
pub(super) fn of_own_store(own: Option<&Uuid>) -> String {
    own.map_or("this database has no files yet".to_owned(), |own| {
        format!("the store of this database has {own}")
    })
}

/// Returns how a database and a store that differ are put together.
pub(super) fn of_same_store(own: Option<&Uuid>) -> String {
    own.map_or("delete this file".to_owned(), |own| format!("write {own} into this file"))
}
