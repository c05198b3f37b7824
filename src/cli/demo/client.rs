//! The demo's client: its requests to the service and its progress display.

use anyhow::{Context, Result, bail};
use futures::{StreamExt, TryStreamExt};
use indicatif::{MultiProgress, ProgressBar, ProgressStyle};
use reqwest::{Body, Response, StatusCode};
use serde::Deserialize;
use serde_json::{Value, json};
use std::cell::RefCell;
use std::collections::BTreeMap;
use std::net::SocketAddr;
use std::path::Path;
use std::time::{Duration, Instant};
use tokio_util::io::ReaderStream;
use viola_geometry::Pose2;

/// The members of a clip that the client reads.
#[derive(Debug, Deserialize)]
pub struct ClipAnswer {
    pub id: String,
    pub state: String,
    pub reasons: Vec<ReasonAnswer>,
    pub alignment: Option<AlignmentAnswer>,
    pub job: Option<JobAnswer>,
}

#[derive(Debug, Deserialize)]
pub struct AlignmentAnswer {
    pub map_from_clip: Option<Pose2>,
    pub seconds: BTreeMap<String, f64>,
}

#[derive(Debug, Deserialize)]
pub struct ReasonAnswer {
    pub detail: String,
}

#[derive(Debug, Deserialize)]
pub struct JobAnswer {
    pub id: String,
    state: String,
    stage: Option<String>,
    progress: f64,
}

/// Maximum time for the fusion of the demo's clips, which takes seconds.
const MAX_MERGE: Duration = Duration::from_secs(60);
/// Interval at which the map is read meanwhile.
const POLL: Duration = Duration::from_millis(250);

/// Progress display of a clip: a bar on a terminal, else a plain line for every new stage.
pub struct Line {
    bar: ProgressBar,
    name: String,
    last: RefCell<String>,
}

impl Line {
    pub fn new(bars: &MultiProgress, name: &str) -> Line {
        let bar = bars.add(ProgressBar::new(1000));
        if let Ok(style) = ProgressStyle::with_template("{prefix:<8} {msg:<10} {wide_bar} {percent:>3} %") {
            bar.set_style(style);
        }
        bar.set_prefix(name.to_owned());
        Line { bar, name: name.to_owned(), last: RefCell::default() }
    }

    fn show(&self, doing: &str, share: f64) {
        self.bar.set_position((share * 1000.0) as u64);
        if *self.last.borrow() != doing {
            self.last.replace(doing.to_owned());
            self.bar.set_message(doing.to_owned());
        }
    }

    pub fn end(&self, state: &str) {
        self.show(state, 1.0);
        self.bar.finish();
        if self.bar.is_hidden() {
            println!("{}: {state}", self.name);
        }
    }
}

pub struct Client {
    http: reqwest::Client,
    base: String,
}

impl Client {
    pub fn new(address: SocketAddr) -> Result<Client> {
        // A proxy of the environment does not reach this machine's own service.
        let http = reqwest::Client::builder().no_proxy().build()?;
        Ok(Client { http, base: format!("http://{address}/v1") })
    }

    pub async fn make_home(&self, home: &str, name: &str) -> Result<()> {
        let request = self.http.put(format!("{}/homes/{home}", self.base)).json(&json!({ "name": name }));
        good(request.send().await?).await.context("the home was refused")?;
        Ok(())
    }

    pub async fn put_map(&self, home: &str, file: Vec<u8>) -> Result<()> {
        let request = self.http.put(format!("{}/homes/{home}/lidar-map", self.base)).body(file);
        good(request.send().await?).await.context("the LiDAR map was refused")?;
        Ok(())
    }

    /// Uploads a file as a stream.
    pub async fn upload(&self, home: &str, path: &Path, line: &Line) -> Result<ClipAnswer> {
        let shown = path.display();
        let file = tokio::fs::File::open(path).await.with_context(|| format!("cannot read {shown}"))?;
        let size = file.metadata().await.with_context(|| format!("cannot read {shown}"))?.len();
        let bar = line.bar.clone();
        line.show("upload", 0.0);
        let pieces = ReaderStream::with_capacity(file, 64 << 10).inspect_ok({
            let mut sent = 0;
            move |piece| {
                sent += piece.len() as u64;
                bar.set_position(sent * 1000 / size.max(1));
            }
        });
        let request = self
            .http
            .post(format!("{}/homes/{home}/clips", self.base))
            .header("content-type", "application/zip")
            .body(Body::wrap_stream(pieces));
        let answer = good(request.send().await?).await.with_context(|| format!("{shown} was refused"))?;
        Ok(answer.json().await?)
    }

    /// Shows a job's events until it ends.
    pub async fn watch(&self, job: &str, line: &Line) -> Result<()> {
        let answer = good(self.http.get(format!("{}/jobs/{job}/events", self.base)).send().await?).await?;
        let mut bytes = answer.bytes_stream();
        let mut text = Vec::new();
        while let Some(piece) = bytes.next().await {
            text.extend_from_slice(&piece?);
            // An event ends with an empty line.
            while let Some(end) = text.windows(2).position(|pair| pair == b"\n\n") {
                let event: Vec<u8> = text.drain(..end + 2).collect();
                let event = String::from_utf8_lossy(&event);
                let field =
                    |name: &str| event.lines().find_map(|line| line.strip_prefix(name)).map(str::trim);
                let Some(data) = field("data:") else { continue };
                let job: Option<JobAnswer> = serde_json::from_str(data).context("an event is no job")?;
                let Some(job) = job else { bail!("the job was removed") };
                if field("event:") == Some("end") {
                    return Ok(());
                }
                line.show(job.stage.as_deref().unwrap_or(&job.state), job.progress);
            }
        }
        bail!("the events of job {job} ended before it did")
    }

    pub async fn clip(&self, home: &str, clip: &str) -> Result<ClipAnswer> {
        let request = self.http.get(format!("{}/homes/{home}/clips/{clip}", self.base));
        Ok(good(request.send().await?).await?.json().await?)
    }

    /// Returns the classes of the objects of a home's map, after all aligned clips are in it or [`MAX_MERGE`] is over.
    pub async fn objects(&self, home: &str) -> Result<Vec<String>> {
        let map = format!("{}/homes/{home}/map", self.base);
        let begun = Instant::now();
        while !self.is_merged(&map).await? && begun.elapsed() < MAX_MERGE {
            tokio::time::sleep(POLL).await;
        }
        let answer = good(self.http.get(format!("{map}/objects")).send().await?).await;
        let answer: Value = answer.context("the home has no map")?.json().await?;
        let objects = answer["objects"].as_array().context("the map has no objects")?;
        Ok(objects.iter().filter_map(|object| object["class"].as_str()).map(str::to_owned).collect())
    }

    async fn is_merged(&self, map: &str) -> Result<bool> {
        let answer = self.http.get(map).send().await?;
        // There is no map before the first merge.
        if answer.status() == StatusCode::NOT_FOUND {
            return Ok(false);
        }
        let map: Value = good(answer).await?.json().await?;
        let left_out = map["left_out"].as_array().context("the map does not tell its clips")?;
        Ok(left_out.iter().all(|clip| clip["state"] != "aligned"))
    }

    /// Downloads a file of a clip's results.
    pub async fn result(&self, home: &str, clip: &str, file: &str) -> Result<Vec<u8>> {
        let request = self.http.get(format!("{}/homes/{home}/clips/{clip}/{file}", self.base));
        Ok(good(request.send().await?).await?.bytes().await?.to_vec())
    }
}

/// Returns a successful answer, or its text as an error.
async fn good(answer: Response) -> Result<Response> {
    let status = answer.status();
    if status.is_success() {
        return Ok(answer);
    }
    bail!("{status}: {}", answer.text().await.unwrap_or_default())
}
