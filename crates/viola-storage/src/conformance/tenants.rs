//! Tenants: each has its own homes under its own names, and nothing of others.

use super::*;

on_every_back_end!(
    the_same_id_is_another_home,
    lists_and_the_feed_are_a_tenants_own,
    bytes_are_counted,
    parts_are_joined_within_a_tenant,
);

fn tenant(name: &str) -> Tenant {
    name.parse().unwrap()
}

/// Returns two tenants with the same prefix, and the default one.
fn three() -> [Tenant; 3] {
    [tenant("acme"), tenant("acme-2"), Tenant::default()]
}

async fn the_same_id_is_another_home(storage: Storage) {
    let mut clips = Vec::new();
    for (n, tenant) in three().iter().enumerate() {
        let id = tenant.home(&home("h"));
        assert_eq!((id.tenant(), id.as_str(), id.to_string().as_str()), (tenant.name(), "h", "h"));
        let (made, is_new) = storage.put_home(&id, Some(tenant.name()), |_| true, at(0)).await.unwrap();
        assert!(is_new && made.id == id);
        put_map(&storage, &id, b"map").await;
        clips.push(add(&storage, &id, &[n as u8]).await);
    }
    for (tenant, clip) in three().iter().zip(&clips) {
        let id = tenant.home(&home("h"));
        assert_eq!(storage.home(&id).await.unwrap().name.as_deref(), Some(tenant.name()));
        for other in clips.iter().filter(|other| other.id != clip.id) {
            assert!(matches!(storage.clip(&id, other.id).await, Err(StorageError::NoSuchClip)));
            assert!(matches!(
                storage.delete_clip(&id, other.id, |_| true, at(1)).await,
                Err(StorageError::NoSuchClip)
            ));
        }
        let job = clip.job.as_ref().unwrap().id;
        assert_eq!(storage.job_home(job).await.unwrap(), Some(id));
    }
    storage.delete_home(&three()[0].home(&home("h")), |_| true, at(1)).await.unwrap();
    for (tenant, clip) in three().iter().zip(&clips).skip(1) {
        assert_eq!(storage.clip(&tenant.home(&home("h")), clip.id).await.unwrap(), *clip);
    }
}

async fn lists_and_the_feed_are_a_tenants_own(storage: Storage) {
    for tenant in &three() {
        for id in ["a", "b"] {
            storage.put_home(&tenant.home(&home(id)), None, |_| true, at(0)).await.unwrap();
        }
    }
    let page = |after: Option<HomeId>| Page { limit: 1, after };
    for tenant in &three() {
        for updated_after in [None, Some(at(-1))] {
            let since = HomeFilter { updated_after, ..HomeFilter::default() };
            let first = storage.homes(tenant, &since, &page(None)).await.unwrap();
            let second = storage.homes(tenant, &since, &page(Some(first[0].id.clone()))).await.unwrap();
            let third = storage.homes(tenant, &since, &page(Some(second[0].id.clone()))).await.unwrap();
            assert_eq!([&first[0].id, &second[0].id], [&tenant.home(&home("a")), &tenant.home(&home("b"))]);
            assert!(third.is_empty());
        }
        let told = storage.changes(tenant, None, 9, at(0)).await.unwrap();
        assert_eq!(told.items.len(), 2);
        assert!(told.items.iter().all(|change| tenant.has(&change.home)));
    }
    storage.delete_home(&three()[1].home(&home("a")), |_| true, at(1)).await.unwrap();
    for (n, tenant) in three().iter().enumerate() {
        let told = storage.changes(tenant, None, 9, at(1)).await.unwrap().items;
        let deleted: Vec<_> = told.iter().filter(|change| change.deleted).map(|change| change.kind).collect();
        assert_eq!(deleted, if n == 1 { vec![ChangeKind::Home] } else { vec![] });
    }
}

async fn bytes_are_counted(storage: Storage) {
    let [acme, other, _] = three();
    let id = acme.home(&home("h"));
    storage.put_home(&id, None, |_| true, at(0)).await.unwrap();
    assert_eq!(storage.tenant_bytes(&acme).await.unwrap(), 0);
    put_map(&storage, &id, b"a map").await;
    put_map(&storage, &id, b"another").await;
    let clip = add(&storage, &id, b"clip").await;
    add(&storage, &id, b"a clip").await;
    // Each map has a picture of 7 bytes.
    let maps = 5 + 7 + 7 + 7;
    assert_eq!(storage.tenant_bytes(&acme).await.unwrap(), maps + 4 + 6);
    storage.delete_clip(&id, clip.id, |_| true, at(1)).await.unwrap();
    assert_eq!(storage.tenant_bytes(&acme).await.unwrap(), maps + 6);
    assert_eq!(storage.tenant_bytes(&other).await.unwrap(), 0);
    storage.delete_home(&id, |_| true, at(2)).await.unwrap();
    assert_eq!(storage.tenant_bytes(&acme).await.unwrap(), 0);
}

async fn parts_are_joined_within_a_tenant(storage: Storage) {
    let [acme, other, _] = three();
    for tenant in [&acme, &other] {
        storage.put_home(&tenant.home(&home("h")), None, |_| true, at(0)).await.unwrap();
    }
    let limits = UploadLimits::default();
    let new = new_upload(UploadKind::Partial, &acme, Some(4));
    let part = storage.create_upload(new, &limits, None, at(0)).await.unwrap().id;
    assert_eq!(storage.upload_owner(part).await.unwrap(), Some((acme.clone(), None)));
    let mut writer = storage.begin_append(part, 0, None, &limits, at(0)).await.unwrap();
    let bytes = arrived(&storage, b"part").await;
    storage.append(&mut writer, bytes, &limits, at(0)).await.unwrap();
    let joining = |tenant: &Tenant| Joining {
        parts: vec![part],
        tenant: tenant.clone(),
        home: tenant.home(&home("h")),
        metadata: String::new(),
        concat: "final".to_owned(),
        max_bytes: 100,
    };
    let stolen = storage.join_uploads(&joining(&other), &limits, at(0)).await;
    assert!(matches!(stolen, Err(UploadError::PartNotFound { id }) if id == part), "{stolen:?}");
    let joined = storage.join_uploads(&joining(&acme), &limits, at(0)).await.unwrap();
    let owner = storage.upload_owner(joined.id).await.unwrap();
    assert_eq!(owner, Some((acme.clone(), Some(acme.home(&home("h"))))));
}

#[test]
fn only_harmless_names_are_tenants() {
    for good in ["a", "A.b_c-9", "default", &"x".repeat(64)] {
        assert!(good.parse::<Tenant>().is_ok(), "{good}");
    }
    for bad in ["", ".", "..", "a/b", "a b", "\u{e9}", &"x".repeat(65)] {
        assert!(bad.parse::<Tenant>().is_err(), "{bad:?}");
    }
}
