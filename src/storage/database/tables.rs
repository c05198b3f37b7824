//! The tables: one set of migrations for both databases.

use sha2::{Digest, Sha384};
use sqlx::migrate::{Migration, Migrator};
use std::borrow::Cow;

static MIGRATIONS: Migrator = sqlx::migrate!();

/// Tables of a newer version are tolerated: they have what this one knows, and more.
fn tolerant(migrations: Cow<'static, [Migration]>) -> Migrator {
    Migrator { migrations, ignore_missing: true, ..Migrator::DEFAULT }
}

pub fn sqlite() -> Migrator {
    tolerant(MIGRATIONS.migrations.clone())
}

/// Text is compared byte by byte, as SQLite does: pages of lists go by it, and it keeps indexes of ids small and fast
/// whatever language the database was made for. Several processes that start at once take turns.
pub fn postgres() -> Migrator {
    let migrations = MIGRATIONS.iter().map(|migration| {
        let sql = migration.sql.as_str().replace(" TEXT", " TEXT COLLATE \"C\"");
        Migration {
            checksum: Cow::Owned(Sha384::digest(sql.as_bytes()).to_vec()),
            sql: sqlx::SqlSafeStr::into_sql_str(sqlx::AssertSqlSafe(sql)),
            ..migration.clone()
        }
    });
    tolerant(Cow::Owned(migrations.collect()))
}
