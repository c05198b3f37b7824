//! Pictures of a completion: each view, its inpainted result, and the plan before and after.

use super::png::png;
use super::{lettering, shades};
use image::{GrayImage, Rgb, RgbImage, imageops};
use viola_align::complete::CompletedView;
use viola_align::{Aligned, Completion, CompletionReport, VirtualScan};
use viola_geometry::{Point2, Pose2, Vector2};

/// Sizes in pixels.
const TILE: (u32, u32) = (320, 240);
const GAP: u32 = 12;
const LETTER: u32 = 8;
const CAPTION: u32 = 20;
const PLAN: u32 = 2 * TILE.0 + GAP;

mod ink {
    use image::Rgb;
    pub const PAPER: Rgb<u8> = Rgb([255, 255, 255]);
    pub const TEXT: Rgb<u8> = Rgb([32, 32, 32]);
    pub const SURFACE: Rgb<u8> = Rgb([205, 213, 223]);
    pub const COMPLETED: Rgb<u8> = Rgb([236, 160, 220]);
    pub const HIT: Rgb<u8> = Rgb([30, 41, 59]);
    pub const COMPLETED_HIT: Rgb<u8> = Rgb([190, 24, 150]);
    pub const CAMERA: Rgb<u8> = Rgb([37, 99, 235]);
    pub const VIEW: Rgb<u8> = Rgb([234, 88, 12]);
    pub const FRONTIER: Rgb<u8> = Rgb([234, 179, 8]);
    pub const BOUNDARY: Rgb<u8> = Rgb([220, 38, 38]);
}

/// Returns a sheet with all pictures as PNG; none without a completion.
pub fn completion_png(aligned: &Aligned) -> Option<Vec<u8>> {
    let (completion, report) = (aligned.completion.as_ref()?, aligned.alignment.completion.as_ref()?);
    let rows: Vec<[(&str, RgbImage); 4]> = completion.views.iter().map(tiles).collect();
    let plans = [("before", plan(aligned, completion, false)), ("after", plan(aligned, completion, true))];
    Some(png(&sheet(&rows, &plans, report)))
}

/// Returns the sheet and each of its pictures as PNG, with file names; empty without a completion.
pub fn completion_pngs(aligned: &Aligned) -> Vec<(String, Vec<u8>)> {
    let (Some(completion), Some(sheet)) = (&aligned.completion, completion_png(aligned)) else {
        return Vec::new();
    };
    let mut files = vec![("sheet.png".to_owned(), sheet)];
    for (name, after) in [("before", false), ("after", true)] {
        files.push((format!("plan_{name}.png"), png(&plan(aligned, completion, after))));
    }
    for (number, view) in completion.views.iter().enumerate() {
        let depth = shades(view);
        let mask = expand(&view.mask);
        let whole = [
            ("rendered", &view.rendered),
            ("mask", &mask),
            ("inpainted", &view.inpainted),
            ("depth", &depth),
        ];
        for (name, picture) in whole {
            files.push((format!("view_{:02}_{name}.png", number + 1), png(picture)));
        }
    }
    files
}

fn tiles(view: &CompletedView) -> [(&'static str, RgbImage); 4] {
    let small =
        |picture: &RgbImage| imageops::resize(picture, TILE.0, TILE.1, imageops::FilterType::Triangle);
    [
        ("what the cloud shows", small(&view.rendered)),
        ("filled in: white", small(&expand(&view.mask))),
        ("the picture filled in", small(&view.inpainted)),
        ("its depth: near dark, far bright", small(&shades(view))),
    ]
}

fn expand(mask: &GrayImage) -> RgbImage {
    RgbImage::from_fn(mask.width(), mask.height(), |x, y| Rgb([mask.get_pixel(x, y).0[0]; 3]))
}

/// Returns the view's depth picture at the colour picture's size.
fn shades(view: &CompletedView) -> RgbImage {
    let small = shades::shades(view.depth_camera.width, view.depth_camera.height, &view.depth_m);
    imageops::resize(&small, view.camera.width, view.camera.height, imageops::FilterType::Nearest)
}

fn sheet(
    rows: &[[(&str, RgbImage); 4]],
    plans: &[(&str, RgbImage); 2],
    report: &CompletionReport,
) -> RgbImage {
    let width = 4 * (TILE.0 + GAP) + GAP;
    let lines = words(report);
    let head = GAP + lines.len() as u32 * CAPTION;
    let row = CAPTION + TILE.1 + GAP;
    let height = head + rows.len() as u32 * row + CAPTION + PLAN + GAP;
    let mut canvas = RgbImage::from_pixel(width, height, ink::PAPER);
    for (line, words) in (0..).zip(&lines) {
        lettering::write(&mut canvas, GAP, GAP + line * CAPTION, LETTER, ink::TEXT, words);
    }
    for (number, tiles) in (0..).zip(rows) {
        let top = head + number * row;
        for (place, (caption, tile)) in (0..).zip(tiles) {
            let left = GAP + place * (TILE.0 + GAP);
            let caption = format!("view {}: {caption}", number + 1);
            lettering::write(&mut canvas, left, top + 4, LETTER, ink::TEXT, &caption);
            imageops::replace(&mut canvas, tile, i64::from(left), i64::from(top + CAPTION));
        }
    }
    let top = head + rows.len() as u32 * row;
    for (place, (name, plan)) in (0..).zip(plans) {
        let left = GAP + place * (PLAN + GAP);
        let caption = format!("plan {name}");
        lettering::write(&mut canvas, left, top + 4, LETTER, ink::TEXT, &caption);
        imageops::replace(&mut canvas, plan, i64::from(left), i64::from(top + CAPTION));
    }
    canvas
}

/// Returns the report as lines of text.
fn words(report: &CompletionReport) -> Vec<String> {
    let text = |answer: &viola_align::AnswerSummary| {
        let state = format!("{:?}", answer.state).to_lowercase();
        match (&answer.map_from_clip, answer.probability) {
            (Some(pose), Some(p)) => format!(
                "{state}, probability {p:.2}, x {:.2} m, y {:.2} m, yaw {:.1} deg",
                pose.x_m,
                pose.y_m,
                pose.yaw_rad.to_degrees()
            ),
            _ => state,
        }
    };
    let by =
        if report.imagined_by.is_empty() { "no network".to_owned() } else { report.imagined_by.join(", ") };
    vec![
        format!("before: {}", text(&report.before)),
        format!("after:  {}", text(&report.after)),
        format!(
            "the answer is the one {} completion; {} hits filled in",
            if report.taken { "with" } else { "without" },
            report.hits
        ),
        format!(
            "{} points continue walls, {} points made up by {by}",
            report.structure_points, report.imagined_points
        ),
        "plans: dark hits, violet filled in, blue cameras, orange views, red boundary of the seen, yellow frontier"
            .to_owned(),
    ]
}

/// Draws the clip from above, x right: observed points, completed points, and hits at the vacuum's height.
fn plan(aligned: &Aligned, completion: &Completion, after: bool) -> RgbImage {
    let observed = aligned.cloud_in_clip.points.iter().map(|p| p.position().xy());
    let filled = completion.cloud_in_clip.points.iter().map(|p| p.position().xy());
    let paper = Paper::around(observed.clone().chain(filled.clone()));
    let mut canvas = RgbImage::from_pixel(PLAN, PLAN, ink::PAPER);
    observed.for_each(|p| paper.dot(&mut canvas, &p, 0, ink::SURFACE));
    if after {
        filled.for_each(|p| paper.dot(&mut canvas, &p, 0, ink::COMPLETED));
    }
    let scan: &VirtualScan = if after { &completion.scan } else { &aligned.scan };
    for hit in &scan.hits {
        let ink = if hit.completed { ink::COMPLETED_HIT } else { ink::HIT };
        paper.dot(&mut canvas, &hit.point_m, 1, ink);
    }
    for camera in &scan.cameras {
        paper.dot(&mut canvas, &Point2::new(camera.x_m, camera.y_m), 1, ink::CAMERA);
    }
    completion.sets.frontier_m.iter().for_each(|p| paper.dot(&mut canvas, p, 2, ink::FRONTIER));
    completion.sets.boundary_m.iter().for_each(|p| paper.dot(&mut canvas, p, 4, ink::BOUNDARY));
    for completed in &completion.views {
        let view = completed.view;
        paper.wedge(&mut canvas, &Pose2::new(view.eye_m[0], view.eye_m[1], view.yaw_rad), ink::VIEW);
    }
    canvas
}

/// A square of the floor plan on a square of pixels.
struct Paper {
    corner_m: Point2,
    px_per_m: f64,
}

impl Paper {
    fn around(points: impl Iterator<Item = Point2>) -> Paper {
        let (mut low, mut high) = (Point2::new(-1.0, -1.0), Point2::new(1.0, 1.0));
        for point in points {
            low = low.inf(&point);
            high = high.sup(&point);
        }
        let side_m = (high - low).max() + 0.6;
        let middle = nalgebra::center(&low, &high);
        Paper { corner_m: middle + Vector2::new(-0.5, 0.5) * side_m, px_per_m: f64::from(PLAN) / side_m }
    }

    fn dot(&self, canvas: &mut RgbImage, at: &Point2, radius: i64, ink: Rgb<u8>) {
        let x = ((at.x - self.corner_m.x) * self.px_per_m) as i64;
        let y = ((self.corner_m.y - at.y) * self.px_per_m) as i64;
        for (dx, dy) in (-radius..=radius).flat_map(|dy| (-radius..=radius).map(move |dx| (dx, dy))) {
            let (x, y) = (x + dx, y + dy);
            if (0..i64::from(PLAN)).contains(&x) && (0..i64::from(PLAN)).contains(&y) {
                canvas.put_pixel(x as u32, y as u32, ink);
            }
        }
    }

    /// Draws a camera and its viewing direction.
    fn wedge(&self, canvas: &mut RgbImage, pose: &Pose2, ink: Rgb<u8>) {
        let apex = Point2::new(pose.x_m, pose.y_m);
        self.dot(canvas, &apex, 3, ink);
        for side in [-0.5, 0.5] {
            let edge = pose.rotate(&Vector2::new(1.0, side)) * 0.5;
            (1..=40).for_each(|step| self.dot(canvas, &(apex + edge * (f64::from(step) / 40.0)), 0, ink));
        }
    }
}
