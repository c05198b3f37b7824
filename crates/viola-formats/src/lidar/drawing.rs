//! A robot's map: layers of cells on a sheet, and marks. The readers of robot files only collect them. Their
//! interpretation is here, so that a robot's own file and the Valetudo JSON made of it give the same map.

use super::build::{Parts, build, occupied_centres};
use super::marks::{MAX_CORNERS, MapMarks};
use super::sheet::{MAX_OFF_SHEET_M, Run, Sheet};
use super::{
    Cell, LidarError, LidarMap, Line, LineKind, MAX_POINTS, RobotFrame, RobotFrames, Room, UnknownYaw, Zone,
    ZoneKind,
};
use std::collections::BTreeMap;
use viola_geometry::{Grid, Pose2};

const MAX_NAME_CHARS: usize = 100;
/// Below this ratio of wall cells to cells around the floor, the floor's border becomes walls.
const MIN_WALL_FRACTION: f64 = 0.25;

/// Layers and marks, before the map is made of them.
pub(super) struct Drawing {
    pub format: &'static str,
    pub frame: &'static str,
    pub sheet: Sheet,
    /// The coordinates of the file; default: those of Valetudo.
    pub own_frame: Option<RobotFrame>,
    pub layers: Vec<Layer>,
    pub charger: Option<Spot>,
    pub robot: Option<Spot>,
    /// `robot` replaces the robot in it.
    pub marks: MapMarks,
    /// Cells in which the robot detected carpet.
    pub carpet: Vec<Run>,
    pub notes: Vec<String>,
}

pub(super) struct Layer {
    pub kind: LayerKind,
    pub runs: Vec<Run>,
}

pub(super) enum LayerKind {
    Floor,
    Wall,
    Segment {
        id: String,
        name: Option<String>,
        material: Option<String>,
    },
    /// A kind that this crate does not know.
    Other,
}

/// A pose on the sheet: centimetres from the top-left corner, y down, and degrees clockwise from the top.
#[derive(Debug, Clone, Copy)]
pub(super) struct Spot {
    pub x_cm: f64,
    pub y_cm: f64,
    pub angle_deg: Option<f64>,
}

impl Spot {
    fn pose(&self, sheet: &Sheet, what: &str, notes: &mut Vec<String>) -> Option<Pose2> {
        let angle_deg = self.angle_deg.unwrap_or_else(|| {
            notes.push(format!("the {what} has no angle; it was taken as facing the top of the map"));
            0.0
        });
        let at = sheet.point(self.x_cm, self.y_cm);
        let pose = Pose2::new(at.x, at.y, (90.0 - angle_deg).to_radians());
        pose.is_finite().then_some(pose)
    }
}

impl Drawing {
    pub fn new(format: &'static str, frame: &'static str, sheet: Sheet) -> Drawing {
        Drawing {
            format,
            frame,
            sheet,
            own_frame: None,
            layers: Vec::new(),
            charger: None,
            robot: None,
            marks: MapMarks::default(),
            carpet: Vec::new(),
            notes: Vec::new(),
        }
    }

    /// Adds a zone of corners in centimetres on the sheet; a zone of fewer than three is ignored.
    pub fn add_zone(&mut self, kind: ZoneKind, corners_cm: &[[f64; 2]]) {
        let outline_m = self.points_m(corners_cm);
        match outline_m {
            Some(outline_m) if (3..=MAX_CORNERS).contains(&outline_m.len()) => {
                self.marks.zones.push(Zone { kind, outline_m });
            }
            _ => self.notes.push(format!("a zone of {} corners was ignored", corners_cm.len())),
        }
    }

    /// Adds a line between two points in centimetres on the sheet.
    pub fn add_line(&mut self, kind: LineKind, ends_cm: &[[f64; 2]]) {
        match self.points_m(ends_cm).as_deref() {
            Some(&[from, to]) => self.marks.lines.push(Line { kind, ends_m: [from, to] }),
            _ => self.notes.push("a line without two ends was ignored".to_string()),
        }
    }

    fn points_m(&self, points_cm: &[[f64; 2]]) -> Option<Vec<[f64; 2]>> {
        let points = points_cm.iter().map(|[x, y]| self.sheet.point(*x, *y));
        let points: Vec<[f64; 2]> = points.map(|point| [point.x, point.y]).collect();
        points.iter().flatten().all(|v| v.is_finite()).then_some(points)
    }

    /// Drops marks that are far off the sheet, with a note.
    fn drop_far_marks(&mut self) {
        let sheet = self.sheet;
        let is_near = |at_m: &[f64; 2]| sheet.is_near(*at_m);
        let is_spot_near = |spot: &Spot| {
            let at = sheet.point(spot.x_cm, spot.y_cm);
            sheet.is_near([at.x, at.y])
        };
        let before = self.count_marks();
        self.charger = self.charger.filter(is_spot_near);
        self.robot = self.robot.filter(is_spot_near);
        self.marks.zones.retain(|zone| zone.outline_m.iter().all(is_near));
        self.marks.lines.retain(|line| line.ends_m.iter().all(is_near));
        self.marks.obstacles.retain(|obstacle| is_near(&obstacle.at_m));
        let dropped = before - self.count_marks();
        if dropped > 0 {
            self.notes.push(format!(
                "{dropped} marks are more than {MAX_OFF_SHEET_M} m off the map's sheet and were ignored"
            ));
        }
    }

    fn count_marks(&self) -> usize {
        let spots = [self.charger, self.robot].into_iter().flatten().count();
        spots + self.marks.zones.len() + self.marks.lines.len() + self.marks.obstacles.len()
    }

    pub fn into_map(mut self) -> Result<LidarMap, LidarError> {
        self.drop_far_marks();
        let runs = || self.layers.iter().flat_map(|layer| &layer.runs);
        let cells: u64 = runs().map(|run| u64::from(run.count)).sum();
        if cells > MAX_POINTS as u64 {
            return Err(LidarError::TooManyCells { cells, max: MAX_POINTS });
        }
        let sheet = self.sheet;
        let mut grid = sheet.grid_around(runs())?;
        let (mut rooms, mut unknown_layers) = (Rooms::default(), 0);
        // Walls are written over floors, in any order of the layers.
        for Layer { kind, runs } in &self.layers {
            match kind {
                LayerKind::Wall => {}
                LayerKind::Other => unknown_layers += 1,
                LayerKind::Floor => sheet.fill(&mut grid, runs, Cell::Free),
                LayerKind::Segment { id, name, material } => {
                    sheet.fill(&mut grid, runs, Cell::Free);
                    rooms.add(Room {
                        id: shorten(id),
                        name: name.as_deref().map(shorten).filter(|name| !name.is_empty()),
                        material: material.as_deref().map(shorten).filter(|material| !material.is_empty()),
                        cells_m: sheet.centres(runs),
                    });
                }
            }
        }
        if unknown_layers > 0 {
            let note =
                format!("{unknown_layers} layers are neither floor, segment nor wall and were ignored");
            self.notes.push(note);
        }
        for layer in self.layers.iter().filter(|layer| matches!(layer.kind, LayerKind::Wall)) {
            sheet.fill(&mut grid, &layer.runs, Cell::Occupied);
        }
        add_floor_border(&mut grid, &mut self.notes);
        let charger = self.charger.and_then(|spot| spot.pose(&sheet, "charger", &mut self.notes));
        self.marks.robot = self.robot.and_then(|spot| spot.pose(&sheet, "robot", &mut self.notes));
        let has_no_angle = |spot: Option<Spot>| spot.is_some_and(|spot| spot.angle_deg.is_none());
        let unknown_yaw = UnknownYaw { charger: has_no_angle(self.charger), robot: has_no_angle(self.robot) };
        let parts = Parts {
            format: self.format,
            frame: self.frame,
            occupied_m: occupied_centres(&grid)?,
            cells: Some(grid),
            rooms: rooms.merged(&mut self.notes),
            charger,
            marks: self.marks,
            carpet_m: sheet.centres(&self.carpet),
            notes: self.notes,
        };
        let valetudo = sheet.valetudo_frame();
        let frames = RobotFrames { own: self.own_frame.unwrap_or(valetudo), valetudo: Some(valetudo) };
        Ok(LidarMap { frames, sheet_cm: Some(sheet.size_cm), unknown_yaw, ..build(parts)? })
    }
}

/// Rooms with different ids.
#[derive(Default)]
struct Rooms {
    all: Vec<Room>,
    place_of: BTreeMap<String, usize>,
    /// Number of segments with the id of an earlier one.
    repeated: usize,
}

impl Rooms {
    /// Adds a segment: a room, or a part of the room with its id.
    fn add(&mut self, part: Room) {
        let Some(place) = self.place_of.get(&part.id).copied() else {
            self.place_of.insert(part.id.clone(), self.all.len());
            self.all.push(part);
            return;
        };
        let room = &mut self.all[place];
        room.cells_m.extend(part.cells_m);
        room.name = room.name.take().or(part.name);
        room.material = room.material.take().or(part.material);
        self.repeated += 1;
    }

    /// Returns the rooms, with a note if some have several segments.
    fn merged(mut self, notes: &mut Vec<String>) -> Vec<Room> {
        if self.repeated > 0 {
            notes.push(format!(
                "{} segments have the id of an earlier one and were added to its room",
                self.repeated
            ));
            // A cell may be in several segments.
            for room in &mut self.all {
                room.cells_m.sort_by(|a, b| b.y.total_cmp(&a.y).then(a.x.total_cmp(&b.x)));
                room.cells_m.dedup();
            }
        }
        self.all
    }
}

/// Shortens a name: names are part of every answer about the map.
pub(super) fn shorten(name: &str) -> String {
    name.chars().filter(|c| !c.is_control()).take(MAX_NAME_CHARS).collect()
}

/// Adds walls at the floor's border if the map has few or none: some early robots (Dreame 1C) hardly store walls.
fn add_floor_border(grid: &mut Grid<Cell>, notes: &mut Vec<String>) {
    let (width, height) = (grid.frame.width, grid.frame.height);
    let walls = grid.cells.iter().filter(|cell| **cell == Cell::Occupied).count();
    let mut border = Vec::new();
    for y in 0..height {
        for x in 0..width {
            let is_free = |nx: usize, ny: usize| nx < width && ny < height && grid.get(nx, ny) == Cell::Free;
            let touches_floor = is_free(x.wrapping_sub(1), y)
                || is_free(x + 1, y)
                || is_free(x, y.wrapping_sub(1))
                || is_free(x, y + 1);
            if grid.get(x, y) != Cell::Free && touches_floor {
                border.push((x, y));
            }
        }
    }
    if walls as f64 >= MIN_WALL_FRACTION * border.len() as f64 {
        return;
    }
    for &(x, y) in &border {
        grid.set(x, y, Cell::Occupied);
    }
    let few = if walls == 0 { "no".to_string() } else { format!("only {walls}") };
    notes.push(format!(
        "the map has {few} wall cells; the {} cells around its floor were taken as walls",
        border.len()
    ));
}
