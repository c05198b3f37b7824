//! A plan as a picture.

use super::paper::{self, FOOT_M, MARGIN_M};
use super::{Plan, hangs, letters, opens};
use crate::rooms::outline::Outline;
use tiny_skia::{Color, FillRule, LineCap, LineJoin, Paint, Path, PathBuilder, Pixmap, Stroke, Transform};

/// The longer side of a picture.
const SIDE_PX: f64 = 1600.0;
/// A small home is not blown up beyond this.
const MOST_PX_PER_M: f64 = 160.0;

/// The plan as PNG, y up: rooms tinted with their names and areas, walls dark, things with a light fill and what
/// they are, a scale bar.
pub fn plan_png(plan: &Plan) -> Vec<u8> {
    let mut canvas = Canvas::over(plan);
    for (place, room) in plan.rooms.iter().enumerate() {
        let outline = Outline { ring_m: room.polygon_m.clone(), holes_m: room.holes_m.clone() };
        canvas.fill(&outline, paper::tint(place));
    }
    for outline in &plan.obstacles {
        canvas.fill(outline, paper::OBSTACLE);
    }
    let flat = |object: &&super::Object| opens(object.class) || hangs(object.class);
    for object in plan.objects.iter().filter(|object| !flat(object)) {
        let color = object.class.color();
        let corners = object.bounds().corners();
        canvas.polygon(&corners, paper::lighter(color, 0.62), 225);
        canvas.ring(&corners, paper::darker(color, 0.25), 2.0);
    }
    for outline in &plan.walls {
        canvas.fill(outline, paper::WALL);
        // The robot's cells are thinner than walls.
        canvas.ring(&outline.ring_m, paper::WALL, 2.0);
    }
    for object in plan.objects.iter().filter(flat) {
        let color = object.class.color();
        let mut bounds = object.bounds();
        bounds.size_m[1] = bounds.size_m[1].clamp(0.06, 0.14);
        canvas.polygon(&bounds.corners(), paper::lighter(color, 0.35), 235);
        canvas.ring(&bounds.corners(), paper::darker(color, 0.35), 1.5);
    }
    for label in paper::labels(plan) {
        let middle = canvas.place(&label.at_m);
        let height_px = (label.height_m * canvas.px_per_m).max(9.0);
        letters::write(&mut canvas.pixmap, middle, height_px, label.ink, label.bold, &label.words);
    }
    canvas.bar(paper::bar_m(plan));
    canvas.png()
}

struct Canvas {
    pixmap: Pixmap,
    /// Upper-left corner.
    corner_m: [f64; 2],
    px_per_m: f64,
}

impl Canvas {
    fn over(plan: &Plan) -> Canvas {
        let width_m = plan.max_m[0] - plan.min_m[0] + 2.0 * MARGIN_M;
        let height_m = plan.max_m[1] - plan.min_m[1] + 2.0 * MARGIN_M + FOOT_M;
        let px_per_m = (SIDE_PX / width_m.max(height_m)).min(MOST_PX_PER_M);
        let pixels = |metres: f64| ((metres * px_per_m).ceil() as u32).clamp(1, SIDE_PX as u32 + 1);
        let mut pixmap = Pixmap::new(pixels(width_m), pixels(height_m)).expect("the size is not zero");
        pixmap.fill(opaque(paper::PAPER));
        Canvas { pixmap, corner_m: [plan.min_m[0] - MARGIN_M, plan.max_m[1] + MARGIN_M], px_per_m }
    }

    fn place(&self, at_m: &[f64; 2]) -> [f64; 2] {
        [(at_m[0] - self.corner_m[0]) * self.px_per_m, (self.corner_m[1] - at_m[1]) * self.px_per_m]
    }

    fn path<'a>(&self, rings: impl Iterator<Item = &'a [[f64; 2]]>) -> Option<Path> {
        let mut builder = PathBuilder::new();
        for ring in rings {
            for (i, corner) in ring.iter().enumerate() {
                let [x, y] = self.place(corner).map(|v| v as f32);
                if i == 0 { builder.move_to(x, y) } else { builder.line_to(x, y) }
            }
            builder.close();
        }
        builder.finish()
    }

    fn fill(&mut self, outline: &Outline, ink: [u8; 3]) {
        let rings = std::iter::once(&outline.ring_m).chain(&outline.holes_m).map(Vec::as_slice);
        if let Some(path) = self.path(rings) {
            self.pixmap.fill_path(&path, &paint(ink, 255), FillRule::EvenOdd, Transform::identity(), None);
        }
    }

    fn polygon(&mut self, ring: &[[f64; 2]], ink: [u8; 3], alpha: u8) {
        if let Some(path) = self.path(std::iter::once(ring)) {
            self.pixmap.fill_path(&path, &paint(ink, alpha), FillRule::Winding, Transform::identity(), None);
        }
    }

    fn ring(&mut self, ring: &[[f64; 2]], ink: [u8; 3], width_px: f32) {
        if let Some(path) = self.path(std::iter::once(ring)) {
            let stroke = Stroke { width: width_px, line_join: LineJoin::Round, ..Stroke::default() };
            self.pixmap.stroke_path(&path, &paint(ink, 255), &stroke, Transform::identity(), None);
        }
    }

    /// Lower left: a bar with its length.
    fn bar(&mut self, length_m: f64) {
        let left = MARGIN_M * self.px_per_m;
        let y = f64::from(self.pixmap.height()) - 0.55 * FOOT_M * self.px_per_m;
        let right = left + length_m * self.px_per_m;
        let mut builder = PathBuilder::new();
        let mut line = |from: [f64; 2], to: [f64; 2]| {
            builder.move_to(from[0] as f32, from[1] as f32);
            builder.line_to(to[0] as f32, to[1] as f32);
        };
        line([left, y], [right, y]);
        for x in [left, (left + right) / 2.0, right] {
            line([x, y - 6.0], [x, y + 6.0]);
        }
        if let Some(path) = builder.finish() {
            let stroke = Stroke { width: 2.5, line_cap: LineCap::Square, ..Stroke::default() };
            let ink = paint(paper::TEXT, 255);
            self.pixmap.stroke_path(&path, &ink, &stroke, Transform::identity(), None);
        }
        let words = format!("{length_m} m");
        let middle = [right + 14.0 + letters::width_px(&words, 14.0) / 2.0, y];
        letters::write(&mut self.pixmap, middle, 14.0, paper::TEXT, false, &words);
    }

    fn png(self) -> Vec<u8> {
        self.pixmap.encode_png().expect("an RGBA picture in memory always encodes")
    }
}

fn opaque(ink: [u8; 3]) -> Color {
    Color::from_rgba8(ink[0], ink[1], ink[2], 255)
}

fn paint(ink: [u8; 3], alpha: u8) -> Paint<'static> {
    let mut paint = Paint::default();
    paint.set_color(Color::from_rgba8(ink[0], ink[1], ink[2], alpha));
    paint
}
