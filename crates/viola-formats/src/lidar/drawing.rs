//! A robot's map: layers of cells on a sheet, and marks. The readers of robot files only collect them. Their
//! interpretation is here, so that a robot's own file and the Valetudo JSON made of it give the same map.

use super::build::{Parts, build, occupied_centres};
use super::marks::{MAX_CORNERS, MapMarks};
use super::sheet::{Run, Sheet};
use super::{
    Cell, LidarError, LidarMap, Line, LineKind, MAX_POINTS, RobotFrame, RobotFrames, Room, UnknownYaw, Zone,
    ZoneKind,
};
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

    pub fn into_map(mut self) -> Result<LidarMap, LidarError> {
        let runs = || self.layers.iter().flat_map(|layer| &layer.runs);
        let cells: u64 = runs().map(|run| u64::from(run.count)).sum();
        if cells > MAX_POINTS as u64 {
            return Err(LidarError::TooManyCells { cells, max: MAX_POINTS });
        }
        let sheet = self.sheet;
        let mut grid = sheet.grid_around(runs())?;
        let (mut rooms, mut unknown_layers) = (Vec::new(), 0);
        // Walls are written over floors, in any order of the layers.
        for Layer { kind, runs } in &self.layers {
            match kind {
                LayerKind::Wall => {}
                LayerKind::Other => unknown_layers += 1,
                LayerKind::Floor => sheet.fill(&mut grid, runs, Cell::Free),
                LayerKind::Segment { id, name, material } => {
                    sheet.fill(&mut grid, runs, Cell::Free);
                    rooms.push(Room {
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
            rooms,
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
