//! Statements that must not read whole tables: SQLite has one writer, and all others wait for a slow one.

use super::*;
use crate::database::query;
use crate::{changes, clip_list, clips, home_maps, job_list, jobs, lidar_maps, pending_deletes, tenants};
use sqlx::AssertSqlSafe;

/// Returns the reads of a statement, which end with the index and the columns by which SQLite finds the rows.
async fn plan(storage: &Storage, statement: &str) -> Vec<String> {
    let explain = query(AssertSqlSafe(format!("EXPLAIN QUERY PLAN {statement}")));
    let rows = explain.fetch_all(&mut storage.database.reader().await.unwrap()).await.unwrap();
    let steps = rows.iter().map(|row| row.text("detail").unwrap());
    steps.filter(|step| step.starts_with("SEARCH") || step.starts_with("SCAN")).collect()
}

#[tokio::test]
async fn statements_read_their_own_rows() {
    let folder = tempfile::tempdir().unwrap();
    let storage = in_folder(folder.path()).await;
    let objects = |class: Option<&str>, of_home: Option<&str>| {
        let filter = ObjectFilter { class: class.map(str::to_owned), home: of_home.map(home) };
        home_maps::objects_statement(&filter)
    };
    let cases = [
        (
            lidar_maps::CURRENT_OF_LEVELS,
            vec!["lidar_maps_current (home_id=?)", "lidar_maps_current (home_id=? AND level=?)"],
        ),
        (lidar_maps::OF_HOME, vec!["(home_id=?)"]),
        (clips::BLOBS_OF_HOME, vec!["(home_id=?)"]),
        (home_maps::BLOBS_OF_HOME, vec!["(home_id=?)"]),
        (changes::CHANGED_HOMES, vec!["changes_by_seq (seq>?)"]),
        (pending_deletes::NEXT, vec!["(id>?)"]),
        (objects(None, None), vec!["home_objects_of_tenant (tenant=? AND (home_id,object_id)>(?,?))"]),
        (
            objects(Some("chair"), None),
            vec!["home_objects_by_class (tenant=? AND class=? AND (home_id,object_id)>(?,?))"],
        ),
        (objects(None, Some("h")), vec!["home_objects_of_tenant (tenant=? AND home_id=?)"]),
        (
            objects(Some("chair"), Some("h")),
            vec!["home_objects_by_class (tenant=? AND class=? AND home_id=?)"],
        ),
    ];
    for (statement, expected) in cases {
        let found = plan(&storage, statement).await;
        assert_eq!(found.len(), expected.len(), "{statement}: {found:?}");
        for (step, end) in found.iter().zip(expected) {
            assert!(step.starts_with("SEARCH") && step.ends_with(end), "{statement}: {step}");
        }
    }
}

#[tokio::test]
async fn the_list_of_tenants_reads_one_row_of_each() {
    let folder = tempfile::tempdir().unwrap();
    let storage = in_folder(folder.path()).await;
    let found = plan(&storage, tenants::TENANTS).await;
    // The statement scans its own lists.
    let is_list =
        |step: &str| ["SCAN last", "SCAN of_", "SCAN known"].iter().any(|list| step.starts_with(list));
    let of_tables: Vec<&String> = found.iter().filter(|step| !is_list(step)).collect();
    let tables = 6;
    assert_eq!(of_tables.len(), 2 * tables, "{found:?}");
    assert!(of_tables.iter().all(|step| step.starts_with("SEARCH")), "{of_tables:?}");
}

#[tokio::test]
async fn the_load_of_the_queue_is_one_read_of_it() {
    let folder = tempfile::tempdir().unwrap();
    let storage = in_folder(folder.path()).await;
    let found = plan(&storage, jobs::QUEUE_STATE).await;
    // The queued jobs, the running ones, and the homes that are due.
    assert_eq!(found.len(), 3, "{found:?}");
    assert!(found.iter().all(|step| step.contains("INDEX")), "{found:?}");
}

#[tokio::test]
async fn a_list_of_clips_by_state_reads_those_of_its_tenant() {
    let folder = tempfile::tempdir().unwrap();
    let storage = in_folder(folder.path()).await;
    let found = plan(&storage, clip_list::OF_TENANT).await;
    let by_state = "clips_of_tenant (<expr>=? AND (state,id)>(?,?) AND (state,id)<(?,?))";
    let of_states = found.iter().filter(|step| step.ends_with(by_state)).count();
    assert_eq!(of_states, ClipState::ALL.len(), "{found:?}");
    assert!(!found.iter().any(|step| step.starts_with("SCAN clips")), "{found:?}");
}

#[tokio::test]
async fn a_search_for_a_merge_reads_no_clip_that_has_settled() {
    let folder = tempfile::tempdir().unwrap();
    let storage = in_folder(folder.path()).await;
    let found = plan(&storage, home_maps::CLAIM_LATER).await;
    assert!(found.iter().all(|step| step.starts_with("SEARCH")), "{found:?}");
    let of_clips: Vec<&String> = found.iter().filter(|step| step.starts_with("SEARCH clips")).collect();
    // Those of the map first, then all.
    let ends = ["COVERING INDEX clips_unsettled_in_map (", "COVERING INDEX clips_unsettled ("];
    assert_eq!(of_clips.len(), ends.len(), "{found:?}");
    assert!(of_clips.iter().zip(ends).all(|(step, index)| step.contains(index)), "{found:?}");
}

/// PostgreSQL uses the generic plan for any values if it expects the plans of the values to cost as much.
#[tokio::test]
async fn a_list_of_jobs_reads_its_page_with_the_generic_plan_too() {
    let Some(postgres) = Schema::new().await else { return };
    let folder = tempfile::tempdir().unwrap();
    let storage = on(&postgres, folder.path(), None).await;
    one_job(&storage).await;
    let mut transaction = storage.database.begin().await.unwrap();
    let prepare = format!("PREPARE page AS {}", job_list::OF_TENANT);
    for statement in [
        "INSERT INTO jobs (id, clip_id, lidar_map_id, state, progress, attempts, max_attempts, run_after, fence, version,
            created_at, updated_at, tenant)
        SELECT id || n, clip_id, lidar_map_id, 'failed', 1, 1, 1, 0, 0, 0, 0, 0, 'other'
        FROM jobs, generate_series(1, 80000) AS n",
        "ANALYZE jobs",
        "SET LOCAL plan_cache_mode = force_generic_plan",
        prepare.as_str(),
    ] {
        query(AssertSqlSafe(statement.to_owned())).execute(&mut transaction).await.unwrap();
    }
    let explain = query("EXPLAIN EXECUTE page ('default', '~', 200, 'queued', NULL, NULL, NULL, NULL)");
    let rows = explain.fetch_all(&mut transaction).await.unwrap();
    let steps: Vec<String> = rows.iter().map(|row| row.text("QUERY PLAN").unwrap()).collect();
    let reads_all =
        |step: &String| step.contains("Seq Scan on jobs") || step.contains("Backward using jobs_pkey");
    assert!(!steps.iter().any(reads_all), "{steps:#?}");
    drop(transaction);
    postgres.remove().await;
}
