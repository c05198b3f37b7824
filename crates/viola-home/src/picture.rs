//! Pictures of a LiDAR map, with and without a clip.

use super::svg::{FONT_FAMILY, escape, hex, render};
use serde::{Deserialize, Serialize};
use tiny_skia::{Color, FillRule, LineCap, Paint, PathBuilder, Pixmap, PixmapPaint, Rect, Stroke, Transform};
use viola_align::{Aligned, Alternative};
use viola_formats::lidar::{Cell, LidarInfo, LidarMap};
use viola_geometry::{Grid, Point2, Pose2, Vector2};

/// The longer side of a picture.
const SIDE_PX: f64 = 1200.0;
const MARGIN_M: f64 = 0.5;

mod ink {
    pub const PAPER: [u8; 4] = [255, 255, 255, 255];
    pub const FREE: [u8; 4] = [236, 240, 244, 255];
    pub const WALL: [u8; 4] = [52, 58, 64, 255];
    pub const ROOMS: [[u8; 4]; 6] = [
        [219, 234, 254, 255],
        [220, 252, 231, 255],
        [254, 249, 195, 255],
        [252, 231, 243, 255],
        [237, 233, 254, 255],
        [255, 237, 213, 255],
    ];
    pub const MATCHED: [u8; 4] = [22, 163, 74, 255];
    pub const UNMATCHED: [u8; 4] = [220, 38, 38, 255];
    pub const CAMERA: [u8; 4] = [37, 99, 235, 255];
    pub const ALTERNATIVE: [u8; 4] = [234, 88, 12, 255];
    pub const CHARGER: [u8; 4] = [147, 51, 234, 255];
}

/// Position of a picture in the map's frame: x right, y up, square pixels.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct PictureFrame {
    /// Upper left corner of the picture: x and y in metres.
    pub corner_m: [f64; 2],
    pub px_per_m: f64,
    pub width_px: u32,
    pub height_px: u32,
}

impl PictureFrame {
    /// Returns the frame of [`lidar_png`]'s picture.
    pub fn of(info: &LidarInfo) -> PictureFrame {
        PictureFrame::around(info.min_m, info.max_m)
    }

    fn around(min: [f64; 2], max: [f64; 2]) -> PictureFrame {
        let size = [max[0] - min[0] + 2.0 * MARGIN_M, max[1] - min[1] + 2.0 * MARGIN_M];
        let px_per_m = SIDE_PX / size[0].max(size[1]);
        let pixels = |metres: f64| ((metres * px_per_m).ceil() as u32).clamp(1, SIDE_PX as u32 + 1);
        PictureFrame {
            corner_m: [min[0] - MARGIN_M, max[1] + MARGIN_M],
            px_per_m,
            width_px: pixels(size[0]),
            height_px: pixels(size[1]),
        }
    }
}

/// Returns the map as PNG, x right, y up: walls dark, free cells light, rooms tinted, the charger violet.
pub fn lidar_png(lidar: &LidarMap) -> Vec<u8> {
    let mut canvas = Canvas::around(lidar, &[]);
    canvas.lidar(lidar);
    canvas.png()
}

/// Returns the map with the clip at its pose as PNG, with a legend below. Hits are green if the map has a point
/// within 10 cm, otherwise red; the camera path is blue, with a wedge at the first camera; alternatives on its
/// level are orange wedges.
pub fn overlay_png(lidar: &LidarMap, aligned: &Aligned) -> Vec<u8> {
    const MATCHED_M: f64 = 0.1;
    let alternatives = &aligned.alignment.alternatives;
    // A failed clip shows its best alternative, for diagnosis.
    let pose = aligned.alignment.map_from_clip.or_else(|| alternatives.first().map(|a| a.map_from_clip));
    let Some(pose) = pose else { return lidar_png(lidar) };
    let hits: Vec<Point2> = aligned.scan.hits.iter().map(|h| pose.apply(&h.point_m)).collect();
    let mut canvas = Canvas::around(lidar, &hits);
    canvas.lidar(lidar);
    let others = others_on_level(alternatives);
    others.iter().rev().for_each(|other| canvas.wedge(other, ink::ALTERNATIVE));
    let near = viola_align::Target::new(lidar);
    for hit in &hits {
        let matched = near.as_ref().is_some_and(|target| target.field.value(hit) < MATCHED_M);
        canvas.dot(hit, 0.03, if matched { ink::MATCHED } else { ink::UNMATCHED });
    }
    let path: Vec<Point2> =
        aligned.scan.cameras.iter().map(|c| pose.apply(&Point2::new(c.x_m, c.y_m))).collect();
    canvas.line(&path, ink::CAMERA);
    canvas.wedge(&pose, ink::CAMERA);
    let mut meanings = vec![
        (ink::WALL, "LiDAR map"),
        (ink::MATCHED, "clip at the vacuum's height, in the map"),
        (ink::UNMATCHED, "clip, not in the map"),
        (ink::CAMERA, "camera's path, from its wedge on"),
    ];
    if !others.is_empty() {
        meanings.push((ink::ALTERNATIVE, "first camera of another possible pose"));
    }
    if lidar.charger.is_some() {
        meanings.push((ink::CHARGER, "charger"));
    }
    canvas.with_legend(&meanings).png()
}

/// Returns the poses of the alternatives on the level of the best one: those on other levels are in other frames.
fn others_on_level(alternatives: &[Alternative]) -> Vec<Pose2> {
    let level = alternatives.first().map(|best| best.level);
    let others = alternatives.iter().skip(1).filter(|other| Some(other.level) == level);
    others.map(|other| other.map_from_clip).collect()
}

struct Canvas {
    pixmap: Pixmap,
    frame: PictureFrame,
}

impl Canvas {
    fn around(lidar: &LidarMap, points: &[Point2]) -> Canvas {
        let (mut min, mut max) = (lidar.info.min_m, lidar.info.max_m);
        // A pose far outside must not shrink the map.
        let reach = 5.0;
        let limit = [min[0] - reach, min[1] - reach, max[0] + reach, max[1] + reach];
        for point in points {
            let p = [point.x.clamp(limit[0], limit[2]), point.y.clamp(limit[1], limit[3])];
            for axis in 0..2 {
                min[axis] = min[axis].min(p[axis]);
                max[axis] = max[axis].max(p[axis]);
            }
        }
        let frame = PictureFrame::around(min, max);
        let mut pixmap = Pixmap::new(frame.width_px, frame.height_px).expect("the size is not zero");
        pixmap.fill(color(ink::PAPER));
        Canvas { pixmap, frame }
    }

    fn lidar(&mut self, lidar: &LidarMap) {
        if let Some(grid) = &lidar.cells {
            self.cells(grid, Cell::Free, ink::FREE);
        }
        let cell_m = lidar.cells.as_ref().map_or(0.05, |grid| grid.frame.cell_m);
        for (i, room) in lidar.rooms.iter().enumerate() {
            let tint = ink::ROOMS[i % ink::ROOMS.len()];
            room.cells_m.iter().for_each(|centre| self.square(centre, cell_m, tint));
        }
        match &lidar.cells {
            Some(grid) => self.cells(grid, Cell::Occupied, ink::WALL),
            None => lidar.occupied_m.iter().for_each(|p| self.dot(p, 0.02, ink::WALL)),
        }
        if let Some(charger) = &lidar.charger {
            self.dot(&Point2::new(charger.x_m, charger.y_m), 0.12, ink::CHARGER);
        }
    }

    fn cells(&mut self, grid: &Grid<Cell>, kind: Cell, ink: [u8; 4]) {
        for y in 0..grid.frame.height {
            for x in 0..grid.frame.width {
                if grid.get(x, y) == kind {
                    self.square(&grid.frame.centre(x, y), grid.frame.cell_m, ink);
                }
            }
        }
    }

    fn place(&self, point: &Point2) -> (f32, f32) {
        let x = (point.x - self.frame.corner_m[0]) * self.frame.px_per_m;
        let y = (self.frame.corner_m[1] - point.y) * self.frame.px_per_m;
        (x as f32, y as f32)
    }

    fn square(&mut self, centre: &Point2, side_m: f64, ink: [u8; 4]) {
        let (x, y) = self.place(centre);
        // Rounded to pixels, so that neighbouring squares leave no seam.
        let side = (side_m * self.frame.px_per_m) as f32;
        let (left, top) = ((x - side / 2.0).round(), (y - side / 2.0).round());
        let (right, bottom) = ((x + side / 2.0).round(), (y + side / 2.0).round());
        if let Some(rect) = Rect::from_ltrb(left, top, right.max(left + 1.0), bottom.max(top + 1.0)) {
            let mut paint = paint(ink);
            paint.anti_alias = false;
            self.pixmap.fill_rect(rect, &paint, Transform::identity(), None);
        }
    }

    fn dot(&mut self, centre: &Point2, radius_m: f64, ink: [u8; 4]) {
        let (x, y) = self.place(centre);
        let radius = ((radius_m * self.frame.px_per_m) as f32).max(1.5);
        if let Some(path) = PathBuilder::from_circle(x, y, radius) {
            self.pixmap.fill_path(&path, &paint(ink), FillRule::Winding, Transform::identity(), None);
        }
    }

    fn path(&self, points: &[Point2]) -> PathBuilder {
        let mut builder = PathBuilder::new();
        for (i, point) in points.iter().enumerate() {
            let (x, y) = self.place(point);
            if i == 0 { builder.move_to(x, y) } else { builder.line_to(x, y) }
        }
        builder
    }

    fn line(&mut self, points: &[Point2], ink: [u8; 4]) {
        if let Some(path) = self.path(points).finish() {
            let stroke = Stroke { width: 2.5, line_cap: LineCap::Round, ..Stroke::default() };
            self.pixmap.stroke_path(&path, &paint(ink), &stroke, Transform::identity(), None);
        }
    }

    /// Draws a camera as a wedge open in its viewing direction.
    fn wedge(&mut self, pose: &Pose2, ink: [u8; 4]) {
        let apex = Point2::new(pose.x_m, pose.y_m);
        let side = |y: f64| apex + pose.rotate(&Vector2::new(0.4, y));
        let mut builder = self.path(&[apex, side(0.22), side(-0.22)]);
        builder.close();
        if let Some(path) = builder.finish() {
            let mut fill = paint(ink);
            fill.set_color(color([ink[0], ink[1], ink[2], 90]));
            self.pixmap.fill_path(&path, &fill, FillRule::Winding, Transform::identity(), None);
            let stroke = Stroke { width: 2.0, ..Stroke::default() };
            self.pixmap.stroke_path(&path, &paint(ink), &stroke, Transform::identity(), None);
        }
    }

    /// Returns the picture with the meanings of its colours below it, and the length of a metre.
    fn with_legend(self, meanings: &[([u8; 4], &str)]) -> Canvas {
        const LETTER_PX: f64 = 15.0;
        const LINE_PX: f64 = 24.0;
        /// Width of a letter of [`LETTER_PX`], at most on average.
        const ADVANCE_PX: f64 = 8.0;
        let width = self.pixmap.width();
        let (mut x, mut line, mut entries) = (12.0, 0.0, String::new());
        let mut entry = |mark_px: f64, mark: &dyn Fn(f64, f64) -> String, words: &str| {
            let whole = mark_px + 8.0 + ADVANCE_PX * words.chars().count() as f64 + 16.0;
            if x > 12.0 && x + whole > f64::from(width) {
                (x, line) = (12.0, line + 1.0);
            }
            let middle = 10.0 + LINE_PX * (line + 0.5);
            entries += &mark(x, middle);
            entries +=
                &format!("<text x=\"{}\" y=\"{}\">{}</text>", x + mark_px + 8.0, middle + 5.0, escape(words));
            x += whole;
        };
        for ([red, green, blue, _], words) in meanings {
            let fill = hex([*red, *green, *blue]);
            let mark = |x, y| format!("<circle cx=\"{}\" cy=\"{y}\" r=\"6\" fill=\"{fill}\"/>", x + 6.0);
            entry(12.0, &mark, words);
        }
        let metre_px = self.frame.px_per_m;
        let bar = |x, y| {
            format!(
                "<path d=\"M{x} {}v8v-4h{metre_px}v-4v8\" fill=\"none\" stroke=\"#343a40\" stroke-width=\"2\"/>",
                y - 4.0
            )
        };
        entry(metre_px, &bar, "1 m; x to the right, y up");
        let height = (20.0 + LINE_PX * (line + 1.0)) as u32;
        let legend = render(
            &format!(
                "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" \
                 font-family=\"{FONT_FAMILY}\" font-size=\"{LETTER_PX}\" fill=\"#343a40\">{entries}</svg>"
            ),
            1.0,
        );
        let below = self.pixmap.height() as i32;
        let mut pixmap = Pixmap::new(width, self.pixmap.height() + height).expect("the size is not zero");
        pixmap.fill(color(ink::PAPER));
        for (part, top) in [(&self.pixmap, 0), (&legend, below)] {
            pixmap.draw_pixmap(0, top, part.as_ref(), &PixmapPaint::default(), Transform::identity(), None);
        }
        Canvas { pixmap, frame: self.frame }
    }

    fn png(self) -> Vec<u8> {
        self.pixmap.encode_png().expect("an RGBA picture in memory always encodes")
    }
}

fn color(ink: [u8; 4]) -> Color {
    Color::from_rgba8(ink[0], ink[1], ink[2], ink[3])
}

fn paint(ink: [u8; 4]) -> Paint<'static> {
    let mut paint = Paint::default();
    paint.set_color(color(ink));
    paint
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn alternatives_on_other_levels_are_not_drawn() {
        let alternative = |level: &str, x_m: f64| Alternative {
            level: level.parse().unwrap(),
            map_from_clip: Pose2::new(x_m, 0.0, 0.0),
            rise_m: 0.0,
            loss_m: 0.1,
            inliers: 0.5,
            free_space: None,
            misplaced: None,
            probability: None,
            evidence: None,
        };
        let all = [alternative("upper", 1.0), alternative("main", 2.0), alternative("upper", 3.0)];
        assert_eq!(others_on_level(&all), [Pose2::new(3.0, 0.0, 0.0)]);
        assert!(others_on_level(&all[..2]).is_empty() && others_on_level(&[]).is_empty());
    }
}
