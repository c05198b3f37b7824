//! A home: its plan, its furniture on two days, and the people on the second.

use super::catalogue::Catalogue;
use super::piece::Piece;
use super::plan::Plan;
use super::rng::Rng;
use super::scene::Scene;
use super::solid::Solid;
use super::{change, furnish, structure};
use serde::Serialize;
use std::str::FromStr;
use std::sync::Arc;
use viola_geometry::Point2;
use viola_geometry::taxonomy::Class;

/// A benchmark set.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Set {
    /// Flats and houses with ordinary recordings.
    Normal,
    /// Clips that see mostly the upper part of the rooms (the paper's hard case).
    Upper,
    /// Rows of rooms that look alike.
    Repeated,
    /// Furniture moved, added and removed between the vacuum's day and the clips' day.
    Changed,
    /// Two storeys with the same walls and rooms, but other furniture and doors.
    Storeys,
    /// Maps with errors over metres: bent corridors, shifted rooms, a wrong scale, doubled walls.
    Drifted,
    /// Outer walls of glass, which vacuum and camera see through.
    Glass,
    /// Furniture at nearly every wall.
    Crowded,
}

impl Set {
    pub const ALL: [Set; 8] = [
        Set::Normal,
        Set::Upper,
        Set::Repeated,
        Set::Changed,
        Set::Storeys,
        Set::Drifted,
        Set::Glass,
        Set::Crowded,
    ];

    pub fn name(self) -> &'static str {
        match self {
            Set::Normal => "normal",
            Set::Upper => "upper",
            Set::Repeated => "repeated",
            Set::Changed => "changed",
            Set::Storeys => "storeys",
            Set::Drifted => "drifted",
            Set::Glass => "glass",
            Set::Crowded => "crowded",
        }
    }

    /// Returns the number of storeys of a home.
    pub fn storeys(self) -> u64 {
        if self == Set::Storeys { 2 } else { 1 }
    }
}

impl FromStr for Set {
    type Err = String;

    fn from_str(text: &str) -> Result<Set, String> {
        Set::ALL.into_iter().find(|set| set.name() == text).ok_or_else(|| {
            let names: Vec<&str> = Set::ALL.iter().map(|set| set.name()).collect();
            format!("no set is called {text:?}; there are {}", names.join(", "))
        })
    }
}

/// Selection of a home.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct HomeParams {
    pub set: Set,
    pub seed: u64,
    /// Fraction of the movable pieces and doors that change by another day; used by [`Set::Changed`].
    #[serde(rename = "changed_share")]
    pub changed_fraction: f64,
    /// Counts from 0; used by [`Set::Storeys`].
    pub storey: u64,
}

impl HomeParams {
    pub fn new(set: Set, seed: u64) -> HomeParams {
        HomeParams { set, seed, changed_fraction: 0.35, storey: 0 }
    }
}

/// A furnished home with exact truth.
pub struct Home {
    pub params: HomeParams,
    pub plan: Plan,
    /// Furniture and doors on the vacuum's day and on the clips' day.
    pub(super) vacuum_day: Day,
    pub(super) clip_day: Day,
    pub(super) rng: Rng,
}

/// The home on one day.
#[derive(Clone)]
pub(super) struct Day {
    /// Furniture first, then door leaves, then people and pets. A piece's number in label pictures is its
    /// index plus one.
    pub pieces: Arc<Vec<Piece>>,
    pub scene: Arc<Scene>,
}

impl Day {
    fn new(building: &[Solid], pieces: Vec<Piece>) -> Day {
        let structure = building.iter().map(|solid| (*solid, 0));
        let furniture = pieces
            .iter()
            .enumerate()
            .flat_map(|(index, piece)| piece.placed().map(move |solid| (solid, index as u16 + 1)));
        let scene = Scene::new(structure.chain(furniture));
        Day { scene: Arc::new(scene), pieces: Arc::new(pieces) }
    }
}

/// An object in the home.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct HomeObject {
    /// Number in the clips' instance pictures.
    pub instance: u16,
    pub class: Class,
    pub class_id: u16,
    pub room: String,
    /// Centre of its box in the home's frame.
    pub centre_m: [f64; 3],
    /// Full size along its own x, y and z.
    pub size_m: [f64; 3],
    pub yaw_rad: f64,
    pub movable: bool,
}

/// Ground truth of a home that does not depend on a clip.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct HomeTruth {
    pub params: HomeParams,
    pub area_m2: f64,
    pub ceiling_m: f64,
    pub rooms: Vec<super::plan::Room>,
    /// On the clips' day.
    pub objects: Vec<HomeObject>,
}

impl Home {
    /// Generates and furnishes the home of these parameters.
    pub fn generate(params: &HomeParams) -> Home {
        Home::furnished(params, &Catalogue::default())
    }

    /// Generates a home with models of a catalogue among its furniture.
    pub fn furnished(params: &HomeParams, catalogue: &Catalogue) -> Home {
        let rng = Rng::new(params.seed).fork(params.set.name(), 0);
        let mut plan_rng = rng.fork("plan", 0);
        let plan = match params.set {
            Set::Repeated => Plan::of_a_row(&mut plan_rng),
            set => Plan::of_a_home(set == Set::Glass, &mut plan_rng),
        };
        let building = structure::solids(&plan, &mut rng.fork("building", 0));
        // The building is the same on all storeys; everything else has random streams of its own.
        let rng = if params.storey > 0 { rng.fork("storey", params.storey) } else { rng };
        let mut pieces = furnish::furnish(&plan, params.set == Set::Crowded, &rng.fork("furniture", 0));
        catalogue.dress(&mut pieces, &mut rng.fork("catalogue", 0));
        if params.set == Set::Repeated {
            pieces = change::break_symmetry(&plan, pieces, &mut rng.fork("likeness", 0));
        }
        let doors = structure::leaves(&plan, &mut rng.fork("leaves", 0));
        let mut later = None;
        if params.set == Set::Changed {
            let day = rng.fork("another day", 0);
            let mut moved = change::another_day(&plan, &pieces, params.changed_fraction, &day);
            moved.extend(change::turn_doors(&plan, &doors, params.changed_fraction, &day));
            later = Some(moved);
        }
        pieces.extend(doors);
        let mut clip_pieces = later.unwrap_or_else(|| pieces.clone());
        let people = match params.set {
            // People would tell rooms apart that look alike.
            Set::Repeated => vec![],
            _ => furnish::at_home(&plan, &clip_pieces, &mut rng.fork("people", 0)),
        };
        let same = params.set != Set::Changed && people.is_empty();
        clip_pieces.extend(people);
        let vacuum_day = Day::new(&building, pieces);
        let clip_day = if same { vacuum_day.clone() } else { Day::new(&building, clip_pieces) };
        Home { params: *params, plan, vacuum_day, clip_day, rng }
    }

    /// Returns the home on the clips' day.
    pub fn scene(&self) -> &Scene {
        &self.clip_day.scene
    }

    /// Returns the home on the vacuum's day.
    pub fn vacuum_scene(&self) -> &Scene {
        &self.vacuum_day.scene
    }

    pub fn truth(&self) -> HomeTruth {
        let pieces = self.clip_day.pieces.iter().enumerate();
        let objects = pieces.map(|(index, piece)| {
            let low = piece.solids.iter().map(Solid::bottom_m).fold(f64::INFINITY, f64::min).max(0.0);
            let high = piece.solids.iter().map(Solid::top_m).fold(0.0, f64::max);
            let [width, depth, _] = piece.size;
            self.object(index, piece, [0.0, 0.0, (low + high) / 2.0], [width, depth, high - low])
        });
        HomeTruth {
            params: self.params,
            area_m2: self.plan.area_m2(),
            ceiling_m: self.plan.ceiling_m,
            rooms: self.plan.rooms.clone(),
            objects: objects.collect(),
        }
    }

    /// Returns the objects with the boxes of what has their class: a desk without the screen on it.
    pub fn objects_alone(&self) -> Vec<HomeObject> {
        let pieces = self.clip_day.pieces.iter().enumerate();
        let objects = pieces.map(|(index, piece)| {
            let of_class = piece.solids.iter().filter(|solid| solid.class == piece.class);
            let bounds = of_class.map(|solid| (solid.centre, solid.half_bounds()));
            let corners = bounds.map(|(centre, half)| (centre - half, centre + half));
            let all = corners.reduce(|a, b| (a.0.inf(&b.0), a.1.sup(&b.1)));
            let (low, high) = all.unwrap_or_default();
            self.object(index, piece, nalgebra::center(&low, &high).into(), (high - low).into())
        });
        objects.collect()
    }

    /// Returns a piece as an object with a box in its own frame.
    fn object(&self, index: usize, piece: &Piece, centre_m: [f64; 3], size_m: [f64; 3]) -> HomeObject {
        let [x, y, z] = centre_m;
        let pose = &piece.home_from_piece;
        let ground = pose.apply(&Point2::new(x, y));
        HomeObject {
            instance: index as u16 + 1,
            class: piece.class,
            class_id: piece.class.id(),
            room: self.plan.rooms[piece.room].name.clone(),
            centre_m: [ground.x, ground.y, z],
            size_m,
            yaw_rad: pose.yaw_rad,
            movable: piece.movable,
        }
    }
}
