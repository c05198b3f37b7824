//! Webhooks over HTTP: a real receiver, the library of Standard Webhooks, and forbidden addresses.

use crate::server::Server;
use reqwest::Method;
use serde_json::{Value, json};
use std::collections::VecDeque;
use std::io::Write;
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::{Arc, Mutex};
use tokio::io::{AsyncBufReadExt, AsyncReadExt, AsyncWriteExt, BufReader};
use tokio::net::{TcpListener, TcpStream};
use viola::webhooks::WebhookParams;
use viola_storage::Role;
use viola_testing::{eventually, has_node};

/// A received message.
#[derive(Debug, Clone)]
struct Message {
    headers: Value,
    body: String,
}

/// An address that sends prepared answers, and 204 if there are none.
struct Receiver {
    url: String,
    got: Arc<Mutex<Vec<Message>>>,
    answers: Arc<Mutex<VecDeque<String>>>,
}

impl Receiver {
    async fn start() -> Receiver {
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let url = format!("http://{}/hooks?key=value", listener.local_addr().unwrap());
        let (got, answers) = (Arc::<Mutex<Vec<_>>>::default(), Arc::<Mutex<VecDeque<String>>>::default());
        let (kept, told) = (got.clone(), answers.clone());
        tokio::spawn(async move {
            while let Ok((connection, _)) = listener.accept().await {
                let (kept, told) = (kept.clone(), told.clone());
                tokio::spawn(async move {
                    let mut connection = BufReader::new(connection);
                    while let Some(message) = read(&mut connection).await {
                        kept.lock().unwrap().push(message);
                        let answer = told.lock().unwrap().pop_front();
                        let answer = answer.unwrap_or("204 No Content\r\n".to_owned());
                        let answer = format!("HTTP/1.1 {answer}content-length: 0\r\n\r\n");
                        let _ = connection.get_mut().write_all(answer.as_bytes()).await;
                    }
                });
            }
        });
        Receiver { url, got, answers }
    }

    fn answer(&self, answers: &[&str]) {
        self.answers.lock().unwrap().extend(answers.iter().map(|answer| format!("{answer}\r\n")));
    }

    async fn messages(&self, count: usize) -> Vec<Message> {
        eventually("messages arrive", || async {
            Some(self.got.lock().unwrap().clone()).filter(|got| got.len() >= count)
        })
        .await
    }
}

async fn read(connection: &mut BufReader<TcpStream>) -> Option<Message> {
    let mut headers = serde_json::Map::new();
    let mut line = String::new();
    connection.read_line(&mut line).await.ok().filter(|count| *count > 0)?;
    assert_eq!(line, "POST /hooks?key=value HTTP/1.1\r\n");
    loop {
        line.clear();
        connection.read_line(&mut line).await.ok()?;
        let Some((name, value)) = line.trim_end().split_once(": ") else { break };
        headers.insert(name.to_lowercase(), value.into());
    }
    let length: usize = headers["content-length"].as_str().unwrap().parse().unwrap();
    let mut body = vec![0; length];
    connection.read_exact(&mut body).await.ok()?;
    Some(Message { headers: headers.into(), body: String::from_utf8(body).unwrap() })
}

async fn make(server: &Server, body: Value) -> Value {
    let answer = server.send_json(Method::POST, "/v1/webhooks", &body).await;
    let location = answer.header("location").to_owned();
    let made = answer.ok(201);
    assert_eq!(location, format!("/v1/webhooks/{}", made["id"].as_str().unwrap()));
    made
}

/// Returns the log, oldest first.
async fn log(server: &Server, webhook: &Value) -> Vec<Value> {
    let path = format!("/v1/webhooks/{}/deliveries", webhook["id"].as_str().unwrap());
    let mut items = server.get(&path).await.ok(200)["items"].as_array().unwrap().clone();
    items.reverse();
    items
}

/// Returns the log once all of its deliveries have been tried.
async fn tried(server: &Server, webhook: &Value, count: usize) -> Vec<Value> {
    eventually("deliveries were tried", || async {
        let log = log(server, webhook).await;
        let all = log.len() == count && log.iter().all(|delivery| delivery["attempts"] != 0);
        all.then_some(log)
    })
    .await
}

#[tokio::test(flavor = "multi_thread")]
async fn changes_are_told_as_standard_webhooks() {
    let server = Server::start().await;
    let receiver = Receiver::start().await;
    let webhook = make(&server, json!({"url": receiver.url})).await;
    let home = server.make_home("h").await;
    receiver.messages(1).await;
    let name = json!({"name": "\u{201c}Zo\u{eb}\u{201d} <a@b>"});
    server.send_json(Method::PUT, &home, &name).await.ok(200);
    receiver.messages(2).await;
    server.delete(&home).await.ok(204);
    let got = receiver.messages(3).await;
    assert!(got[2].body.contains("\"deleted\":true"), "{got:?}");
    for message in &got {
        let body: Value = serde_json::from_str(&message.body).unwrap();
        let names: Vec<&String> = body.as_object().unwrap().keys().collect();
        assert_eq!(names.len(), 3, "{body}");
        assert_eq!((&body["data"]["home"], &body["data"]["kind"]), (&"h".into(), &"home".into()));
        body["timestamp"].as_str().unwrap().parse::<jiff::Timestamp>().unwrap();
        assert_eq!(message.headers["content-type"], "application/json");
    }
    let log = tried(&server, &webhook, got.len()).await;
    assert!(
        log.iter().all(|delivery| delivery["state"] == "delivered" && delivery["status"] == 204),
        "{log:?}"
    );
    assert_eq!(log.last().unwrap()["event"], "home.deleted");
    verified(&webhook, &got);
}

/// Verifies messages by the library; skips with a message if it is missing and not required.
fn verified(webhook: &Value, got: &[Message]) {
    let web = Path::new(env!("CARGO_MANIFEST_DIR")).join("web");
    if !has_node("the library of Standard Webhooks", &web, "standardwebhooks", &[]) {
        return;
    }
    let verify = |secret: &str| {
        let mut command = Command::new("node");
        let command = command.arg("tests/webhook.mjs").current_dir(&web);
        let mut child =
            command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap();
        let mut input = child.stdin.take().unwrap();
        for Message { headers, body } in got {
            let line = json!({"secret": secret, "headers": headers, "body": body});
            // The process ends at the first wrong message.
            let _ = writeln!(input, "{line}");
        }
        drop(input);
        let output = child.wait_with_output().unwrap();
        (output.status.success(), String::from_utf8(output.stdout).unwrap().lines().count())
    };
    assert_eq!(verify(webhook["secret"].as_str().unwrap()), (true, got.len()));
    assert!(!verify("whsec_MfKQ9r8GKYqrTwjUPD8ILPZIo2LaLaSw").0, "another secret does not fit");
}

#[tokio::test]
async fn what_fails_is_in_the_log_and_can_be_sent_again() {
    let server = Server::start().await;
    let receiver = Receiver::start().await;
    let elsewhere = Receiver::start().await;
    let moved = format!("307 Temporary Redirect\r\nlocation: {}", elsewhere.url);
    let webhook = make(&server, json!({"url": receiver.url, "kinds": ["map"]})).await;
    let path = format!("/v1/webhooks/{}", webhook["id"].as_str().unwrap());
    let test = async || server.post(&format!("{path}/test"), "").await.ok(201);
    let cases = [
        ("500 Internal Server Error", "pending", "the address answered 500 (Internal Server Error)"),
        (
            moved.as_str(),
            "pending",
            "the address answered 307 (Temporary Redirect); redirects are not followed",
        ),
        (
            "429 Too Many Requests\r\nretry-after: 3600",
            "pending",
            "the address answered 429 (Too Many Requests)",
        ),
        ("410 Gone", "failed", "the address answered 410 and is told nothing any more"),
    ];
    for (count, (answer, state, error)) in cases.iter().enumerate() {
        receiver.answer(&[answer]);
        test().await;
        let delivery = tried(&server, &webhook, count + 1).await.pop().unwrap();
        assert_eq!((&delivery["state"], &delivery["error"]), (&json!(state), &json!(error)));
    }
    assert!(elsewhere.got.lock().unwrap().is_empty(), "a redirect was followed");
    assert!(server.get(&path).await.ok(200)["disabled_at"].is_string());
    let failed = log(&server, &webhook).await.pop().unwrap();
    let retry = format!("{path}/deliveries/{}/retry", failed["id"].as_str().unwrap());
    assert_eq!(server.post(&retry, "").await.ok(200)["state"], "pending");
    eventually("it arrives at last", || async {
        (log(&server, &webhook).await.pop()?["state"] == "delivered").then_some(())
    })
    .await;
    assert!(server.get(&path).await.ok(200)["disabled_at"].is_null());
    // The same message both times.
    let got = receiver.messages(5).await;
    let of_failed: Vec<&Message> =
        got.iter().filter(|message| message.headers["webhook-id"] == failed["id"]).collect();
    assert_eq!(of_failed.len(), 2);
    assert_eq!(of_failed[0].body, of_failed[1].body);
    let body: Value = serde_json::from_str(&of_failed[0].body).unwrap();
    let time = body["timestamp"].as_str().unwrap();
    assert!(time.len() <= "2026-03-14T15:09:26.535Z".len(), "{time} has milliseconds, as that of a change");
    server.delete(&path).await.ok(204);
    server.get(&path).await.problem(404, "webhook-not-found");
    server.post(&format!("{path}/test"), "").await.problem(404, "webhook-not-found");
}

/// Attacks by addresses; the resolution of names is tested with the sender.
#[tokio::test]
async fn no_webhook_leads_to_this_machine_or_its_neighbours() {
    let server = Server::with(|params| params.webhooks = WebhookParams::default()).await;
    let receiver = Receiver::start().await;
    let bad = [
        "https://169.254.169.254/latest/meta-data/",
        "https://[fd00:ec2::254]/latest/meta-data/",
        "https://127.0.0.1:8080/",
        "https://localhost/",
        "https://10.0.0.1/",
        "https://192.168.1.1/",
        "https://[::ffff:10.0.0.1]/",
        "https://2852039166/",
        "http://fleet.example/",
        "gopher://fleet.example/",
        "https://user:password@fleet.example/",
        "not a url",
        "",
        receiver.url.as_str(),
    ];
    for url in bad {
        let answer = server.send_json(Method::POST, "/v1/webhooks", &json!({"url": url})).await;
        assert_eq!(answer.problem(422, "invalid-body")["field"], "url", "{url}");
    }
    // A name of this machine is refused at the delivery: here one that every machine has.
    let webhook = make(&server, json!({"url": "https://localhost.localdomain/"})).await;
    server.post(&format!("/v1/webhooks/{}/test", webhook["id"].as_str().unwrap()), "").await.ok(201);
    let delivery = tried(&server, &webhook, 1).await.remove(0);
    assert_eq!(delivery["state"], "pending");
    assert!(delivery["error"].is_string() && delivery["status"].is_null(), "{delivery}");
}

#[tokio::test]
async fn webhooks_are_an_admins_and_not_many() {
    let server = Server::without_workers().await;
    let admin = server.client("acme", Role::Admin, None).await;
    let other = server.client("bolt", Role::Admin, None).await;
    let one_home = server.client("acme", Role::Admin, Some("h")).await;
    let make = async |body: Value| admin.send_json(Method::POST, "/v1/webhooks", &body).await;
    for n in 0..10 {
        make(json!({"url": format!("https://fleet.example/{n}")})).await.ok(201);
    }
    make(json!({"url": "https://fleet.example/11"})).await.problem(409, "too-many-webhooks");
    let listed = admin.get("/v1/webhooks").await.ok(200);
    let listed = listed["items"].as_array().unwrap();
    assert_eq!(listed.len(), 10);
    assert!(listed.iter().all(|webhook| webhook["secret"].is_null()), "the secret is shown once");
    assert!(other.get("/v1/webhooks").await.ok(200)["items"].as_array().unwrap().is_empty());
    one_home.get("/v1/webhooks").await.problem(403, "forbidden");
    let bad = [
        (json!({"url": "https://a.example", "kinds": []}), "kinds"),
        (json!({"kinds": ["map"]}), "url"),
        (json!({"url": "https://a.example", "kinds": ["maps"]}), ""),
        (json!({"url": "https://a.example", "secret": "mine"}), ""),
    ];
    for (body, field) in bad {
        let problem = make(body).await.problem(422, "invalid-body");
        assert!(field.is_empty() || problem["field"] == field, "{problem}");
    }
}
