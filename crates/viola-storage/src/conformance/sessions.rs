//! Sessions: they end with time, with their key and at sign-out, and their tokens are not stored.

use super::*;

on_every_back_end!(
    a_session_has_the_rights_of_its_key_for_twelve_hours,
    a_session_ends_at_sign_out_and_with_its_key,
    a_key_has_at_most_a_hundred_sessions,
);

async fn key(storage: &Storage, expires_at: Option<Timestamp>) -> ApiKey {
    let new = NewKey {
        tenant: "acme".parse().unwrap(),
        role: Role::Reader,
        home: None,
        label: String::new(),
        expires_at,
    };
    storage.create_key(new, at(0)).await.unwrap().0
}

async fn a_session_has_the_rights_of_its_key_for_twelve_hours(storage: Storage) {
    let key = key(&storage, None).await;
    let token = storage.begin_session(key.id, at(0)).await.unwrap();
    let used = storage.use_session(&token, at(12 * 3600 - 1)).await.unwrap().unwrap();
    assert_eq!((used.id, used.tenant.name(), used.role), (key.id, "acme", Role::Reader));
    assert_eq!(storage.use_session(&token, at(12 * 3600)).await.unwrap(), None);
    // Expired sessions leave with the next one.
    storage.begin_session(key.id, at(12 * 3600)).await.unwrap();
    let rows = crate::database::query("SELECT sha256 FROM sessions");
    let rows = rows.fetch_all(&mut storage.database.reader().await.unwrap()).await.unwrap();
    assert_eq!(rows.len(), 1);
    assert_ne!(rows[0].text("sha256").unwrap(), token.show());
    assert_eq!(format!("{token:?}"), "SessionToken");
    assert_eq!(token.show().parse(), Ok(token.clone()));
    for bad in ["", "00", &"g".repeat(64), &"0".repeat(65)] {
        assert!(bad.parse::<SessionToken>().is_err(), "{bad}");
    }
}

async fn a_session_ends_at_sign_out_and_with_its_key(storage: Storage) {
    let first = key(&storage, None).await;
    let out = storage.begin_session(first.id, at(0)).await.unwrap();
    let stays = storage.begin_session(first.id, at(0)).await.unwrap();
    storage.end_session(&out).await.unwrap();
    storage.end_session(&out).await.unwrap();
    assert_eq!(storage.use_session(&out, at(1)).await.unwrap(), None);
    assert!(storage.use_session(&stays, at(1)).await.unwrap().is_some());
    storage.revoke_key(first.id, at(2)).await.unwrap();
    assert_eq!(storage.use_session(&stays, at(2)).await.unwrap(), None);
    let short = key(&storage, Some(at(100))).await;
    let token = storage.begin_session(short.id, at(0)).await.unwrap();
    assert!(storage.use_session(&token, at(99)).await.unwrap().is_some());
    assert_eq!(storage.use_session(&token, at(100)).await.unwrap(), None);
    storage.delete_tenant(&first.tenant, at(3), |_| {}).await.unwrap();
    assert_eq!(storage.use_session(&token, at(3)).await.unwrap(), None);
}

async fn a_key_has_at_most_a_hundred_sessions(storage: Storage) {
    let (key, other) = (key(&storage, None).await, key(&storage, None).await);
    let apart = storage.begin_session(other.id, at(0)).await.unwrap();
    let oldest = storage.begin_session(key.id, at(0)).await.unwrap();
    let next = storage.begin_session(key.id, at(1)).await.unwrap();
    for second in 2..101 {
        storage.begin_session(key.id, at(second)).await.unwrap();
    }
    assert_eq!(storage.use_session(&oldest, at(200)).await.unwrap(), None);
    assert!(storage.use_session(&next, at(200)).await.unwrap().is_some());
    assert!(storage.use_session(&apart, at(200)).await.unwrap().is_some());
}
