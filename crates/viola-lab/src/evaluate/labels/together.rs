//! Accuracy of the classes of a home's fused map beside those of its single clips, on the same vertices.

use super::{Calibration, Confusion, LabelRow, Said, Truth};
use viola_geometry::{Point3, Pose3};
use viola_reconstruct::PointCloud;

/// Returns the rows of the single clips and of the map fused of them: the vertices near a point of the map and of
/// at least one clip. Of several clips each has its part of the vertex. `in_map` places a vertex in the map.
pub fn together(
    truth: &Truth,
    clips: &[(PointCloud, Pose3)],
    map: &PointCloud,
    in_map: impl Fn(&Point3) -> Point3,
) -> [LabelRow; 2] {
    let of_clip = |(cloud, map_from_clip): &(PointCloud, Pose3)| {
        let clip_from_map = map_from_clip.inverse();
        Said::of(cloud, truth, |vertex| clip_from_map * in_map(vertex))
    };
    let single: Vec<Said> = clips.iter().map(of_clip).collect();
    let fused = Said::of(map, truth, &in_map);
    let (mut of_clips, mut of_map) = (Confusion::new(), Confusion::new());
    let (mut single_answers, mut fused_answers) = (Vec::new(), Vec::new());
    let (mut without_clip, mut without_map) = (0, 0);
    for (i, class) in truth.classes.iter().enumerate() {
        let Some(class) = *class else { continue };
        let answers: Vec<(usize, f32)> = single.iter().filter_map(|single| single.classes[i]).collect();
        let Some((said, p)) = fused.classes[i] else {
            without_map += usize::from(!answers.is_empty());
            continue;
        };
        if answers.is_empty() {
            without_clip += 1;
            continue;
        }
        of_map.add(class, said, 1.0);
        fused_answers.push((f64::from(p), class == said));
        for (said, p) in &answers {
            of_clips.add(class, *said, 1.0 / answers.len() as f64);
            single_answers.push((f64::from(*p), class == *said));
        }
    }
    let vertices = fused_answers.len();
    let row = |variant: &str, confusion: Confusion, answers: Vec<(f64, bool)>, without_point: usize| {
        let calibration = Calibration::of_answers(answers);
        LabelRow {
            calibration_error: calibration.map(|c| c.expected_calibration_error),
            without_point: Some(without_point),
            ..confusion.row(variant, None, vertices)
        }
    };
    [
        row("single clips", of_clips, single_answers, without_clip),
        row("fused", of_map, fused_answers, without_map),
    ]
}
