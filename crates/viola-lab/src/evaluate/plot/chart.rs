//! Minimal SVG charts.

use std::fmt::Write;

const LEFT: f64 = 80.0;
const WIDTH: f64 = 640.0;
const HEIGHT: f64 = 320.0;
const BELOW: f64 = 60.0;
const TITLE: f64 = 40.0;

#[derive(Clone)]
pub(super) struct Axis {
    label: String,
    low: f64,
    high: f64,
    is_logarithmic: bool,
    ticks: Vec<f64>,
}

impl Axis {
    pub(super) fn linear(label: &str, low: f64, high: f64, step: f64) -> Axis {
        let ticks = (0..=((high - low) / step).round() as usize).map(|i| low + i as f64 * step).collect();
        Axis { label: label.to_owned(), low, high, is_logarithmic: false, ticks }
    }

    /// Returns a logarithmic axis between powers of ten.
    pub(super) fn logarithmic(label: &str, low: f64, high: f64) -> Axis {
        let powers = low.log10().round() as i32..=high.log10().round() as i32;
        let ticks = powers.map(|power| 10f64.powi(power)).collect();
        Axis { label: label.to_owned(), low, high, is_logarithmic: true, ticks }
    }

    /// Returns a position in 0..1 along the axis; values outside are clamped.
    fn place(&self, value: f64) -> f64 {
        let value = value.clamp(self.low, self.high);
        if self.is_logarithmic {
            (value / self.low).ln() / (self.high / self.low).ln()
        } else {
            (value - self.low) / (self.high - self.low)
        }
    }
}

/// A chart with two axes.
pub(super) struct Chart {
    x: Axis,
    y: Axis,
    marks: String,
    next_legend: f64,
}

impl Chart {
    pub(super) fn new(x: Axis, y: Axis) -> Chart {
        Chart { x, y, marks: String::new(), next_legend: 16.0 }
    }

    /// Returns it with the legend below the middle, for rising curves.
    pub(super) fn with_low_legend(self) -> Chart {
        Chart { next_legend: 0.6 * HEIGHT, ..self }
    }

    fn place(&self, x: f64, y: f64) -> (f64, f64) {
        (LEFT + WIDTH * self.x.place(x), HEIGHT * (1.0 - self.y.place(y)))
    }

    pub(super) fn dot(&mut self, x: f64, y: f64, ink: &str) {
        let (x, y) = self.place(x, y);
        let _ = writeln!(
            self.marks,
            r#"<circle cx="{x:.1}" cy="{y:.1}" r="3" fill="{ink}" fill-opacity="0.6"/>"#
        );
    }

    pub(super) fn line(&mut self, points: &[(f64, f64)], ink: &str) {
        let points: Vec<String> = points
            .iter()
            .map(|(x, y)| {
                let (x, y) = self.place(*x, *y);
                format!("{x:.1},{y:.1}")
            })
            .collect();
        let _ = writeln!(
            self.marks,
            r#"<polyline points="{}" fill="none" stroke="{ink}" stroke-width="1.5"/>"#,
            points.join(" ")
        );
    }

    /// Adds text beside a point.
    pub(super) fn label(&mut self, x: f64, y: f64, words: &str) {
        let (x, y) = self.place(x, y);
        self.text(x + 6.0, y + 14.0, "start", words, "#404040");
    }

    /// Adds a legend line at the right edge, below the last one.
    pub(super) fn legend(&mut self, words: &str, ink: &str) {
        let y = self.next_legend;
        self.next_legend += 16.0;
        let x = LEFT + WIDTH - 10.0;
        let _ = writeln!(self.marks, r#"<circle cx="{x:.1}" cy="{:.1}" r="4" fill="{ink}"/>"#, y - 4.0);
        self.text(x - 10.0, y, "end", words, ink);
    }

    fn text(&mut self, x: f64, y: f64, anchor: &str, words: &str, ink: &str) {
        let _ = writeln!(
            self.marks,
            r#"<text x="{x:.1}" y="{y:.1}" text-anchor="{anchor}" fill="{ink}">{}</text>"#,
            escape(words)
        );
    }

    fn finish(mut self) -> String {
        let (right, bottom) = (LEFT + WIDTH, HEIGHT);
        let mut frame = String::new();
        for tick in self.x.ticks.clone() {
            let x = LEFT + WIDTH * self.x.place(tick);
            let _ =
                writeln!(frame, r##"<line x1="{x:.1}" y1="0" x2="{x:.1}" y2="{bottom}" stroke="#e0e0e0"/>"##);
            self.text(x, bottom + 18.0, "middle", &short(tick), "#404040");
        }
        for tick in self.y.ticks.clone() {
            let y = HEIGHT * (1.0 - self.y.place(tick));
            let _ = writeln!(
                frame,
                r##"<line x1="{LEFT}" y1="{y:.1}" x2="{right}" y2="{y:.1}" stroke="#e0e0e0"/>"##
            );
            self.text(LEFT - 8.0, y + 4.0, "end", &short(tick), "#404040");
        }
        let _ = writeln!(
            frame,
            r##"<rect x="{LEFT}" y="0" width="{WIDTH}" height="{HEIGHT}" fill="none" stroke="#404040"/>"##
        );
        self.text(LEFT + WIDTH / 2.0, bottom + 40.0, "middle", &self.x.label.clone(), "#000000");
        let _ = writeln!(
            self.marks,
            r#"<text transform="translate(20 {:.1}) rotate(-90)" text-anchor="middle">{}</text>"#,
            HEIGHT / 2.0,
            escape(&self.y.label)
        );
        frame + &self.marks
    }
}

/// Returns an SVG of stacked charts under one title.
pub(super) fn stack(title: &str, charts: impl IntoIterator<Item = Chart>) -> String {
    let charts: Vec<String> = charts.into_iter().map(Chart::finish).collect();
    let (width, each) = (LEFT + WIDTH + 30.0, HEIGHT + BELOW);
    let height = TITLE + charts.len() as f64 * each;
    let mut out = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" width=\"{width}\" \
         height=\"{height}\" font-family=\"sans-serif\" font-size=\"12\">\n\
         <rect width=\"100%\" height=\"100%\" fill=\"#ffffff\"/>\n\
         <text x=\"{LEFT}\" y=\"24\" font-size=\"15\">{}</text>\n",
        escape(title)
    );
    for (i, chart) in charts.iter().enumerate() {
        let _ = writeln!(out, "<g transform=\"translate(0 {})\">\n{chart}</g>", TITLE + i as f64 * each);
    }
    out.push_str("</svg>\n");
    out
}

/// Returns a tick's number without rounding errors.
fn short(value: f64) -> String {
    format!("{}", (value * 1000.0).round() / 1000.0)
}

fn escape(words: &str) -> String {
    words.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}
