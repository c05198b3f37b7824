//! The changes feed: a copy that follows it equals the stored state.

use super::*;
use crate::changes as feed;
use crate::database::query;
use sqlx::AssertSqlSafe;
use std::collections::BTreeMap;
use viola_geometry::Pose2;

on_every_back_end!(
    every_change_is_told_once_and_in_order,
    a_copy_that_follows_is_whole,
    a_home_goes_with_all_that_was_in_it,
    what_was_not_committed_is_not_told,
    what_was_deleted_is_told_for_a_month,
    a_cursor_ends_where_deletions_may_be_missed,
    a_restored_database_is_told_from_the_one_before,
    a_page_without_news_stays_the_same_for_an_hour,
    a_feed_begins_with_what_was_there_before_it,
    homes_that_changed_are_named,
);

const DAY_S: i64 = 24 * 3600;

async fn part(storage: &Storage, after: Option<ChangesCursor>, limit: u32, seconds: i64) -> Changes {
    storage.changes(&Tenant::default(), after, limit, at(seconds)).await.unwrap()
}

fn shown(change: &Change) -> String {
    let kind = serde_json::to_value(change.kind).unwrap();
    let mut text = format!("{} {}", change.home, kind.as_str().unwrap());
    if let Some(revision) = change.revision {
        text += &format!(" {revision}");
    }
    if let Some(state) = change.state {
        text += &format!(" {}", state.name());
    }
    if change.deleted {
        text += " deleted";
    }
    text
}

/// Returns the changes since the cursor, and moves it to the end.
async fn news(storage: &Storage, cursor: &mut Option<ChangesCursor>, seconds: i64) -> Vec<String> {
    let changes = part(storage, *cursor, 100, seconds).await;
    assert!(!changes.more);
    assert!(changes.items.is_sorted_by(|a, b| a.seq < b.seq));
    *cursor = Some(changes.next);
    changes.items.iter().map(shown).collect()
}

async fn homes_that_changed_are_named(storage: Storage) {
    let acme: Tenant = "acme".parse().unwrap();
    let homes = [home("h"), home("still"), acme.home(&home("h"))];
    for id in &homes {
        storage.put_home(id, None, |_| true, at(0)).await.unwrap();
    }
    let before = storage.last_change().await.unwrap();
    assert!(storage.changed_homes(before).await.unwrap().is_empty());
    for (id, name) in [(&homes[0], "a"), (&homes[2], "b"), (&homes[0], "c")] {
        storage.put_home(id, Some(name), |_| true, at(1)).await.unwrap();
    }
    let after = storage.last_change().await.unwrap();
    let changed = storage.changed_homes(before).await.unwrap();
    assert_eq!(changed.len(), 2);
    assert!(changed.contains(&homes[0]) && changed.contains(&homes[2]));
    assert!(storage.changed_homes(after).await.unwrap().is_empty());
}

async fn every_change_is_told_once_and_in_order(storage: Storage) {
    let (id, mut cursor) = (home("h"), None);
    assert!(news(&storage, &mut cursor, 0).await.is_empty());
    storage.put_home(&id, None, |_| true, at(0)).await.unwrap();
    assert_eq!(news(&storage, &mut cursor, 0).await, ["h home"]);
    assert!(news(&storage, &mut cursor, 0).await.is_empty());
    storage.put_home(&id, None, |_| true, at(0)).await.unwrap();
    assert!(news(&storage, &mut cursor, 0).await.is_empty(), "the same name is no change");
    storage.put_home(&id, Some("name"), |_| true, at(0)).await.unwrap();
    assert_eq!(news(&storage, &mut cursor, 0).await, ["h home"]);
    let clip = add(&storage, &id, b"clip").await;
    assert_eq!(news(&storage, &mut cursor, 0).await, ["h clip uploaded"]);
    put_map(&storage, &id, b"map").await;
    assert_eq!(news(&storage, &mut cursor, 0).await, ["h clip queued", "h lidar_map 1"]);
    put_map(&storage, &id, b"map").await;
    assert!(news(&storage, &mut cursor, 0).await.is_empty(), "the same map is no change");

    let claim = storage.claim(LEASE, at(1)).await.unwrap().unwrap();
    assert_eq!(news(&storage, &mut cursor, 1).await, ["h clip aligning"]);
    storage.heartbeat(&claim, &job_progress(None, 0.5), LEASE, at(2)).await.unwrap();
    assert!(news(&storage, &mut cursor, 2).await.is_empty(), "progress is the job's");
    assert!(end_attempt(&storage, &claim, answer(AlignmentState::Aligned), 3).await);
    assert_eq!(news(&storage, &mut cursor, 3).await, ["h clip aligned"]);
    let pose = Chosen::Pose(LevelName::MAIN, Pose2::IDENTITY);
    storage.choose(&id, clip.id, pose, |_| true, at(4)).await.unwrap();
    assert_eq!(news(&storage, &mut cursor, 4).await, ["h clip aligned"]);
    storage.choose(&id, clip.id, pose, |_| true, at(5)).await.unwrap();
    assert!(news(&storage, &mut cursor, 5).await.is_empty(), "the same choice is no change");
    storage.withdraw_choice(&id, clip.id, |_| true, at(6)).await.unwrap();
    let change = part(&storage, cursor, 9, 6).await.items.pop().unwrap();
    assert_eq!((change.clip, change.at, change.kind), (Some(clip.id), at(6), ChangeKind::Clip));
    let job = storage.align_clip(&id, clip.id, at(7)).await.unwrap().job.unwrap();
    assert_eq!(news(&storage, &mut cursor, 7).await, ["h clip queued"]);
    storage.cancel_job(job.id, at(8)).await.unwrap();
    assert_eq!(news(&storage, &mut cursor, 8).await, ["h clip uploaded"]);
    storage.delete_clip(&id, clip.id, |_| true, at(9)).await.unwrap();
    assert_eq!(news(&storage, &mut cursor, 9).await, ["h clip deleted"]);
    // A new reader gets each item once.
    assert_eq!(news(&storage, &mut None, 9).await, ["h home", "h lidar_map 1", "h clip deleted"]);
}

/// Copy of a reader that applies the feed, by home, kind and clip.
type Copy = BTreeMap<(String, String), Change>;

fn apply(copy: &mut Copy, items: Vec<Change>) {
    for change in items {
        let key = (change.home.to_string(), format!("{:?} {:?}", change.kind, change.clip));
        if change.deleted {
            copy.remove(&key)
        } else {
            copy.insert(key, change)
        };
    }
}

async fn a_copy_that_follows_is_whole(storage: Storage) {
    let (mut copy, mut cursor) = (Copy::new(), None);
    let mut clips: Vec<Clip> = Vec::new();
    // Two items are read after every step, so the reader is always behind, and unread items change again.
    for step in 0..30i64 {
        let id = home(&format!("h{}", step % 3));
        storage.put_home(&id, Some(&format!("name {}", step / 9)), |_| true, at(step)).await.unwrap();
        match step % 5 {
            0 => drop(put_map(&storage, &id, &[step as u8]).await),
            1 | 2 => clips.push(add(&storage, &id, &[step as u8]).await),
            3 => {
                let clip = clips.remove(0);
                storage.delete_clip(&clip.home, clip.id, |_| true, at(step)).await.unwrap();
            }
            _ => drop(storage.claim(LEASE, at(step)).await.unwrap()),
        }
        if step == 17 {
            storage.delete_home(&home("h1"), |_| true, at(step)).await.unwrap();
            clips.retain(|clip| clip.home != home("h1"));
        }
        let changes = part(&storage, cursor, 2, step).await;
        cursor = Some(changes.next);
        apply(&mut copy, changes.items);
    }
    loop {
        let changes = part(&storage, cursor, 2, 100).await;
        cursor = Some(changes.next);
        apply(&mut copy, changes.items);
        if !changes.more {
            break;
        }
    }
    let mut fresh = Copy::new();
    apply(&mut fresh, part(&storage, None, 1000, 100).await.items);
    assert_eq!(copy, fresh);
    let mut told: Vec<Uuid> = copy.values().filter_map(|change| change.clip).collect();
    let mut there: Vec<Uuid> = clips.iter().map(|clip| clip.id).collect();
    told.sort_unstable();
    there.sort_unstable();
    assert_eq!(told, there);
    for clip in &clips {
        let state = storage.clip(&clip.home, clip.id).await.unwrap().state;
        let told = copy.values().find(|change| change.clip == Some(clip.id)).unwrap();
        assert_eq!(told.state, Some(state));
    }
}

async fn a_home_goes_with_all_that_was_in_it(storage: Storage) {
    let (id, clip) = one_job(&storage).await;
    let other = home("other");
    storage.put_home(&other, None, |_| true, at(0)).await.unwrap();
    let mut cursor = None;
    assert_eq!(
        news(&storage, &mut cursor, 0).await,
        ["h home", "h lidar_map 1", "h clip queued", "other home"]
    );
    storage.delete_home(&id, |_| true, at(1)).await.unwrap();
    let gone = ["h lidar_map 1 deleted", "h clip deleted", "h home deleted"];
    assert_eq!(news(&storage, &mut cursor, 1).await, gone);
    // A home of the same id is another one; the feed still has the removals in the old one.
    storage.put_home(&id, None, |_| true, at(2)).await.unwrap();
    assert_eq!(news(&storage, &mut cursor, 2).await, ["h home"]);
    assert_eq!(
        news(&storage, &mut None, 2).await,
        ["other home", "h lidar_map 1 deleted", "h clip deleted", "h home"]
    );
    put_map(&storage, &id, b"map").await;
    assert_eq!(news(&storage, &mut cursor, 2).await, ["h lidar_map 1"]);
    assert!(matches!(storage.clip(&id, clip.id).await, Err(StorageError::NoSuchClip)));
}

async fn what_was_not_committed_is_not_told(storage: Storage) {
    let (id, clip) = one_job(&storage).await;
    let mut cursor = None;
    news(&storage, &mut cursor, 0).await;
    let mut transaction = storage.database.begin().await.unwrap();
    let changed = feed::Changed::Clip { id: clip.id, state: ClipState::Failed };
    feed::record(&mut transaction, &id, changed, at(1)).await.unwrap();
    assert!(news(&storage, &mut cursor, 1).await.is_empty());
    drop(transaction);
    assert!(news(&storage, &mut cursor, 1).await.is_empty());
    storage.delete_home(&home("nowhere"), |_| true, at(1)).await.unwrap_err();
    assert!(news(&storage, &mut cursor, 1).await.is_empty());
    let again = part(&storage, None, 100, 1).await;
    assert_eq!(again.items.last().unwrap().state, Some(ClipState::Queued));
}

async fn what_was_deleted_is_told_for_a_month(storage: Storage) {
    let (id, first) = one_job(&storage).await;
    let second = add(&storage, &id, b"second").await;
    let third = add(&storage, &id, b"third").await;
    let deleted = || async {
        let items = part(&storage, None, 100, 32 * DAY_S).await.items;
        items.into_iter().filter(|change| change.deleted).filter_map(|change| change.clip).collect::<Vec<_>>()
    };
    storage.delete_clip(&id, first.id, |_| true, at(0)).await.unwrap();
    storage.delete_clip(&id, second.id, |_| true, at(31 * DAY_S)).await.unwrap();
    assert_eq!(deleted().await, [first.id, second.id]);
    storage.delete_clip(&id, third.id, |_| true, at(31 * DAY_S + 1)).await.unwrap();
    assert_eq!(deleted().await, [second.id, third.id]);
    // Numbers are not reused when their rows are gone.
    let last = part(&storage, None, 100, 32 * DAY_S).await.items.pop().unwrap().seq;
    storage.delete_home(&id, |_| true, at(40 * DAY_S)).await.unwrap();
    let gone = part(&storage, None, 100, 40 * DAY_S).await;
    storage.put_home(&home("new"), None, |_| true, at(80 * DAY_S)).await.unwrap();
    storage.put_home(&home("newer"), None, |_| true, at(80 * DAY_S)).await.unwrap();
    storage.delete_home(&home("newer"), |_| true, at(80 * DAY_S)).await.unwrap();
    let items = part(&storage, None, 100, 80 * DAY_S).await.items;
    assert_eq!(items.iter().map(shown).collect::<Vec<_>>(), ["new home", "newer home deleted"]);
    assert!(items[0].seq > gone.items.last().unwrap().seq && gone.items[0].seq > 0 && last > 0);
}

async fn a_cursor_ends_where_deletions_may_be_missed(storage: Storage) {
    let expired = |after: ChangesCursor, seconds: i64| {
        let storage = &storage;
        async move {
            let read = storage.changes(&Tenant::default(), Some(after), 1, at(seconds)).await;
            matches!(read, Err(StorageError::CursorExpired))
        }
    };
    for n in 0..3 {
        storage.put_home(&home(&format!("h{n}")), None, |_| true, at(0)).await.unwrap();
    }
    // The lifetime counts from the hour of the last read at the end, or else of the first read.
    const HOUR_S: i64 = 3600;
    let behind = part(&storage, None, 1, 0).await;
    assert!(behind.more);
    let still_behind = part(&storage, Some(behind.next), 1, 10).await;
    assert!(still_behind.more && !expired(still_behind.next, 30 * DAY_S).await);
    assert!(expired(still_behind.next, 30 * DAY_S + HOUR_S).await);
    let end = part(&storage, Some(still_behind.next), 1, 10).await;
    assert!(!end.more && !expired(end.next, 30 * DAY_S + 10).await);
    assert!(expired(end.next, 30 * DAY_S + HOUR_S).await);
    let kept_up = part(&storage, Some(end.next), 1, 20 * DAY_S).await;
    assert!(kept_up.items.is_empty() && !expired(kept_up.next, 50 * DAY_S).await);
    // A number that this database never assigned.
    let text = end.next.to_string();
    let [time, seq, epoch] = text.split('.').collect::<Vec<_>>()[..] else { panic!("{text}") };
    let ahead = format!("{time}.{}.{epoch}", seq.parse::<i64>().unwrap() + 1);
    assert!(expired(ahead.parse().unwrap(), 10).await);
    assert_eq!(text.parse::<ChangesCursor>(), Ok(end.next));
    // As earlier versions wrote it, of a time before the first start of this one.
    assert!(!expired(format!("0.{time}").parse().unwrap(), 10).await);
    for bad in [
        "",
        ".",
        "1",
        "1.",
        ".1",
        "-1.0",
        "1.x",
        "x.1",
        "1.9223372036854775807",
        "9223372036854775808.1",
        "1.1.",
        "1..1",
        "1.1.x",
        "1.1.1.1",
    ] {
        assert_eq!(bad.parse::<ChangesCursor>(), Err(()), "{bad}");
    }
}

/// The copy was made after the first home. The processes start again on it, and number other changes as the lost ones.
async fn a_restored_database_is_told_from_the_one_before(storage: Storage) {
    let put = |id: &'static str| {
        let storage = &storage;
        async move { storage.put_home(&home(id), None, |_| true, at(0)).await.unwrap() }
    };
    let home_seen = |text: String| {
        let storage = &storage;
        async move { storage.home_position(Some(text.parse().unwrap())).await.unwrap().seq }
    };
    put("kept").await;
    let kept = part(&storage, None, 9, 0).await;
    storage.begin_epoch(at(1)).await.unwrap();
    assert!(part(&storage, Some(kept.next), 9, 1).await.items.is_empty());
    let watched = storage.home_position(None).await.unwrap();

    put("lost").await;
    let lost = part(&storage, Some(kept.next), 9, 1).await;
    let lost_watched = watched.at(watched.seq + 1).to_string();
    assert_eq!(home_seen(lost_watched.clone()).await, watched.seq + 1);
    storage.begin_epoch(at(2)).await.unwrap();
    let lost_later = part(&storage, Some(lost.next), 9, 2).await;

    let mut transaction = storage.database.begin().await.unwrap();
    for undo in [
        "DELETE FROM homes WHERE id LIKE '%lost'",
        "DELETE FROM changes WHERE home_id LIKE '%lost'",
        "UPDATE change_counter SET last_seq = last_seq - 1",
        "DELETE FROM feed_epochs WHERE begun_at = 1800000002000",
    ] {
        assert_eq!(query(undo).execute(&mut transaction).await.unwrap(), 1, "{undo}");
    }
    transaction.commit().await.unwrap();
    storage.begin_epoch(at(3)).await.unwrap();
    for id in ["new", "newer"] {
        put(id).await;
    }
    let news = part(&storage, Some(kept.next), 9, 3).await.items;
    assert_eq!(news.iter().map(shown).collect::<Vec<_>>(), ["new home", "newer home"]);
    for cursor in [lost.next, lost_later.next] {
        let read = storage.changes(&Tenant::default(), Some(cursor), 9, at(3)).await;
        assert!(matches!(read, Err(StorageError::CursorExpired)), "{cursor}");
    }
    assert_eq!(home_seen(lost_watched).await, 0);
    assert_eq!(home_seen(watched.to_string()).await, watched.seq);
}

/// Its text has an entity tag, which a reader sends back; the cursor in it names the hour.
async fn a_page_without_news_stays_the_same_for_an_hour(storage: Storage) {
    const WHOLE_HOUR_S: i64 = 3600;
    storage.put_home(&home("h"), None, |_| true, at(0)).await.unwrap();
    let first = part(&storage, None, 9, WHOLE_HOUR_S).await;
    assert_eq!(part(&storage, None, 9, 2 * WHOLE_HOUR_S - 1).await, first);
    let later = part(&storage, None, 9, 2 * WHOLE_HOUR_S).await;
    assert_eq!(later.items, first.items);
    assert_ne!(later.next, first.next);
}

async fn a_feed_begins_with_what_was_there_before_it(storage: Storage) {
    let (id, clip) = one_job(&storage).await;
    put_map(&storage, &id, b"second map").await;
    let before: Vec<String> = part(&storage, None, 9, 0).await.items.iter().map(shown).collect();
    // The data folder of a version without the feed: the migration is undone and done again.
    let mut transaction = storage.database.begin().await.unwrap();
    let text = include_str!("../../../../migrations/0003_choices_and_changes.sql");
    let filling = text.split("INSERT INTO changes").nth(1).and_then(|rest| rest.split(';').next()).unwrap();
    query("DELETE FROM changes").execute(&mut transaction).await.unwrap();
    let filling = AssertSqlSafe(format!("INSERT INTO changes{filling}"));
    query(filling).execute(&mut transaction).await.unwrap();
    transaction.commit().await.unwrap();
    let items = part(&storage, None, 9, 0).await.items;
    let mut shown: Vec<String> = items.iter().map(shown).collect();
    assert_eq!(shown, ["h home", "h lidar_map 2", "h clip queued"]);
    assert_eq!(items[2].clip, Some(clip.id));
    shown.sort_unstable();
    let mut sorted = before;
    sorted.sort_unstable();
    assert_eq!(shown, sorted);
}
