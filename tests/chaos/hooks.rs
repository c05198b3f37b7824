//! A receiver of webhooks that remembers the newest change of each item.

use crate::fleet::Fleet;
use serde_json::{Value, json};
use std::collections::HashMap;
use std::sync::{Arc, Mutex};
use viola_testing::client::Client;
use viola_testing::{eventually, receiver};

#[derive(Clone, Default)]
pub struct Hooks {
    /// Highest sequence number received for each item.
    told: Arc<Mutex<HashMap<String, i64>>>,
    messages: Arc<Mutex<u64>>,
}

fn thing(change: &Value) -> String {
    format!("{} {} {}", change["home"], change["kind"], change["clip"])
}

impl Hooks {
    pub async fn start(fleet: &Fleet) -> Hooks {
        let hooks = Hooks::default();
        let hearing = hooks.clone();
        let url = receiver(move |message| hearing.hear(message));
        let request = fleet.server(0).request(reqwest::Method::POST, "/v1/webhooks");
        Client::read(request.json(&json!({"url": url})).send().await.unwrap()).await.ok(201);
        hooks
    }

    fn hear(&self, message: &[u8]) {
        let message: Value = serde_json::from_slice(message).unwrap();
        let change = &message["data"];
        let seq = change["seq"].as_i64().unwrap();
        let mut told = self.told.lock().unwrap();
        let newest = told.entry(thing(change)).or_default();
        *newest = seq.max(*newest);
        *self.messages.lock().unwrap() += 1;
    }

    /// Checks that the newest change of every item in the feed was received.
    pub async fn check(&self, fleet: &Fleet) -> String {
        let mut feed = HashMap::new();
        let mut path = "/v1/changes?limit=200".to_owned();
        loop {
            let page = fleet.server(0).get(&path).await.ok(200);
            for change in page["items"].as_array().unwrap() {
                feed.insert(thing(change), change["seq"].as_i64().unwrap());
            }
            if page["more"] == false {
                break;
            }
            path = format!("/v1/changes?limit=200&after={}", page["next"].as_str().unwrap());
        }
        eventually("the webhook was told everything", || async {
            let told = self.told.lock().unwrap();
            feed.iter().all(|(thing, seq)| told.get(thing) == Some(seq)).then_some(())
        })
        .await;
        format!("{} webhook messages about {} things", self.messages.lock().unwrap(), feed.len())
    }
}
