//! The walls of a scene's plan against those of its labelled mesh.

use super::instances::LabelledMesh;
use rustc_hash::FxHashMap;
use serde::Serialize;
use viola_geometry::taxonomy::Class;
use viola_geometry::{Point2, Pose2, cell_of};
use viola_home::Plan;

/// A drawn face is right this near a wall of the mesh, and a wall is drawn this near a face.
const NEAR_M: f64 = 0.1;
/// Distance of the points on drawn faces, and side of the cells of the mesh's walls.
const STEP_M: f64 = 0.05;
/// Vertices of at least this height count; walls above cupboards do.
const LOWEST_M: f64 = 0.15;
/// Minimum vertices of a cell; a wall's cell has up to a hundred.
const MIN_VERTICES: usize = 3;

/// Drawn and true walls of a scene.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct WallScore {
    /// Length of the sides of the drawn rooms, without doors and passages.
    pub drawn_m: f64,
    /// Length near a wall or an opening of the mesh.
    pub on_wall_m: f64,
    /// Other length near upright surface of the mesh: furniture in front of a wall, or surface without a label.
    pub on_other_m: f64,
    /// Cells of the mesh's walls that the clips see, and those near a drawn face.
    pub seen_cells: usize,
    pub drawn_cells: usize,
}

/// Cells of the plane with upright surface of the mesh.
#[derive(Default)]
struct Cells {
    walls: FxHashMap<[i32; 2], Vec<Point2>>,
    others: FxHashMap<[i32; 2], Vec<Point2>>,
    seen: FxHashMap<[i32; 2], Vec<Point2>>,
}

/// Compares the plan with the mesh; `seen` marks the vertices that the clips' frames see.
pub fn score_walls(plan: &Plan, mesh: &LabelledMesh, seen: &[bool], map_from_world: &Pose2) -> WallScore {
    let cells = Cells::new(mesh, seen, &plan.map_from_plan.inverse().compose(map_from_world));
    let mut score = WallScore::default();
    let mut drawn: FxHashMap<[i32; 2], Vec<Point2>> = FxHashMap::default();
    for p in drawn_points(plan) {
        drawn.entry(cell_of(&p, STEP_M)).or_default().push(p);
        score.drawn_m += STEP_M;
        if is_near(&cells.walls, &p) {
            score.on_wall_m += STEP_M;
        } else if is_near(&cells.others, &p) {
            score.on_other_m += STEP_M;
        }
    }
    for vertices in cells.seen.values().filter(|vertices| vertices.len() >= MIN_VERTICES) {
        let sum = vertices.iter().fold(nalgebra::Vector2::zeros(), |sum, p| sum + p.coords);
        let centre = Point2::from(sum / vertices.len() as f64);
        score.seen_cells += 1;
        score.drawn_cells += usize::from(is_near(&drawn, &centre));
    }
    score
}

/// Returns points at equal distances on the sides of the drawn rooms.
fn drawn_points(plan: &Plan) -> Vec<Point2> {
    let rings =
        plan.rooms.iter().flat_map(|room| std::iter::once(&room.outline.ring_m).chain(&room.outline.holes_m));
    let mut points = Vec::new();
    for ring in rings {
        for (a, b) in ring.iter().zip(ring.iter().cycle().skip(1)) {
            let (a, b) = (Point2::from(*a), Point2::from(*b));
            let count = ((b - a).norm() / STEP_M).round() as usize;
            points.extend((0..count).map(|i| a + (b - a) * ((i as f64 + 0.5) / count as f64)));
        }
    }
    let is_open = |p: &Point2| {
        plan.openings.iter().filter(|opening| opening.kind != viola_home::OpeningKind::Window).any(
            |opening| {
                let (a, b) = (Point2::from(opening.from_m), Point2::from(opening.to_m));
                let along = (b - a).normalize();
                let off = p - a;
                let half_m = opening.thickness_m / 2.0 + 0.02;
                (0.0..=opening.width_m()).contains(&off.dot(&along)) && off.perp(&along).abs() <= half_m
            },
        )
    };
    points.retain(|p| !is_open(p));
    points
}

impl Cells {
    fn new(mesh: &LabelledMesh, seen: &[bool], plan_from_world: &Pose2) -> Cells {
        let mut cells = Cells::default();
        for ((vertex, class), seen) in mesh.mesh.vertices_m.iter().zip(&mesh.classes).zip(seen) {
            if vertex.z - mesh.floor_m < LOWEST_M {
                continue;
            }
            let p = plan_from_world.apply(&vertex.xy());
            let is_wall = class.is_some_and(is_wall_or_opening);
            let of_kind = if is_wall { &mut cells.walls } else { &mut cells.others };
            of_kind.entry(cell_of(&p, STEP_M)).or_default().push(p);
            if is_wall && *seen {
                cells.seen.entry(cell_of(&p, STEP_M)).or_default().push(p);
            }
        }
        cells
    }
}

impl WallScore {
    pub fn markdown(&self) -> String {
        let percent = |part: f64, of: f64| 100.0 * part / of.max(1e-9);
        format!(
            "| drawn sides of rooms | within 10 cm of the mesh's walls | of its other surface | of none | cells of walls seen | \
             with a side within 10 cm |\n|---|---|---|---|---|---|\n| {:.1} m | {:.1} % | {:.1} % | {:.1} % | {} | {:.1} % |\n",
            self.drawn_m,
            percent(self.on_wall_m, self.drawn_m),
            percent(self.on_other_m, self.drawn_m),
            percent(self.drawn_m - self.on_wall_m - self.on_other_m, self.drawn_m),
            self.seen_cells,
            percent(self.drawn_cells as f64, self.seen_cells as f64)
        )
    }
}

fn is_wall_or_opening(class: Class) -> bool {
    matches!(
        class,
        Class::Wall | Class::Door | Class::Window | Class::Curtain | Class::Mirror | Class::Picture
    )
}

fn is_near(points: &FxHashMap<[i32; 2], Vec<Point2>>, p: &Point2) -> bool {
    let [x, y] = cell_of(p, STEP_M);
    let reach = (NEAR_M / STEP_M).ceil() as i32;
    (-reach..=reach).flat_map(|i| (-reach..=reach).map(move |j| [x + i, y + j])).any(|key| {
        points.get(&key).is_some_and(|points| points.iter().any(|other| (other - p).norm() <= NEAR_M))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluate::Mesh;
    use viola_geometry::{LevelName, Point3};
    use viola_home::PlanRoom;

    /// A room of 4 m by 3 m: the mesh has wall at two of its sides, a cupboard at the third, nothing at the last.
    #[test]
    fn sides_count_by_what_the_mesh_has_there() {
        let mut vertices_m = Vec::new();
        let mut classes = Vec::new();
        let mut side = |from: [f64; 2], to: [f64; 2], class: Class| {
            for (i, j) in (0..200).flat_map(|i| (0..40).map(move |j| (i, j))) {
                let at = |axis: usize| from[axis] + (to[axis] - from[axis]) * i as f64 / 199.0;
                vertices_m.push(Point3::new(at(0), at(1), 0.05 * j as f64));
                classes.push(Some(class));
            }
        };
        side([0.0, 0.0], [4.0, 0.0], Class::Wall);
        side([4.0, 0.0], [4.0, 3.0], Class::Window);
        side([4.0, 3.0], [0.0, 3.0], Class::Cabinet);
        let seen: Vec<bool> = vertices_m.iter().map(|vertex| vertex.x < 2.0).collect();
        let mesh = Mesh { vertices_m, triangles: Vec::new(), labels: Vec::new() };
        let mesh = LabelledMesh { mesh, classes, floor_m: 0.0 };
        let ring_m = vec![[0.0, 0.0], [4.0, 0.0], [4.0, 3.0], [0.0, 3.0]];
        let outline = viola_home::Outline { ring_m, holes_m: Vec::new() };
        let room = PlanRoom { id: None, name: None, outline, area_m2: 12.0, label_at_m: [2.0, 1.5] };
        let plan = Plan {
            level: LevelName::MAIN,
            home_name: None,
            map_from_plan: Pose2::new(0.0, 0.0, 0.0),
            walls: Vec::new(),
            masonry: Vec::new(),
            unfilmed_masonry: Vec::new(),
            openings: Vec::new(),
            rooms: vec![room],
            furniture: Vec::new(),
        };
        let score = score_walls(&plan, &mesh, &seen, &Pose2::new(0.0, 0.0, 0.0));
        let near = |metres: f64, want: f64| assert!((metres - want).abs() <= 0.25, "{score:?}");
        near(score.drawn_m, 14.0);
        near(score.on_wall_m, 7.0);
        near(score.on_other_m, 4.0);
        assert!(score.drawn_cells == score.seen_cells && (39..=42).contains(&score.seen_cells), "{score:?}");
    }
}
