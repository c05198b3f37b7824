//! Drawing of a home from above, for visual inspection.

use super::clip::SimulatedClip;
use super::home::Home;
use super::piece::Footprint;
use super::plan::RoomKind;
use super::scene::Primitive;
use super::solid::Shape;
use super::survey::Survey;
use tiny_skia::{Color, FillRule, Paint, Path, PathBuilder, Pixmap, Stroke, Transform};
use viola_geometry::taxonomy::Class;
use viola_geometry::{Point2, Point3, Vector3};

const PIXELS_PER_M: f64 = 70.0;
const MARGIN_M: f64 = 0.6;

struct Canvas {
    pixmap: Pixmap,
    low: [f64; 2],
    high: [f64; 2],
}

/// Draws the home on the clips' day, the vacuum's points (red) and scans (small dots), solids that cross the
/// vacuum's height on its day (black outlines), and the clips' paths with views (blue, green, violet).
pub fn plan_png(home: &Home, survey: &Survey, clips: &[&SimulatedClip]) -> Vec<u8> {
    let bounds = home.plan.bounds();
    let size = |axis: usize| ((bounds.size(axis) + 2.0 * MARGIN_M) * PIXELS_PER_M).ceil() as u32;
    let Some(pixmap) = Pixmap::new(size(0), size(1)) else { return vec![] };
    let mut canvas =
        Canvas { pixmap, low: bounds.min.map(|v| v - MARGIN_M), high: bounds.max.map(|v| v + MARGIN_M) };
    canvas.pixmap.fill(Color::WHITE);
    for room in &home.plan.rooms {
        let floor = canvas.path(&Footprint::of_rect(&room.outline).corners(), true);
        canvas.fill(floor, tint(room.kind), 255);
    }
    let scene = &home.clip_day.scene;
    let mut order: Vec<&Primitive> = scene
        .primitives
        .iter()
        .filter(|p| !matches!(p.class, Class::Floor | Class::Ceiling) && p.low.z < 1.9)
        .collect();
    order.sort_by(|a, b| a.high.z.total_cmp(&b.high.z));
    for primitive in order {
        let wall = primitive.class == Class::Wall;
        let rgb = if wall { [90, 90, 96] } else { primitive.finish.rgb.map(|c| (c * 235.0) as u8) };
        canvas.solid(primitive, rgb, if wall { 255 } else { 215 });
    }
    let height = survey.vacuum_height_m;
    for primitive in &home.vacuum_day.scene.primitives {
        let crosses = primitive.low.z < height && primitive.high.z > height;
        if crosses && !matches!(primitive.class, Class::Wall | Class::Floor) {
            canvas.outline(&outline_of(primitive), [0, 0, 0], 1.2);
        }
    }
    let home_from_robot = survey.robot_from_home.inverse();
    for scan in &survey.scans {
        canvas.dot(&Point2::new(scan.x_m, scan.y_m), 0.012, [120, 120, 200]);
    }
    for point in &survey.points_m {
        canvas.dot(&home_from_robot.apply(point), 0.022, [225, 30, 30]);
    }
    let charger = home_from_robot.compose(&survey.charger);
    canvas.dot(&Point2::new(charger.x_m, charger.y_m), 0.09, [250, 170, 0]);
    for (clip, rgb) in clips.iter().zip([[20, 70, 230], [0, 140, 60], [150, 20, 170]].iter().cycle()) {
        canvas.walk(clip, *rgb);
    }
    canvas.pixmap.encode_png().unwrap_or_default()
}

fn tint(kind: RoomKind) -> [u8; 3] {
    match kind {
        RoomKind::Living | RoomKind::Studio => [250, 240, 220],
        RoomKind::Kitchen | RoomKind::Dining => [250, 232, 200],
        RoomKind::Bedroom | RoomKind::Child => [226, 236, 250],
        RoomKind::Study => [232, 245, 228],
        RoomKind::Bathroom => [214, 240, 244],
        RoomKind::Corridor => [240, 240, 240],
        RoomKind::Storage => [238, 230, 238],
    }
}

fn paint([r, g, b]: [u8; 3], alpha: u8) -> Paint<'static> {
    let mut paint = Paint { anti_alias: true, ..Paint::default() };
    paint.set_color_rgba8(r, g, b, alpha);
    paint
}

/// Returns a solid's outline from above.
fn outline_of(primitive: &Primitive) -> Vec<Point2> {
    let corner = |x: f64, y: f64| {
        let offset = primitive.home_from_unit * Vector3::new(x, y, 0.0);
        primitive.centre.xy() + offset.xy()
    };
    match primitive.shape {
        Shape::Block | Shape::Mesh(_) => {
            [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(x, y)| corner(x, y)).into()
        }
        Shape::Cylinder | Shape::Ball | Shape::Cushion => (0..20)
            .map(|k| {
                let (s, c) = (f64::from(k) / 20.0 * std::f64::consts::TAU).sin_cos();
                corner(c, s)
            })
            .collect(),
    }
}

impl Canvas {
    fn pixel(&self, point: &Point2) -> (f32, f32) {
        let x = (point.x - self.low[0]) * PIXELS_PER_M;
        let y = (self.high[1] - point.y) * PIXELS_PER_M;
        (x as f32, y as f32)
    }

    fn path(&self, points: &[Point2], close: bool) -> Option<Path> {
        let mut builder = PathBuilder::new();
        for (index, point) in points.iter().enumerate() {
            let (x, y) = self.pixel(point);
            if index == 0 { builder.move_to(x, y) } else { builder.line_to(x, y) }
        }
        if close {
            builder.close();
        }
        builder.finish()
    }

    fn fill(&mut self, path: Option<Path>, rgb: [u8; 3], alpha: u8) {
        let Some(path) = path else { return };
        self.pixmap.fill_path(&path, &paint(rgb, alpha), FillRule::Winding, Transform::identity(), None);
    }

    fn line(&mut self, points: &[Point2], close: bool, rgb: [u8; 3], width: f32) {
        let Some(path) = self.path(points, close) else { return };
        let stroke = Stroke { width, ..Stroke::default() };
        self.pixmap.stroke_path(&path, &paint(rgb, 255), &stroke, Transform::identity(), None);
    }

    fn outline(&mut self, points: &[Point2], rgb: [u8; 3], width: f32) {
        self.line(points, true, rgb, width);
    }

    fn solid(&mut self, primitive: &Primitive, rgb: [u8; 3], alpha: u8) {
        let outline = outline_of(primitive);
        self.fill(self.path(&outline, true), rgb, alpha);
        self.outline(&outline, rgb.map(|c| c / 2), 0.6);
    }

    fn dot(&mut self, at: &Point2, radius_m: f64, rgb: [u8; 3]) {
        let (x, y) = self.pixel(at);
        self.fill(PathBuilder::from_circle(x, y, (radius_m * PIXELS_PER_M) as f32), rgb, 255);
    }

    fn walk(&mut self, clip: &SimulatedClip, rgb: [u8; 3]) {
        let at = |pose: &viola_geometry::Pose3| Point3::from(pose.translation.vector).xy();
        let way: Vec<Point2> = clip.truth.home_from_camera.iter().map(at).collect();
        self.line(&way, false, rgb, 2.5);
        for pose in clip.truth.home_from_camera.iter().step_by(4) {
            let toward = pose.rotation * Vector3::z();
            let from = at(pose);
            self.line(&[from, from + toward.xy() * 0.35], false, rgb, 1.0);
        }
        if let Some(first) = way.first() {
            self.dot(first, 0.08, rgb);
        }
    }
}
