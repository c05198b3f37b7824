//! Keys: valid from their creation to their end, and never stored in plain text.

use super::*;
use jiff::SignedDuration;

on_every_back_end!(
    a_key_is_valid_until_its_end,
    a_use_waits_for_no_writer,
    a_revoked_key_is_nobodys,
    the_secret_is_kept_nowhere,
);

fn new_key(tenant: &str, expires_at: Option<Timestamp>) -> NewKey {
    let tenant: Tenant = tenant.parse().unwrap();
    let home = Some(tenant.home(&home("h")));
    NewKey { tenant, role: Role::Uploader, home, label: "phone".to_owned(), expires_at }
}

async fn a_key_is_valid_until_its_end(storage: Storage) {
    assert!(!storage.has_keys().await.unwrap());
    let (key, secret) = storage.create_key(new_key("acme", Some(at(100))), at(0)).await.unwrap();
    assert!(storage.has_keys().await.unwrap());
    assert_eq!((key.tenant.name(), key.role, key.last_used_at), ("acme", Role::Uploader, None));
    assert_eq!(key.home.as_ref().map(HomeId::as_str), Some("h"));
    let used = storage.use_key(&secret, at(99)).await.unwrap().unwrap();
    assert_eq!(ApiKey { last_used_at: None, ..used }, key);
    assert_eq!(storage.use_key(&secret, at(100)).await.unwrap(), None);
    // The last use is known to a minute.
    assert_eq!(last_use(&storage).await, at(99));
    let (_, forever) = storage.create_key(new_key("acme", None), at(0)).await.unwrap();
    let late = at(0) + SignedDuration::from_hours(24 * 3650);
    assert!(storage.use_key(&forever, late).await.unwrap().is_some());
    let other: Secret = format!("viola_{}", "0".repeat(64)).parse().unwrap();
    assert_eq!(storage.use_key(&other, at(0)).await.unwrap(), None);
}

/// Returns the last use of the oldest key, which a task writes.
async fn last_use(storage: &Storage) -> Timestamp {
    viola_testing::eventually("the use of the key is noted", || async {
        storage.keys(None).await.unwrap()[0].last_used_at
    })
    .await
}

async fn a_use_waits_for_no_writer(storage: Storage) {
    let (_, secret) = storage.create_key(new_key("acme", None), at(0)).await.unwrap();
    // SQLite has one writer; PostgreSQL locks the row.
    let mut writer = storage.database.begin().await.unwrap();
    let lock = crate::database::query("UPDATE api_keys SET label = 'desk'");
    lock.execute(&mut writer).await.unwrap();
    for second in 1..=3 {
        let used = tokio::time::timeout(Duration::from_secs(3), storage.use_key(&secret, at(second)));
        assert!(used.await.expect("it does not wait").unwrap().is_some());
        assert_eq!(storage.key_uses.len(), 1, "one task notes the uses of a key");
    }
    writer.commit().await.unwrap();
    assert_eq!(last_use(&storage).await, at(1));
}

async fn a_revoked_key_is_nobodys(storage: Storage) {
    let (first, secret) = storage.create_key(new_key("acme", None), at(0)).await.unwrap();
    let (second, other) = storage.create_key(new_key("bolt", None), at(0)).await.unwrap();
    assert!(storage.revoke_key(first.id, at(1)).await.unwrap());
    assert!(storage.revoke_key(first.id, at(2)).await.unwrap(), "again changes nothing");
    assert!(!storage.revoke_key(Uuid::now_v7(), at(1)).await.unwrap());
    assert_eq!(storage.use_key(&secret, at(1)).await.unwrap(), None);
    assert!(storage.use_key(&other, at(1)).await.unwrap().is_some());
    let all = storage.keys(None).await.unwrap();
    assert_eq!(
        all.iter().map(|key| (key.id, key.revoked_at)).collect::<Vec<_>>(),
        [(first.id, Some(at(1))), (second.id, None)]
    );
    let acme = storage.keys(Some(&first.tenant)).await.unwrap();
    assert_eq!(acme.iter().map(|key| key.id).collect::<Vec<_>>(), [first.id]);
    assert!(storage.has_keys().await.unwrap(), "a service whose keys all ended is not open");
}

async fn the_secret_is_kept_nowhere(storage: Storage) {
    let (_, secret) = storage.create_key(new_key("acme", None), at(0)).await.unwrap();
    let rows = crate::database::query("SELECT sha256, label FROM api_keys");
    let rows = rows.fetch_all(&mut storage.database.reader().await.unwrap()).await.unwrap();
    let kept = rows[0].text("sha256").unwrap();
    let digits = secret.show().strip_prefix("viola_").unwrap();
    assert!(kept.len() == 64 && digits.len() == 64 && kept != digits);
    assert_eq!(format!("{secret:?}"), "Secret");
    for bad in ["", "viola_", "viola_00", &"0".repeat(70), &format!("viola_{}", "g".repeat(64))] {
        assert!(bad.parse::<Secret>().is_err(), "{bad}");
    }
}
