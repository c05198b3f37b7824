//! Accuracy of point classes on simulated clips, against the true surface.

use super::confusion::Confusion;
use super::{LabelRow, coarse};
use crate::evaluate::HomesParams;
use crate::evaluate::calibration::Calibration;
use crate::simulate::{ClipParams, Home, HomeParams, Sensor, SimulatedClip, clip_in_memory};
use crate::surfaces::REACH_M;
use std::sync::Arc;
use viola_align::{AlignError, AlignParams, observe};
use viola_formats::clip::Clip;
use viola_geometry::progress::Silent;
use viola_reconstruct::LabelParams;

/// Coarse classes, and each point's probability with whether its class is right.
type Counts = (Confusion, Vec<(f64, bool)>);

/// Returns the rows of shapes alone, and with the surface network if there is one: all points of all clips with a
/// floor. `advance` is called after each clip.
pub fn simulated(
    homes: &HomesParams,
    params: &AlignParams,
    advance: &dyn Fn(),
) -> Result<Vec<LabelRow>, AlignError> {
    let mut variants = vec![("geometry", LabelParams { surface: None, ..params.label.clone() })];
    if params.label.surface.is_some() {
        variants.push(("volume", params.label.clone()));
    }
    let mut counts: Vec<Counts> = variants.iter().map(|_| (Confusion::new(), Vec::new())).collect();
    for &set in &homes.sets {
        for seed in homes.seeds.clone() {
            let home = Home::generate(&HomeParams::new(set, seed));
            let survey = home.survey();
            for (index, &frames) in (0..).zip(&homes.frames) {
                let color_width = Sensor::PhoneLidar.depth_camera().width;
                let (sensor, drift) = (homes.sensor, homes.drift);
                let clip = ClipParams { frames, sensor, color_width, drift, ..ClipParams::default() };
                let recorded = Arc::new(home.clip(&survey, index, &clip));
                let clip = clip_in_memory(recorded.clone());
                for ((_, label), counts) in variants.iter().zip(&mut counts) {
                    let params = AlignParams { label: label.clone(), ..params.clone() };
                    count(&clip, &recorded, &params, counts)?;
                }
                advance();
            }
        }
    }
    let rows = variants.iter().zip(counts).map(|((variant, _), (confusion, answers))| {
        let accuracy = confusion.accuracy(|class| class);
        let row = confusion.row(variant, accuracy, answers.len());
        let calibration = Calibration::of_answers(answers);
        LabelRow { calibration_error: calibration.map(|c| c.expected_calibration_error), ..row }
    });
    Ok(rows.collect())
}

/// Counts the points of a clip, if it has a floor.
fn count(
    clip: &Clip,
    recorded: &SimulatedClip,
    params: &AlignParams,
    (confusion, answers): &mut Counts,
) -> Result<(), AlignError> {
    let seen = observe(clip, None, params, &Silent)?;
    let Some(clip_from_world) = seen.clip_from_world else { return Ok(()) };
    let home_from_clip = (clip_from_world * recorded.truth.world_from_home).inverse();
    for point in &seen.cloud_in_clip.points {
        let (at, normal) = (home_from_clip * point.position(), home_from_clip * point.normal());
        let Some((truth, _)) = recorded.label_at(&at, &normal, REACH_M) else { continue };
        let (truth, said) = (coarse(truth), coarse(point.label.class));
        confusion.add(truth, said, 1.0);
        answers.push((f64::from(point.label.probability()), truth == said));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::Set;

    #[test]
    fn shapes_tell_structure_of_simulated_clips() {
        let homes = HomesParams {
            sets: vec![Set::Normal],
            seeds: 6..7,
            clips_per_home: 1,
            frames: vec![8],
            sensor: Sensor::PhoneLidar,
            picture_labels: None,
            foreign: false,
            withhold_poses: false,
            drift: 0.0,
            rescale: false,
        };
        let rows = simulated(&homes, &AlignParams::default(), &|| ()).unwrap();
        let [row] = &rows[..] else { panic!("{rows:?}") };
        // The goal for the real apartment.
        assert!(row.variant == "geometry" && row.vertices > 1000 && row.structure_accuracy > 0.8, "{row:?}");
        assert!(row.calibration_error.is_some_and(|error| error < 0.5), "{row:?}");
    }
}
