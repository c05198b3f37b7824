//! Webhooks: each gets a change once, with retries by the schedule, and has a log.

use super::*;

on_every_back_end!(
    changes_become_deliveries,
    failures_follow_the_schedule,
    a_retry_during_an_attempt_stays_due,
    who_is_gone_is_told_nothing,
    a_lost_lease_notes_nothing,
    a_slow_webhook_takes_nobodys_turn,
    an_address_that_is_away_is_not_drowned,
    an_address_without_answers_gets_few_tests,
    there_are_at_most_ten,
    requests_at_once_create_at_most_ten,
    the_log_is_a_tenants_own,
    a_webhook_that_cannot_be_read_lets_others_pass,
    messages_of_a_clock_that_was_ahead_are_due,
);

const MINUTE: Duration = Duration::from_secs(60);

fn acme() -> Tenant {
    "acme".parse().unwrap()
}

async fn webhook(storage: &Storage, kinds: &[ChangeKind]) -> Uuid {
    match storage.create_webhook(&acme(), "https://fleet.example/", kinds, at(0)).await.unwrap() {
        WebhookMade::Made(webhook, _) => webhook.id,
        WebhookMade::TooMany => panic!("there is room"),
    }
}

async fn put(storage: &Storage, id: &str, name: &str) {
    storage.put_home(&acme().home(&home(id)), Some(name), |_| true, at(0)).await.unwrap();
}

async fn claim(storage: &Storage, now: Timestamp) -> Option<Sending> {
    storage.claim_deliveries(16, MINUTE, now).await.unwrap()
}

/// Takes all due deliveries and records the same result for each; returns their ids.
async fn send_all(storage: &Storage, sent: &Sent, now: Timestamp) -> Vec<Uuid> {
    let mut ids = Vec::new();
    while let Some(sending) = claim(storage, now).await {
        for delivery in &sending.deliveries {
            storage.note_attempt(&sending, delivery, sent, now).await.unwrap();
            ids.push(delivery.id);
        }
        storage.release_webhook(&sending, now).await.unwrap();
    }
    ids
}

async fn log(storage: &Storage, webhook: Uuid) -> Vec<Delivery> {
    storage.deliveries(&acme(), webhook, &Page { limit: 50, after: None }).await.unwrap()
}

fn failed() -> Sent {
    Sent::Failed { status: Some(503), error: "the address answered 503".to_owned(), wait: None }
}

async fn changes_become_deliveries(storage: Storage) {
    put(&storage, "before", "old").await;
    let all = webhook(&storage, &ChangeKind::ALL).await;
    let maps = webhook(&storage, &[ChangeKind::Map]).await;
    put(&storage, "h", "one").await;
    storage.delete_home(&acme().home(&home("h")), |_| true, at(1)).await.unwrap();
    put(&storage, "g", "two").await;
    storage.put_home(&home("of-another-tenant"), None, |_| true, at(0)).await.unwrap();
    assert!(!storage.fan_out(at(2)).await.unwrap());
    assert!(!storage.fan_out(at(2)).await.unwrap(), "again makes nothing new");
    let mut told = log(&storage, all).await;
    told.reverse();
    let events: Vec<&str> = told.iter().map(|delivery| delivery.event.as_str()).collect();
    assert_eq!(events, ["home.deleted", "home.changed"]);
    assert!(told.iter().all(|delivery| delivery.state == DeliveryState::Pending));
    assert!(log(&storage, maps).await.is_empty());
    let sending = claim(&storage, at(2)).await.unwrap();
    assert_eq!((sending.webhook, sending.url.as_str()), (all, "https://fleet.example/"));
    assert!(sending.secret.show().starts_with("whsec_") && sending.secret.bytes().len() == 32);
    let body: serde_json::Value = serde_json::from_str(&sending.deliveries[0].body).unwrap();
    assert_eq!(body["type"], "home.deleted");
    assert_eq!(body["timestamp"], at(1).to_string());
    assert_eq!((&body["data"]["home"], &body["data"]["deleted"]), (&"h".into(), &true.into()));
    for delivery in &sending.deliveries {
        storage.note_attempt(&sending, delivery, &Sent::Delivered { status: 204 }, at(3)).await.unwrap();
    }
    storage.release_webhook(&sending, at(3)).await.unwrap();
    assert!(claim(&storage, at(1_000_000)).await.is_none(), "all is delivered");
    let told = log(&storage, all).await;
    assert!(told.iter().all(|delivery| delivery.state == DeliveryState::Delivered
        && (delivery.attempts, delivery.status, delivery.due_at) == (1, Some(204), None)));
    storage.delete_webhook(&acme(), all).await.unwrap();
    assert!(matches!(storage.webhook(&acme(), all).await, Err(StorageError::NoSuchWebhook)));
}

async fn failures_follow_the_schedule(storage: Storage) {
    let id = webhook(&storage, &ChangeKind::ALL).await;
    put(&storage, "h", "one").await;
    storage.fan_out(at(0)).await.unwrap();
    let mut now = at(0);
    for (made, delay) in RETRY_AFTER.iter().enumerate() {
        assert_eq!(send_all(&storage, &failed(), now).await.len(), 1, "attempt {made}");
        let delivery = &log(&storage, id).await[0];
        assert_eq!((delivery.attempts as usize, delivery.due_at), (made + 1, Some(now + *delay)));
        assert_eq!(delivery.error.as_deref(), Some("the address answered 503"));
        let just_before = now + *delay - jiff::SignedDuration::from_millis(1);
        assert!(claim(&storage, just_before).await.is_none(), "it is not due yet");
        now += *delay;
    }
    send_all(&storage, &failed(), now).await;
    let delivery = log(&storage, id).await.remove(0);
    assert_eq!((delivery.state, delivery.attempts, delivery.due_at), (DeliveryState::Failed, 10, None));
    // A manual retry restarts the schedule; a delay that the address asks for is kept.
    let again = storage.retry_delivery(&acme(), id, delivery.id, now).await.unwrap();
    assert_eq!((again.state, again.attempts, again.due_at), (DeliveryState::Pending, 0, Some(now)));
    let busy = Sent::Failed { status: Some(429), error: String::new(), wait: Some(MINUTE) };
    send_all(&storage, &busy, now).await;
    assert_eq!(log(&storage, id).await[0].due_at, Some(now + MINUTE));
    let nobody = storage.retry_delivery(&acme(), id, Uuid::now_v7(), now).await;
    assert!(matches!(nobody, Err(StorageError::NoSuchDelivery)));
}

async fn a_retry_during_an_attempt_stays_due(storage: Storage) {
    let id = webhook(&storage, &ChangeKind::ALL).await;
    put(&storage, "h", "one").await;
    storage.fan_out(at(0)).await.unwrap();
    send_all(&storage, &failed(), at(0)).await;
    // The attempt of each row ends a second after the retry, and the next one begins then.
    for (begun_s, sent) in [(5, failed()), (7, Sent::Gone), (9, Sent::Delivered { status: 200 })] {
        let sending = claim(&storage, at(begun_s)).await.expect("a message is due");
        let [delivery] = &sending.deliveries[..] else { panic!("{begun_s}: it is one message") };
        let asked = storage.retry_delivery(&acme(), id, delivery.id, at(begun_s + 1)).await.unwrap();
        storage.note_attempt(&sending, delivery, &sent, at(begun_s + 2)).await.unwrap();
        storage.release_webhook(&sending, at(begun_s + 2)).await.unwrap();
        let noted = log(&storage, id).await.remove(0);
        if matches!(sent, Sent::Delivered { .. }) {
            assert_eq!(noted.state, DeliveryState::Delivered);
        } else {
            assert_eq!(noted, asked, "{begun_s}");
        }
        assert_eq!(storage.webhook(&acme(), id).await.unwrap().disabled_at, None, "{begun_s}");
    }
    assert!(claim(&storage, at(1_000_000)).await.is_none(), "it was delivered");
}

async fn who_is_gone_is_told_nothing(storage: Storage) {
    let id = webhook(&storage, &ChangeKind::ALL).await;
    put(&storage, "h", "one").await;
    storage.fan_out(at(0)).await.unwrap();
    assert_eq!(send_all(&storage, &Sent::Gone, at(5)).await.len(), 1);
    assert_eq!(storage.webhook(&acme(), id).await.unwrap().disabled_at, Some(at(5)));
    put(&storage, "h", "two").await;
    storage.fan_out(at(6)).await.unwrap();
    assert_eq!(log(&storage, id).await.len(), 1);
    let test = storage.test_webhook(&acme(), id, at(7)).await.unwrap();
    assert_eq!(test.event, "webhook.test");
    assert_eq!(storage.webhook(&acme(), id).await.unwrap().disabled_at, None);
    storage.fan_out(at(7)).await.unwrap();
    assert_eq!(send_all(&storage, &Sent::Delivered { status: 200 }, at(7)).await.len(), 2);
}

async fn a_lost_lease_notes_nothing(storage: Storage) {
    let id = webhook(&storage, &ChangeKind::ALL).await;
    put(&storage, "h", "one").await;
    storage.fan_out(at(0)).await.unwrap();
    let slow = claim(&storage, at(0)).await.unwrap();
    assert!(claim(&storage, at(59)).await.is_none(), "one process sends to a webhook");
    let fast = claim(&storage, at(60)).await.unwrap();
    storage.note_attempt(&slow, &slow.deliveries[0], &failed(), at(61)).await.unwrap();
    storage.release_webhook(&slow, at(61)).await.unwrap();
    assert!(claim(&storage, at(62)).await.is_none());
    storage.note_attempt(&fast, &fast.deliveries[0], &Sent::Delivered { status: 200 }, at(62)).await.unwrap();
    let delivery = &log(&storage, id).await[0];
    assert_eq!((delivery.state, delivery.attempts), (DeliveryState::Delivered, 1));
}

async fn a_slow_webhook_takes_nobodys_turn(storage: Storage) {
    let ids = [webhook(&storage, &ChangeKind::ALL).await, webhook(&storage, &ChangeKind::ALL).await];
    for n in 0..3 {
        put(&storage, &format!("h-{n}"), "one").await;
    }
    storage.fan_out(at(0)).await.unwrap();
    let mut served = Vec::new();
    for n in 0..4 {
        let sending = storage.claim_deliveries(1, MINUTE, at(n)).await.unwrap().unwrap();
        let sent = Sent::Delivered { status: 200 };
        storage.note_attempt(&sending, &sending.deliveries[0], &sent, at(n)).await.unwrap();
        storage.release_webhook(&sending, at(n)).await.unwrap();
        served.push(sending.webhook);
    }
    assert_eq!((served[0], served[1]), (served[2], served[3]), "they take turns");
    assert!(ids.contains(&served[0]) && ids.contains(&served[1]) && served[0] != served[1]);
}

async fn an_address_that_is_away_is_not_drowned(storage: Storage) {
    let id = webhook(&storage, &ChangeKind::ALL).await;
    for n in 0..6 {
        for name in ["one", "two"] {
            for h in 0..250 {
                put(&storage, &format!("h-{h}"), &format!("{name} {n}")).await;
            }
            while storage.fan_out(at(0)).await.unwrap() {}
        }
    }
    // 3000 changes; the feed holds those beyond the limit, one for each home.
    let waiting = count(&storage, "webhook_deliveries", "1 = 1", None).await;
    assert!((1000..=1200).contains(&waiting), "{waiting}");
    let mut told = send_all(&storage, &Sent::Delivered { status: 200 }, at(1)).await.len();
    while storage.fan_out(at(1)).await.unwrap() {}
    told += send_all(&storage, &Sent::Delivered { status: 200 }, at(1)).await.len();
    assert!(told <= 1450, "{told}");
    let newest = storage.changes(&acme(), None, 250, at(1)).await.unwrap().items;
    let bodies = crate::database::query("SELECT body FROM webhook_deliveries ORDER BY id DESC LIMIT 250");
    let bodies = bodies.fetch_all(&mut storage.database.reader().await.unwrap()).await.unwrap();
    let mut told: Vec<i64> = bodies
        .iter()
        .map(|row| {
            let body: serde_json::Value = serde_json::from_str(&row.text("body").unwrap()).unwrap();
            body["data"]["seq"].as_i64().unwrap()
        })
        .collect();
    told.sort_unstable();
    assert_eq!(
        told,
        newest.iter().map(|change| change.seq).collect::<Vec<_>>(),
        "the newest of each is told"
    );
    storage.delete_webhook(&acme(), id).await.unwrap();
}

async fn an_address_without_answers_gets_few_tests(storage: Storage) {
    let id = webhook(&storage, &ChangeKind::ALL).await;
    let mut tests = Vec::new();
    for second in 0..30 {
        tests.push(storage.test_webhook(&acme(), id, at(second)).await.unwrap());
    }
    let waiting = log(&storage, id).await;
    assert_eq!(waiting.len(), 10);
    // The newest of them is that of each further request, and due again.
    assert_eq!((tests[29].id, tests[29].due_at), (waiting[0].id, Some(at(29))));
    send_all(&storage, &Sent::Delivered { status: 200 }, at(30)).await;
    let next = storage.test_webhook(&acme(), id, at(31)).await.unwrap();
    assert!(tests.iter().all(|test| test.id != next.id), "the others were delivered");
}

async fn there_are_at_most_ten(storage: Storage) {
    for _ in 0..MAX_WEBHOOKS {
        webhook(&storage, &ChangeKind::ALL).await;
    }
    let more = storage.create_webhook(&acme(), "https://a.example/", &ChangeKind::ALL, at(0)).await.unwrap();
    assert!(matches!(more, WebhookMade::TooMany));
    let other =
        storage.create_webhook(&Tenant::default(), "https://a.example/", &ChangeKind::ALL, at(0)).await;
    assert!(matches!(other, Ok(WebhookMade::Made(..))));
    assert_eq!(storage.webhooks(&acme()).await.unwrap().len() as i64, MAX_WEBHOOKS);
}

async fn requests_at_once_create_at_most_ten(storage: Storage) {
    let tenant = acme();
    let create = |_| storage.create_webhook(&tenant, "https://a.example/", &ChangeKind::ALL, at(0));
    let made = futures::future::join_all((0..3 * MAX_WEBHOOKS).map(create)).await;
    let created = made.into_iter().filter(|made| matches!(made, Ok(WebhookMade::Made(..)))).count();
    assert_eq!(created as i64, MAX_WEBHOOKS);
    assert_eq!(storage.webhooks(&tenant).await.unwrap().len() as i64, MAX_WEBHOOKS);
}

async fn the_log_is_a_tenants_own(storage: Storage) {
    let id = webhook(&storage, &ChangeKind::ALL).await;
    let delivery = storage.test_webhook(&acme(), id, at(0)).await.unwrap().id;
    let other = Tenant::default();
    let page = Page { limit: 9, after: None };
    assert!(matches!(storage.webhook(&other, id).await, Err(StorageError::NoSuchWebhook)));
    assert!(matches!(storage.delete_webhook(&other, id).await, Err(StorageError::NoSuchWebhook)));
    assert!(matches!(storage.deliveries(&other, id, &page).await, Err(StorageError::NoSuchWebhook)));
    assert!(matches!(storage.test_webhook(&other, id, at(0)).await, Err(StorageError::NoSuchWebhook)));
    let again = storage.retry_delivery(&other, id, delivery, at(0)).await;
    assert!(matches!(again, Err(StorageError::NoSuchWebhook)));
    assert_eq!(log(&storage, id).await.len(), 1);
    // After 30 days ended deliveries are removed, with the next change.
    send_all(&storage, &Sent::Delivered { status: 200 }, at(0)).await;
    put(&storage, "h", "one").await;
    storage.fan_out(at(31 * 24 * 3600)).await.unwrap();
    let events: Vec<String> = log(&storage, id).await.into_iter().map(|delivery| delivery.event).collect();
    assert_eq!(events, ["home.changed"]);
}

async fn a_webhook_that_cannot_be_read_lets_others_pass(storage: Storage) {
    let mut ids = Vec::new();
    for _ in 0..3 {
        ids.push(webhook(&storage, &ChangeKind::ALL).await);
    }
    let later = "UPDATE webhooks SET kinds = 'of a later version' WHERE id = $1";
    execute(&storage, later, &ids[1].to_string()).await;
    put(&storage, "h", "one").await;
    assert!(!storage.fan_out(at(0)).await.unwrap());
    for id in [ids[0], ids[2]] {
        assert_eq!(log(&storage, id).await.len(), 1);
    }
}

async fn messages_of_a_clock_that_was_ahead_are_due(storage: Storage) {
    webhook(&storage, &ChangeKind::ALL).await;
    put(&storage, "h", "one").await;
    let day = 24 * 3600;
    storage.fan_out(at(2 * day)).await.unwrap();
    assert_eq!(send_all(&storage, &Sent::Delivered { status: 200 }, at(0)).await.len(), 1);
}
