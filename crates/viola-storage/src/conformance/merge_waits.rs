//! The time that a merge waits for clips that are queued or running.

use super::home_maps::{current, due, finish, merge, two_aligned};
use super::*;
use crate::database::query;
use viola_testing::postgres::try_execute;

const HOUR: i64 = 3600;

on_every_back_end!(
    a_home_that_never_stops_uploading_is_merged,
    a_removed_clip_leaves_the_map_of_a_home_that_never_stops_uploading,
    a_new_lidar_map_takes_no_clip_out_of_the_map_for_hours,
    a_first_map_waits_for_clips_that_a_new_lidar_map_queued,
    a_map_whose_clips_rest_after_faults_is_not_emptied,
    a_map_waits_two_hours_for_its_clip_that_meets_faults,
    a_merge_waits_no_longer_after_the_clock_was_set_back,
    a_change_of_an_earlier_version_waits_for_the_clips_of_the_map,
    a_map_keeps_its_clips_while_no_process_runs,
);

/// Runs the next job, whose clip gets a pose; returns the clip.
async fn align_at(storage: &Storage, seconds: i64) -> Uuid {
    super::home_maps::align_at(storage, AlignmentState::Aligned, seconds).await
}

/// Runs the next job, which meets a fault of the service; returns its clip.
async fn fault_at(storage: &Storage, seconds: i64) -> Uuid {
    let held = storage.claim(LEASE, at(seconds)).await.unwrap().expect("a job is due");
    assert!(end_attempt(storage, &held, AttemptEnd::Fault(Fault::Storage), seconds).await);
    held.job.clip
}

async fn merge_at(storage: &Storage, seconds: i64) {
    merge(storage, b"tile", seconds).await;
}

async fn clips_in_map(storage: &Storage, home: &HomeId) -> Vec<Uuid> {
    current(storage, home).await.clips.iter().map(|placed| placed.clip).collect()
}

fn members_of(claim: &MergeClaim) -> Vec<Uuid> {
    claim.members.iter().map(|member| member.clip).collect()
}

async fn a_home_that_never_stops_uploading_is_merged(storage: Storage) {
    // The home is due from second 100 on.
    let (home, clips) = two_aligned(&storage).await;
    let third = add(&storage, &home, b"third").await.id;
    assert!(due(&storage, 699).await.is_none(), "a clip is on its way");
    let claim = due(&storage, 700).await.expect("the home is due for ten minutes");
    assert_eq!(align_at(&storage, 705).await, third);
    let fourth = add(&storage, &home, b"fourth").await.id;
    assert!(finish(&storage, &claim, b"two", 710).await);
    assert_eq!(clips_in_map(&storage, &home).await, clips);
    // The answer during the merge waits for the next one, which follows no sooner.
    for seconds in [711, 1309] {
        assert!(due(&storage, seconds).await.is_none(), "{seconds}");
    }
    merge_at(&storage, 1310).await;
    assert_eq!(clips_in_map(&storage, &home).await, [clips[0], clips[1], third]);
    assert!(due(&storage, 3000).await.is_none(), "the map has every answer");
    assert_eq!(align_at(&storage, 3000).await, fourth);
    merge_at(&storage, 3001).await;
    assert_eq!(clips_in_map(&storage, &home).await, [clips[0], clips[1], third, fourth]);
}

async fn a_removed_clip_leaves_the_map_of_a_home_that_never_stops_uploading(storage: Storage) {
    let (home, clips) = two_aligned(&storage).await;
    merge_at(&storage, 110).await;
    add(&storage, &home, b"third").await;
    storage.delete_clip(&home, clips[0], |_| true, at(200)).await.unwrap();
    assert!(due(&storage, 799).await.is_none(), "a clip is on its way");
    let claim = due(&storage, 800).await.expect("the home is due for ten minutes");
    assert_eq!(members_of(&claim), [clips[1]]);
}

async fn a_new_lidar_map_takes_no_clip_out_of_the_map_for_hours(storage: Storage) {
    let (home, clips) = two_aligned(&storage).await;
    merge_at(&storage, 110).await;
    // Put at second 0.
    put_map(&storage, &home, b"new map").await;
    for seconds in [700, HOUR, 15 * HOUR - 1] {
        assert!(due(&storage, seconds).await.is_none(), "{seconds}");
    }
    assert_eq!(clips_in_map(&storage, &home).await, clips);
    let claim = due(&storage, 15 * HOUR).await.expect("nothing is waited for that long");
    assert!(claim.has_new_lidar_map() && claim.members.is_empty());
}

async fn a_first_map_waits_for_clips_that_a_new_lidar_map_queued(storage: Storage) {
    // The home is due from second 100 on, and no worker had time for the merge.
    let (home, clips) = two_aligned(&storage).await;
    let new = new_lidar_map(LevelName::MAIN, arrived(&storage, b"new map").await);
    storage.put_lidar_map(&home, new, None, |_| true, at(900)).await.unwrap();
    assert!(due(&storage, 901).await.is_none(), "the first map would be empty");
    for _ in &clips {
        align_at(&storage, 901).await;
    }
    let claim = due(&storage, 902).await.expect("the home is due");
    assert_eq!(members_of(&claim), clips);
}

async fn a_map_whose_clips_rest_after_faults_is_not_emptied(storage: Storage) {
    let (home, clip) = one_job(&storage).await;
    align_at(&storage, 100).await;
    merge_at(&storage, 110).await;
    put_map(&storage, &home, b"new map").await;
    let mut now_s = 200;
    // Two hours are over at the last one.
    for pause_s in [5, 10, 20, 40, 80, 160, 320, 640, 1280, 1800, 1800, 1800, 1800] {
        assert_eq!(fault_at(&storage, now_s).await, clip.id);
        assert!(due(&storage, now_s).await.is_none(), "{pause_s}");
        now_s += pause_s;
    }
    align_at(&storage, now_s).await;
    let claim = due(&storage, now_s + 60).await.expect("the home is due");
    assert_eq!(members_of(&claim), [clip.id]);
}

async fn a_map_waits_two_hours_for_its_clip_that_meets_faults(storage: Storage) {
    let (home, clips) = two_aligned(&storage).await;
    merge_at(&storage, 110).await;
    storage.align_clip(&home, clips[1], at(200)).await.unwrap();
    let mut now_s = 200;
    for pause_s in [5, 10, 20, 40, 80, 160, 320, 640, 1280, 1800, 1800, 1800] {
        assert_eq!(fault_at(&storage, now_s).await, clips[1]);
        assert!(due(&storage, now_s).await.is_none(), "{pause_s}");
        now_s += pause_s;
    }
    // The next attempt is at second 8155.
    assert!(due(&storage, 200 + 2 * HOUR - 1).await.is_none(), "an outage may last as long");
    let claim = due(&storage, 200 + 2 * HOUR).await.expect("the other clip keeps its map");
    assert_eq!(members_of(&claim), [clips[0]]);
}

async fn a_merge_waits_no_longer_after_the_clock_was_set_back(storage: Storage) {
    let (home, clips) = two_aligned(&storage).await;
    add(&storage, &home, b"third").await;
    storage.claim(LEASE, at(100)).await.unwrap().expect("a job is due");
    assert!(due(&storage, 101).await.is_none(), "a clip is on its way");
    let claim = due(&storage, 100 - HOUR).await.expect("the home is due since a clock that was ahead");
    assert_eq!(members_of(&claim), clips);
}

async fn a_change_of_an_earlier_version_waits_for_the_clips_of_the_map(storage: Storage) {
    let (home, clips) = two_aligned(&storage).await;
    merge_at(&storage, 110).await;
    // Its processes know no time since which a map is due.
    let queue = "UPDATE clips SET state = 'queued', result_key = NULL WHERE id = $1";
    execute(&storage, queue, &clips[0].to_string()).await;
    let mark = "UPDATE homes SET map_wanted = map_wanted + 1 WHERE id = $1";
    execute(&storage, mark, home.key()).await;
    assert!(due(&storage, 20 * HOUR).await.is_none(), "the last merge was long ago, and this change was not");
}

async fn a_map_keeps_its_clips_while_no_process_runs(storage: Storage) {
    let (home, clips) = two_aligned(&storage).await;
    merge_at(&storage, 110).await;
    put_map(&storage, &home, b"new map").await;
    storage.begin_waits_again(at(20 * HOUR)).await.unwrap();
    assert!(due(&storage, 20 * HOUR + 700).await.is_none(), "its clips are queued");
    for _ in &clips {
        align_at(&storage, 20 * HOUR + 700).await;
    }
    let claim = due(&storage, 20 * HOUR + 701).await.expect("the home is due");
    assert_eq!(members_of(&claim), clips);
}

#[tokio::test]
async fn a_start_lets_the_waits_begin_again() {
    let folder = tempfile::tempdir().unwrap();
    let storage = in_folder(folder.path()).await;
    let (home, _) = two_aligned(&storage).await;
    execute(&storage, "UPDATE homes SET map_due_since = 0 WHERE id = $1", home.key()).await;
    storage.close().await;
    drop(storage);
    let storage = in_folder(folder.path()).await;
    let since = query("SELECT map_due_since FROM homes");
    let since = since.fetch_one(&mut storage.database.reader().await.unwrap()).await.unwrap();
    assert!(since.number("map_due_since").unwrap() > 0);
    storage.close().await;
}

/// A new LiDAR map is committed while the claim reads the clips, so only a later statement sees that they are queued.
#[tokio::test]
async fn a_lidar_map_that_arrives_during_a_claim_is_waited_for() {
    let Some(postgres) = Schema::new().await else { return };
    let folder = tempfile::tempdir().unwrap();
    let storage = on(&postgres, folder.path(), None).await;
    let (home, clip) = one_job(&storage).await;
    align_at(&storage, 100).await;
    // The claim reads the job of a clip that rests, and this read waits for a lock.
    add(&storage, &home, b"second").await;
    let pause = query("UPDATE jobs SET run_after = $1 WHERE state = 'queued'");
    storage.database.execute(pause.bind(at(HOUR).as_millisecond())).await.unwrap();
    for statement in [
        "CREATE FUNCTION gate() RETURNS BOOLEAN LANGUAGE plpgsql AS $$ BEGIN
            PERFORM pg_advisory_xact_lock_shared(hashtext(current_schema())); RETURN TRUE; END $$",
        "ALTER TABLE jobs RENAME TO all_jobs",
        "CREATE VIEW jobs AS SELECT * FROM all_jobs WHERE gate()",
    ] {
        try_execute(&postgres.url(), statement.to_owned()).await.unwrap();
    }
    let mut put = storage.database.begin().await.unwrap();
    let gate = query("SELECT pg_advisory_xact_lock(hashtext(current_schema()))");
    gate.execute(&mut put).await.unwrap();
    let mut claiming = std::pin::pin!(storage.claim_merge("", LEASE, at(200)));
    let waited = tokio::time::timeout(Duration::from_millis(500), &mut claiming).await;
    assert!(waited.is_err(), "the claim reads the job");
    let queued = query("UPDATE clips SET state = 'queued', result_key = NULL WHERE id = $1");
    queued.bind(clip.id.to_string()).execute(&mut put).await.unwrap();
    let wanted = query("UPDATE homes SET map_wanted = map_wanted + 1 WHERE id = $1");
    wanted.bind(home.key()).execute(&mut put).await.unwrap();
    put.commit().await.unwrap();
    assert!(claiming.await.unwrap().is_none(), "the only clip with an answer is queued again");
    storage.close().await;
    postgres.remove().await;
}
