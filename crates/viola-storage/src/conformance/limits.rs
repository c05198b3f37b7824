//! Limits of a tenant: every file counts.

use super::home_maps::{align, merge};
use super::*;

on_every_back_end!(
    every_file_of_a_tenant_counts,
    announced_bytes_count_until_they_have_arrived,
    old_lidar_maps_go,
    uploads_are_limited_for_each_tenant,
    a_repeated_upload_of_a_stored_clip_needs_no_room,
    uploads_at_once_do_not_fill_the_same_room,
    a_used_key_gives_no_room,
    lidar_maps_have_no_room_beyond_the_quota,
);

/// Returns the size of all blobs.
async fn stored_bytes(storage: &Storage) -> u64 {
    let mut sum = 0;
    for key in storage.blobs_that_exist().await {
        sum += storage.blobs.read(&key).await.unwrap().unwrap().size_bytes;
    }
    sum
}

pub(super) async fn check(storage: &Storage, what: &str) {
    let counted = storage.tenant_bytes(&Tenant::default()).await.unwrap();
    assert_eq!(counted, stored_bytes(storage).await, "after {what}");
}

async fn every_file_of_a_tenant_counts(storage: Storage) {
    let (home, clip) = one_job(&storage).await;
    check(&storage, "a map and a clip").await;
    // More revisions than are kept.
    for number in 0..7 {
        align(&storage, AlignmentState::Aligned).await;
        check(&storage, "a result").await;
        merge(&storage, format!("tile {number}").repeat(number + 1).as_bytes(), 200).await;
        check(&storage, "a merge").await;
        storage.align_clip(&home, clip.id, at(100)).await.unwrap();
        check(&storage, "the end of a result").await;
    }
    align(&storage, AlignmentState::Aligned).await;
    storage.delete_clip(&home, clip.id, |_| true, at(400)).await.unwrap();
    check(&storage, "the end of a clip").await;
    put_level(&storage, &home, "upper".parse().unwrap(), b"another level").await.unwrap();
    check(&storage, "a level").await;
    storage.delete_lidar_map(&home, "upper".parse().unwrap(), |_| true, at(500)).await.unwrap();
    check(&storage, "the end of a level").await;
    storage.delete_home(&home, |_| true, at(600)).await.unwrap();
    assert_eq!(storage.tenant_bytes(&Tenant::default()).await.unwrap(), 0);
}

fn upload(tenant: &Tenant, length_bytes: Option<u64>) -> NewUpload {
    new_upload(UploadKind::Partial, tenant, length_bytes)
}

async fn announced_bytes_count_until_they_have_arrived(storage: Storage) {
    let (tenant, limits) = (Tenant::default(), UploadLimits::default());
    let counted = async || storage.tenant_bytes(&tenant).await.unwrap();
    let known = storage.create_upload(upload(&tenant, Some(100)), &limits, None, at(0)).await.unwrap().id;
    assert_eq!(counted().await, 100);
    let deferred = storage.create_upload(upload(&tenant, None), &limits, None, at(0)).await.unwrap().id;
    for (id, expected) in [(known, 100), (deferred, 104)] {
        let mut writer = storage.begin_append(id, 0, None, &limits, at(0)).await.unwrap();
        storage.append(&mut writer, arrived(&storage, b"part").await, &limits, at(0)).await.unwrap();
        assert_eq!(counted().await, expected);
    }
    storage.begin_append(deferred, 4, Some(50), &limits, at(0)).await.unwrap();
    assert_eq!((counted().await, storage.unfinished_uploads(&tenant).await.unwrap()), (150, 2));
    storage.delete_upload(known, at(1)).await.unwrap();
    assert_eq!(counted().await, 50);
    storage.expire_uploads(at(1_000_000)).await.unwrap();
    assert_eq!((counted().await, storage.unfinished_uploads(&tenant).await.unwrap()), (0, 0));
}

async fn old_lidar_maps_go(storage: Storage) {
    let (home, _) = one_job(&storage).await;
    let upper: LevelName = "upper".parse().unwrap();
    put_level(&storage, &home, upper, b"upper").await.unwrap();
    for number in 0..30 {
        put_map(&storage, &home, format!("map {number}").as_bytes()).await;
    }
    check(&storage, "thirty maps").await;
    let page = Page { limit: 100, after: None };
    let kept = storage.lidar_map_revisions(&home, LevelName::MAIN, &page).await.unwrap();
    assert_eq!(kept.iter().map(|map| map.revision).collect::<Vec<_>>(), (23..=32).rev().collect::<Vec<_>>());
    assert_eq!(storage.lidar_map_revisions(&home, upper, &page).await.unwrap().len(), 1);
    assert_eq!(storage.blobs_that_exist().await, storage.blob_keys_that_matter().await);
    // The clip keeps eleven jobs, and these their maps.
    assert_eq!(count(&storage, "lidar_maps", "1 = 1", None).await, 1 + 11);
    // The next revision counts from one that was removed.
    storage.delete_lidar_map(&home, LevelName::MAIN, |_| true, at(1)).await.unwrap();
    assert_eq!(put_map(&storage, &home, b"map").await.0.revision, 33);
}

async fn uploads_are_limited_for_each_tenant(storage: Storage) {
    let [acme, bolt]: [Tenant; 2] = ["acme", "bolt"].map(|name| name.parse().unwrap());
    let limits = UploadLimits { in_tenant: 3, ..UploadLimits::default() };
    let create = async |tenant: &Tenant| {
        storage.create_upload(upload(tenant, Some(1)), &limits, None, at(0)).await.is_ok()
    };
    let count = async |tenant: &Tenant| {
        let mut made = 0;
        while create(tenant).await {
            made += 1;
        }
        made
    };
    assert_eq!((count(&acme).await, count(&bolt).await), (3, 3));
    let own = TenantLimits { max_bytes: Some(5), max_uploads: Some(4) };
    storage.set_tenant_limits(&acme, &own).await.unwrap();
    assert_eq!(storage.tenant_limits(&acme).await.unwrap(), own);
    assert_eq!((count(&acme).await, count(&bolt).await), (1, 0));
    storage.set_tenant_limits(&acme, &TenantLimits::default()).await.unwrap();
    assert_eq!(storage.tenant_limits(&acme).await.unwrap(), TenantLimits::default());
    // Expired uploads do not count, even before they are removed.
    let later = at(2 * limits.patience.as_secs() as i64);
    storage.create_upload(upload(&bolt, Some(1)), &limits, None, later).await.unwrap();
}

async fn a_repeated_upload_of_a_stored_clip_needs_no_room(storage: Storage) {
    let (tenant, limits) = (Tenant::default(), UploadLimits::default());
    for (is_stored, fits) in [(false, false), (true, true)] {
        let new = NewUpload { is_stored, ..upload(&tenant, Some(60)) };
        assert_eq!(storage.create_upload(new, &limits, Some(50), at(0)).await.is_ok(), fits, "{is_stored}");
    }
}

async fn uploads_at_once_do_not_fill_the_same_room(storage: Storage) {
    let (tenant, limits) = (Tenant::default(), UploadLimits::default());
    let create = |_| storage.create_upload(upload(&tenant, Some(60)), &limits, Some(100), at(0));
    let made = futures::future::join_all((0..6).map(create)).await;
    assert_eq!(made.iter().filter(|made| made.is_ok()).count(), 1);
    let is_full = |error: &UploadError| {
        matches!(error, UploadError::Storage(StorageError::TenantFull { used: 60, limit: 100, .. }))
    };
    assert_eq!(made.iter().filter(|made| made.as_ref().is_err_and(is_full)).count(), 5, "{made:?}");
    // The limit of the tenant comes before that of the service.
    storage
        .set_tenant_limits(&tenant, &TenantLimits { max_bytes: Some(120), max_uploads: None })
        .await
        .unwrap();
    assert!(create(0).await.is_ok());
    assert!(create(0).await.is_err());
}

async fn a_used_key_gives_no_room(storage: Storage) {
    let id = home("h");
    storage.put_home(&id, None, |_| true, at(0)).await.unwrap();
    let add = async |bytes: &[u8], key: &str| {
        let file = arrived(&storage, bytes).await;
        let new = NewClip { idempotency_key: Some(key.to_owned()), ..new_clip(file) };
        storage.add_clip(&id, new, Some(10), at(0)).await
    };
    let Ok(Added::New(small)) = add(b"small", "key").await else { panic!("it is new") };
    let full = add(b"six...", "other key").await;
    assert!(matches!(full, Err(StorageError::TenantFull { used: 5, limit: 10, .. })), "{full:?}");
    assert!(matches!(add(b"small", "key").await, Ok(Added::Replayed(_))));
    // A larger file that came with the key arrives after the end of the clip.
    storage.delete_clip(&id, small.id, |_| true, at(1)).await.unwrap();
    let large = add(b"twelve bytes", "key").await;
    assert!(matches!(large, Err(StorageError::TenantFull { used: 0, limit: 10, .. })), "{large:?}");
    assert!(storage.blobs_that_exist().await.is_empty());
}

async fn lidar_maps_have_no_room_beyond_the_quota(storage: Storage) {
    let id = home("h");
    storage.put_home(&id, None, |_| true, at(0)).await.unwrap();
    let put = async |bytes: &[u8]| {
        let file = arrived(&storage, bytes).await;
        let new = NewLidarMap { image_png: vec![0], ..new_lidar_map(LevelName::MAIN, file) };
        storage.put_lidar_map(&id, new, Some(10), |_| true, at(0)).await
    };
    let (first, _) = put(b"small").await.unwrap();
    let full = put(b"four").await;
    assert!(matches!(full, Err(StorageError::TenantFull { used: 6, limit: 10, .. })), "{full:?}");
    let (again, is_new) = put(b"small").await.unwrap();
    assert_eq!((again.revision, is_new), (first.revision, false));
    let (second, _) = put(b"map").await.unwrap();
    let full = storage.restore_lidar_map(&id, &first, None, Some(10), |_| true, at(1)).await;
    assert!(matches!(full, Err(StorageError::TenantFull { used: 10, limit: 10, .. })), "{full:?}");
    assert_eq!(storage.lidar_map(&id, LevelName::MAIN).await.unwrap(), second);
}
