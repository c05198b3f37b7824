//! Contact sheet of a clip: a dozen frames, colour above depth.

use super::lettering;
use super::png::png;
use super::shades::shades;
use image::{Rgb, RgbImage, imageops};
use viola_formats::clip::{Clip, ClipError, Frame, FrameHeader};

const COLUMNS: u32 = 4;
const ROWS: u32 = 3;
/// The longer side of a picture, in pixels.
const SIDE: u32 = 300;
const GAP: u32 = 10;
const LETTER: u32 = 8;
const CAPTION: u32 = 20;
const PAPER: Rgb<u8> = Rgb([255, 255, 255]);
const TEXT: Rgb<u8> = Rgb([32, 32, 32]);
const BROKEN: Rgb<u8> = Rgb([220, 38, 38]);

/// Returns evenly spaced frames of the clip as PNG; a frame that cannot be decoded is a caption with the
/// reason. Fails if no frame can be decoded.
pub fn contact_sheet_png(clip: &Clip) -> Result<Vec<u8>, ClipError> {
    let frames = clip.frames().len();
    let count = frames.min((COLUMNS * ROWS) as usize);
    let places: Vec<usize> = (0..count).map(|i| i * (frames - 1) / (count - 1).max(1)).collect();
    let mut stream = clip.stream(places.clone());
    // One by one: a phone's pictures are large, their tiles are small.
    let tiles: Vec<Result<RgbImage, ClipError>> = places
        .iter()
        .flat_map(|_| stream.next_batch(1))
        .map(|frame| frame.map(|frame| tile(&frame)))
        .collect();
    let Some((width, height)) = size(&tiles) else {
        let error = tiles.into_iter().find_map(Result::err);
        return Err(error.unwrap_or(ClipError::NoFrames { color: 0, depth: 0 }));
    };
    let rows = (count as u32).div_ceil(COLUMNS);
    let columns = COLUMNS.min(count as u32);
    let (across, down) = (width + GAP, height + CAPTION + GAP);
    let mut sheet = RgbImage::from_pixel(columns * across + GAP, rows * down + GAP, PAPER);
    for (i, (tile, place)) in (0..).zip(tiles.iter().zip(&places)) {
        let (left, top) = (GAP + i % COLUMNS * across, GAP + i / COLUMNS * down);
        let header = &clip.frames()[*place];
        let (ink, words) = match tile {
            Ok(_) => (TEXT, caption(header)),
            Err(error) => (BROKEN, format!("{}: {}", caption(header), error.code())),
        };
        lettering::write(&mut sheet, left, top + 4, LETTER, ink, &words);
        if let Ok(tile) = tile {
            imageops::replace(&mut sheet, tile, i64::from(left), i64::from(top + CAPTION));
        }
    }
    Ok(png(&sheet))
}

/// Returns the width and the height in which every tile has room: a frame without a colour picture has half the height.
/// None without a tile.
fn size(tiles: &[Result<RgbImage, ClipError>]) -> Option<(u32, u32)> {
    let sizes = tiles.iter().flatten().map(RgbImage::dimensions);
    sizes.reduce(|a, b| (a.0.max(b.0), a.1.max(b.1)))
}

fn caption(header: &FrameHeader) -> String {
    let time = header.time_s.map_or(String::new(), |time_s| format!(", {time_s:.1} s"));
    let pose = if header.world_from_camera.is_some() { "" } else { ", no pose" };
    format!("frame {}{time}{pose}", header.number)
}

/// Returns colour above depth at the same size, or depth alone.
fn tile(frame: &Frame) -> RgbImage {
    let (width, height) = (frame.color_camera.width, frame.color_camera.height);
    let scale = f64::from(SIDE) / f64::from(width.max(height));
    let side = |side: u32| ((f64::from(side) * scale).round() as u32).max(1);
    let (width, height) = (side(width), side(height));
    let depth = shades(frame.depth.width, frame.depth.height, &frame.depth.depth_m);
    let depth = imageops::resize(&depth, width, height, imageops::FilterType::Nearest);
    let Some(color) = &frame.color else { return depth };
    let color = imageops::thumbnail(color, width, height);
    let mut tile = RgbImage::new(width, 2 * height);
    imageops::replace(&mut tile, &color, 0, 0);
    imageops::replace(&mut tile, &depth, 0, i64::from(height));
    tile
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_tile_has_room() {
        let tile = |width: u32, height: u32| Ok(RgbImage::new(width, height));
        let broken = || Err(ClipError::NoFrames { color: 0, depth: 0 });
        for (tiles, expected) in [
            (vec![tile(300, 169), broken(), tile(300, 338)], Some((300, 338))),
            (vec![tile(300, 338), tile(300, 169)], Some((300, 338))),
            (vec![broken()], None),
        ] {
            assert_eq!(size(&tiles), expected);
        }
    }
}
