//! The tables: one set of migrations for both databases.

use super::LOCK_TIMEOUT;
use crate::StorageError;
use sqlx::migrate::{Migrate as _, Migration, MigrationType, Migrator};
use sqlx::postgres::PgConnectOptions;
use sqlx::{AssertSqlSafe, ConnectOptions as _, Connection as _, SqlSafeStr};
use std::borrow::Cow;

/// Number, name and statements of each migration. sqlx's own macro compiles every driver twice.
const MIGRATIONS: &[(i64, &str, &str)] = &[
    (1, "service", include_str!("../../../../migrations/0001_service.sql")),
    (2, "home maps", include_str!("../../../../migrations/0002_home_maps.sql")),
    (3, "choices and changes", include_str!("../../../../migrations/0003_choices_and_changes.sql")),
    (4, "map tiles", include_str!("../../../../migrations/0004_map_tiles.sql")),
    (5, "uploads", include_str!("../../../../migrations/0005_uploads.sql")),
    (6, "many processes", include_str!("../../../../migrations/0006_many_processes.sql")),
    (7, "webhooks and deletions", include_str!("../../../../migrations/0007_webhooks_and_deletions.sql")),
    (8, "faults of jobs", include_str!("../../../../migrations/0008_faults_of_jobs.sql")),
    (9, "early poses", include_str!("../../../../migrations/0009_early_poses.sql")),
    (10, "corrections", include_str!("../../../../migrations/0010_corrections.sql")),
    (11, "levels", include_str!("../../../../migrations/0011_levels.sql")),
    (12, "sessions", include_str!("../../../../migrations/0012_sessions.sql")),
    (13, "limits", include_str!("../../../../migrations/0013_limits.sql")),
    (14, "names and coverage", include_str!("../../../../migrations/0014_names_and_coverage.sql")),
    (15, "fair merges", include_str!("../../../../migrations/0015_fair_merges.sql")),
    (16, "frames of lidar maps", include_str!("../../../../migrations/0016_frames_of_lidar_maps.sql")),
    (17, "current lidar maps", include_str!("../../../../migrations/0017_current_lidar_maps.sql")),
    (18, "merges and searches", include_str!("../../../../migrations/0018_merges_and_searches.sql")),
    (19, "feed epochs", include_str!("../../../../migrations/0019_feed_epochs.sql")),
    (20, "answers and turns", include_str!("../../../../migrations/0020_answers_and_turns.sql")),
    (21, "store identity", include_str!("../../../../migrations/0021_store_identity.sql")),
    (22, "same recordings", include_str!("../../../../migrations/0022_same_recordings.sql")),
    (23, "clips of tenants", include_str!("../../../../migrations/0023_clips_of_tenants.sql")),
    (24, "unsettled clips", include_str!("../../../../migrations/0024_unsettled_clips.sql")),
    (25, "due homes", include_str!("../../../../migrations/0025_due_homes.sql")),
];

/// Tolerates tables of a newer version: they extend those of this one.
fn migrator(sql: impl Fn(&'static str) -> Cow<'static, str>) -> Migrator {
    let migrations = MIGRATIONS.iter().map(|&(version, name, statements)| {
        let sql = AssertSqlSafe(sql(statements).into_owned()).into_sql_str();
        Migration::new(version, name.into(), MigrationType::Simple, sql, false)
    });
    Migrator { migrations: migrations.collect(), ignore_missing: true, ..Migrator::DEFAULT }
}

pub fn sqlite() -> Migrator {
    migrator(Cow::Borrowed)
}

/// Compares text byte by byte, as SQLite does: pages of lists depend on it, and it keeps indexes of ids small
/// and fast in every locale. Processes that start at once take turns.
fn postgres() -> Migrator {
    migrator(|sql| sql.replace(" TEXT", " TEXT COLLATE \"C\"").into())
}

/// Migrates PostgreSQL on a connection of its own. A process waits for another one that migrates as long as that takes; a
/// statement of a migration waits for a table only as long as any other, since all that comes later waits behind it.
pub async fn migrate_postgres(options: &PgConnectOptions) -> Result<(), StorageError> {
    let mut connection = options.clone().options([("lock_timeout", "0")]).connect().await?;
    connection.lock().await?;
    sqlx::query(AssertSqlSafe(format!("SET lock_timeout = '{LOCK_TIMEOUT}'")))
        .execute(&mut connection)
        .await?;
    // It takes the same lock once more, and releases it once.
    postgres().run_direct(None, &mut connection, false).await?;
    connection.close().await?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::str::FromStr;
    use viola_testing::postgres::Schema;

    /// A long migration of one process must not end the others, which wait for its lock.
    #[tokio::test]
    async fn a_process_waits_for_one_that_migrates() {
        let Some(schema) = Schema::new().await else { return };
        let options = PgConnectOptions::from_str(&schema.url()).unwrap();
        let mut other = options.connect().await.unwrap();
        other.lock().await.unwrap();
        let waiting =
            tokio::spawn(async move { migrate_postgres(&options.options([("lock_timeout", "1ms")])).await });
        // Longer than the timeout of its other statements.
        let waits = "SELECT COUNT(*) FROM pg_stat_activity
            WHERE application_name = current_setting('application_name') AND wait_event = 'advisory'
                AND clock_timestamp() - query_start > INTERVAL '5 milliseconds'";
        while sqlx::query_scalar::<_, i64>(waits).fetch_one(&mut other).await.unwrap() == 0 {
            assert!(!waiting.is_finished());
        }
        other.unlock().await.unwrap();
        waiting.await.unwrap().unwrap();
        schema.remove().await;
    }

    #[test]
    fn every_file_is_a_row() {
        let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../migrations");
        let files = std::fs::read_dir(folder).unwrap().map(|file| file.unwrap().file_name());
        let mut files: Vec<String> = files.map(|name| name.into_string().unwrap()).collect();
        files.sort();
        let row =
            |&(version, name, _): &(i64, &str, &str)| format!("{version:04}_{}.sql", name.replace(' ', "_"));
        assert_eq!(files, MIGRATIONS.iter().map(row).collect::<Vec<_>>());
    }
}
