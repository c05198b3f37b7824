//! The result on standard output: a row for each clip, the reasons for which a clip is not in the map, and the size of
//! the map.

use super::document::{ClipDocument, MapDocument};
use crate::cli::output;
use std::path::Path;

pub fn print(map: &MapDocument, objects: usize, rooms: usize, out: &Path) {
    let mut rows =
        vec![["clip", "in map", "state", "probability", "x_m", "y_m", "yaw_deg"].map(str::to_owned)];
    rows.extend(map.clips.iter().map(row));
    print!("{}", output::columns(&rows));
    let absent: Vec<String> = map.clips.iter().filter_map(absence).collect();
    if !absent.is_empty() {
        println!("\nnot in the map:");
        absent.iter().for_each(|line| println!("  {line}"));
    }
    let placed = map.clips.iter().filter(|clip| clip.by.is_some()).count();
    println!();
    println!("clips:   {placed} of {} in the map", map.clips.len());
    println!("rooms:   {rooms}");
    println!("objects: {objects}");
    println!("points:  {}", map.info.points);
    println!("wrote:   {}", out.display());
}

/// Returns the state of a clip that is not in the map, with its reasons; `None` for a clip in the map.
fn absence(clip: &ClipDocument) -> Option<String> {
    if clip.by.is_some() {
        return None;
    }
    let reasons: Vec<String> =
        clip.reasons.iter().map(|reason| format!("{} ({})", reason.detail, reason.code)).collect();
    let reasons = if reasons.is_empty() {
        "its own alignment is not certain enough, and no other clip decides it".to_owned()
    } else {
        reasons.join("; ")
    };
    Some(format!("{}: {}: {reasons}", clip.file, clip.state.name()))
}

fn row(clip: &ClipDocument) -> [String; 7] {
    let or_dash = |value: Option<String>| value.unwrap_or_else(|| "-".to_owned());
    let pose = clip.map_from_clip;
    [
        clip.file.clone(),
        if clip.by.is_some() { "yes" } else { "no" }.to_owned(),
        clip.state.name().to_owned(),
        or_dash(clip.probability.map(|probability| format!("{probability:.3}"))),
        or_dash(pose.map(|pose| format!("{:.3}", pose.x_m))),
        or_dash(pose.map(|pose| format!("{:.3}", pose.y_m))),
        or_dash(pose.map(|pose| format!("{:.2}", pose.yaw_rad.to_degrees()))),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use viola_geometry::LevelName;
    use viola_home::PlacedBy;
    use viola_reconstruct::Reason;
    use viola_storage::ClipState;

    fn clip(state: ClipState, by: Option<PlacedBy>, reasons: Vec<Reason>) -> ClipDocument {
        ClipDocument {
            clip: None,
            file: "a.zip".to_owned(),
            sha256: None,
            state,
            level: Some(LevelName::MAIN),
            map_from_clip: None,
            rise_m: 0.0,
            probability: None,
            scale: None,
            by,
            recorded_at: None,
            points: 0,
            moved_m: None,
            moved_deg: None,
            reasons,
        }
    }

    #[test]
    fn a_clip_that_is_not_in_the_map_has_its_state_and_its_reasons() {
        let reasons =
            || vec![Reason::new("several_modes", "two poses"), Reason::new("no_colour", "no colour")];
        for (state, by, reasons, want) in [
            (
                ClipState::Ambiguous,
                None,
                reasons(),
                Some("a.zip: ambiguous: two poses (several_modes); no colour (no_colour)"),
            ),
            (ClipState::Aligned, Some(PlacedBy::Alignment), reasons(), None),
            (
                ClipState::Ambiguous,
                None,
                vec![],
                Some(
                    "a.zip: ambiguous: its own alignment is not certain enough, and no other clip decides it",
                ),
            ),
        ] {
            let clip = clip(state, by, reasons);
            assert_eq!(absence(&clip).as_deref(), want);
            assert_eq!(row(&clip)[1], if want.is_some() { "no" } else { "yes" });
        }
    }
}
