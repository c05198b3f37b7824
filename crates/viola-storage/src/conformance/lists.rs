//! Filters and pages of lists.

use super::home_maps::{align, due, merge};
use super::*;

on_every_back_end!(
    clips_by_state_and_time,
    homes_by_time_of_anything_in_them,
    homes_by_text_and_need,
    homes_with_clips_after_a_fault_need_attention,
    the_same_file_twice_is_told,
    the_same_recording_in_another_archive_is_told_and_merged_once,
    clips_of_all_homes_by_reason,
    a_clip_is_corrected,
    an_earlier_lidar_map_comes_back,
);

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
        assert!(end_attempt(&storage, &claim, answer(state), at_s).await);
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
        let updated_after = updated_after.map(at);
        let filter = ClipFilter { states: states.to_vec(), updated_after, ..ClipFilter::default() };
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
        storage.put_home(id, None, |_| true, at(0)).await.unwrap();
    }
    let after = |seconds: i64, limit, last: Option<&str>| {
        let page = Page { limit, after: last.map(home) };
        let filter = HomeFilter { updated_after: Some(at(seconds)), ..HomeFilter::default() };
        let storage = &storage;
        async move {
            let homes = storage.homes(&Tenant::default(), &filter, &page).await.unwrap();
            homes.into_iter().map(|home| home.id.to_string()).collect::<Vec<_>>()
        }
    };
    assert_eq!(after(-1, 9, None).await, ["a", "b", "c"]);
    assert_eq!(after(-1, 2, None).await, ["a", "b"]);
    assert_eq!(after(-1, 2, Some("b")).await, ["c"]);
    assert!(after(0, 9, None).await.is_empty());
    // The same name again is no change; another one is.
    storage.put_home(&ids[0], None, |_| true, at(1)).await.unwrap();
    assert!(after(0, 9, None).await.is_empty());
    storage.put_home(&ids[0], Some("name"), |_| true, at(1)).await.unwrap();
    assert_eq!(after(0, 9, None).await, ["c"]);
    // Every change in a home moves its time forward, never back. (Clips and maps are added at 0 here.)
    put_map(&storage, &ids[1], b"map").await;
    let clip = add(&storage, &ids[1], b"clip").await;
    assert_eq!(after(0, 9, None).await, ["c"]);
    let claim = storage.claim(LEASE, at(2)).await.unwrap().unwrap();
    assert_eq!(after(1, 9, None).await, ["a"]);
    assert!(end_attempt(&storage, &claim, answer(AlignmentState::Failed), 3).await);
    assert_eq!(after(2, 9, None).await, ["a"]);
    let pose = Chosen::Pose(LevelName::MAIN, viola_geometry::Pose2::IDENTITY);
    storage.choose(&ids[1], clip.id, pose, |_| true, at(4)).await.unwrap();
    assert_eq!(after(3, 9, None).await, ["a"]);
    storage.withdraw_choice(&ids[1], clip.id, |_| true, at(5)).await.unwrap();
    assert_eq!(after(4, 9, None).await, ["a"]);
    storage.delete_clip(&ids[1], clip.id, |_| true, at(6)).await.unwrap();
    assert_eq!(after(5, 9, None).await, ["a"]);
    storage.put_home(&ids[1], Some("late clock"), |_| true, at(2)).await.unwrap();
    assert_eq!(storage.home(&ids[1]).await.unwrap().updated_at, at(6));
}

async fn homes_by_text_and_need(storage: Storage) {
    for (id, name) in [("elm-3", "Elm Street"), ("oak-1", "\u{c4}hrenweg 1"), ("elm_4", "100 % new")] {
        storage.put_home(&home(id), Some(name), |_| true, at(0)).await.unwrap();
    }
    add(&storage, &home("oak-1"), b"waits for a map").await;
    let found = |text: Option<&str>, needs_attention, updated_after| {
        let filter = HomeFilter { text: text.map(str::to_owned), needs_attention, updated_after };
        let storage = &storage;
        async move {
            let page = Page { limit: 9, after: None };
            let homes = storage.homes(&Tenant::default(), &filter, &page).await.unwrap();
            homes.into_iter().map(|home| home.id.to_string()).collect::<Vec<_>>()
        }
    };
    let elm = home("elm_4");
    for (change, state) in [
        ("UPDATE homes SET map_wanted = 1 WHERE id = $1", MapState::Due),
        ("UPDATE homes SET map_faults = 1 WHERE id = $1", MapState::Due),
        ("UPDATE homes SET map_faults = 2 WHERE id = $1", MapState::Failing),
        ("UPDATE homes SET map_made = 1 WHERE id = $1", MapState::Current),
    ] {
        execute(&storage, change, elm.key()).await;
        assert_eq!(storage.home(&elm).await.unwrap().map_state, state);
        assert_eq!(storage.map_state(&elm).await.unwrap(), state);
        let expected: &[&str] = if state == MapState::Failing { &["elm_4", "oak-1"] } else { &["oak-1"] };
        for since in [None, Some(at(-1))] {
            assert_eq!(found(None, true, since).await, expected, "{change}");
        }
    }
    for since in [None, Some(at(-1))] {
        assert_eq!(found(Some("ELM"), false, since).await, ["elm-3", "elm_4"]);
        assert_eq!(found(Some("\u{e4}hren"), false, since).await, ["oak-1"]);
        assert_eq!(found(Some("m_"), false, since).await, ["elm_4"]);
        assert_eq!(found(Some("0 %"), false, since).await, ["elm_4"]);
        assert_eq!(found(Some("!"), false, since).await, Vec::<String>::new());
        assert_eq!(found(None, true, since).await, ["oak-1"]);
    }
    storage.put_home(&home("elm-3"), Some("Ash"), |_| true, at(1)).await.unwrap();
    assert_eq!(found(Some("ash"), false, None).await, ["elm-3"]);
    assert_eq!(found(Some("street"), false, None).await, Vec::<String>::new());
    let counts = storage.home(&home("oak-1")).await.unwrap().clips;
    assert_eq!(counts, [1, 0, 0, 0, 0, 0]);
    let refused = storage.put_home(&home("elm-3"), None, |home| home.is_none(), at(2)).await;
    assert!(matches!(refused, Err(StorageError::Changed { .. })));
}

async fn homes_with_clips_after_a_fault_need_attention(storage: Storage) {
    let (id, _) = one_job(&storage).await;
    let retry = RetryPolicy::default();
    let needs = async || {
        let filter = HomeFilter { needs_attention: true, ..HomeFilter::default() };
        let page = Page { limit: 9, after: None };
        let found = storage.homes(&Tenant::default(), &filter, &page).await.unwrap().len() as i64;
        let since = HomeFilter { updated_after: Some(at(-1)), ..filter };
        let changed = storage.homes(&Tenant::default(), &since, &page).await.unwrap().len() as i64;
        let clips = storage.home(&id).await.unwrap().clips_after_fault;
        assert_eq!((found, changed), (clips, clips));
        found
    };
    assert_eq!(needs().await, 0);
    // Longer than the lease and than any pause.
    let mut now_s = 0;
    for (ending, expected) in [
        (Some(AttemptEnd::Fault(Fault::Storage)), 1),
        (Some(AttemptEnd::Fault(Fault::System)), 1),
        // The worker is lost.
        (None, 1),
        (Some(AttemptEnd::GivenUp), 0),
        (Some(AttemptEnd::Fault(Fault::Storage)), 1),
        (Some(answer(AlignmentState::Aligned)), 0),
    ] {
        now_s += 1000;
        let held = storage.claim(LEASE, at(now_s)).await.unwrap().expect("the job is due");
        assert_eq!(needs().await, 0, "it runs");
        match &ending {
            Some(ending) => assert!(storage.finish(&held, ending, &retry, at(now_s)).await.unwrap()),
            None => assert_eq!(storage.release_lost(&retry, at(now_s + 31)).await.unwrap(), 1),
        }
        assert_eq!(needs().await, expected, "{ending:?}");
    }
}

async fn the_same_file_twice_is_told(storage: Storage) {
    let (id, first) = one_job(&storage).await;
    let second = add(&storage, &id, b"clip").await;
    let other = add(&storage, &id, b"another clip").await;
    assert_eq!([first.duplicate_of, second.duplicate_of, other.duplicate_of], [None, Some(first.id), None]);
    let page = Page { limit: 9, after: None };
    let listed = storage.clips(&id, &ClipFilter::default(), &page).await.unwrap();
    assert_eq!(listed[1].duplicate_of, Some(first.id));
    storage.delete_clip(&id, first.id, |_| true, at(1)).await.unwrap();
    assert_eq!(storage.clip(&id, second.id).await.unwrap().duplicate_of, None);
}

/// Adds a clip whose file is an archive.
async fn add_archive(storage: &Storage, home: &HomeId, file: &[u8], content: &str) -> Uuid {
    match add_content(storage, home, file, Some(content), None).await {
        Added::New(clip) => clip.id,
        other => panic!("{other:?}"),
    }
}

async fn the_same_recording_in_another_archive_is_told_and_merged_once(storage: Storage) {
    // Its clip is as of an earlier version: its content is unknown.
    let (id, old) = one_job(&storage).await;
    let old_again = add_archive(&storage, &id, b"clip", "content of the old one").await;
    let first = add_archive(&storage, &id, b"zip", "content").await;
    let second = add_archive(&storage, &id, b"zipped again", "content").await;
    for _ in 0..4 {
        align(&storage, AlignmentState::Aligned).await;
    }
    let twins = async || {
        let page = Page { limit: 9, after: None };
        let listed = storage.clips(&id, &ClipFilter::default(), &page).await.unwrap();
        listed.iter().map(|clip| clip.duplicate_of).collect::<Vec<_>>()
    };
    assert_eq!(twins().await, [None, Some(old.id), None, Some(first)]);
    assert_eq!(storage.clip(&id, second).await.unwrap().duplicate_of, Some(first));
    let merged = async |seconds: i64| {
        let claim = merge(&storage, b"tile", seconds).await;
        claim.members.iter().map(|member| (member.clip, member.sha256.clone())).collect::<Vec<_>>()
    };
    let left_out = async || {
        let left_out = storage.clips_left_out(&id).await.unwrap();
        left_out.iter().map(|clip| (clip.clip, clip.duplicate_of)).collect::<Vec<_>>()
    };
    let content = "content".to_owned();
    assert_eq!(merged(200).await, [(old.id, old.sha256.clone()), (first, content.clone())]);
    assert_eq!(left_out().await, [(old_again, Some(old.id)), (second, Some(first))]);
    // The copy takes its place.
    storage.delete_clip(&id, first, |_| true, at(201)).await.unwrap();
    storage.delete_clip(&id, old.id, |_| true, at(201)).await.unwrap();
    assert_eq!(twins().await, [None, None]);
    assert_eq!(merged(202).await, [(old_again, "content of the old one".to_owned()), (second, content)]);
}

async fn clips_of_all_homes_by_reason(storage: Storage) {
    let [acme, bolt]: [Tenant; 2] = ["acme", "bolt"].map(|name| name.parse().unwrap());
    // The ids have all characters that ids may have.
    let ids = ["abcdefghijklmnopqrstuvwxyz", "ABCDEFGHIJKLMNOPQRSTUVWXYZ.0123456789_-"];
    let homes = [acme.home(&home(ids[0])), acme.home(&home(ids[1])), bolt.home(&home(ids[0]))];
    let mut clips = Vec::new();
    for id in &homes {
        storage.put_home(id, None, |_| true, at(0)).await.unwrap();
        for n in 0..2u8 {
            clips.push(add(&storage, id, &[n]).await.id);
        }
    }
    let [a, b, c, d, e, f] = clips[..] else { unreachable!() };
    // The first clip has an answer with the reason `two_modes`, and another one only names it.
    put_map(&storage, &homes[0], b"map").await;
    let claim = storage.claim(LEASE, at(10)).await.unwrap().unwrap();
    assert!(end_attempt(&storage, &claim, answer(AlignmentState::Ambiguous), 10).await);
    assert_eq!(claim.job.clip, a);
    let quoting =
        r#"UPDATE clips SET reasons = '[{"code":"other","detail":"\"code\":\"two_modes\""}]' WHERE id = $1"#;
    execute(&storage, quoting, &b.to_string()).await;
    let similar = r#"UPDATE clips SET reasons = '[{"code":"twoxmodes","detail":"x"}]' WHERE id = $1"#;
    execute(&storage, similar, &d.to_string()).await;
    use ClipState::{Ambiguous, Queued, Uploaded};
    // The tenant, the states and codes of the filter, and the clips of the list.
    type Case<'a> = (&'a Tenant, &'a [ClipState], &'a [&'a str], &'a [Uuid]);
    let cases: [Case; 11] = [
        (&acme, &[], &[], &[a, b, c, d]),
        (&bolt, &[], &[], &[e, f]),
        (&Tenant::default(), &[], &[], &[]),
        (&acme, &[Uploaded], &[], &[c, d]),
        (&acme, &[Ambiguous, Queued], &[], &[a, b]),
        (&acme, &[], &["two_modes"], &[a]),
        (&acme, &[], &["no_lidar_map"], &[c]),
        (&acme, &[], &["no_lidar_map", "two_modes"], &[a, c]),
        (&acme, &[Uploaded], &["two_modes"], &[]),
        (&acme, &[], &["%"], &[]),
        (&bolt, &[], &["two_modes", "other", "no_lidar_map", "x"], &[e, f]),
    ];
    for (tenant, states, codes, expected) in cases {
        let codes = codes.iter().map(|code| (*code).to_owned()).collect();
        let filter = ClipFilter { states: states.to_vec(), codes, updated_after: None };
        let (mut seen, mut page) = (Vec::new(), Page { limit: 1, after: None });
        while let Some(clip) = storage.clips_of_tenant(tenant, &filter, &page).await.unwrap().pop() {
            assert_eq!(clip.job.as_ref().map_or(clip.id, |job| job.clip), clip.id);
            page.after = Some(clip.id);
            seen.push(clip.id);
        }
        assert_eq!(seen, expected, "{filter:?}");
        let all = Page { limit: 9, after: None };
        let all = storage.clips_of_tenant(tenant, &filter, &all).await.unwrap();
        assert_eq!(all.iter().map(|clip| clip.id).collect::<Vec<_>>(), expected, "{filter:?}");
    }
    let filter = ClipFilter { updated_after: Some(at(9)), ..ClipFilter::default() };
    let page = Page { limit: 9, after: None };
    assert_eq!(storage.clips_of_tenant(&acme, &filter, &page).await.unwrap().len(), 1);
    // Of one home, too.
    let filter = ClipFilter { codes: vec!["two_modes".to_owned()], ..ClipFilter::default() };
    assert_eq!(storage.clips(&homes[0], &filter, &page).await.unwrap().len(), 1);
    assert!(storage.clips(&homes[1], &filter, &page).await.unwrap().is_empty());
}

async fn a_clip_is_corrected(storage: Storage) {
    let (id, clip) = one_job(&storage).await;
    let expected = |title: Option<&'static str>| move |clip: &Clip| clip.title.as_deref() == title;
    let named =
        |title: Option<&str>| ClipEdit { title: Some(title.map(str::to_owned)), ..ClipEdit::default() };
    let kitchen = || named(Some("Kitchen"));
    let renamed = storage.edit_clip(&id, clip.id, kitchen(), expected(None), at(5)).await.unwrap();
    assert_eq!((renamed.title.as_deref(), renamed.updated_at), (Some("Kitchen"), at(5)));
    let again = storage.edit_clip(&id, clip.id, kitchen(), |_| true, at(6)).await.unwrap();
    assert_eq!(again.updated_at, at(5));
    let refused = storage.edit_clip(&id, clip.id, named(None), expected(None), at(7)).await;
    assert!(matches!(refused, Err(StorageError::Changed { .. })));
    assert_eq!(storage.edit_clip(&id, clip.id, named(None), |_| true, at(8)).await.unwrap().title, None);

    // The time of a clip counts in the home's map, once the clip has an answer.
    let timed = |recorded_at| ClipEdit { recorded_at: Some(recorded_at), ..kitchen() };
    let edit = async |edit: ClipEdit| storage.edit_clip(&id, clip.id, edit, |_| true, at(300)).await.unwrap();
    let early = edit(timed(Some(at(-50)))).await;
    assert_eq!((early.recorded_at, early.title.as_deref()), (Some(at(-50)), Some("Kitchen")));
    align(&storage, AlignmentState::Aligned).await;
    let claim = due(&storage, 301).await.expect("a clip has an answer");
    assert_eq!(claim.members[0].recorded_at_ms, Some(at(-50).as_millisecond()));
    assert!(storage.finish_merge(&claim, None, at(302)).await.unwrap());
    for (change, recorded_at) in [
        (timed(Some(at(-50))), Some(None)),
        (named(Some("Hall")), Some(None)),
        (timed(Some(at(-40))), Some(Some(at(-40).as_millisecond()))),
        (timed(None), Some(None)),
    ] {
        let is_changed = change.recorded_at.is_some_and(|time| time != Some(at(-50)));
        edit(change).await;
        let claim = due(&storage, 303).await;
        assert_eq!(claim.is_some(), is_changed, "{recorded_at:?}");
        if let Some(claim) = claim {
            assert_eq!(Some(claim.members[0].recorded_at_ms), recorded_at);
            assert!(storage.finish_merge(&claim, None, at(304)).await.unwrap());
        }
    }
}

async fn an_earlier_lidar_map_comes_back(storage: Storage) {
    let (id, clip) = one_job(&storage).await;
    let (first, _) = put_map(&storage, &id, b"map").await;
    put_map(&storage, &id, b"another map").await;
    let (current, is_new) =
        storage.restore_lidar_map(&id, &first, None, None, |_| true, at(5)).await.unwrap();
    assert_eq!((current.revision, is_new, &current.sha256), (3, true, &first.sha256));
    assert_eq!(storage.lidar_map_file(current.id()).await.unwrap(), &b"map"[..]);
    let job = storage.clip(&id, clip.id).await.unwrap().job.unwrap();
    assert_eq!((job.state, job.lidar_map_revision), (JobState::Queued, 3));
    let (again, is_new) = storage.restore_lidar_map(&id, &first, None, None, |_| true, at(6)).await.unwrap();
    assert_eq!((again, is_new), (current.clone(), false));
    let expected = |map: Option<&LidarMapRevision>| map.is_some_and(|map| map.revision == 2);
    let refused = storage.restore_lidar_map(&id, &first, None, None, expected, at(7)).await;
    assert!(matches!(refused, Err(StorageError::Changed { .. })));
    assert_eq!(storage.lidar_map(&id, LevelName::MAIN).await.unwrap(), current);
    // Its files go with the home.
    assert!(storage.delete_home(&id, |_| true, at(8)).await.is_ok());
    let late = storage.restore_lidar_map(&id, &first, None, None, |_| true, at(9)).await;
    assert!(matches!(late, Err(StorageError::NoLidarMap)), "{late:?}");
}
