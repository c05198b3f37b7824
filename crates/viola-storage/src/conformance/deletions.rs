//! Deletions remove the last byte, and succeed only then.

use super::faults::{removals_fail, removals_fail_times};
use super::home_maps::{align, merge};
use super::*;

on_every_back_end!(
    a_tenant_goes_whole,
    a_tenant_goes_although_others_delete_all_the_time,
    a_tenant_goes_although_a_deletion_of_another_fails,
    who_deletes_is_told_the_truth,
    one_pass_finishes_all_deletions,
    a_deletion_that_times_out_does_not_stop_the_others,
    a_deletion_that_cannot_be_read_lets_others_pass,
    a_deletion_is_of_the_resource_as_it_was_read,
    files_that_a_change_replaces_are_deleted_once_the_store_works,
    a_home_is_removed_with_the_files_that_its_maps_left,
    a_removal_forgets_a_part_of_many_old_ones,
);

/// Creates a home with a map, a clip with results, and an unfinished upload.
async fn belongings(storage: &Storage, tenant: &Tenant) -> Clip {
    let id = tenant.home(&home("h"));
    storage.put_home(&id, None, |_| true, at(0)).await.unwrap();
    put_map(storage, &id, b"map").await;
    let clip = add(storage, &id, b"clip").await;
    let claim = storage.claim(LEASE, at(0)).await.unwrap().unwrap();
    storage.put_result(&claim, "cloud.ply", b"cloud".to_vec()).await.unwrap();
    assert!(end_attempt(storage, &claim, answer(AlignmentState::Ambiguous), 1).await);
    half_upload(storage, tenant).await;
    let key = NewKey {
        tenant: tenant.clone(),
        role: Role::Admin,
        home: None,
        label: String::new(),
        expires_at: None,
    };
    storage.create_key(key, at(0)).await.unwrap();
    let own = TenantLimits { max_bytes: None, max_uploads: Some(9) };
    storage.set_tenant_limits(tenant, &own).await.unwrap();
    storage.create_webhook(tenant, "https://fleet.example/", &ChangeKind::ALL, at(0)).await.unwrap();
    storage.fan_out(at(1)).await.unwrap();
    clip
}

/// Creates an upload with the first half of its bytes.
async fn half_upload(storage: &Storage, tenant: &Tenant) -> Uuid {
    let limits = UploadLimits::default();
    let new = new_upload(UploadKind::Partial, tenant, Some(8));
    let id = storage.create_upload(new, &limits, None, at(0)).await.unwrap().id;
    let mut writer = storage.begin_append(id, 0, None, &limits, at(0)).await.unwrap();
    storage.append(&mut writer, arrived(storage, b"part").await, &limits, at(0)).await.unwrap();
    id
}

/// Returns the number of a tenant's rows in all tables.
async fn rows(storage: &Storage, tenant: &Tenant) -> i64 {
    let mut rows = 0;
    let tables =
        ["homes", "jobs", "uploads", "changes", "api_keys", "tenant_sizes", "tenant_limits", "webhooks"];
    for table in tables {
        rows += count(storage, table, "tenant = $1", Some(tenant.name())).await;
    }
    for table in ["clips", "lidar_maps"] {
        rows += count(storage, table, "home_id LIKE $1", Some(&format!("{}/%", tenant.name()))).await;
    }
    rows + pending(storage, &format!("%{}%", tenant.name())).await
}

async fn a_tenant_goes_whole(storage: Storage) {
    let [acme, bolt]: [Tenant; 2] = ["acme", "bolt"].map(|name| name.parse().unwrap());
    let kept = belongings(&storage, &bolt).await;
    let before = (storage.blobs_that_exist().await, rows(&storage, &bolt).await);
    belongings(&storage, &acme).await;
    assert_eq!(storage.tenants().await.unwrap(), [acme.clone(), bolt.clone()]);
    let mut seen = 0;
    let removed = storage.delete_tenant(&acme, at(2), |homes| seen = homes).await.unwrap();
    assert_eq!(removed, Removed { homes: 1, uploads: 1, webhooks: 1, keys: 1 });
    assert_eq!(seen, 1);
    assert_eq!(rows(&storage, &acme).await, 0);
    assert_eq!((storage.blobs_that_exist().await, rows(&storage, &bolt).await), before);
    assert_eq!(storage.tenants().await.unwrap(), std::slice::from_ref(&bolt));
    let kept_still = storage.clip(&bolt.home(&home("h")), kept.id).await.unwrap();
    assert_eq!(kept_still.sha256, kept.sha256);
    let again = storage.delete_tenant(&acme, at(2), |_| {}).await.unwrap();
    assert_eq!(again, Removed::default());
}

/// Keeps some pending deletes of another tenant there.
async fn delete_all_the_time(storage: &Storage) {
    loop {
        let mut transaction = storage.database.begin().await.unwrap();
        if pending(storage, "%").await < 20 {
            let key = [format!("clips/{}/file", Uuid::now_v7())];
            pending_deletes::add(&mut transaction, "clip:bolt/h:", &key, at(3)).await.unwrap();
        }
        transaction.commit().await.unwrap();
    }
}

async fn a_tenant_goes_although_others_delete_all_the_time(storage: Storage) {
    let acme: Tenant = "acme".parse().unwrap();
    storage.put_home(&acme.home(&home("h")), None, |_| true, at(0)).await.unwrap();
    let limit = Duration::from_secs(30);
    tokio::select! {
        () = delete_all_the_time(&storage) => {}
        removed = tokio::time::timeout(limit, storage.delete_tenant(&acme, at(3), |_| {})) => {
            assert_eq!(removed.expect("it ends").unwrap(), Removed { homes: 1, ..Removed::default() });
        }
    }
}

async fn a_tenant_goes_although_a_deletion_of_another_fails(mut storage: Storage) {
    let acme: Tenant = "acme".parse().unwrap();
    let add_pending = async |storage: &Storage, owner: &str| {
        let mut transaction = storage.database.begin().await.unwrap();
        let key = [format!("clips/{}/file", Uuid::now_v7())];
        pending_deletes::add(&mut transaction, owner, &key, at(0)).await.unwrap();
        transaction.commit().await.unwrap();
    };
    storage.put_home(&acme.home(&home("h")), None, |_| true, at(0)).await.unwrap();
    add_pending(&storage, "clip:bolt/h:").await;
    let repair = removals_fail(&mut storage);
    let removed = storage.delete_tenant(&acme, at(1), |_| {}).await.unwrap();
    assert_eq!(removed, Removed { homes: 1, ..Removed::default() });
    assert_eq!((rows(&storage, &acme).await, pending(&storage, "%").await), (0, 1));
    // One of its own is not gone yet.
    add_pending(&storage, "clip:acme/h:").await;
    assert!(storage.delete_tenant(&acme, at(2), |_| {}).await.is_err());
    repair();
    storage.delete_tenant(&acme, at(3), |_| {}).await.unwrap();
    assert_eq!(pending(&storage, "%").await, 0);
}

async fn one_pass_finishes_all_deletions(storage: Storage) {
    let mut transaction = storage.database.begin().await.unwrap();
    for number in 0..250 {
        let key = [format!("clips/{number}/file")];
        pending_deletes::add(&mut transaction, "clip:h", &key, at(number / 7)).await.unwrap();
    }
    transaction.commit().await.unwrap();
    assert_eq!(storage.finish_deletions().await.unwrap(), 250);
    assert_eq!(storage.finish_deletions().await.unwrap(), 0);
}

async fn a_deletion_that_times_out_does_not_stop_the_others(mut storage: Storage) {
    let mut transaction = storage.database.begin().await.unwrap();
    let keys: Vec<String> = (0..2001).map(|number| format!("clips/{number}/file")).collect();
    pending_deletes::add(&mut transaction, "home:h", &keys, at(0)).await.unwrap();
    transaction.commit().await.unwrap();
    // All tries of the first of three deletions.
    let _ = removals_fail_times(&mut storage, 3);
    assert!(storage.finish_deletions().await.is_err());
    assert_eq!(storage.finish_deletions().await.unwrap(), 1);
}

async fn a_deletion_that_cannot_be_read_lets_others_pass(storage: Storage) {
    let mut transaction = storage.database.begin().await.unwrap();
    for owner in ["clip:h:1", "clip:h:2", "clip:h:3"] {
        pending_deletes::add(&mut transaction, owner, &["clips/1/file".to_owned()], at(0)).await.unwrap();
    }
    transaction.commit().await.unwrap();
    let later = "UPDATE doomed_blobs SET blob_keys = 'of a later version' WHERE owner = $1";
    execute(&storage, later, "clip:h:1").await;
    let failed = storage.finish_deletions().await;
    assert!(matches!(failed, Err(StorageError::Column { .. })), "{failed:?}");
    assert_eq!(pending(&storage, "%").await, 1);
}

async fn who_deletes_is_told_the_truth(mut storage: Storage) {
    let tenant: Tenant = "acme".parse().unwrap();
    let id = tenant.home(&home("h"));
    let clip = belongings(&storage, &tenant).await;
    let repair = removals_fail(&mut storage);
    let failed = storage.delete_clip(&id, clip.id, |_| true, at(3)).await;
    assert!(matches!(&failed, Err(error) if error.is_transient()), "{failed:?}");
    assert!(matches!(storage.clip(&id, clip.id).await, Err(StorageError::NoSuchClip)));
    let failed = storage.delete_clip(&id, clip.id, |_| true, at(3)).await;
    assert!(
        matches!(&failed, Err(error) if error.is_transient()),
        "as long as the file is there: {failed:?}"
    );
    assert!(storage.delete_home(&id, |_| true, at(3)).await.is_err());
    assert!(storage.delete_tenant(&tenant, at(3), |_| {}).await.is_err());
    assert!(storage.finish_deletions().await.is_err());
    repair();
    storage.delete_home(&id, |_| true, at(4)).await.unwrap();
    assert!(matches!(storage.delete_home(&id, |_| true, at(4)).await, Err(StorageError::NoSuchHome)));
    let left = storage.blobs_that_exist().await;
    assert!(left.iter().all(|key| key.starts_with("uploads/")), "of the home nothing: {left:?}");
    assert!(storage.delete_clip(&id, clip.id, |_| true, at(4)).await.is_err());
    storage.delete_tenant(&tenant, at(4), |_| {}).await.unwrap();
    assert_eq!(storage.finish_deletions().await.unwrap(), 0);
    assert!(storage.blobs_that_exist().await.is_empty());
    assert_eq!(rows(&storage, &tenant).await, 0);
}

async fn a_deletion_is_of_the_resource_as_it_was_read(mut storage: Storage) {
    let (id, clip) = one_job(&storage).await;
    let upper: LevelName = "upper".parse().unwrap();
    put_level(&storage, &id, upper, b"upper map").await.unwrap();
    let is_changed = |deleted| matches!(deleted, Err(StorageError::Changed { .. }));
    let home_as_read = storage.home(&id).await.unwrap();
    let map_as_read = storage.lidar_map(&id, upper).await.unwrap();
    let clip_as_read = storage.clip(&id, clip.id).await.unwrap();
    put_level(&storage, &id, upper, b"newer").await.unwrap();
    let title = ClipEdit { title: Some(Some("Kitchen".to_owned())), ..ClipEdit::default() };
    storage.edit_clip(&id, clip.id, title, |_| true, at(1)).await.unwrap();
    storage.put_home(&id, Some("Elm"), |_| true, at(1)).await.unwrap();
    let as_read = |map: Option<&LidarMapRevision>| map == Some(&map_as_read);
    assert!(is_changed(storage.delete_lidar_map(&id, upper, as_read, at(2)).await));
    assert!(is_changed(storage.delete_clip(&id, clip.id, |clip| *clip == clip_as_read, at(2)).await));
    assert!(is_changed(storage.delete_home(&id, |home| *home == home_as_read, at(2)).await));
    // The condition comes before the rule of the last level.
    storage.delete_lidar_map(&id, upper, |map| map.is_some(), at(3)).await.unwrap();
    assert!(is_changed(storage.delete_lidar_map(&id, LevelName::MAIN, |_| false, at(3)).await));
    assert_eq!(storage.clip(&id, clip.id).await.unwrap().title.as_deref(), Some("Kitchen"));
    // The same requests again resume deletions that the store interrupted: nothing is left to compare.
    let repair = removals_fail(&mut storage);
    assert!(storage.delete_clip(&id, clip.id, |_| true, at(4)).await.is_err());
    repair();
    storage.delete_clip(&id, clip.id, |_| false, at(5)).await.unwrap();
    storage.delete_home(&id, |_| true, at(6)).await.unwrap();
    assert!(storage.blobs_that_exist().await.is_empty());
}

async fn files_that_a_change_replaces_are_deleted_once_the_store_works(mut storage: Storage) {
    let (home, clip) = one_job(&storage).await;
    let deleted = half_upload(&storage, &Tenant::default()).await;
    half_upload(&storage, &Tenant::default()).await;
    let repair = removals_fail(&mut storage);
    storage.delete_upload(deleted, at(1)).await.unwrap();
    assert_eq!(storage.expire_uploads(at(1_000_000)).await.unwrap(), 1);
    // More revisions than are kept, of the home's map and of its LiDAR map.
    for n in 0..12u8 {
        align(&storage, AlignmentState::Aligned).await;
        merge(&storage, &[n], 200).await;
        if n < 6 {
            storage.align_clip(&home, clip.id, at(100)).await.unwrap();
        } else {
            put_map(&storage, &home, &[n]).await;
        }
    }
    for n in 20..26u8 {
        put_map(&storage, &home, &[n]).await;
    }
    repair();
    while storage.finish_deletions().await.unwrap() > 0 {}
    storage.check_no_blob_is_left("changes").await;
}

async fn a_home_is_removed_with_the_files_that_its_maps_left(mut storage: Storage) {
    let (home, clip) = one_job(&storage).await;
    let repair = removals_fail(&mut storage);
    // More revisions than are kept.
    for n in 0..7u8 {
        align(&storage, AlignmentState::Aligned).await;
        merge(&storage, &[n], 200).await;
        storage.align_clip(&home, clip.id, at(100)).await.unwrap();
    }
    assert!(pending(&storage, "home-map:%").await > 0);
    assert!(storage.delete_home(&home, |_| true, at(300)).await.is_err());
    repair();
    storage.delete_home(&home, |_| true, at(301)).await.unwrap();
    assert_eq!(pending(&storage, "home-map:%").await, 0);
}

async fn a_removal_forgets_a_part_of_many_old_ones(storage: Storage) {
    use crate::database::query;
    let (id, clip) = one_job(&storage).await;
    let mut transaction = storage.database.begin().await.unwrap();
    for number in 0..1_200 {
        query(
            "INSERT INTO changes (home_id, kind, clip_id, at, deleted, ticket)
            VALUES ('gone', 'clip', $1, $2, 1, $1)",
        )
        .bind(format!("{number:04}"))
        .bind(at(0).as_millisecond())
        .execute(&mut transaction)
        .await
        .unwrap();
    }
    transaction.commit().await.unwrap();
    let old = async || count(&storage, "changes", "home_id = 'gone'", None).await;
    let later = at(40 * 24 * 3600);
    storage.delete_clip(&id, clip.id, |_| true, later).await.unwrap();
    assert_eq!(old().await, 200);
    storage.delete_home(&id, |_| true, later).await.unwrap();
    assert_eq!(old().await, 0);
}

/// Returns the number of pending deletes whose owners are like a pattern.
async fn pending(storage: &Storage, owners: &str) -> i64 {
    count(storage, "doomed_blobs", "owner LIKE $1", Some(owners)).await
}
