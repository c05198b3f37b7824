//! Uploads in parts: rights to append, durable bytes, and the conversion into a clip.

use super::*;

on_every_back_end!(
    pieces_become_the_file,
    a_writer_that_was_overtaken_changes_nothing,
    two_writers_at_one_offset_are_one,
    only_one_makes_the_clip,
    each_tenant_has_its_due_uploads,
    a_claim_that_was_lost_ends_nothing,
    a_refused_upload_tells_why,
    joining_is_all_or_nothing,
    what_is_abandoned_goes_and_what_has_arrived_stays,
    deleting_a_home_deletes_its_uploads,
    the_same_content_has_one_upload,
);

const HOUR: i64 = 3600;

fn limits() -> UploadLimits {
    UploadLimits { patience: Duration::from_secs(HOUR as u64), ..UploadLimits::default() }
}

async fn begin(storage: &Storage, kind: UploadKind, length_bytes: Option<u64>) -> Uuid {
    begin_of(storage, Tenant::default(), kind, length_bytes).await
}

async fn begin_of(storage: &Storage, tenant: Tenant, kind: UploadKind, length_bytes: Option<u64>) -> Uuid {
    let of = tenant.home(&home("h"));
    storage.put_home(&of, None, |_| true, at(0)).await.unwrap();
    let home = (kind == UploadKind::Whole).then_some(of);
    let new = NewUpload { home, ..new_upload(kind, &tenant, length_bytes) };
    storage.create_upload(new, &limits(), None, at(0)).await.unwrap().id
}

async fn writer(storage: &Storage, id: Uuid, offset: u64) -> Result<UploadWriter, UploadError> {
    storage.begin_append(id, offset, None, &limits(), at(1)).await
}

async fn write(storage: &Storage, writer: &mut UploadWriter, bytes: &[u8]) -> Result<(), UploadError> {
    let bytes = arrived(storage, bytes).await;
    storage.append(writer, bytes, &limits(), at(2)).await
}

/// Creates an upload with all its bytes.
async fn whole(storage: &Storage, bytes: &[u8]) -> Uuid {
    whole_of(storage, Tenant::default(), bytes).await
}

async fn whole_of(storage: &Storage, tenant: Tenant, bytes: &[u8]) -> Uuid {
    let id = begin_of(storage, tenant, UploadKind::Whole, Some(bytes.len() as u64)).await;
    write(storage, &mut writer(storage, id, 0).await.unwrap(), bytes).await.unwrap();
    id
}

async fn finish(storage: &Storage, claim: &UploadClaim) -> Option<Added> {
    let file = storage.assemble_upload(claim).await.unwrap();
    storage.finish_upload(claim, new_clip(file), Duration::from_secs(60), at(3)).await.unwrap()
}

async fn read(storage: &Storage, id: Uuid) -> Upload {
    storage.upload(id, at(3)).await.unwrap().expect("the upload is there")
}

async fn pieces_become_the_file(storage: Storage) {
    let id = begin(&storage, UploadKind::Whole, None).await;
    let mut first = writer(&storage, id, 0).await.unwrap();
    for piece in [&b"one "[..], b"two "] {
        write(&storage, &mut first, piece).await.unwrap();
    }
    assert_eq!((first.offset(), read(&storage, id).await.received_bytes), (8, 8));
    assert!(matches!(writer(&storage, id, 7).await, Err(UploadError::WrongOffset { received: 8 })));
    // The length is set in between, and is fixed then.
    let told = storage.begin_append(id, 8, Some(13), &limits(), at(1)).await;
    write(&storage, &mut told.unwrap(), b"three").await.unwrap();
    let upload = read(&storage, id).await;
    assert_eq!((upload.state, upload.length_bytes), (UploadState::Arrived, Some(13)));
    let again = storage.begin_append(id, 13, Some(14), &limits(), at(1)).await;
    assert!(matches!(again, Err(UploadError::LengthTold)), "{again:?}");

    assert_eq!(storage.due_uploads(9, at(3)).await.unwrap(), [(Tenant::default(), id)]);
    let claim = storage.claim_upload(id, LEASE, at(3)).await.unwrap().expect("it is due");
    let Some(Added::New(clip)) = finish(&storage, &claim).await else { panic!("a clip is made") };
    assert_eq!(bytes_of(storage.clip_recording(clip.id).await.unwrap()).await, b"one two three");
    let upload = read(&storage, id).await;
    assert_eq!((upload.state, upload.clip), (UploadState::Finished, Some(clip.id)));
    assert_eq!(storage.blobs_that_exist().await, storage.blob_keys_that_matter().await);
    storage.delete_clip(&home("h"), clip.id, |_| true, at(4)).await.unwrap();
    assert_eq!(storage.upload(id, at(4)).await.unwrap(), None);
}

async fn a_writer_that_was_overtaken_changes_nothing(storage: Storage) {
    let id = begin(&storage, UploadKind::Whole, Some(6)).await;
    let mut old = writer(&storage, id, 0).await.unwrap();
    write(&storage, &mut old, b"ab").await.unwrap();
    let mut new = writer(&storage, id, 2).await.unwrap();
    // Before and after the newer one has written.
    for _ in 0..2 {
        let late = write(&storage, &mut old, b"XY").await;
        assert!(matches!(late, Err(UploadError::Overtaken)), "{late:?}");
        assert_eq!(
            storage.blobs_that_exist().await.len() as u64,
            read(&storage, id).await.received_bytes / 2
        );
        if new.offset() == 2 {
            write(&storage, &mut new, b"cd").await.unwrap();
        }
    }
    write(&storage, &mut new, b"ef").await.unwrap();
    let claim = storage.claim_upload(id, LEASE, at(3)).await.unwrap().expect("it is due");
    assert_eq!(storage.assemble_upload(&claim).await.unwrap().read().unwrap(), b"abcdef");
    storage.delete_upload(id, at(3)).await.unwrap();
    assert!(matches!(write(&storage, &mut new, b"gh").await, Err(UploadError::NotFound)));
    assert_eq!(storage.blobs_that_exist().await, Vec::<String>::new());
}

async fn two_writers_at_one_offset_are_one(storage: Storage) {
    for _ in 0..20 {
        let id = begin(&storage, UploadKind::Whole, Some(100)).await;
        let both = [b"first bytes!", b"other bytes!"].map(|bytes| {
            let storage = &storage;
            async move {
                let mut writer = writer(storage, id, 0).await?;
                tokio::task::yield_now().await;
                write(storage, &mut writer, bytes).await
            }
        });
        let ended = futures::future::join_all(both).await;
        let kept = ended.iter().filter(|ended| ended.is_ok()).count();
        assert_eq!(read(&storage, id).await.received_bytes, 12 * kept as u64);
        assert_eq!((kept, storage.blobs_that_exist().await.len()), (1, 1), "{ended:?}");
        storage.delete_upload(id, at(3)).await.unwrap();
    }
}

async fn only_one_makes_the_clip(storage: Storage) {
    let id = whole(&storage, b"a clip").await;
    let claims = (0..5).map(|_| storage.claim_upload(id, LEASE, at(3)));
    let claims = futures::future::join_all(claims).await;
    let claims: Vec<UploadClaim> = claims.into_iter().filter_map(|claim| claim.unwrap()).collect();
    assert_eq!(claims.len(), 1);
    assert!(storage.due_uploads(9, at(3)).await.unwrap().is_empty());
    // Given back, it is due after a pause, and the attempt does not count.
    storage.give_back_upload(&claims[0], Duration::from_secs(10), at(3)).await.unwrap();
    assert!(storage.claim_upload(id, LEASE, at(12)).await.unwrap().is_none());
    let claim = storage.claim_upload(id, LEASE, at(13)).await.unwrap().expect("it is due again");
    assert_eq!(claim.lost_attempts, 0);
    // A lost claim counts.
    assert!(storage.renew_upload(&claim, LEASE, at(20)).await.unwrap());
    assert!(storage.claim_upload(id, LEASE, at(49)).await.unwrap().is_none());
    let next = storage.claim_upload(id, LEASE, at(50)).await.unwrap().expect("its lease ran out");
    assert_eq!(next.lost_attempts, 1);
}

async fn each_tenant_has_its_due_uploads(storage: Storage) {
    let [acme, bolt]: [Tenant; 2] = ["acme", "bolt"].map(|name| name.parse().unwrap());
    let mut of_acme = Vec::new();
    for _ in 0..4 {
        of_acme.push(whole_of(&storage, acme.clone(), b"a clip").await);
    }
    let of_bolt = whole_of(&storage, bolt.clone(), b"a clip").await;
    let due = async |seconds| storage.due_uploads(3, at(seconds)).await.unwrap();
    let of = |tenant: &Tenant, ids: &[Uuid]| ids.iter().map(|id| (tenant.clone(), *id)).collect::<Vec<_>>();
    let [first, second, third, fourth] = of_acme[..] else { unreachable!() };
    let expected = [of(&acme, &[first]), of(&bolt, &[of_bolt]), of(&acme, &[second, third])].concat();
    assert_eq!(due(3).await, expected);
    // One that was tried comes after those that were not.
    let claim = storage.claim_upload(first, LEASE, at(3)).await.unwrap().expect("it is due");
    storage.give_back_upload(&claim, Duration::ZERO, at(4)).await.unwrap();
    let expected = [of(&acme, &[second]), of(&bolt, &[of_bolt]), of(&acme, &[third, fourth])].concat();
    assert_eq!(due(5).await, expected);
}

async fn a_claim_that_was_lost_ends_nothing(storage: Storage) {
    let id = whole(&storage, b"a clip").await;
    let late = storage.claim_upload(id, LEASE, at(3)).await.unwrap().expect("it is due");
    let file = storage.assemble_upload(&late).await.unwrap();
    let claim = storage.claim_upload(id, LEASE, at(100)).await.unwrap().expect("the lease ran out");
    assert!(!storage.renew_upload(&late, LEASE, at(100)).await.unwrap());
    let none = storage.finish_upload(&late, new_clip(file), Duration::from_secs(60), at(100)).await.unwrap();
    assert!(none.is_none(), "{none:?}");
    let problem = serde_json::json!({"type": "late"});
    storage.refuse_upload(&late, &problem, Duration::from_secs(60), at(100)).await.unwrap();
    storage.give_back_upload(&late, Duration::ZERO, at(100)).await.unwrap();
    assert!(storage.claim_upload(id, LEASE, at(101)).await.unwrap().is_none(), "the claim is held");
    assert!(matches!(finish(&storage, &claim).await, Some(Added::New(_))));
    assert!(finish_again(&storage, &claim).await, "a second end changes nothing");
    assert_eq!(storage.home(&home("h")).await.unwrap().clips.iter().sum::<i64>(), 1);
    assert_eq!(storage.blobs_that_exist().await, storage.blob_keys_that_matter().await);
}

async fn finish_again(storage: &Storage, claim: &UploadClaim) -> bool {
    let file = arrived(storage, b"a clip").await;
    storage.finish_upload(claim, new_clip(file), Duration::from_secs(60), at(200)).await.unwrap().is_none()
}

async fn a_refused_upload_tells_why(storage: Storage) {
    let id = whole(&storage, b"no clip").await;
    let claim = storage.claim_upload(id, LEASE, at(3)).await.unwrap().expect("it is due");
    let problem = serde_json::json!({"type": "no-clip"});
    storage.refuse_upload(&claim, &problem, Duration::from_secs(60), at(3)).await.unwrap();
    let upload = read(&storage, id).await;
    assert_eq!((upload.state, upload.problem), (UploadState::Refused, Some(problem)));
    assert!(matches!(storage.living_upload(id, at(3)).await, Err(UploadError::Gone)));
    assert_eq!(storage.blobs_that_exist().await, Vec::<String>::new());
    assert_eq!(storage.expire_uploads(at(63)).await.unwrap(), 1);
    assert_eq!(storage.upload(id, at(63)).await.unwrap(), None);
}

async fn joining_is_all_or_nothing(storage: Storage) {
    let mut parts = Vec::new();
    for bytes in [&b"one "[..], b"two "] {
        let id = begin(&storage, UploadKind::Partial, Some(4)).await;
        write(&storage, &mut writer(&storage, id, 0).await.unwrap(), bytes).await.unwrap();
        parts.push(id);
    }
    let unfinished = begin(&storage, UploadKind::Partial, Some(5)).await;
    let joining = |parts: &[Uuid], max_bytes| Joining {
        parts: parts.to_vec(),
        tenant: Tenant::default(),
        home: home("h"),
        metadata: String::new(),
        concat: format!("final;{parts:?}"),
        max_bytes,
    };
    let storage = &storage;
    let join = |joining| async move { storage.join_uploads(&joining, &limits(), at(3)).await };
    let all = [parts[1], parts[0], unfinished];
    assert!(
        matches!(join(joining(&all, 99)).await, Err(UploadError::PartUnfinished { id }) if id == unfinished)
    );
    write(storage, &mut writer(storage, unfinished, 0).await.unwrap(), b"three").await.unwrap();
    assert!(matches!(join(joining(&all, 12)).await, Err(UploadError::TooLarge { limit: 12 })));
    let nobody = Uuid::now_v7();
    let with_nobody = [parts[0], nobody];
    assert!(
        matches!(join(joining(&with_nobody, 99)).await, Err(UploadError::PartNotFound { id }) if id == nobody)
    );
    for part in all {
        assert_eq!(read(storage, part).await.state, UploadState::Arrived);
    }
    // Several at once: one is made, and all requests return it.
    let made = futures::future::join_all((0..4).map(|_| join(joining(&all, 13)))).await;
    let ids: Vec<Uuid> = made.into_iter().map(|made| made.unwrap().id).collect();
    assert!(ids.iter().all(|id| *id == ids[0]), "{ids:?}");
    let claim = storage.claim_upload(ids[0], LEASE, at(3)).await.unwrap().expect("it is due");
    assert_eq!(storage.assemble_upload(&claim).await.unwrap().read().unwrap(), b"two one three");
    assert!(matches!(join(joining(&parts, 99)).await, Err(UploadError::PartGone { .. })));
    // The parts' records expire, and the whole file stays.
    assert_eq!(storage.expire_uploads(at(2 * HOUR)).await.unwrap(), 3);
    assert_eq!(storage.blobs_that_exist().await.len(), 3);
}

async fn what_is_abandoned_goes_and_what_has_arrived_stays(storage: Storage) {
    let arriving = begin(&storage, UploadKind::Whole, Some(9)).await;
    write(&storage, &mut writer(&storage, arriving, 0).await.unwrap(), b"half").await.unwrap();
    let part = begin(&storage, UploadKind::Partial, Some(4)).await;
    write(&storage, &mut writer(&storage, part, 0).await.unwrap(), b"part").await.unwrap();
    let arrived = whole(&storage, b"whole").await;
    // Every append extends the expiry; the last one was in second 2.
    let end = HOUR + 2;
    assert_eq!(storage.expire_uploads(at(end - 1)).await.unwrap(), 0);
    for gone in [arriving, part] {
        assert!(storage.living_upload(gone, at(end - 1)).await.is_ok());
        assert!(matches!(storage.living_upload(gone, at(end)).await, Err(UploadError::Gone)));
        assert!(matches!(storage.delete_upload(gone, at(end)).await, Err(UploadError::Gone)));
    }
    assert_eq!(storage.expire_uploads(at(end)).await.unwrap(), 2);
    for gone in [arriving, part] {
        assert!(matches!(storage.living_upload(gone, at(end)).await, Err(UploadError::NotFound)));
    }
    assert_eq!(storage.living_upload(arrived, at(99 * HOUR)).await.unwrap().received_bytes, 5);
    // The cleaner calls both.
    storage.finish_deletions().await.unwrap();
    assert_eq!(storage.blobs_that_exist().await.len(), 1);
    // More than one transaction removes.
    for _ in 0..150 {
        let new = new_upload(UploadKind::Partial, &Tenant::default(), None);
        storage.create_upload(new, &limits(), None, at(0)).await.unwrap();
    }
    assert_eq!(storage.expire_uploads(at(end)).await.unwrap(), 150);
}

async fn deleting_a_home_deletes_its_uploads(storage: Storage) {
    let id = whole(&storage, b"a clip").await;
    let claim = storage.claim_upload(id, LEASE, at(3)).await.unwrap().expect("it is due");
    let file = storage.assemble_upload(&claim).await.unwrap();
    storage.delete_home(&home("h"), |_| true, at(3)).await.unwrap();
    assert_eq!(storage.upload(id, at(3)).await.unwrap(), None);
    let late = storage.finish_upload(&claim, new_clip(file), Duration::from_secs(60), at(4)).await;
    assert!(matches!(late, Err(StorageError::NoSuchHome)), "{late:?}");
    assert_eq!(storage.blobs_that_exist().await, Vec::<String>::new());
}

async fn the_same_content_has_one_upload(storage: Storage) {
    let ids = ["h", "other"].map(home);
    for id in &ids {
        storage.put_home(id, None, |_| true, at(0)).await.unwrap();
    }
    let new = |of: &HomeId, content_key: Option<&str>, length_bytes: Option<u64>| NewUpload {
        home: Some(of.clone()),
        content_key: content_key.map(str::to_owned),
        ..new_upload(UploadKind::Whole, &Tenant::default(), length_bytes)
    };
    let storage = &storage;
    let same = async |new: NewUpload, seconds| storage.same_upload(&new, at(seconds)).await.unwrap();
    let begin = async |new: NewUpload| storage.create_upload(new, &limits(), None, at(0)).await.unwrap().id;
    assert_eq!(same(new(&ids[0], Some("a"), Some(6)), 1).await, None);
    begin(new(&ids[0], None, Some(6))).await;
    let id = begin(new(&ids[0], Some("a"), Some(6))).await;
    // The same file by the same home, whether its length is known or not.
    let cases = [
        (&ids[0], Some("a"), Some(6), Some(id)),
        (&ids[0], Some("a"), None, Some(id)),
        (&ids[0], Some("a"), Some(7), None),
        (&ids[0], Some("b"), Some(6), None),
        (&ids[0], None, Some(6), None),
        (&ids[1], Some("a"), Some(6), None),
    ];
    let check = async |state: &str| {
        for (of, key, length, expected) in cases {
            assert_eq!(same(new(of, key, length), 3).await, expected, "{state}: {of} {key:?} {length:?}");
        }
    };
    check("begun").await;
    write(storage, &mut writer(storage, id, 0).await.unwrap(), b"a cl").await.unwrap();
    check("arriving").await;
    write(storage, &mut writer(storage, id, 4).await.unwrap(), b"ip").await.unwrap();
    check("arrived").await;
    assert_eq!(same(new(&ids[0], Some("a"), None), 99 * HOUR).await, Some(id), "it never expires");
    let claim = storage.claim_upload(id, LEASE, at(3)).await.unwrap().expect("it is due");
    let Some(Added::New(clip)) = finish(storage, &claim).await else { panic!("a clip is made") };
    check("finished").await;
    // The record of its end expires, and it goes with its clip.
    assert_eq!(same(new(&ids[0], Some("a"), None), 63).await, None);
    storage.delete_clip(&ids[0], clip.id, |_| true, at(4)).await.unwrap();
    assert_eq!(same(new(&ids[0], Some("a"), None), 5).await, None);
    // A refused one is no upload of the file.
    let refused = begin(new(&ids[0], Some("a"), Some(6))).await;
    write(storage, &mut writer(storage, refused, 0).await.unwrap(), b"a clip").await.unwrap();
    let claim = storage.claim_upload(refused, LEASE, at(3)).await.unwrap().expect("it is due");
    let problem = serde_json::json!({"type": "no-clip"});
    storage.refuse_upload(&claim, &problem, Duration::from_secs(60), at(3)).await.unwrap();
    assert_eq!(same(new(&ids[0], Some("a"), Some(6)), 3).await, None);
}

#[tokio::test]
async fn pieces_outlive_a_restart() {
    let folder = tempfile::tempdir().unwrap();
    let storage = in_folder(folder.path()).await;
    let id = begin(&storage, UploadKind::Whole, Some(6)).await;
    let mut before = writer(&storage, id, 0).await.unwrap();
    write(&storage, &mut before, b"abc").await.unwrap();
    drop(storage);
    let storage = in_folder(folder.path()).await;
    let mut after = writer(&storage, id, 3).await.unwrap();
    write(&storage, &mut after, b"def").await.unwrap();
    let claim = storage.claim_upload(id, LEASE, at(3)).await.unwrap().expect("it is due");
    assert_eq!(storage.assemble_upload(&claim).await.unwrap().read().unwrap(), b"abcdef");
    // A version without uploads removes their pieces at its start: the loss is detected, and no clip made.
    for key in storage.blobs_that_exist().await.iter().take(1) {
        std::fs::remove_file(folder.path().join("blobs").join(key)).unwrap();
    }
    assert!(matches!(storage.assemble_upload(&claim).await, Err(UploadError::Lost)));
}
