//! Clients that upload, read and delete on any server, and record the acknowledgements.

use crate::fleet::Fleet;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use reqwest::{Method, RequestBuilder};
use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};
use viola_testing::client::{Answer, Client};
use viola_testing::tus::sha256;
use viola_testing::{eventually, room, zips};

/// Longest time of a request.
const PATIENCE: Duration = Duration::from_secs(30);

/// Clips after which a client moves on to a new home: a home's export is read whole within `PATIENCE`, in a
/// run of any length.
const CLIPS_PER_HOME: u64 = 20;

/// Homes that a client keeps. It checks and deletes older ones, so that a long run needs no larger disk.
const HOMES_KEPT: usize = 3;

/// The acknowledgements of the service.
#[derive(Default)]
pub struct Ledger {
    /// Clips by their paths.
    clips: Mutex<BTreeMap<String, Promise>>,
    requests: AtomicU64,
    unanswered: AtomicU64,
    slowest_ms: AtomicU64,
    compared: AtomicU64,
    pub jobs_ended: AtomicU64,
}

#[derive(Debug, Clone, PartialEq)]
struct Promise {
    sha256: String,
    size_bytes: usize,
    state: Kept,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Kept {
    Here,
    /// Its deletion was requested, and no answer came.
    Unsure,
    Gone,
}

struct Person {
    number: u64,
    fleet: Arc<Fleet>,
    ledger: Arc<Ledger>,
    random: ChaCha8Rng,
    sent: u64,
}

/// Runs one client until `over`; then it completes its current work.
pub async fn go_on(
    number: u64,
    fleet: Arc<Fleet>,
    ledger: Arc<Ledger>,
    random: ChaCha8Rng,
    over: Arc<AtomicBool>,
) {
    let mut person = Person { number, fleet, ledger, random, sent: 0 };
    let mut homes = VecDeque::from([person.new_home().await]);
    let mut full = CLIPS_PER_HOME;
    while !over.load(Ordering::Relaxed) {
        if person.sent >= full {
            homes.push_back(person.new_home().await);
            full = person.sent + CLIPS_PER_HOME;
        }
        if homes.len() > HOMES_KEPT
            && let Some(oldest) = homes.pop_front()
        {
            person.leave(&oldest).await;
        }
        let home = homes.back().expect("the newest is kept").clone();
        match person.random.random_range(0..12) {
            0 | 1 => person.upload(&home).await,
            2 => person.upload_in_parts(&home).await,
            3 => person.delete(&home).await,
            4 => person.ask(&format!("{home}/export")).await,
            5 => person.ask("/v1/changes?limit=50").await,
            6 | 7 => person.ask(&home).await,
            8 | 9 => person.ask(&format!("{home}/clips")).await,
            _ => person.ask("/v1/homes").await,
        }
        let pause = person.random.random_range(50..1000);
        tokio::time::sleep(Duration::from_millis(pause)).await;
    }
}

impl Person {
    /// Returns a random server.
    fn client(&mut self) -> Client {
        self.fleet.server(self.random.random_range(0..self.fleet.servers()))
    }

    /// Creates a home with the vacuum's map, named by the number of clips sent before it.
    async fn new_home(&mut self) -> String {
        let home = format!("/v1/homes/home-{}-{}", self.number, self.sent);
        self.insist(|client| client.request(Method::PUT, &home)).await;
        let map = format!("{home}/lidar-map");
        self.insist(|client| client.request(Method::PUT, &map).body(room::lidar_csv())).await;
        home
    }

    /// Compares a home with the promises, and deletes it.
    async fn leave(&mut self, home: &str) {
        let recordings = exported(&self.fleet, home).await;
        self.ledger.compare(home, &recordings);
        let answer = self.insist(|client| client.request(Method::DELETE, home)).await;
        assert!([204, 404].contains(&answer.status), "{home}: {}", answer.status);
        for promise in self
            .ledger
            .clips
            .lock()
            .unwrap()
            .iter_mut()
            .filter_map(|(path, promise)| path.starts_with(&format!("{home}/")).then_some(promise))
        {
            promise.state = Kept::Gone;
        }
    }

    /// Sends a request; returns `None` if there was no answer, or a fault of the service.
    async fn once(&mut self, request: RequestBuilder) -> Option<Answer> {
        let begun = Instant::now();
        self.ledger.requests.fetch_add(1, Ordering::Relaxed);
        let (client, request) = request.build_split();
        let request = request.expect("a request");
        let asked = format!("{} {}", request.method(), request.url());
        let answer = tokio::time::timeout(PATIENCE, async {
            let response = client.execute(request).await.ok()?;
            let (status, headers) = (response.status().as_u16(), response.headers().clone());
            Some(Answer { status, headers, bytes: response.bytes().await.ok()?.to_vec() })
        });
        let answer = answer
            .await
            .unwrap_or_else(|_| panic!("client {}: {asked} took more than {PATIENCE:?}", self.number));
        self.ledger.slowest_ms.fetch_max(begun.elapsed().as_millis() as u64, Ordering::Relaxed);
        let answer = answer.filter(|answer| answer.status < 500);
        if answer.is_none() {
            self.ledger.unanswered.fetch_add(1, Ordering::Relaxed);
        }
        answer
    }

    /// Retries on random servers until there is an answer.
    async fn insist(&mut self, request: impl Fn(&Client) -> RequestBuilder) -> Answer {
        let begun = Instant::now();
        loop {
            let client = self.client();
            if let Some(answer) = self.once(request(&client)).await {
                return answer;
            }
            assert!(begun.elapsed() < 8 * PATIENCE, "client {} was never answered", self.number);
            tokio::time::sleep(Duration::from_millis(100)).await;
        }
    }

    async fn ask(&mut self, path: &str) {
        let client = self.client();
        if let Some(answer) = self.once(client.request(Method::GET, path)).await {
            assert_eq!(answer.status, 200, "{path}: {}", String::from_utf8_lossy(&answer.bytes));
        }
    }

    /// Returns a unique clip.
    fn clip(&mut self) -> Vec<u8> {
        self.sent += 1;
        let mut files = room::clip(2);
        let size = self.random.random_range(0..300_000);
        let mut noise = vec![0; size];
        self.random.fill(noise.as_mut_slice());
        noise.extend_from_slice(format!("{} {}", self.number, self.sent).as_bytes());
        files.push(("notes.bin".to_owned(), noise));
        zips::zip(&files)
    }

    async fn upload(&mut self, home: &str) {
        let (bytes, key) = (self.clip(), format!("{}-{}", self.number, self.sent));
        let send = |client: &Client| {
            let request = client.request(Method::POST, &format!("{home}/clips"));
            request.header("idempotency-key", &key).body(bytes.clone())
        };
        let answer = self.insist(send).await;
        let path = answer.header("location").to_owned();
        let clip = answer.ok(201);
        assert_eq!(clip["sha256"], sha256(&bytes));
        self.promised(path, &bytes);
    }

    fn promised(&self, path: String, bytes: &[u8]) {
        let promise = Promise { sha256: sha256(bytes), size_bytes: bytes.len(), state: Kept::Here };
        self.ledger.clips.lock().unwrap().insert(path, promise);
    }

    async fn upload_in_parts(&mut self, home: &str) {
        let (bytes, key) = (self.clip(), format!("{}-{}", self.number, self.sent));
        let id = home.rsplit('/').next().unwrap().to_owned();
        let metadata = viola_testing::tus::metadata(&[("home", &id), ("idempotency_key", &key)]);
        let begin = |client: &Client| {
            let request = client.tus(Method::POST, "/v1/uploads").header("upload-length", bytes.len());
            request.header("upload-metadata", &metadata)
        };
        let upload = self.insist(begin).await.header("location").to_owned();
        let begun = Instant::now();
        loop {
            let head = self.insist(|client| client.tus(Method::HEAD, &upload)).await;
            if head.status == 410 || head.status == 404 {
                // The upload was idle for too long and expired; none of it was promised yet.
                return;
            }
            assert_eq!(head.status, 200);
            let clip = head.header("viola-clip").to_owned();
            if !clip.is_empty() {
                self.promised(clip, &bytes);
                return;
            }
            let offset: usize = head.header("upload-offset").parse().unwrap();
            let step = self.random.random_range(1..200_000).min(bytes.len() - offset);
            let client = self.client();
            let sent = self.once(client.patch(&upload, offset, &bytes[offset..offset + step])).await;
            if let Some(answer) = sent {
                let text = String::from_utf8_lossy(&answer.bytes).into_owned();
                assert!([204, 404, 409, 410].contains(&answer.status), "{} {text}", answer.status);
            }
            assert!(begun.elapsed() < 8 * PATIENCE, "client {} never came to the end of a file", self.number);
        }
    }

    async fn delete(&mut self, home: &str) {
        let own = {
            let clips = self.ledger.clips.lock().unwrap();
            let here = clips.iter().filter(|(path, promise)| {
                path.starts_with(&format!("{home}/")) && promise.state == Kept::Here
            });
            here.map(|(path, _)| path.clone()).next()
        };
        let Some(path) = own else { return };
        let client = self.client();
        let state = match self.once(client.request(Method::DELETE, &path)).await {
            Some(answer) if answer.status == 204 => Kept::Gone,
            Some(answer) => panic!("{path}: {} {}", answer.status, String::from_utf8_lossy(&answer.bytes)),
            None => Kept::Unsure,
        };
        self.ledger.clips.lock().unwrap().get_mut(&path).unwrap().state = state;
    }
}

impl Ledger {
    /// Compares the stored clips with the promises; returns a summary.
    pub async fn check(&self, fleet: &Fleet) -> String {
        let clips = self.clips.lock().unwrap().clone();
        let mut here = 0;
        for (path, promise) in &clips {
            let answer = fleet.server(0).get(path).await;
            match (promise.state, answer.status) {
                (Kept::Gone, status) => assert_eq!(status, 404, "{path} was deleted"),
                (Kept::Unsure, 404) => {}
                (Kept::Here | Kept::Unsure, _) => {
                    let clip = answer.ok(200);
                    let state = clip["state"].as_str().unwrap();
                    assert!(
                        ["aligned", "ambiguous", "failed"].contains(&state),
                        "{path} is {state}: {clip:#}"
                    );
                    // Disasters are faults of the service and fail no clip.
                    let faults = ["worker", "storage", "system", "internal"];
                    let code = clip["job"]["error"]["code"].as_str().unwrap_or_default();
                    assert!(!faults.iter().any(|fault| code.starts_with(fault)), "{path}: {clip:#}");
                    assert_eq!(clip["sha256"], promise.sha256);
                    here += 1;
                }
            }
        }
        let left = clips.iter().filter(|(_, promise)| promise.state != Kept::Gone);
        let homes: BTreeSet<&str> = left.filter_map(|(path, _)| path.split("/clips/").next()).collect();
        let mut compared = 0;
        for home in homes {
            compared += self.compare(home, &exported(fleet, home).await);
        }
        assert_eq!(compared, here, "every clip was compared byte by byte");
        format!(
            "{} clips sent, {here} here at the end, {} compared byte for byte; {} requests, {} unanswered, the \
             slowest {} ms",
            clips.len(),
            self.compared.load(Ordering::Relaxed),
            self.requests.load(Ordering::Relaxed),
            self.unanswered.load(Ordering::Relaxed),
            self.slowest_ms.load(Ordering::Relaxed),
        )
    }

    /// Compares a home's recordings with its promises; returns the number of promised ones.
    fn compare(&self, home: &str, recordings: &BTreeMap<String, Recording>) -> u64 {
        let clips = self.clips.lock().unwrap();
        let mut compared = 0;
        for (path, promise) in clips.iter().filter(|(path, _)| path.starts_with(&format!("{home}/"))) {
            let promised = Recording { sha256: promise.sha256.clone(), size_bytes: promise.size_bytes };
            match (promise.state, recordings.get(path)) {
                (Kept::Gone, found) => assert_eq!(found, None, "{path} was deleted"),
                (Kept::Unsure, None) => {}
                (_, found) => {
                    assert_eq!(found, Some(&promised), "{path}");
                    compared += 1;
                }
            }
        }
        self.compared.fetch_add(compared, Ordering::Relaxed);
        compared
    }
}

#[derive(Debug, PartialEq)]
struct Recording {
    sha256: String,
    size_bytes: usize,
}

/// The recordings in a home's export, by the paths of their clips.
async fn exported(fleet: &Fleet, home: &str) -> BTreeMap<String, Recording> {
    let once = || async {
        let response = fleet.server(1).request(Method::GET, &format!("{home}/export")).send().await.ok()?;
        let bytes = response.error_for_status().ok()?.bytes().await.ok()?;
        let mut export = zip::ZipArchive::new(std::io::Cursor::new(bytes)).ok()?;
        let names = export.file_names().map(|name| name.unwrap().into_owned());
        let names: Vec<String> = names.filter(|name| name.ends_with("/recording")).collect();
        let mut recordings = BTreeMap::new();
        for name in &names {
            let mut recording = Vec::new();
            std::io::Read::read_to_end(&mut export.by_name(name).unwrap(), &mut recording).unwrap();
            let id = name.split('/').nth_back(1).unwrap();
            let found = Recording { sha256: sha256(&recording), size_bytes: recording.len() };
            recordings.insert(format!("{home}/clips/{id}"), found);
        }
        Some(recordings)
    };
    eventually("the export comes whole", once).await
}
