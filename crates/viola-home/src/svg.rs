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

/// Returns whether the fonts in the binary have all letters of a text. They have those of Latin, Greek and Cyrillic.
pub fn has_letters(words: &str) -> bool {
    fn is_whole(group: &Group) -> bool {
        group.children().iter().all(|node| match node {
            Node::Group(group) => is_whole(group),
            Node::Text(text) => {
                let mut glyphs = text.layouted().iter().flat_map(|span| &span.positioned_glyphs);
                // Glyph 0 is the box of a missing letter.
                glyphs.all(|glyph| glyph.id != GlyphId(0))
            }
            Node::Path(_) | Node::Image(_) => true,
        })
    }
    let svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"1\" height=\"1\" font-family=\"{FONT_FAMILY}\">\
         <text>{}</text></svg>",
        escape(words)
    );
    is_whole(parse(&svg).root())
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
