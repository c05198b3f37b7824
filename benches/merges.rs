//! Times a merge of one more clip into a home's map, without the service around it: simulated clips of one room
//! and of a whole home, with and without times of recording.
//!
//! `cargo run --release --example merges -- [room|home] [timed|untimed] CLIPS...`

use nalgebra::Matrix3;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;
use tempfile::TempDir;
use uuid::Uuid;
use viola_align::{AlignParams, observe};
use viola_geometry::Pose2;
use viola_geometry::progress::Silent;
use viola_home::{
    ClipContribution, ClipNumbers, Manifest, Member, Tile, TileKey, Verdict, assemble, cloud_ply, describe,
    views_bytes,
};
use viola_lab::evaluate::peak_memory_bytes;
use viola_lab::simulate::{ClipParams, Home, HomeParams, Set, clip_in_memory};
use viola_network::RuntimeParams;
use viola_network::manifest::{self, Task};
use viola_reconstruct::View;
use viola_reconstruct::label::SurfaceNetwork;

/// Different recordings. More clips are these again, with other errors of their poses.
const RECORDINGS: usize = 12;
const FRAMES: usize = 60;
/// Largest error of a clip's own pose.
const ERROR_M: f64 = 0.02;
const ERROR_RAD: f64 = 0.005;

type Failure = Box<dyn std::error::Error>;

fn main() -> Result<(), Failure> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [place, times, counts @ ..] = &arguments[..] else {
        return Err("usage: merges room|home timed|untimed CLIPS...".into());
    };
    let in_one_room = place == "room";
    let home = Home::generate(&HomeParams::new(Set::Normal, 5));
    let recordings = Recordings::make(&home, in_one_room)?;
    println!("{place}, {times}: {:.1} MB of files a clip\n", recordings.mean_mb());
    println!(
        "| clips | points | all others at once, clips read | one more: tiles anew | clips read | written | assembly | labels | description | sum | of both cores | peak memory |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|---|---|");
    for count in counts {
        let count: usize = count.parse()?;
        let members: Vec<Member> = (0..count).map(|at| recordings.member(at, times == "timed")).collect();
        println!("{}", recordings.row(&home, &members)?);
    }
    Ok(())
}

/// The files of recordings, in a folder, and their true poses.
struct Recordings {
    folder: TempDir,
    /// The network that labels the map.
    network: SurfaceNetwork,
    map_from_clip: Vec<Pose2>,
}

impl Recordings {
    fn make(home: &Home, in_one_room: bool) -> Result<Recordings, Failure> {
        let survey = home.survey();
        let params = ClipParams { frames: FRAMES, color_width: 256, ..ClipParams::default() };
        let clips = (0..).map(|index| home.clip(&survey, index, &params));
        let mut clips =
            clips.filter(|clip| !in_one_room || clip.truth.rooms.first() == Some(&home_room(home)));
        let network = built_in_network()?;
        let mut recordings = Recordings { folder: tempfile::tempdir()?, network, map_from_clip: Vec::new() };
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
        self.folder.path().join(format!("cloud_{number}"))
    }

    fn views(&self, number: usize) -> PathBuf {
        self.folder.path().join(format!("views_{number}"))
    }

    fn mean_mb(&self) -> f64 {
        let size = |path: &Path| std::fs::metadata(path).map_or(0, |file| file.len());
        let all = (0..RECORDINGS).map(|n| size(&self.cloud(n)) + size(&self.views(n)));
        all.sum::<u64>() as f64 * 1e-6 / RECORDINGS as f64
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
            share: at.to_string(),
            verdict: Verdict::Aligned {
                level: viola_geometry::LevelName::MAIN,
                map_from_clip,
                covariance: Matrix3::from_diagonal(&sigmas.component_mul(&sigmas)),
                probability: Some(0.99),
            },
        }
    }

    fn load(&self, member: &Member) -> Result<ClipContribution, Failure> {
        let number = member.clip.as_u128() as usize % RECORDINGS;
        let (cloud, views) = (std::fs::read(self.cloud(number))?, std::fs::read(self.views(number))?);
        Ok(ClipContribution::read(&cloud, &views)?)
    }

    /// Merges all but the last clip, then the last, and describes the map.
    fn row(&self, home: &Home, members: &[Member]) -> Result<String, Failure> {
        let mut read = 0usize;
        let mut load = |member: &Member| {
            read += 1;
            self.load(member)
        };
        let others = members.split_last().map_or(&[][..], |(_, others)| others);
        let begun = Instant::now();
        let first = assemble(&Manifest::default(), others.to_vec(), &mut load)?;
        let at_once_s = begun.elapsed().as_secs_f64();
        let at_once_read = std::mem::take(&mut read);
        let first = first.label(BTreeMap::new(), Some(&self.network));
        let stored: BTreeMap<TileKey, Vec<u8>> =
            first.tiles.iter().map(|(key, tile)| (*key, tile.to_bytes())).collect();
        let last = serde_json::to_vec(&first.manifest)?;
        drop(first);
        let lidar = home.survey().lidar_map();
        // On Linux the peak begins anew.
        let _ = std::fs::write("/proc/self/clear_refs", "5");
        let mut load = |member: &Member| {
            read += 1;
            self.load(member)
        };
        let (begun, cpu_before_s) = (Instant::now(), cpu_s());
        let last: Manifest = serde_json::from_slice(&last)?;
        let next = assemble(&last, members.to_vec(), &mut load)?;
        let merged_s = begun.elapsed().as_secs_f64();
        let mut kept: BTreeMap<TileKey, Tile> = BTreeMap::new();
        for (key, bytes) in stored.iter().filter(|(key, _)| !next.changed.contains_key(key)) {
            kept.insert(*key, Tile::read(bytes)?);
        }
        let labelling = Instant::now();
        let next = next.label(kept, Some(&self.network));
        let labelled_s = labelling.elapsed().as_secs_f64();
        let (anew, all) = (next.changed.len(), next.tiles.len());
        let changed = next.changed.iter().filter_map(|key| next.tiles.get(key));
        let written: usize = changed.map(|tile| tile.to_bytes().len()).sum();
        let tiles: Vec<Tile> = next.tiles.into_values().collect();
        let manifest = serde_json::to_vec(&next.manifest)?;
        let numbers = ClipNumbers::new(next.manifest.clips.iter().map(|clip| &clip.clip));
        let described = Instant::now();
        describe(&lidar, &tiles, &numbers);
        let (described_s, one_s) = (described.elapsed().as_secs_f64(), begun.elapsed().as_secs_f64());
        let cpu_s = cpu_s() - cpu_before_s;
        let points: usize = tiles.iter().map(|tile| tile.points.len()).sum();
        let peak = peak_memory_bytes().map_or(0.0, |bytes| bytes as f64 / f64::from(1 << 20));
        Ok(format!(
            "| {} | {points} | {at_once_s:.1} s, {at_once_read} | {anew} of {all} | {read} | {:.1} MB | {merged_s:.2} s | {labelled_s:.2} s | {described_s:.2} s | \
             {one_s:.2} s | {cpu_s:.2} s | {peak:.0} MiB |",
            members.len(),
            (written + manifest.len()) as f64 * 1e-6
        ))
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
