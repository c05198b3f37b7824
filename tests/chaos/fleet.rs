//! Processes that are restarted after a kill: two servers and two workers, or one process alone.

use crate::clients::Ledger;
use serde_json::Value;
use std::collections::HashMap;
use std::fs::{File, OpenOptions};
use std::io::{BufRead, BufReader};
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use tempfile::TempDir;
use viola_testing::client::Client;
use viola_testing::disk::Disk;
use viola_testing::eventually;
use viola_testing::postgres::Schema;
use viola_testing::process::{prepared, program, succeed, viola};
use viola_testing::s3_server::{ACCESS_KEY_ID, BUCKET, PREFIX, REGION, S3Server, SECRET_ACCESS_KEY};

/// Storage of the processes.
enum Place {
    /// PostgreSQL and a bucket. The first two processes are servers, the others workers.
    Shared,
    /// SQLite and files, for one process.
    Disk(Box<dyn Disk>),
}

pub struct Fleet {
    settings: Vec<(&'static str, String)>,
    place: Place,
    folder: TempDir,
    processes: Mutex<Vec<Member>>,
    pub killed: AtomicU64,
}

struct Member {
    child: Child,
    /// Base URL of a server.
    base: Option<String>,
}

impl Fleet {
    pub fn start(schema: &Schema, bucket: &S3Server) -> Fleet {
        let settings = vec![
            ("VIOLA_DATABASE_URL", schema.url()),
            ("VIOLA_DATABASE_CONNECTIONS", "6".to_owned()),
            ("VIOLA_S3_BUCKET", BUCKET.to_owned()),
            ("VIOLA_S3_PREFIX", PREFIX.to_owned()),
            ("VIOLA_S3_ENDPOINT", bucket.endpoint()),
            ("VIOLA_S3_REGION", REGION.to_owned()),
            ("VIOLA_S3_ACCESS_KEY_ID", ACCESS_KEY_ID.to_owned()),
            ("VIOLA_S3_SECRET_ACCESS_KEY", SECRET_ACCESS_KEY.to_owned()),
            ("VIOLA_S3_ALLOW_HTTP", "true".to_owned()),
        ];
        Fleet::begin_all(settings, Place::Shared)
    }

    /// Starts one process that does everything on one disk.
    pub fn alone(disk: Box<dyn Disk>) -> Fleet {
        Fleet::begin_all(Vec::new(), Place::Disk(disk))
    }

    fn begin_all(mut settings: Vec<(&'static str, String)>, place: Place) -> Fleet {
        settings.push(("VIOLA_UPLOAD_PATIENCE_SECONDS", "10".to_owned()));
        settings.push(("VIOLA_WEBHOOKS_TO_PRIVATE_ADDRESSES", "true".to_owned()));
        let fleet = Fleet {
            settings,
            place,
            folder: TempDir::new().unwrap(),
            processes: Mutex::default(),
            killed: AtomicU64::new(0),
        };
        for number in 0..fleet.size() {
            let member = fleet.begin(number);
            fleet.processes.lock().unwrap().push(member);
        }
        fleet
    }

    pub fn size(&self) -> usize {
        match self.place {
            Place::Shared => 4,
            Place::Disk(_) => 1,
        }
    }

    pub fn servers(&self) -> usize {
        self.size().div_ceil(2)
    }

    /// Returns a command of the binary on the storage of the process with this number.
    fn command(&self, number: usize) -> Command {
        let mut command = match &self.place {
            Place::Shared => viola(),
            Place::Disk(disk) => prepared(disk.command(program())),
        };
        command.envs(self.settings.iter().map(|(name, value)| (*name, value)));
        // Labels would take half of the processors' time, and no promise is about them.
        command.env("VIOLA_MODELS", "none");
        match &self.place {
            Place::Shared => command.env("VIOLA_DATA", self.folder.path().join(number.to_string())),
            Place::Disk(disk) => command.env("VIOLA_DATA", disk.data()),
        };
        command
    }

    fn log(&self, number: usize) -> PathBuf {
        self.folder.path().join(format!("{number}.log"))
    }

    fn begin(&self, number: usize) -> Member {
        let is_server = number < self.servers();
        let arguments: &[&str] = match &self.place {
            Place::Disk(_) => &["serve", "--listen", "127.0.0.1:0"],
            Place::Shared if is_server => &["serve", "--no-worker", "--listen", "127.0.0.1:0"],
            Place::Shared => &["work"],
        };
        let log = OpenOptions::new().create(true).append(true).open(self.log(number)).unwrap();
        // The database may refuse at this moment: retry, as any supervisor would.
        for _ in 0..50 {
            let mut child = self
                .command(number)
                .args(arguments)
                .args(["--lease-seconds", "2", "--retry-seconds", "0.2"])
                .stdout(Stdio::piped())
                .stderr(log.try_clone().unwrap())
                .spawn()
                .unwrap();
            if !is_server {
                return Member { child, base: None };
            }
            let mut line = String::new();
            BufReader::new(child.stdout.take().unwrap()).read_line(&mut line).unwrap();
            if let Some(base) = line.trim().strip_prefix("listening on ") {
                return Member { child, base: Some(base.to_owned()) };
            }
            child.wait().unwrap();
        }
        panic!("process {number} does not start; its log is {}", self.log_text(number));
    }

    /// Kills a process with `kill -9` and starts a new one in its place.
    pub fn kill(&self, number: usize) {
        {
            let mut processes = self.processes.lock().unwrap();
            let child = &mut processes[number].child;
            child.kill().unwrap();
            child.wait().unwrap();
        }
        self.killed.fetch_add(1, Ordering::Relaxed);
        // An operator frees the disk before a restart.
        if let Place::Disk(_) = &self.place {
            self.free_disk();
        }
        let member = self.begin(number);
        self.processes.lock().unwrap()[number] = member;
    }

    /// Fills the disk of a process alone.
    pub fn fill_disk(&self) {
        if let Place::Disk(disk) = &self.place {
            disk.fill(self.process_id());
        }
    }

    pub fn free_disk(&self) {
        if let Place::Disk(disk) = &self.place {
            disk.free(self.process_id());
        }
    }

    fn process_id(&self) -> u32 {
        self.processes.lock().unwrap()[0].child.id()
    }

    /// Returns a client of one of the servers, as it is now.
    pub fn server(&self, number: usize) -> Client {
        let base = self.processes.lock().unwrap()[number % self.servers()].base.clone();
        Client::new(base.expect("it is a server"))
    }

    /// Waits until there is nothing more to do.
    pub async fn settle(&self) {
        // A worker that ended by itself met an error that it should have survived.
        for (number, member) in self.processes.lock().unwrap().iter_mut().enumerate() {
            assert!(member.child.try_wait().unwrap().is_none(), "{number} ended: {}", self.log_text(number));
        }
        // The deadline is for each job, since many clips may be queued after a long run.
        let mut before = None;
        while before != Some([0, 0, 0]) {
            let left = eventually("another job or merge is done", || async {
                let answer = self.server(0).get("/readyz").await;
                if answer.status != 200 {
                    return None;
                }
                let state = answer.json();
                let left = ["queued", "running", "merges_due"].map(|name| state[name].as_u64().unwrap());
                (before != Some(left)).then_some(left)
            });
            before = Some(left.await);
        }
    }

    /// Checks that no job's end was recorded twice: a worker logs `job ends` when its end counted.
    pub fn check_logs(&self, ledger: &Ledger) {
        let mut ends: HashMap<String, u32> = HashMap::new();
        for number in 0..self.size() {
            let log = BufReader::new(File::open(self.log(number)).unwrap());
            for line in log.lines().map(Result::unwrap) {
                let Ok(event) = serde_json::from_str::<Value>(&line) else { continue };
                assert!(!line.contains("panicked"), "{line}");
                if event["message"] == "job ends" && is_answer(&event["outcome"]) {
                    *ends.entry(event["job"].as_str().unwrap().to_owned()).or_default() += 1;
                }
            }
        }
        let twice: Vec<_> = ends.iter().filter(|(_, count)| **count > 1).collect();
        assert!(twice.is_empty(), "ran to their end more than once: {twice:?}");
        ledger.jobs_ended.store(ends.len() as u64, Ordering::Relaxed);
    }

    /// Checks that the cleaner removes the leftovers of killed processes, and finds none a second time.
    pub fn clean_twice(&self) {
        let clean = || {
            // With many kills and few files, the leftovers may exceed the limit of a sweep.
            let arguments = ["clean", "--remove-unknown", "--older-than-seconds", "0"];
            succeed(self.command(0).args(arguments))
        };
        println!("first: {}", clean().trim());
        let second = clean();
        assert!(second.contains(" and 0 blobs"), "{second}");
    }

    fn log_text(&self, number: usize) -> String {
        let text = std::fs::read_to_string(self.log(number)).unwrap_or_default();
        let tail = text.lines().rev().take(20).collect::<Vec<_>>();
        tail.into_iter().rev().collect::<Vec<_>>().join("\n")
    }
}

/// Returns whether an outcome is final.
fn is_answer(outcome: &Value) -> bool {
    ["aligned", "ambiguous", "failed"].contains(&outcome.as_str().unwrap_or_default())
}

impl Drop for Fleet {
    fn drop(&mut self) {
        for member in self.processes.get_mut().unwrap() {
            let _ = member.child.kill();
            let _ = member.child.wait();
        }
    }
}
