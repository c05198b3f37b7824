//! Times a merge of one more clip into a home's map, without the service around it: simulated clips of one room
//! and of a whole home, with and without times of recording.
//!
//! `cargo run --release --example merges -- [room|home] [timed|untimed] CLIPS...`

use nalgebra::Matrix3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Arc;
use std::time::Instant;
use uuid::Uuid;
use viola_align::{AlignParams, observe};
use viola_geometry::Pose2;
use viola_geometry::progress::Silent;
use viola_home::{
    ClipContribution, ClipNumbers, LoadClips, Manifest, Member, PlacedClip, Tile, TileKey, Verdict, assemble,
    cloud_ply, describe, views_bytes,
};
use viola_lab::evaluate::peak_memory_bytes;
use viola_lab::simulate::{ClipParams, Home, HomeParams, Set, clip_in_memory};
use viola_network::RuntimeParams;
use viola_network::manifest::{self, Task};
use viola_reconstruct::label::SurfaceNetwork;
use viola_reconstruct::{Feature, View};

/// Different recordings. More clips are these again, with other errors of their poses.
const RECORDINGS: usize = 12;
const FRAMES: usize = 60;
/// Largest error of a clip's own pose.
const ERROR_M: f64 = 0.02;
const ERROR_RAD: f64 = 0.005;

type Failure = Box<dyn std::error::Error>;

fn main() -> Result<(), Failure> {
    viola_network::return_large_buffers();
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    if let [command, place, times, count, folder] = &arguments[..]
        && command == FIRST
    {
        return first(place, times, count.parse()?, Path::new(folder));
    }
    let [place, times, counts @ ..] = &arguments[..] else {
        return Err("usage: merges room|home timed|untimed CLIPS...".into());
    };
    println!("{place}, {times}\n");
    println!(
        "| clips | points | all others at once, clips read | one more: tiles anew | clips read | written | assembly | windows | labels | description | sum | of both cores | peak memory | poses off |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|---|---|---|---|");
    for count in counts {
        let folder = tempfile::tempdir()?;
        // In a process of its own, whose memory does not count.
        let mut child = Command::new(std::env::current_exe()?);
        let made = child.args([FIRST, place, times, count]).arg(folder.path()).status()?;
        if !made.success() {
            return Err("the first map could not be made".into());
        }
        println!("{}", row(&home(), times == "timed", count.parse()?, folder.path())?);
    }
    Ok(())
}

/// The command of the process that makes the map of all but the last clip.
const FIRST: &str = "first";
const MADE: &str = "made.json";
const MANIFEST: &str = "manifest.json";

/// Report of the process that makes the first map.
#[derive(Serialize, Deserialize)]
struct Made {
    map_from_clip: Vec<Pose2>,
    tiles: Vec<(TileKey, usize)>,
    sums: Vec<(TileKey, usize)>,
    seconds: f64,
    read: usize,
}

fn home() -> Home {
    Home::generate(&HomeParams::new(Set::Normal, 5))
}

/// Records clips and makes the map of all but the last of `count`.
fn first(place: &str, times: &str, count: usize, folder: &Path) -> Result<(), Failure> {
    let recordings = Recordings::make(&home(), place == "room", folder)?;
    let network = built_in_network()?;
    let members: Vec<Member> =
        (0..count.saturating_sub(1)).map(|at| recordings.member(at, times == "timed")).collect();
    let begun = Instant::now();
    let mut load = Load { of: &recordings, sums: BTreeMap::new(), read: 0 };
    let map = assemble(&Manifest::default(), members, &mut load, &Silent)?;
    let seconds = begun.elapsed().as_secs_f64();
    let map = map.label(BTreeMap::new(), Some(&network), &Silent)?;
    let kept = |name: &str, number: usize, bytes: &[u8]| {
        std::fs::write(folder.join(format!("{name}_{number}")), bytes)
    };
    let (mut tiles, mut sums) = (Vec::new(), Vec::new());
    for (number, (key, tile)) in map.tiles.iter().enumerate() {
        kept("tile", number, &tile.to_bytes())?;
        tiles.push((*key, number));
    }
    for (number, (key, bytes)) in map.sums.iter().enumerate() {
        if let Some(bytes) = bytes {
            kept("sums", number, bytes)?;
            sums.push((*key, number));
        }
    }
    let read = load.read;
    let Recordings { map_from_clip, .. } = recordings;
    std::fs::write(folder.join(MANIFEST), serde_json::to_vec(&map.manifest)?)?;
    let made = Made { map_from_clip, tiles, sums, seconds, read };
    Ok(std::fs::write(folder.join(MADE), serde_json::to_vec(&made)?)?)
}

/// The files of recordings, in a folder, and their true poses.
struct Recordings {
    folder: PathBuf,
    map_from_clip: Vec<Pose2>,
}

impl Recordings {
    fn make(home: &Home, in_one_room: bool, folder: &Path) -> Result<Recordings, Failure> {
        let survey = home.survey();
        let params = ClipParams { frames: FRAMES, color_width: 256, ..ClipParams::default() };
        let clips = (0..).map(|index| home.clip(&survey, index, &params));
        let mut clips =
            clips.filter(|clip| !in_one_room || clip.truth.rooms.first() == Some(&home_room(home)));
        let mut recordings = Recordings { folder: folder.to_owned(), map_from_clip: Vec::new() };
        while recordings.map_from_clip.len() < RECORDINGS {
            let Some(clip) = clips.next() else { break };
            let truth = clip.truth.clone();
            let clip = clip_in_memory(Arc::new(clip));
            let seen = observe(&clip, None, &AlignParams::default(), &Silent)?;
            let Some(clip_from_world) = seen.clip_from_world else { continue };
            let place = |key: &viola_reconstruct::KeyFrame| View {
                clip_from_camera: clip_from_world * key.world_from_camera,
                readings: key.readings.clone(),
            };
            let views: Vec<View> = seen.keys.iter().map(place).collect();
            let number = recordings.map_from_clip.len();
            std::fs::write(recordings.cloud(number), cloud_ply(&seen.cloud_in_clip, None))?;
            std::fs::write(recordings.views(number), views_bytes(&seen.cloud_in_clip, &views))?;
            recordings.map_from_clip.push(truth.map_from_clip);
        }
        Ok(recordings)
    }

    fn cloud(&self, number: usize) -> PathBuf {
        self.folder.join(format!("cloud_{number}"))
    }

    fn views(&self, number: usize) -> PathBuf {
        self.folder.join(format!("views_{number}"))
    }

    fn member(&self, at: usize, timed: bool) -> Member {
        // Evenly spread errors, different for each clip.
        let error = |salt: f64| 2.0 * ((at as f64 + 1.0) * salt).fract() - 1.0;
        let truth = self.map_from_clip[at % RECORDINGS];
        let map_from_clip = Pose2::new(
            truth.x_m + ERROR_M * error(0.618_034),
            truth.y_m + ERROR_M * error(0.754_878),
            truth.yaw_rad + ERROR_RAD * error(0.569_840),
        );
        let sigmas = nalgebra::Vector3::new(ERROR_M, ERROR_M, ERROR_RAD);
        Member {
            clip: Uuid::from_u128(at as u128),
            recorded_at_ms: timed.then_some(at as i64 * 60_000),
            sha256: format!("{at:06}"),
            contribution: at.to_string(),
            verdict: Verdict::Aligned {
                level: viola_geometry::LevelName::MAIN,
                map_from_clip,
                covariance: Matrix3::from_diagonal(&sigmas.component_mul(&sigmas)),
                probability: Some(0.99),
            },
        }
    }

    /// Returns the RMS error of the clips' positions relative to their mean error.
    fn relative_error_m(&self, clips: &[PlacedClip]) -> f64 {
        let error = |clip: &PlacedClip| {
            let truth = self.map_from_clip[clip.clip.as_u128() as usize % RECORDINGS];
            [clip.map_from_clip.x_m - truth.x_m, clip.map_from_clip.y_m - truth.y_m]
        };
        let errors: Vec<[f64; 2]> = clips.iter().map(error).collect();
        let count = errors.len() as f64;
        let mean = |axis: usize| errors.iter().map(|error| error[axis]).sum::<f64>() / count;
        let mean = [mean(0), mean(1)];
        let squares = errors.iter().map(|error| (error[0] - mean[0]).powi(2) + (error[1] - mean[1]).powi(2));
        (squares.sum::<f64>() / count).sqrt()
    }
}

/// Merges the last clip into the map that the other process made, and describes the new one.
fn row(home: &Home, timed: bool, count: usize, folder: &Path) -> Result<String, Failure> {
    let Made { map_from_clip, tiles, sums, seconds: at_once_s, read: at_once_read } =
        serde_json::from_slice(&std::fs::read(folder.join(MADE))?)?;
    let recordings = Recordings { folder: folder.to_owned(), map_from_clip };
    let members: Vec<Member> = (0..count).map(|at| recordings.member(at, timed)).collect();
    let network = built_in_network()?;
    let lidar = home.survey().lidar_map()?;
    let mut load = Load { of: &recordings, sums: sums.into_iter().collect(), read: 0 };
    // On Linux the peak starts from 0 again.
    let _ = std::fs::write("/proc/self/clear_refs", "5");
    let (begun, cpu_before_s) = (Instant::now(), cpu_s());
    let last: Manifest = serde_json::from_slice(&std::fs::read(folder.join(MANIFEST))?)?;
    let next = assemble(&last, members, &mut load, &Silent)?;
    let merged_s = begun.elapsed().as_secs_f64();
    let mut kept: BTreeMap<TileKey, Tile> = BTreeMap::new();
    for (key, number) in tiles.iter().filter(|(key, _)| !next.changed.contains_key(key)) {
        kept.insert(*key, Tile::read(&std::fs::read(folder.join(format!("tile_{number}")))?)?);
    }
    let labelling = Instant::now();
    let next = next.label(kept, Some(&network), &Silent)?;
    let labelled_s = labelling.elapsed().as_secs_f64();
    let (anew, all, windows) = (next.changed.len(), next.tiles.len(), next.windows);
    let changed = next.changed.iter().filter_map(|key| next.tiles.get(key));
    let written: usize = changed.map(|tile| tile.to_bytes().len()).sum();
    let sums: usize = next.sums.values().flatten().map(Vec::len).sum();
    let tiles: Vec<Tile> = next.tiles.into_values().collect();
    let manifest = serde_json::to_vec(&next.manifest)?;
    let numbers = ClipNumbers::new(next.manifest.clips.iter().map(|clip| &clip.clip));
    let described = Instant::now();
    describe(&lidar, &tiles, &numbers, &Silent)?;
    let (described_s, one_s) = (described.elapsed().as_secs_f64(), begun.elapsed().as_secs_f64());
    let cpu_s = cpu_s() - cpu_before_s;
    let points: usize = tiles.iter().map(|tile| tile.points.len()).sum();
    let peak = peak_memory_bytes().map_or(0.0, |bytes| bytes as f64 / f64::from(1 << 20));
    Ok(format!(
        "| {count} | {points} | {at_once_s:.1} s, {at_once_read} | {anew} of {all} | {} | {:.1} MB | {merged_s:.2} s | {windows} | {labelled_s:.2} s | {described_s:.2} s | \
         {one_s:.2} s | {cpu_s:.2} s | {peak:.0} MiB | {:.1} mm |",
        load.read,
        (written + sums + manifest.len()) as f64 * 1e-6,
        1e3 * recordings.relative_error_m(&next.manifest.clips),
    ))
}

/// Reads the files of clips and the sums of a map, and counts the clips.
struct Load<'a> {
    of: &'a Recordings,
    /// The numbers of the tiles' sums.
    sums: BTreeMap<TileKey, usize>,
    read: usize,
}

impl LoadClips<Failure> for Load<'_> {
    fn contributions(&mut self, members: &[&Member]) -> Result<Vec<ClipContribution>, Failure> {
        self.read += members.len();
        // Decoded side by side, as in the service.
        let read = |member: &&Member| {
            let number = member.clip.as_u128() as usize % RECORDINGS;
            let files = [self.of.cloud(number), self.of.views(number)].map(std::fs::read);
            let [cloud, views] = files.map(|file| file.map_err(|error| error.to_string()));
            ClipContribution::read(&cloud?, &views?).map_err(|error| error.to_string())
        };
        Ok(members.par_iter().map(read).collect::<Result<_, String>>()?)
    }

    fn features(&mut self, members: &[&Member]) -> Result<Vec<Vec<Feature>>, Failure> {
        Ok(vec![Vec::new(); members.len()])
    }

    fn sums(&mut self, tiles: &[TileKey]) -> Result<Vec<Option<Vec<u8>>>, Failure> {
        let read = |tile: &TileKey| {
            let Some(number) = self.sums.get(tile) else { return Ok(None) };
            Ok(Some(std::fs::read(self.of.folder.join(format!("sums_{number}")))?))
        };
        tiles.iter().map(read).collect()
    }
}

/// Returns the surface network of the program.
fn built_in_network() -> Result<SurfaceNetwork, Failure> {
    let installed = manifest::installed(Task::Surface, None)?.ok_or("no surface network is built in")?;
    let network = viola_network::open_weights(&installed.weights, &RuntimeParams::default())?;
    Ok(SurfaceNetwork::new(&installed.entry, network)?)
}

/// Returns the name of the home's largest room.
fn home_room(home: &Home) -> String {
    let rooms = home.plan.rooms.iter();
    let largest = rooms.max_by(|a, b| a.inner.area_m2().total_cmp(&b.inner.area_m2()));
    largest.map(|room| room.name.clone()).unwrap_or_default()
}

/// Returns the time that all threads of the process have used; 0 where Linux does not tell it.
fn cpu_s() -> f64 {
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    // User and system time, in hundredths of a second, are fields 14 and 15; the name before may have spaces.
    let fields = stat.rsplit(')').next().unwrap_or_default().split_whitespace();
    fields.skip(11).take(2).filter_map(|ticks| ticks.parse::<f64>().ok()).sum::<f64>() / 100.0
}
