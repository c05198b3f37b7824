//! The order of jobs.

use super::home_maps::{align, due, merge};
use super::*;

on_every_back_end!(
    nobody_waits_behind_all_of_another,
    who_asks_comes_first,
    nobody_waits_for_ever,
    a_new_map_queues_clips_one_behind_the_other,
    clips_without_an_answer_come_before_those_that_are_aligned_again,
    an_alignment_again_waits_half_a_day_at_most,
    a_map_that_lost_a_clip_waits_no_half_day,
    tenants_take_turns_in_merging,
    a_tenant_whose_maps_wait_keeps_no_other_waiting,
);

const HOUR: i64 = 3600;

/// Returns the homes of claimed jobs, as `tenant/home`, all at one moment.
async fn order(storage: &Storage, now_s: i64, count: usize) -> Vec<String> {
    let mut homes = Vec::new();
    while homes.len() < count
        && let Some(claim) = storage.claim(LEASE, at(now_s)).await.unwrap()
    {
        homes.push(format!("{}/{}", claim.job.home.tenant(), claim.job.home));
    }
    homes
}

async fn home_with_map(storage: &Storage, tenant: &str, id: &str) -> HomeId {
    let home = tenant.parse::<Tenant>().unwrap().home(&home(id));
    storage.put_home(&home, None, |_| true, at(0)).await.unwrap();
    put_map(storage, &home, b"map").await;
    home
}

async fn nobody_waits_behind_all_of_another(storage: Storage) {
    let greedy = home_with_map(&storage, "acme", "greedy").await;
    for n in 0..5u8 {
        add(&storage, &greedy, &[n]).await;
    }
    // Another home of this tenant, and another tenant, come last; each has its first turn after one job.
    let modest = home_with_map(&storage, "acme", "modest").await;
    add(&storage, &modest, b"one").await;
    let other = home_with_map(&storage, "bolt", "other").await;
    add(&storage, &other, b"one").await;
    add(&storage, &other, b"two").await;
    let order = order(&storage, 0, 9).await;
    let at = |name: &str| order.iter().position(|home| home == name).unwrap();
    assert_eq!(order.len(), 8);
    assert!(at("acme/modest") <= 3 && at("bolt/other") <= 3, "{order:?}");
    assert!(order[4..].iter().filter(|home| *home == "acme/greedy").count() >= 3, "{order:?}");
}

async fn tenants_take_turns_in_merging(storage: Storage) {
    for (tenant, id) in [("acme", "a"), ("acme", "b"), ("acme", "c"), ("bolt", "d"), ("corp", "e")] {
        let home = home_with_map(&storage, tenant, id).await;
        add(&storage, &home, b"clip").await;
        align(&storage, AlignmentState::Aligned).await;
    }
    let mut order = Vec::new();
    let mut last = String::new();
    for second in 0..6 {
        // Leases end before the next claim, so each home stays due.
        let now = at(200 + 100 * second);
        let claim = storage.claim_merge(&last, LEASE, now).await.unwrap().expect("homes are due");
        claim.home.tenant().clone_into(&mut last);
        order.push(format!("{last}/{}", claim.home));
    }
    assert_eq!(order, ["acme/a", "bolt/d", "corp/e", "acme/b", "bolt/d", "corp/e"]);
}

async fn a_tenant_whose_maps_wait_keeps_no_other_waiting(storage: Storage) {
    let one_aligned = async |tenant: &str, id: &str| {
        let home = home_with_map(&storage, tenant, id).await;
        add(&storage, &home, b"clip").await;
        align(&storage, AlignmentState::Aligned).await;
    };
    for number in 0..20 {
        one_aligned("acme", &format!("h{number}")).await;
        merge(&storage, b"tile", 110).await;
    }
    // The only clip of each map has met faults for long, and rests until second 2000.
    for rest in [
        "UPDATE clips SET state = 'queued', result_key = NULL WHERE home_id IN (SELECT id FROM homes WHERE tenant = $1)",
        "UPDATE jobs SET state = 'queued', first_fault_at = 0, run_after = 1800002000000 WHERE tenant = $1",
        "UPDATE homes SET map_wanted = map_wanted + 1 WHERE tenant = $1",
    ] {
        execute(&storage, rest, "acme").await;
    }
    assert!(due(&storage, 200).await.is_none(), "the merges would empty the maps");
    one_aligned("bolt", "other").await;
    let claim = due(&storage, 300).await.expect("the other tenant's home is due");
    assert_eq!(claim.home.tenant(), "bolt");
}

async fn who_asks_comes_first(storage: Storage) {
    let again = home_with_map(&storage, "acme", "again").await;
    add(&storage, &again, b"clip").await;
    align(&storage, AlignmentState::Aligned).await;
    let fresh = home_with_map(&storage, "bolt", "fresh").await;
    // A new map queues its home's clips again, behind new clips; a clip that is asked for comes before them.
    put_map(&storage, &again, b"new map").await;
    add(&storage, &fresh, b"clip").await;
    let asked = home_with_map(&storage, "corp", "asked").await;
    let clip = add(&storage, &asked, b"clip").await;
    storage.cancel_job(clip.job.unwrap().id, at(0)).await.unwrap();
    storage.align_clip(&asked, clip.id, at(0)).await.unwrap();
    assert_eq!(order(&storage, 0, 9).await, ["corp/asked", "bolt/fresh", "acme/again"]);
}

async fn nobody_waits_for_ever(storage: Storage) {
    let patient = home_with_map(&storage, "acme", "patient").await;
    add(&storage, &patient, b"clip").await;
    put_map(&storage, &patient, b"new map").await;
    let busy = home_with_map(&storage, "bolt", "busy").await;
    let clip = add(&storage, &busy, b"clip").await;
    // A clip is asked for an hour later; the job that has waited for an hour still comes first.
    storage.cancel_job(clip.job.unwrap().id, at(1)).await.unwrap();
    storage.align_clip(&busy, clip.id, at(3600)).await.unwrap();
    assert_eq!(order(&storage, 3600, 1).await, ["acme/patient"]);
}

async fn a_new_map_queues_clips_one_behind_the_other(storage: Storage) {
    let home = home_with_map(&storage, "acme", "h").await;
    for n in 0..3u8 {
        add(&storage, &home, &[n]).await;
        align(&storage, AlignmentState::Aligned).await;
    }
    let other = home_with_map(&storage, "acme", "other").await;
    for n in 0..2u8 {
        add(&storage, &other, &[n]).await;
    }
    put_map(&storage, &home, b"new map").await;
    let rows = crate::database::query(
        "SELECT position, order_at FROM jobs JOIN clips ON clips.id = jobs.clip_id
        WHERE home_id = $1 AND jobs.state = 'queued' ORDER BY clip_id",
    );
    let rows = rows.bind(home.key()).fetch_all(&mut storage.database.reader().await.unwrap()).await.unwrap();
    let turns: Vec<(i64, i64)> = rows
        .iter()
        .map(|row| {
            (
                row.number("position").unwrap(),
                row.number("order_at").unwrap() - at(12 * HOUR).as_millisecond(),
            )
        })
        .collect();
    // Before the third are two of its own home and two of the other one; each takes 5 s.
    assert_eq!(turns, [(0, 5_000), (1, 15_000), (2, 20_000)]);
}

async fn clips_without_an_answer_come_before_those_that_are_aligned_again(storage: Storage) {
    // Each robot of a tenant sends a new map. More clips have answers than the lead of a new clip has turns.
    let mut homes = Vec::new();
    for n in 0..4u8 {
        let home = home_with_map(&storage, "acme", &format!("h{n}")).await;
        for clip in 0..2u8 {
            add(&storage, &home, &[clip]).await;
            align(&storage, AlignmentState::Ambiguous).await;
        }
        homes.push(home);
    }
    // A file that no job could use is aligned again, too.
    add(&storage, &homes[0], b"damaged").await;
    let damaged = storage.claim(LEASE, at(100)).await.unwrap().expect("a job is due");
    assert!(end_attempt(&storage, &damaged, AttemptEnd::Refused(reason("bad_picture")), 100).await);
    let waiting = add(&storage, &homes[1], b"waiting").await.id;
    for home in &homes {
        // Twice: a clip that waits for its second answer still has the first.
        for map in [b"second map", b"third map."] {
            put_map(&storage, home, map).await;
        }
    }
    let late = add(&storage, &homes[2], b"late").await.id;
    let other = home_with_map(&storage, "bolt", "other").await;
    let of_other = add(&storage, &other, b"one").await.id;
    let mut order = Vec::new();
    while let Some(claim) = storage.claim(LEASE, at(0)).await.unwrap() {
        order.push(claim.job.clip);
    }
    assert_eq!(order.len(), 4 * 2 + 1 + 3);
    for clip in [waiting, late, of_other] {
        assert!(order[..3].contains(&clip), "{clip} is not among the first of {order:?}");
    }
}

async fn an_alignment_again_waits_half_a_day_at_most(storage: Storage) {
    let patient = home_with_map(&storage, "acme", "patient").await;
    add(&storage, &patient, b"clip").await;
    align(&storage, AlignmentState::Aligned).await;
    put_map(&storage, &patient, b"new map").await;
    let busy = home_with_map(&storage, "bolt", "busy").await;
    let mut clip = add(&storage, &busy, b"clip").await;
    for (hours, first) in [(6, "bolt/busy"), (13, "acme/patient")] {
        storage.cancel_job(clip.job.unwrap().id, at(1)).await.unwrap();
        clip = storage.align_clip(&busy, clip.id, at(hours * HOUR)).await.unwrap();
        assert_eq!(order(&storage, hours * HOUR, 1).await, [first], "{hours}");
    }
}

async fn a_map_that_lost_a_clip_waits_no_half_day(storage: Storage) {
    let again = home_with_map(&storage, "acme", "again").await;
    let removed = add(&storage, &again, b"one").await.id;
    add(&storage, &again, b"two").await;
    for _ in 0..2 {
        align(&storage, AlignmentState::Aligned).await;
    }
    merge(&storage, b"tile", 110).await;
    put_map(&storage, &again, b"new map").await;
    let fresh = home_with_map(&storage, "bolt", "fresh").await;
    for n in 0..4u8 {
        add(&storage, &fresh, &[n]).await;
    }
    storage.delete_clip(&again, removed, |_| true, at(200)).await.unwrap();
    let order = order(&storage, 200, 9).await;
    assert_eq!(order.len(), 5);
    assert_eq!(order[4], "bolt/fresh", "{order:?}");
}
