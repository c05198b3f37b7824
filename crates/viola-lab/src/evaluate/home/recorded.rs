//! Simulated homes as maps fused from recordings, with the labels that the method gives them.

use super::HomeError;
use super::simulated::{SimulatedMap, furniture, true_rooms};
use crate::simulate::{ClipParams, Home, HomeParams, SimulatedClip, clip_in_memory, valetudo_json};
use nalgebra::Matrix3;
use std::collections::BTreeMap;
use std::convert::Infallible;
use std::sync::Arc;
use uuid::Uuid;
use viola_align::{AlignParams, observe};
use viola_formats::lidar::LidarMap;
use viola_geometry::progress::Progress;
use viola_geometry::{Point2, Point3, Vector3};
use viola_home::{ClipContribution, ClipNumbers, Manifest, MapPoint, Member, Verdict, assemble};

/// Distance within which a fused point belongs to a true surface, as in the training of the surface network.
const REACH_M: f64 = 0.08;
/// Standard deviations of the clips' poses: those of aligned clips (BENCHMARKS, "Real apartment").
const PLACE_M: f64 = 0.02;
const TURN_RAD: f64 = 0.005;

/// Recordings of a home.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RecordParams {
    pub clips: u64,
    /// Frames of each clip.
    pub frames: usize,
}

/// Records clips of a home and fuses them at their true poses: objects are evaluated, not the alignment.
pub fn recorded(
    home: &HomeParams,
    recording: RecordParams,
    params: &AlignParams,
    progress: &dyn Progress,
) -> Result<SimulatedMap, HomeError> {
    let home = Home::generate(home);
    let survey = home.survey();
    let lidar = LidarMap::read(valetudo_json(&survey).to_string().as_bytes())?;
    let (mut members, mut shares) = (Vec::new(), Vec::new());
    let mut last = None;
    for number in 0..recording.clips {
        let depth = ClipParams::default().sensor.depth_camera();
        let how = ClipParams { frames: recording.frames, color_width: depth.width, ..ClipParams::default() };
        let clip = Arc::new(home.clip(&survey, number, &how));
        let observation = observe(&clip_in_memory(clip.clone()), None, params, progress)?;
        members.push(Member {
            clip: Uuid::from_u128(u128::from(number)),
            recorded_at_ms: None,
            sha256: format!("{number:06}"),
            share: number.to_string(),
            verdict: Verdict::Aligned {
                map_from_clip: clip.truth.map_from_clip,
                covariance: Matrix3::from_diagonal(
                    &Vector3::new(PLACE_M, PLACE_M, TURN_RAD).map(|sigma| sigma * sigma),
                ),
                probability: Some(1.0),
            },
        });
        shares.push(ClipContribution::new(observation.cloud_in_clip, Vec::new()));
        last = Some(clip);
    }
    let mut load = |member: &Member| -> Result<ClipContribution, Infallible> {
        let share = member.share.parse::<usize>().ok().and_then(|number| shares.get(number));
        Ok(share.cloned().unwrap_or_else(ClipContribution::default))
    };
    let Ok(assembly) = assemble(&Manifest::default(), members, &mut load);
    let clips = ClipNumbers::new(assembly.manifest.clips.iter().map(|clip| &clip.clip));
    let points: Vec<MapPoint> =
        assembly.changed.values().flatten().flat_map(|tile| clips.in_map(tile)).collect();
    let map_from_home = survey.valetudo_from_home();
    let shown = last.map_or_else(BTreeMap::new, |clip| shown(&points, &clip, &map_from_home));
    Ok(SimulatedMap {
        truth: furniture(&home, shown, &map_from_home),
        rooms: true_rooms(&home, &map_from_home),
        lidar,
        points,
    })
}

/// Returns the fused points on each object's surface, by its number and the surface's class.
fn shown(
    points: &[MapPoint],
    clip: &SimulatedClip,
    map_from_home: &viola_geometry::Pose2,
) -> BTreeMap<(u16, u16), Vec<[f64; 3]>> {
    let home_from_map = map_from_home.inverse();
    let mut shown: BTreeMap<(u16, u16), Vec<[f64; 3]>> = BTreeMap::new();
    for point in points {
        let [x, y, z] = point.point.position_m.map(f64::from);
        let at = home_from_map.apply(&Point2::new(x, y));
        let normal = point.point.normal();
        let turned = home_from_map.rotate(&normal.xy());
        let normal = Vector3::new(turned.x, turned.y, normal.z);
        if let Some((class, instance)) = clip.label_at(&Point3::new(at.x, at.y, z), &normal, REACH_M)
            && instance > 0
        {
            shown.entry((instance, class.id())).or_default().push([x, y, z]);
        }
    }
    shown
}
