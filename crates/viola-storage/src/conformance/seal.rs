//! Sealed secrets: not in the database in plain text, and readable with the operator's key only.

use super::*;
use crate::database::query;

on_every_back_end!(secrets_are_sealed_with_the_operators_key, older_secrets_are_sealed_at_the_next_start);

fn key(byte: u8) -> SecretsKey {
    use base64::Engine;
    base64::prelude::BASE64_STANDARD.encode([byte; 32]).parse().unwrap()
}

async fn made(storage: &Storage) -> WebhookSecret {
    let acme = "acme".parse().unwrap();
    match storage.create_webhook(&acme, "https://fleet.example/", &ChangeKind::ALL, at(0)).await.unwrap() {
        WebhookMade::Made(_, secret) => secret,
        WebhookMade::TooMany => panic!("there is room"),
    }
}

async fn stored(storage: &Storage) -> Vec<String> {
    let rows = query("SELECT secret FROM webhooks ORDER BY id");
    let rows = rows.fetch_all(&mut storage.database.reader().await.unwrap()).await.unwrap();
    rows.iter().map(|row| row.text("secret").unwrap()).collect()
}

/// Returns the secret with which the next delivery is signed.
async fn signs(storage: &Storage, now: Timestamp) -> Result<WebhookSecret, StorageError> {
    let acme: Tenant = "acme".parse().unwrap();
    storage.put_home(&acme.home(&home("h")), Some(&now.to_string()), |_| true, now).await?;
    storage.fan_out(now).await?;
    let sending = storage.claim_deliveries(16, LEASE, now).await?.expect("a delivery is due");
    storage.release_webhook(&sending, now).await?;
    Ok(sending.secret)
}

async fn secrets_are_sealed_with_the_operators_key(mut storage: Storage) {
    storage.secrets_key = Some(key(1));
    let secret = made(&storage).await;
    let sealed = stored(&storage).await.remove(0);
    assert!(sealed.starts_with("sealed:v1:") && !sealed.contains(&secret.show()[6..]));
    assert_eq!(signs(&storage, at(1)).await.unwrap(), secret);
    for (turn, wrong) in [(1, Some(key(2))), (2, None)] {
        storage.secrets_key = wrong;
        assert!(matches!(storage.seal_secrets().await, Err(StorageError::SecretsKey)));
        assert!(matches!(signs(&storage, at(1000 * turn)).await, Err(StorageError::SecretsKey)));
        // The lease expires, so that the address is not lost to a process with the key.
        storage.secrets_key = Some(key(1));
        assert_eq!(signs(&storage, at(1000 * turn + 100)).await.unwrap(), secret);
    }
    // Another record's secret cannot be put in its place.
    made(&storage).await;
    execute(&storage, "UPDATE webhooks SET secret = $1", &sealed).await;
    assert!(matches!(storage.seal_secrets().await, Err(StorageError::SecretsKey)));
}

async fn older_secrets_are_sealed_at_the_next_start(mut storage: Storage) {
    let secret = made(&storage).await;
    assert_eq!(stored(&storage).await, [secret.show()]);
    storage.seal_secrets().await.unwrap();
    assert_eq!(stored(&storage).await, [secret.show()], "there is no key");
    storage.secrets_key = Some(key(1));
    assert_eq!(signs(&storage, at(1)).await.unwrap(), secret, "before it is sealed");
    storage.seal_secrets().await.unwrap();
    assert!(stored(&storage).await[0].starts_with("sealed:v1:"));
    assert_eq!(signs(&storage, at(2)).await.unwrap(), secret);
    for bad in ["", "AAAA", "no base64 at all", &"A".repeat(44)] {
        assert!(bad.parse::<SecretsKey>().is_err(), "{bad}");
    }
}
