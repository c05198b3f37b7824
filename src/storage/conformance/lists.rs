//! Filters and pages of lists.

use super::*;

on_every_back_end!(clips_by_state_and_time, homes_by_time_of_anything_in_them);

async fn clips_by_state_and_time(storage: Storage) {
    use ClipState::{Aligned, Aligning, Ambiguous, Failed, Queued, Uploaded};
    let (id, _) = one_job(&storage).await;
    for n in 0..5u8 {
        add(&storage, &id, &[n]).await;
    }
    // Settled at 10, 20, 30; one is being aligned at 40; two stay queued at 0.
    let endings = [AlignmentState::Aligned, AlignmentState::Ambiguous, AlignmentState::Failed];
    for (at_s, state) in (1..).map(|n| n * 10).zip(endings) {
        let claim = storage.claim(LEASE, at(at_s)).await.unwrap().unwrap();
        assert!(storage.finish(&claim, &answer(state), &RetryPolicy::default(), at(at_s)).await.unwrap());
    }
    storage.claim(LEASE, at(40)).await.unwrap().unwrap();
    let cases: [(&[ClipState], Option<i64>, &[ClipState]); 9] = [
        (&[], None, &[Aligned, Ambiguous, Failed, Aligning, Queued, Queued]),
        (&[Ambiguous, Failed], None, &[Ambiguous, Failed]),
        (&[Failed, Ambiguous, Failed], None, &[Ambiguous, Failed]),
        (&[Queued], None, &[Queued, Queued]),
        (&[Uploaded], None, &[]),
        (&[], Some(20), &[Failed, Aligning]),
        (&[], Some(19), &[Ambiguous, Failed, Aligning]),
        (&[Aligned, Failed], Some(10), &[Failed]),
        (&[], Some(40), &[]),
    ];
    for (states, updated_after, expected) in cases {
        let filter = ClipFilter { states: states.to_vec(), updated_after: updated_after.map(at) };
        // One at a time, so that every filter meets a cursor.
        let (mut seen, mut page) = (Vec::new(), Page { limit: 1, after: None });
        while let Some(clip) = storage.clips(&id, &filter, &page).await.unwrap().pop() {
            assert_eq!(clip.job.as_ref().map(|job| job.clip), Some(clip.id));
            page.after = Some(clip.id);
            seen.push(clip.state);
        }
        assert_eq!(seen, expected, "{filter:?}");
        let all = storage.clips(&id, &filter, &Page { limit: 9, after: None }).await.unwrap();
        assert_eq!(all.iter().map(|clip| clip.state).collect::<Vec<_>>(), expected, "{filter:?}");
    }
}

async fn homes_by_time_of_anything_in_them(storage: Storage) {
    let ids = ["c", "a", "b"].map(home);
    for id in &ids {
        storage.put_home(id, None, at(0)).await.unwrap();
    }
    let after = |seconds: i64, limit, last: Option<&str>| {
        let page = Page { limit, after: last.map(home) };
        let storage = &storage;
        async move {
            let homes = storage.homes(&Tenant::default(), Some(at(seconds)), &page).await.unwrap();
            homes.into_iter().map(|home| home.id.to_string()).collect::<Vec<_>>()
        }
    };
    assert_eq!(after(-1, 9, None).await, ["a", "b", "c"]);
    assert_eq!(after(-1, 2, None).await, ["a", "b"]);
    assert_eq!(after(-1, 2, Some("b")).await, ["c"]);
    assert!(after(0, 9, None).await.is_empty());
    // The same name again is no change; another one is.
    storage.put_home(&ids[0], None, at(1)).await.unwrap();
    assert!(after(0, 9, None).await.is_empty());
    storage.put_home(&ids[0], Some("name"), at(1)).await.unwrap();
    assert_eq!(after(0, 9, None).await, ["c"]);
    // Every change in a home moves its time forward, never back. (Clips and maps are added at 0 here.)
    put_map(&storage, &ids[1], b"map").await;
    let clip = add(&storage, &ids[1], b"clip").await;
    assert_eq!(after(0, 9, None).await, ["c"]);
    let claim = storage.claim(LEASE, at(2)).await.unwrap().unwrap();
    assert_eq!(after(1, 9, None).await, ["a"]);
    let retry = RetryPolicy::default();
    assert!(storage.finish(&claim, &answer(AlignmentState::Failed), &retry, at(3)).await.unwrap());
    assert_eq!(after(2, 9, None).await, ["a"]);
    let pose = Chosen::Pose(LevelName::MAIN, viola_geometry::Pose2::IDENTITY);
    storage.choose(&ids[1], clip.id, pose, at(4)).await.unwrap();
    assert_eq!(after(3, 9, None).await, ["a"]);
    storage.withdraw_choice(&ids[1], clip.id, at(5)).await.unwrap();
    assert_eq!(after(4, 9, None).await, ["a"]);
    storage.delete_clip(&ids[1], clip.id, at(6)).await.unwrap();
    assert_eq!(after(5, 9, None).await, ["a"]);
    storage.put_home(&ids[1], Some("late clock"), at(2)).await.unwrap();
    assert_eq!(storage.home(&ids[1]).await.unwrap().updated_at, at(6));
}
