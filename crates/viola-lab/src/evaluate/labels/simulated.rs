//! Accuracy of point classes on simulated clips, against the true surface.

use super::confusion::Confusion;
use super::{LabelRow, ObjectsRow, coarse};
use crate::evaluate::HomesParams;
use crate::evaluate::calibration::Calibration;
use crate::simulate::{ClipParams, Home, HomeObject, HomeParams, Sensor, SimulatedClip, clip_in_memory};
use crate::surfaces::REACH_M;
use std::sync::Arc;
use viola_align::{AlignError, AlignParams, observe};
use viola_formats::clip::Clip;
use viola_geometry::progress::Silent;
use viola_reconstruct::LabelParams;

/// Coarse classes, each point's probability with whether its class is right, and furniture.
type Counts = (Confusion, Vec<(f64, bool)>, ObjectsRow);

/// Returns the rows of shapes alone, and with the surface network if there is one: all points of all clips with a
/// floor, and the furniture of each clip by itself. `advance` is called after each clip with
/// its name.
pub fn simulated(
    homes: &HomesParams,
    params: &AlignParams,
    advance: &dyn Fn(&str),
) -> Result<Vec<(LabelRow, ObjectsRow)>, AlignError> {
    let mut variants = vec![("geometry", LabelParams { surface: None, ..params.label.clone() })];
    if params.label.surface.is_some() {
        variants.push(("volume", params.label.clone()));
    }
    let mut counts: Vec<Counts> =
        variants.iter().map(|_| (Confusion::new(), Vec::new(), ObjectsRow::default())).collect();
    for &set in &homes.sets {
        for seed in homes.seeds.clone() {
            let home = Home::generate(&HomeParams::new(set, seed));
            let (survey, objects) = (home.survey(), home.objects_alone());
            for (index, &frames) in (0..).zip(&homes.frames) {
                let color_width = Sensor::PhoneLidar.depth_camera().width;
                let clip = ClipParams { frames, color_width, drift: homes.drift, ..ClipParams::default() };
                let recorded = Arc::new(home.clip(&survey, index, &clip));
                let clip = clip_in_memory(recorded.clone());
                for ((_, label), counts) in variants.iter().zip(&mut counts) {
                    let params = AlignParams { label: label.clone(), ..params.clone() };
                    count(&clip, &recorded, &objects, &params, counts)?;
                }
                advance(&format!("{} {seed}, {frames} frames", set.name()));
            }
        }
    }
    let rows = variants.iter().zip(counts).map(|((variant, _), (confusion, answers, objects))| {
        let row = confusion.row(variant, None, answers.len());
        let calibration = Calibration::of_answers(answers);
        let row = LabelRow { calibration_error: calibration.map(|c| c.expected_calibration_error), ..row };
        (row, ObjectsRow { variant: (*variant).to_owned(), ..objects })
    });
    Ok(rows.collect())
}

/// Counts the points of a clip, if it has a floor.
fn count(
    clip: &Clip,
    recorded: &SimulatedClip,
    objects: &[HomeObject],
    params: &AlignParams,
    (confusion, answers, furniture): &mut Counts,
) -> Result<(), AlignError> {
    let seen = observe(clip, None, params, &Silent)?;
    let Some(clip_from_world) = seen.clip_from_world else {
        furniture.without_floor += 1;
        return Ok(());
    };
    let clip_from_home = clip_from_world * recorded.truth.world_from_home;
    furniture.add(&seen.cloud_in_clip, &clip_from_home, recorded, objects);
    let home_from_clip = clip_from_home.inverse();
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
    use std::cell::RefCell;

    #[test]
    fn shapes_tell_structure_of_simulated_clips() {
        let homes = HomesParams { seeds: 6..7, frames: vec![8], drift: 0.0, ..HomesParams::default() };
        let names = RefCell::new(Vec::new());
        let advance = |clip: &str| names.borrow_mut().push(clip.to_owned());
        let rows = simulated(&homes, &AlignParams::default(), &advance).unwrap();
        assert_eq!(names.into_inner(), ["normal 6, 8 frames"]);
        let [(row, objects)] = &rows[..] else { panic!("{rows:?}") };
        // The goal for the real apartment.
        assert!(row.variant == "geometry" && row.vertices > 1000 && row.structure_accuracy > 0.8, "{row:?}");
        assert!(row.calibration_error.is_some_and(|error| error < 0.5), "{row:?}");
        // Shapes name no furniture, and the clip shows some.
        assert!(objects.matches.total.truth > 0 && objects.matches.total.found == 0, "{objects:?}");
    }
}
