//! `viola demo`: runs the whole service and sends it a simulated home over HTTP.

mod client;
mod recordings;

use super::args::{NetworkArguments, numbers};
use super::output;
use super::progress::has_bars;
use crate::api::{ServeParams, serve};
use crate::jobs::{JobParams, WorkerParams};
use anyhow::{Context, Result, bail};
use clap::Args;
use client::{Client, ClipAnswer};
use indicatif::{MultiProgress, ProgressDrawTarget};
use recordings::{Recording, Recordings};
use std::collections::BTreeMap;
use std::fs;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use tokio::sync::oneshot;
use tokio_util::sync::CancellationToken;
use viola_align::AlignParams;
use viola_geometry::angle_between;
use viola_lab::evaluate::{SUCCESS_DEG, SUCCESS_M};
use viola_storage::{FolderLock, StorageParams};

const HOME: &str = "demo";
/// File that marks a folder as made by the demo: it may be emptied.
const MARKER: &str = "made-by-viola-demo";

/// Serve on a fresh folder, upload a simulated home's map and clips, and compare the poses with the truth.
#[derive(Args)]
pub struct DemoArguments {
    /// Address and port; port 0 selects a free port.
    #[arg(long, value_name = "ADDRESS", default_value = "127.0.0.1:8080")]
    listen: SocketAddr,
    /// Folder for the data, the recordings and the pictures; the folder of an earlier demo is emptied.
    #[arg(long, value_name = "DIR", default_value = "viola-demo")]
    data: PathBuf,
    /// Seed of the simulated home.
    #[arg(long, default_value_t = 1, value_parser = numbers::seed, allow_negative_numbers = true)]
    seed: u64,
    /// Frames of each clip.
    #[arg(long, default_value_t = 60, value_parser = numbers::frames)]
    frames: usize,
    #[command(flatten)]
    networks: NetworkArguments,
    /// Stop after the report; fail unless every pose is within 0.3 m and 10 degrees of the truth.
    #[arg(long)]
    exit: bool,
}

pub fn run(arguments: &DemoArguments) -> Result<()> {
    // Before the folder is emptied, because a missing network is found immediately.
    let align = AlignParams { label: arguments.networks.surface_labels()?, ..AlignParams::default() };
    fresh_folder(&arguments.data)?;
    println!("Making a home, mapping it with its vacuum and filming three clips ...");
    let recordings = Recordings::make(arguments.seed, arguments.frames, &arguments.data.join("recordings"))?;
    let job = JobParams { align, ..JobParams::default() };
    let worker = WorkerParams { align: Arc::new(job), ..WorkerParams::default() };
    let runtime = tokio::runtime::Runtime::new()?;
    let shown = runtime.block_on(show(arguments, worker, &recordings));
    runtime.shutdown_background();
    shown
}

async fn show(arguments: &DemoArguments, worker: WorkerParams, recordings: &Recordings) -> Result<()> {
    let stop = CancellationToken::new();
    let (listening, address) = oneshot::channel();
    let storage = StorageParams::in_folder(&arguments.data.join("service"));
    let params = ServeParams { worker, ..ServeParams::new(arguments.listen, storage) };
    let mut server = tokio::spawn(serve(params, stop.clone(), |address| {
        // The receiver is dropped only after the demo has ended.
        let _ = listening.send(address);
    }));
    let found = tokio::select! {
        found = report(arguments, address, recordings) => found?,
        ended = &mut server => return Ok(ended.context("the server broke down")??),
    };
    stop.cancel();
    server.await.context("the server broke down")??;
    if !arguments.exit {
        let data = arguments.data.join("service");
        println!(
            "Stopped. `viola serve --data {}` serves the home again, until the next demo empties the folder.",
            data.display()
        );
    } else if found < recordings.clips.len() {
        bail!("{found} of {} clips were found", recordings.clips.len());
    }
    Ok(())
}

/// Uploads everything, waits for the poses and prints their errors; returns the number of correct poses. Without `--exit` it
/// returns at Ctrl-C.
async fn report(
    arguments: &DemoArguments,
    address: oneshot::Receiver<SocketAddr>,
    recordings: &Recordings,
) -> Result<usize> {
    // Without an address the server has ended, which says why.
    let Ok(address) = address.await else { return std::future::pending().await };
    let pictures = arguments.data.join("pictures");
    let client = Client::new(address)?;
    println!("Serving at http://{address}/; uploading as an app would.");
    client.make_home(HOME, "Simulated home").await?;
    client.put_map(HOME, fs::read(&recordings.map).context("cannot read the map back")?).await?;
    let bars = MultiProgress::new();
    if !has_bars() {
        bars.set_draw_target(ProgressDrawTarget::hidden());
    }
    let followed = recordings.clips.iter().map(|clip| follow(&client, clip, &bars));
    let answers = futures::future::try_join_all(followed).await?;
    bars.clear().context("cannot write to the terminal")?;
    output::folder(&pictures)?;
    println!("\n{:<8} {:<10} {:>9} {:>9} {:>10}  where", "clip", "state", "error", "turn", "time");
    let mut found = 0;
    for (recording, answer) in recordings.clips.iter().zip(&answers) {
        found += usize::from(print_answer(recording, answer));
        if answer.alignment.is_some() {
            for (file, name) in [("overlay.png", "png"), ("cloud.ply", "ply")] {
                let bytes = client.result(HOME, &answer.id, file).await?;
                output::write_bytes(&pictures.join(format!("{}.{name}", recording.name)), bytes)?;
            }
        }
    }
    if answers.iter().any(|answer| answer.state == "aligned") {
        println!("\n{}", line_of_objects(&client.objects(HOME).await?));
    }
    println!(
        "\n{found} of {} clips within {SUCCESS_M} m and {SUCCESS_DEG} degrees of the truth.",
        answers.len()
    );
    println!("Pictures: {}; the home from above: {}", pictures.display(), recordings.plan.display());
    if !arguments.exit {
        println!("\nThe service stays up at http://{address}/. Ctrl-C stops it.");
        tokio::signal::ctrl_c().await.context("Ctrl-C cannot be heard")?;
    }
    Ok(found)
}

/// Returns the objects of the home by class: `Objects: 2 bed, 1 sofa`.
fn line_of_objects(objects: &[String]) -> String {
    let mut classes: BTreeMap<&str, usize> = BTreeMap::new();
    for class in objects {
        *classes.entry(class).or_default() += 1;
    }
    let classes: Vec<String> = classes.iter().map(|(class, count)| format!("{count} {class}")).collect();
    format!("Objects: {}", if classes.is_empty() { "none".to_owned() } else { classes.join(", ") })
}

/// Uploads a clip, waits for its job and returns its answer.
async fn follow(client: &Client, recording: &Recording, bars: &MultiProgress) -> Result<ClipAnswer> {
    let line = client::Line::new(bars, &recording.name);
    let clip = client.upload(HOME, &recording.path, &line).await?;
    let job = clip.job.with_context(|| format!("{} has no job", recording.name))?;
    client.watch(&job.id, &line).await?;
    let answer = client.clip(HOME, &clip.id).await?;
    line.end(&answer.state);
    Ok(answer)
}

/// Prints one line of the table and returns whether the pose is correct.
fn print_answer(recording: &Recording, answer: &ClipAnswer) -> bool {
    let rooms = recording.rooms.join(", ");
    let pose = answer.alignment.as_ref().and_then(|alignment| alignment.map_from_clip);
    let Some(pose) = pose else {
        let reasons: Vec<&str> = answer.reasons.iter().map(|reason| reason.detail.as_str()).collect();
        println!("{:<8} {:<10} {}", recording.name, answer.state, reasons.join("; "));
        return false;
    };
    let error_m = pose.distance_m(&recording.map_from_clip);
    let error_deg = angle_between(pose.yaw_rad, recording.map_from_clip.yaw_rad).to_degrees();
    let seconds: f64 = answer.alignment.iter().flat_map(|alignment| alignment.seconds.values()).sum();
    let close = error_m < SUCCESS_M && error_deg < SUCCESS_DEG;
    println!(
        "{:<8} {:<10} {:>6.1} cm {:>5.2} deg {:>8.1} s  {rooms}",
        recording.name,
        answer.state,
        100.0 * error_m,
        error_deg,
        seconds
    );
    close
}

/// Creates the folder or empties that of an earlier demo; refuses any other folder that is not empty.
fn fresh_folder(folder: &Path) -> Result<()> {
    let shown = folder.display();
    if folder.exists() {
        let mut entries = fs::read_dir(folder).with_context(|| format!("cannot read {shown}"))?;
        if !folder.join(MARKER).exists() && entries.next().is_some() {
            bail!("{shown} is not empty and not of an earlier demo; choose another folder with --data");
        }
        FolderLock::refuse_in_use(&folder.join("service"))?;
        fs::remove_dir_all(folder).with_context(|| format!("cannot empty {shown}"))?;
    }
    output::folder(folder)?;
    output::write_bytes(&folder.join(MARKER), "")
}
