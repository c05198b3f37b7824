//! SVG: escaping of text, and rendering with the font in the binary (Noto Sans, SIL Open Font License 1.1).

use notosans::{BOLD_TTF, REGULAR_TTF};
use resvg::tiny_skia::{Pixmap, Transform};
use resvg::usvg::{GlyphId, Group, Node, Options, Tree, fontdb};
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

/// A line of text in the fonts of the binary.
struct Line {
    /// Width as a multiple of the letters' size. A letter that the fonts lack has the width of their box for it.
    width: f64,
    /// Number of letters that the fonts lack.
    lacking: usize,
}

impl Line {
    fn of(words: &str, is_bold: bool) -> Line {
        const SIZE: f32 = 100.0;
        let weight = if is_bold { 700 } else { 400 };
        let svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"1\" height=\"1\" font-family=\"{FONT_FAMILY}\">\
             <text font-size=\"{SIZE}\" font-weight=\"{weight}\">{}</text></svg>",
            escape(words)
        );
        let mut line = Line { width: 0.0, lacking: 0 };
        line.add(parse(&svg).root());
        line.width /= f64::from(SIZE);
        line
    }

    fn add(&mut self, group: &Group) {
        for node in group.children() {
            match node {
                Node::Group(group) => self.add(group),
                Node::Text(text) => {
                    let glyphs = text.layouted().iter().flat_map(|span| &span.positioned_glyphs);
                    // Glyph 0 is the box of a missing letter.
                    self.lacking += glyphs.filter(|glyph| glyph.id == GlyphId(0)).count();
                    // The box of a text is that of its letters' advances.
                    self.width += f64::from(text.bounding_box().width());
                }
                Node::Path(_) | Node::Image(_) => {}
            }
        }
    }
}

/// Returns whether the fonts in the binary have all letters of a text. They have those of Latin, Greek and Cyrillic.
pub fn has_letters(words: &str) -> bool {
    Line::of(words, false).lacking == 0
}

/// Returns the width of a line of text as a multiple of its letters' size. Browsers draw the letters that the fonts in the binary
/// lack with other fonts; those of Chinese and Japanese are as wide as high.
pub fn text_width(words: &str, is_bold: bool) -> f64 {
    /// Width of the box of a missing letter.
    const BOX: f64 = 0.6;
    let line = Line::of(words, is_bold);
    line.width + (1.0 - BOX) * line.lacking as f64
}

/// Returns a text without the letters that the fonts in the binary lack, and without the characters that join pictographs.
pub fn letters_in_fonts(words: &str) -> String {
    let joins = |letter: char| matches!(letter, '\u{200d}' | '\u{fe00}'..='\u{fe0f}');
    let is_there =
        |letter: &char| letter.is_ascii() || !joins(*letter) && has_letters(letter.encode_utf8(&mut [0; 4]));
    words.chars().filter(is_there).collect()
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Sums of the advances in the tables `hmtx` of Noto Sans.
    #[test]
    fn a_text_has_the_width_of_its_letters() {
        for (words, is_bold, width) in [
            ("Wohnzimmer", false, 6.347),
            ("Wohnzimmer", true, 6.702),
            ("WOHNZIMMER", true, 7.415),
            ("K\u{fc}che", true, 3.083),
            ("\u{421}\u{43f}\u{430}\u{43b}\u{44c}\u{43d}\u{44f}", true, 4.407),
            ("map axes", false, 4.504),
            ("\u{53a8}\u{623f}", false, 2.0),
            ("", true, 0.0),
        ] {
            let measured = text_width(words, is_bold);
            // Pairs of letters are set closer.
            assert!((measured - width).abs() < 0.02 * width + 0.01, "{words}: {measured}");
        }
    }

    #[test]
    fn letters_that_the_fonts_lack_are_known() {
        for words in [
            "",
            "K\u{fc}che 2",
            "\u{41a}\u{443}\u{445}\u{43d}\u{44f}",
            "\u{39a}\u{3bf}\u{3c5}\u{3b6}\u{3af}\u{3bd}\u{3b1}",
            "<&>\n",
        ] {
            assert!(has_letters(words), "{words}");
        }
        for words in [
            "\u{53a8}\u{623f}",
            "\u{30ea}\u{30d3}\u{30f3}\u{30b0}",
            "Bad \u{1f6c1}",
            "\u{645}\u{637}\u{628}\u{62e}",
        ] {
            assert!(!has_letters(words), "{words}");
        }
    }
}
