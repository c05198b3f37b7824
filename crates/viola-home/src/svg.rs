//! SVG: escaping of text, and rendering with the font in the binary (Noto Sans, SIL Open Font License 1.1).

use notosans::{BOLD_TTF, REGULAR_TTF};
use resvg::tiny_skia::{Pixmap, Transform};
use resvg::usvg::{Options, Tree, fontdb};
use std::sync::{Arc, LazyLock};

/// Name of the font in the binary. Browsers that lack it use the others.
pub const FONT_FAMILY: &str = "Noto Sans, Helvetica, Arial, sans-serif";

static FONTS: LazyLock<Arc<fontdb::Database>> = LazyLock::new(|| {
    let mut fonts = fontdb::Database::new();
    fonts.load_font_data(REGULAR_TTF.to_vec());
    fonts.load_font_data(BOLD_TTF.to_vec());
    Arc::new(fonts)
});

/// Returns the elements of `svg`, its text as outlines of the font in the binary.
///
/// # Panics
/// If `svg` is not SVG: it is written by this crate.
pub fn parse(svg: &str) -> Tree {
    let options = Options { fontdb: FONTS.clone(), ..Options::default() };
    Tree::from_str(svg, &options).expect("our own SVG parses")
}

/// Renders `svg` with `px_per_unit` pixels for each of its units.
///
/// # Panics
/// If `svg` is not SVG: it is written by this crate.
pub fn render(svg: &str, px_per_unit: f32) -> Pixmap {
    let tree = parse(svg);
    let pixels = |units: f32| ((units * px_per_unit).ceil() as u32).max(1);
    let mut pixmap =
        Pixmap::new(pixels(tree.size().width()), pixels(tree.size().height())).expect("the size is not zero");
    resvg::render(&tree, Transform::from_scale(px_per_unit, px_per_unit), &mut pixmap.as_mut());
    pixmap
}

/// Escapes markup and drops characters that XML 1.0 cannot hold.
pub fn escape(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for letter in text.chars() {
        match letter {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\'' => out.push_str("&#39;"),
            '\u{fffe}' | '\u{ffff}' => {}
            letter if letter.is_control() => {}
            letter => out.push(letter),
        }
    }
    out
}

pub fn hex([red, green, blue]: [u8; 3]) -> String {
    format!("#{red:02x}{green:02x}{blue:02x}")
}
