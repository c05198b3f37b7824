//! Stage 10: completes unseen parts at the vacuum's height, marks them, and registers the clip again
//! (paper III-D).
//!
//! Structure comes first: walls are extended to the floor and to each other. Imagination follows if its
//! networks are installed: pictures from virtual cameras are completed and fused.

mod depth;
mod fusion;
mod imagine;
pub mod inpaint;
pub mod monocular;
pub mod render;
mod structure;
mod view;
mod viewpoints;

pub use imagine::{CompletedView, Imagination};
pub use view::{View, camera_like};
pub use viewpoints::{PointSets, ViewStrategy};

use super::answer::{AnswerSummary, CompletionReport, ViewReport};
use super::observe::{FloorHypothesis, Observation};
use super::register::register;
use super::scan::{self, RaycastParams, VirtualScan};
use super::within::Within;
use super::{AlignError, AlignParams, Alignment, AlignmentState, Target};
use std::cell::OnceCell;
use std::time::Duration;
use viola_geometry::progress::{self, Progress, Stage};
use viola_reconstruct::{FloorReport, NO_COLOR, PointCloud, Reason};

/// Parameters of the completion.
#[derive(Debug, Clone, PartialEq)]
pub struct CompleteParams {
    pub when: Activation,
    /// If false, walls end where they were last seen.
    pub structure: bool,
    /// `None` uses no network for unseen parts.
    pub imagination: Option<Imagination>,
    /// Choice between the two answers.
    pub take: Take,
    /// Time budget, after which no view begins. The method has no clock, so the caller measures the time
    /// ([`Progress::out_of_time`]).
    pub time: Duration,
}

/// Choice between the answers before and after completion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Take {
    /// The one after completion, as in the paper.
    After,
    /// The likelier one.
    Likelier,
}

/// Condition for completing a clip.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Activation {
    Never,
    /// A pose that is not close to the best one has a loss within `margin_m` of it (paper IV-A).
    SeveralMinima {
        margin_m: f64,
    },
    /// The state is not `aligned`.
    Unsure,
    Always,
}

impl Default for CompleteParams {
    fn default() -> Self {
        CompleteParams {
            when: Activation::Unsure,
            structure: true,
            imagination: None,
            take: Take::Likelier,
            time: Duration::from_secs(60),
        }
    }
}

/// The completed points, apart from the observed ones: they never become part of a home's map.
#[derive(Debug, Clone)]
pub struct Completion {
    pub cloud_in_clip: PointCloud,
    /// The virtual scan with the completed points.
    pub scan: VirtualScan,
    /// The views with completed pictures.
    pub views: Vec<CompletedView>,
    /// The point sets that the views were chosen by.
    pub sets: PointSets,
}

/// Registers an observation, and again with completed points if the first answer is in doubt.
pub fn register_completing(
    observation: &Observation,
    targets: &[&Target],
    params: &AlignParams,
    progress: &dyn Progress,
) -> Result<(Alignment, Option<Completion>), AlignError> {
    let first: OnceCell<Alignment> = OnceCell::new();
    completing(observation, params, progress, &|observation, _, progress| {
        let is_completed = || observation.views().any(|view| view.scan.hits.iter().any(|hit| hit.completed));
        if let Some(before) = first.get().filter(|_| !is_completed()) {
            // The same hits have the same answer.
            return Ok(before.clone());
        }
        let answer = register(observation, targets, params, progress)?;
        first.get_or_init(|| answer.clone());
        Ok(answer)
    })
}

/// A registration of an observation; the second time with its completion.
pub type Registrar<'a> =
    &'a dyn Fn(&Observation, Option<&Completion>, &dyn Progress) -> Result<Alignment, AlignError>;

/// Registers an observation by any method, and again with completed points if the first answer is in doubt. The
/// second time the observation's scan includes the completed hits.
pub fn completing(
    observation: &Observation,
    params: &AlignParams,
    progress: &dyn Progress,
    register: Registrar,
) -> Result<(Alignment, Option<Completion>), AlignError> {
    let before = register(observation, None, progress)?;
    if !params.complete.when.applies(&before) {
        return Ok((before, None));
    }
    progress::begin(progress, Stage::Complete)?;
    let Some(on_floor) = observation.on_floor(&before) else { return Ok((before, None)) };
    let filled = fill(&on_floor, params.complete.imagination.as_ref(), params, progress)?;
    if filled.completion.cloud_in_clip.points.is_empty() {
        return Ok((Alignment { reasons: [before.reasons, filled.remarks].concat(), ..before }, None));
    }
    // Poses above another assumed floor stay rivals. Their walls are extended, too; only the chosen floor is worth a network.
    let mut others = Vec::new();
    for other in observation.on_other_floors(&on_floor) {
        let filled = fill(&other, None, params, progress)?;
        others.extend(other.floor.map(|floor| (floor, filled)));
    }
    let other_floors = others.iter().map(|(floor, filled)| FloorHypothesis {
        scan: filled.completion.scan.clone(),
        floor: floor.clone(),
    });
    let completed = Observation {
        scan: filled.completion.scan.clone(),
        other_floors: other_floors.collect(),
        ..on_floor
    };
    let after = register(&completed, Some(&filled.completion), &Within(progress))?;
    let taken = params.complete.take.after(&before, &after);
    let is_above = |(floor, _): &(FloorReport, Filled)| after.floor.as_ref() == Some(floor);
    let filled = match others.iter().position(is_above) {
        Some(index) if taken => Filled { remarks: filled.remarks, ..others.swap_remove(index).1 },
        _ => filled,
    };
    let scan = &filled.completion.scan;
    let report = CompletionReport {
        structure_points: filled.structure_points,
        imagined_points: filled.completion.cloud_in_clip.points.len() - filled.structure_points,
        hits: scan.hits.iter().filter(|hit| hit.completed).count(),
        imagined_by: filled.imagined_by,
        views: filled.completion.views.iter().map(ViewReport::of).collect(),
        cut_short: filled.cut_short,
        taken,
        before: AnswerSummary::of(&before),
        after: AnswerSummary::of(&after),
    };
    let mut chosen = if taken { after } else { before };
    chosen.reasons.extend(filled.remarks);
    chosen.completion = Some(report);
    Ok((chosen, Some(filled.completion)))
}

/// The completion of an observation, and the facts for its report.
struct Filled {
    completion: Completion,
    /// Number of points by structure, which come first in the completion's cloud.
    structure_points: usize,
    imagined_by: Vec<String>,
    cut_short: bool,
    remarks: Vec<Reason>,
}

/// Completes an observation that has its floor at 0.
fn fill(
    on_floor: &Observation,
    imagination: Option<&Imagination>,
    params: &AlignParams,
    progress: &dyn Progress,
) -> Result<Filled, AlignError> {
    let voxel_m = on_floor.cloud_in_clip.voxel_m;
    let walls = structure::Extended::new(&on_floor.walls);
    let mut points = match &on_floor.clip_from_world {
        Some(clip_from_world) if params.complete.structure => {
            walls.points(&on_floor.keys, clip_from_world, voxel_m, progress)?
        }
        _ => Vec::new(),
    };
    let structure_points = points.len();
    let (mut imagined, mut imagined_by) = (imagine::Imagined::default(), Vec::new());
    // Pictures of surface without a colour are black, and so would be what a network adds.
    let has_color = on_floor.cloud_in_clip.points.iter().any(|point| point.color != NO_COLOR);
    if let Some(imagination) = imagination.filter(|_| has_color) {
        let segmenter = params.label.segmenter.as_deref();
        let height_m = params.raycast.vacuum_height_m;
        let setting =
            imagine::Setting { walls: &walls, segmenter, vacuum_height_m: height_m, seed: params.seed };
        imagined = imagine::imagine(on_floor, &points, imagination, &setting, progress)?;
        if !imagined.views.is_empty() {
            imagined_by.push(imagination.inpainter.name());
            imagined_by.extend(imagination.estimator.iter().map(|estimator| estimator.name()));
        }
        points.extend_from_slice(&imagined.points);
    }
    let cloud_in_clip = PointCloud { points, voxel_m };
    let raycast = RaycastParams { floor_m: 0.0, ..params.raycast.clone() };
    let scan = scan::recast(&on_floor.scan, &on_floor.cloud_in_clip, &cloud_in_clip, &raycast);
    let remarks = imagined.failure.map(|why| {
        Reason::new("imagination_failed", format!("what was not seen was completed without a network: {why}"))
    });
    Ok(Filled {
        completion: Completion { cloud_in_clip, scan, views: imagined.views, sets: imagined.sets },
        structure_points,
        imagined_by,
        cut_short: imagined.cut_short,
        remarks: remarks.into_iter().collect(),
    })
}

impl ViewReport {
    fn of(completed: &CompletedView) -> ViewReport {
        let filled = completed.mask.pixels().filter(|pixel| pixel.0[0] > 0).count();
        let pixels = (completed.mask.width() * completed.mask.height()).max(1);
        ViewReport {
            view: completed.view,
            imagined_share: filled as f64 / f64::from(pixels),
            points: completed.added,
        }
    }
}

impl Take {
    fn after(self, before: &Alignment, after: &Alignment) -> bool {
        let probability = |answer: &Alignment| answer.probability.unwrap_or(0.0);
        match self {
            Take::After => true,
            Take::Likelier => after.map_from_clip.is_some() && probability(after) >= probability(before),
        }
    }
}

impl Activation {
    fn applies(self, answer: &Alignment) -> bool {
        match self {
            Activation::Never => false,
            Activation::Always => true,
            Activation::Unsure => answer.state != AlignmentState::Aligned,
            Activation::SeveralMinima { margin_m } => several_minima(answer, margin_m),
        }
    }
}

/// Returns whether a different pose explains the clip nearly as well.
fn several_minima(answer: &Alignment, margin_m: f64) -> bool {
    let Some(best) = answer.alternatives.first() else { return true };
    answer.alternatives[1..]
        .iter()
        .any(|other| other.is_different_from(best) && other.loss_m - best.loss_m < margin_m)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
    use viola_geometry::{Point2, Pose2, Pose3, Vector2};
    use viola_reconstruct::CloudPoint;
    use viola_reconstruct::label::Wall;

    /// Cancels at the second poll of the completion; the first one is at its start.
    #[derive(Default)]
    struct OnePoll {
        is_completing: AtomicBool,
        polls: AtomicUsize,
    }

    impl Progress for OnePoll {
        fn enter(&self, stage: Stage) {
            self.is_completing.store(stage == Stage::Complete, Ordering::Relaxed);
        }

        fn cancelled(&self) -> bool {
            self.is_completing.load(Ordering::Relaxed) && self.polls.fetch_add(1, Ordering::Relaxed) > 0
        }
    }

    #[test]
    fn a_completion_without_a_hit_keeps_the_answer_and_searches_nothing() {
        let mut params = AlignParams::default();
        params.complete.when = Activation::Always;
        let corner = (0..50).map(|i| 0.03 * f64::from(i));
        let corner: Vec<Point2> =
            corner.flat_map(|t| [Point2::new(2.0, t), Point2::new(2.0 - t, 1.5)]).collect();
        let point = |at: &Point2| CloudPoint {
            color: [200; 3],
            ..CloudPoint::new([at.x as f32, at.y as f32, 0.12], [-1.0, 0.0, 0.0])
        };
        let cloud_in_clip = PointCloud { points: corner.iter().map(point).collect(), voxel_m: 0.03 };
        let camera = VirtualScan { cameras: vec![Pose2::IDENTITY], ..VirtualScan::default() };
        let observation = Observation {
            scan: scan::recast(&camera, &cloud_in_clip, &PointCloud::default(), &params.raycast),
            cloud_in_clip,
            // The wall is too far for a ray.
            walls: vec![Wall {
                normal: Vector2::new(-1.0, 0.0),
                offset_m: -20.0,
                from_m: 0.0,
                seen_m: vec![Some((1.2, 2.4)); 30],
            }],
            clip_from_world: Some(Pose3::identity()),
            floor: Some(FloorReport {
                assumed: false,
                camera_height_m: 1.4,
                support_points: 1000,
                gravity_angle_deg: None,
            }),
            ..Observation::default()
        };
        let target = Target::from_points(corner, None, None).unwrap();
        let progress = OnePoll::default();
        let (answer, completion) = register_completing(&observation, &[&target], &params, &progress).unwrap();
        let report = answer.completion.unwrap();
        assert!(report.structure_points > 0 && report.hits == 0 && report.taken, "{report:?}");
        assert_eq!(report.before, report.after);
        assert!(answer.map_from_clip.is_some() && completion.is_some());
    }
}
