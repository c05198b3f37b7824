//! The result on standard output: a row for each clip, and the size of the map.

use super::document::{ClipDocument, MapDocument};
use crate::cli::output;
use std::path::Path;

pub fn print(map: &MapDocument, objects: usize, rooms: usize, out: &Path) {
    let mut rows = vec![["clip", "state", "probability", "x_m", "y_m", "yaw_deg"].map(str::to_owned)];
    rows.extend(map.clips.iter().map(row));
    print!("{}", output::columns(&rows));
    let placed = map.clips.iter().filter(|clip| clip.by.is_some()).count();
    println!();
    println!("clips:   {placed} of {} in the map", map.clips.len());
    println!("rooms:   {rooms}");
    println!("objects: {objects}");
    println!("points:  {}", map.info.points);
    println!("wrote:   {}", out.display());
}

fn row(clip: &ClipDocument) -> [String; 6] {
    let or_dash = |value: Option<String>| value.unwrap_or_else(|| "-".to_owned());
    let pose = clip.map_from_clip;
    [
        clip.file.clone(),
        clip.state.name().to_owned(),
        or_dash(clip.probability.map(|probability| format!("{probability:.3}"))),
        or_dash(pose.map(|pose| format!("{:.3}", pose.x_m))),
        or_dash(pose.map(|pose| format!("{:.3}", pose.y_m))),
        or_dash(pose.map(|pose| format!("{:.2}", pose.yaw_rad.to_degrees()))),
    ]
}
