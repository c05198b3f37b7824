//! The tables: one set of migrations for both databases.

use sqlx::migrate::{Migration, MigrationType, Migrator};
use sqlx::{AssertSqlSafe, SqlSafeStr};
use std::borrow::Cow;

/// Number, name and statements of each migration. sqlx's own macro compiles every driver twice.
const MIGRATIONS: &[(i64, &str, &str)] = &[
    (1, "service", include_str!("../../../migrations/0001_service.sql")),
    (2, "home maps", include_str!("../../../migrations/0002_home_maps.sql")),
    (3, "choices and changes", include_str!("../../../migrations/0003_choices_and_changes.sql")),
    (4, "map tiles", include_str!("../../../migrations/0004_map_tiles.sql")),
    (5, "uploads", include_str!("../../../migrations/0005_uploads.sql")),
    (6, "many processes", include_str!("../../../migrations/0006_many_processes.sql")),
    (7, "webhooks and deletions", include_str!("../../../migrations/0007_webhooks_and_deletions.sql")),
    (8, "faults of jobs", include_str!("../../../migrations/0008_faults_of_jobs.sql")),
    (9, "early poses", include_str!("../../../migrations/0009_early_poses.sql")),
    (10, "corrections", include_str!("../../../migrations/0010_corrections.sql")),
    (11, "levels", include_str!("../../../migrations/0011_levels.sql")),
    (12, "sessions", include_str!("../../../migrations/0012_sessions.sql")),
    (13, "limits", include_str!("../../../migrations/0013_limits.sql")),
    (14, "names and coverage", include_str!("../../../migrations/0014_names_and_coverage.sql")),
    (15, "fair merges", include_str!("../../../migrations/0015_fair_merges.sql")),
    (16, "frames of lidar maps", include_str!("../../../migrations/0016_frames_of_lidar_maps.sql")),
    (17, "current lidar maps", include_str!("../../../migrations/0017_current_lidar_maps.sql")),
    (18, "merges and searches", include_str!("../../../migrations/0018_merges_and_searches.sql")),
    (19, "feed epochs", include_str!("../../../migrations/0019_feed_epochs.sql")),
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
pub fn postgres() -> Migrator {
    migrator(|sql| sql.replace(" TEXT", " TEXT COLLATE \"C\"").into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_file_is_a_row() {
        let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("migrations");
        let files = std::fs::read_dir(folder).unwrap().map(|file| file.unwrap().file_name());
        let mut files: Vec<String> = files.map(|name| name.into_string().unwrap()).collect();
        files.sort();
        let row =
            |&(version, name, _): &(i64, &str, &str)| format!("{version:04}_{}.sql", name.replace(' ', "_"));
        assert_eq!(files, MIGRATIONS.iter().map(row).collect::<Vec<_>>());
    }
}
