//! Refines 100 starts in a simulated home on one thread. Writes points, starts and time for `compare.py`,
//! which repeats it with Open3D.

use rand::{RngExt, SeedableRng};
use serde_json::json;
use std::time::Instant;
use viola_align as align;
use viola_align::AlignParams;
use viola_geometry::Pose2;
use viola_geometry::progress::Silent;
use viola_lab::evaluate::{HomeClips, HomesParams, Suite};

const STARTS: usize = 100;
/// Runs; the fastest counts, because other processes disturb the rest.
const RUNS: usize = 5;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path = std::env::args().nth(1).ok_or("usage: peers OUT.json")?;
    let sample = HomeClips::new(HomesParams::default()).sample(0, &AlignParams::default(), &Silent)?;
    let sample = sample.ok_or("the home has no clip")?;
    let target = sample.target.ok_or("the map is empty")?;
    let (hits, truth) =
        (&sample.observation.scan.hits, sample.map_from_clip.ok_or("the clip has no true pose")?);

    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(0);
    // Half are anywhere in the map, like search results; half are near the truth.
    let starts: Vec<Pose2> = (0..STARTS)
        .map(|i| {
            let place = target.points_m[rng.random_range(0..target.points_m.len())];
            let any = Pose2::new(place.x, place.y, rng.random_range(-3.1..3.1));
            let mut off = |size: f64| rng.random_range(-size..size);
            let near = Pose2::new(truth.x_m + off(0.3), truth.y_m + off(0.3), truth.yaw_rad + off(0.15));
            if i % 2 == 0 { any } else { near }
        })
        .collect();
    let one_thread = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    let (mut seconds, mut refined) = (f64::INFINITY, Vec::new());
    for _ in 0..RUNS {
        let since = Instant::now();
        refined = one_thread.install(|| align::refine(&starts, hits, &target));
        seconds = f64::min(seconds, since.elapsed().as_secs_f64());
    }

    let flat = |pose: &Pose2| [pose.x_m, pose.y_m, pose.yaw_rad];
    let file = json!({
        "hits_m": hits.iter().map(|hit| [hit.point_m.x, hit.point_m.y]).collect::<Vec<_>>(),
        "map_m": target.points_m.iter().map(|p| [p.x, p.y]).collect::<Vec<_>>(),
        "starts": starts.iter().map(flat).collect::<Vec<_>>(),
        "truth": flat(&truth),
        "viola": {
            "seconds": seconds,
            "poses": refined.iter().map(|r| flat(&r.map_from_clip)).collect::<Vec<_>>(),
        },
    });
    std::fs::write(path, file.to_string())?;
    Ok(())
}
