//! The noise-free views of the clips of a simulated home: the surface of its furniture that they show.

use super::shown::{MIN_POINTS, Shown};
use crate::simulate::{ClipParams, Home, Survey, View};
use rayon::prelude::*;
use rustc_hash::FxHashMap;
use std::ops::Range;
use viola_geometry::taxonomy::Class;
use viola_geometry::{Pinhole, Point3, Pose2, Pose3};

/// Side of the cells of a surface.
const CELL_M: f64 = 0.05;
/// Every so many pixels, along both axes, are used.
const STRIDE: usize = 3;
/// A place was looked at if the view measured a surface there or behind it.
const BEFORE_M: f64 = 0.1;
/// Minimum fraction of an object's surface whose place is looked at in the other visit.
const MIN_LOOKED_AT: f64 = 0.5;

type Cell = [i32; 3];
type Surface = FxHashMap<Cell, Point3>;

/// The noise-free views of the clips of a visit.
pub(super) struct Visit {
    camera: Pinhole,
    range_m: f64,
    views: Vec<(View, Pose3)>,
    /// Surface of each piece that the views show, by the piece's number and the class: what stands on a piece is a
    /// part of it. Each cell has its first place.
    seen: FxHashMap<(u16, Class), Surface>,
}

impl Visit {
    pub fn of(home: &Home, survey: &Survey, numbers: Range<u64>, params: &ClipParams) -> Visit {
        let of_clip = |number: u64| -> Vec<(View, Pose3)> {
            let clip = home.clip(survey, number, params);
            let poses = clip.truth.home_from_camera.iter().enumerate();
            poses.map(|(index, pose)| (clip.true_view(index), *pose)).collect()
        };
        let views: Vec<(View, Pose3)> = numbers.into_par_iter().flat_map_iter(of_clip).collect();
        let mut visit = Visit {
            camera: params.sensor.depth_camera(),
            range_m: params.sensor.range_m(),
            views,
            seen: FxHashMap::default(),
        };
        visit.seen = visit.surfaces(home);
        visit
    }

    fn surfaces(&self, home: &Home) -> FxHashMap<(u16, Class), Surface> {
        let mut seen: FxHashMap<(u16, Class), Surface> = FxHashMap::default();
        for (view, home_from_camera) in &self.views {
            let pixels = (0..view.height)
                .step_by(STRIDE)
                .flat_map(|y| (0..view.width).step_by(STRIDE).map(move |x| (x, y)));
            for (x, y) in pixels {
                let depth_m = f64::from(view.depth_m[y * view.width + x]);
                if depth_m > self.range_m {
                    continue;
                }
                let (class, piece) = home.scene().label(view.solid[y * view.width + x] as usize);
                if piece > 0 {
                    let at = home_from_camera * self.camera.unproject(x as f64, y as f64, depth_m);
                    let cell = [at.x, at.y, at.z].map(|c| (c / CELL_M).floor() as i32);
                    seen.entry((piece, class)).or_default().entry(cell).or_insert(at);
                }
            }
        }
        seen
    }

    /// Returns places of a piece that have a class and that the visit shows; none if they are too few to find it.
    pub fn places(&self, piece: u16, class: Class) -> Option<Vec<Point3>> {
        self.seen.get(&(piece, class)).filter(|surface| surface.len() >= MIN_POINTS).map(places)
    }

    /// Returns all furniture that the visit shows, in the map.
    pub fn shown(&self, map_from_home: &Pose2) -> Shown {
        let in_map = |place: Point3| {
            let at = map_from_home.apply(&place.xy());
            [at.x, at.y, place.z]
        };
        let pieces = self.seen.iter();
        pieces
            .map(|((piece, class), surface)| {
                ((*piece, class.id()), places(surface).into_iter().map(in_map).collect())
            })
            .collect()
    }

    /// Returns whether the visit looked at most of these places.
    pub fn looks_at(&self, places: &[Point3]) -> bool {
        let is_looked_at =
            |place: &&Point3| self.views.iter().any(|(view, pose)| self.view_reaches(view, pose, place));
        let count = places.iter().filter(is_looked_at).count();
        count as f64 >= MIN_LOOKED_AT * places.len() as f64
    }

    fn view_reaches(&self, view: &View, home_from_camera: &Pose3, place: &Point3) -> bool {
        let at = home_from_camera.inverse() * place;
        if at.z < 0.1 || at.z > self.range_m {
            return false;
        }
        let Some(pixel) = self.camera.project(&at) else { return false };
        if pixel.x < 0.0 || pixel.y < 0.0 {
            return false;
        }
        let (x, y) = (pixel.x.round() as usize, pixel.y.round() as usize);
        x < view.width && y < view.height && f64::from(view.depth_m[y * view.width + x]) > at.z - BEFORE_M
    }
}

/// Returns the places of a surface, in the order of their cells.
fn places(surface: &Surface) -> Vec<Point3> {
    let mut places: Vec<(Cell, Point3)> = surface.iter().map(|(cell, place)| (*cell, *place)).collect();
    places.sort_unstable_by_key(|(cell, _)| *cell);
    places.into_iter().map(|(_, place)| place).collect()
}
