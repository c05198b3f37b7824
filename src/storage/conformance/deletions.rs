//! Deletions remove the last byte, and succeed only then.

use super::faults::removals_fail;
use super::*;

on_every_back_end!(a_tenant_goes_whole, who_deletes_is_told_the_truth);

/// Creates a home with a map, a clip with results, and an unfinished upload.
async fn belongings(storage: &Storage, tenant: &Tenant) -> Clip {
    let id = tenant.home(&home("h"));
    storage.put_home(&id, None, |_| true, at(0)).await.unwrap();
    put_map(storage, &id, b"map").await;
    let clip = add(storage, &id, b"clip").await;
    let claim = storage.claim(LEASE, at(0)).await.unwrap().unwrap();
    storage.put_result(&claim, "cloud.ply", b"cloud".to_vec()).await.unwrap();
    storage.finish(&claim, &answer(AlignmentState::Ambiguous), &RetryPolicy::default(), at(1)).await.unwrap();
    let new = NewUpload {
        kind: UploadKind::Partial,
        tenant: tenant.clone(),
        home: None,
        metadata: String::new(),
        concat: Some("partial".to_owned()),
        length_bytes: Some(8),
    };
    let limits = UploadLimits::default();
    let part = storage.create_upload(new, &limits, at(0)).await.unwrap().id;
    let mut writer = storage.begin_append(part, 0, None, &limits, at(0)).await.unwrap();
    storage.append(&mut writer, arrived(storage, b"part").await, &limits, at(0)).await.unwrap();
    let key = NewKey {
        tenant: tenant.clone(),
        role: Role::Admin,
        home: None,
        label: String::new(),
        expires_at: None,
    };
    storage.create_key(key, at(0)).await.unwrap();
    storage.create_webhook(tenant, "https://fleet.example/", &ChangeKind::ALL, at(0)).await.unwrap();
    storage.fan_out(at(1)).await.unwrap();
    clip
}

/// Returns the number of a tenant's rows in all tables.
async fn rows(storage: &Storage, tenant: &Tenant) -> u64 {
    use crate::storage::columns::Columns;
    let mut rows = 0;
    for (statement, value) in [
        ("SELECT COUNT(*) AS n FROM homes WHERE tenant = $1", tenant.name().to_owned()),
        ("SELECT COUNT(*) AS n FROM jobs WHERE tenant = $1", tenant.name().to_owned()),
        ("SELECT COUNT(*) AS n FROM uploads WHERE tenant = $1", tenant.name().to_owned()),
        ("SELECT COUNT(*) AS n FROM changes WHERE tenant = $1", tenant.name().to_owned()),
        ("SELECT COUNT(*) AS n FROM api_keys WHERE tenant = $1", tenant.name().to_owned()),
        ("SELECT COUNT(*) AS n FROM tenant_sizes WHERE tenant = $1", tenant.name().to_owned()),
        ("SELECT COUNT(*) AS n FROM webhooks WHERE tenant = $1", tenant.name().to_owned()),
        ("SELECT COUNT(*) AS n FROM clips WHERE home_id LIKE $1", format!("{}/%", tenant.name())),
        ("SELECT COUNT(*) AS n FROM lidar_maps WHERE home_id LIKE $1", format!("{}/%", tenant.name())),
        ("SELECT COUNT(*) AS n FROM doomed_blobs WHERE owner LIKE $1", format!("%{}%", tenant.name())),
    ] {
        let row = crate::storage::database::query(statement).bind(value);
        let row = row.fetch_one(&mut storage.database.reader().await.unwrap()).await.unwrap();
        rows += row.count::<u64>("n").unwrap();
    }
    rows
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

async fn who_deletes_is_told_the_truth(mut storage: Storage) {
    let tenant: Tenant = "acme".parse().unwrap();
    let id = tenant.home(&home("h"));
    let clip = belongings(&storage, &tenant).await;
    let repair = removals_fail(&mut storage);
    let failed = storage.delete_clip(&id, clip.id, at(3)).await;
    assert!(matches!(&failed, Err(error) if error.is_transient()), "{failed:?}");
    assert!(matches!(storage.clip(&id, clip.id).await, Err(StorageError::NoSuchClip)));
    let failed = storage.delete_clip(&id, clip.id, at(3)).await;
    assert!(
        matches!(&failed, Err(error) if error.is_transient()),
        "as long as the file is there: {failed:?}"
    );
    assert!(storage.delete_home(&id, at(3)).await.is_err());
    assert!(storage.delete_tenant(&tenant, at(3), |_| {}).await.is_err());
    assert!(storage.finish_deletions().await.is_err());
    repair();
    storage.delete_home(&id, at(4)).await.unwrap();
    assert!(matches!(storage.delete_home(&id, at(4)).await, Err(StorageError::NoSuchHome)));
    let left = storage.blobs_that_exist().await;
    assert!(left.iter().all(|key| key.starts_with("uploads/")), "of the home nothing: {left:?}");
    assert!(storage.delete_clip(&id, clip.id, at(4)).await.is_err());
    storage.delete_tenant(&tenant, at(4), |_| {}).await.unwrap();
    assert_eq!(storage.finish_deletions().await.unwrap(), 0);
    assert!(storage.blobs_that_exist().await.is_empty());
    assert_eq!(rows(&storage, &tenant).await, 0);
}
