//! Pictures of a few frames of a clip: the sharpest one as its thumbnail, and all in a row, upright, as JPEG.

use image::codecs::jpeg::JpegEncoder;
use image::{Rgb, RgbImage, imageops};
use viola_formats::clip::{Clip, DepthImage, FrameHeader};
use viola_geometry::Vector3;
use viola_reconstruct::QuarterTurn;
use viola_reconstruct::fuse::sharpness;

/// Number of frames that are drawn.
const CANDIDATES: usize = 5;
/// A video is decoded up to the last candidate, so the candidates are among its first frames.
const MAX_VIDEO_FRAMES: usize = 300;
/// The longest side.
const SIDE_PX: u32 = 320;
const QUALITY: u8 = 80;
/// Between the pictures of a row.
const GAP_PX: u32 = 4;
/// Depth that is drawn black.
const FAR_M: f32 = 5.0;

/// Pictures of a clip's frames as JPEG.
#[derive(Debug, Default, PartialEq)]
pub struct FramePictures {
    /// The sharpest of a few frames; `None` if none has a colour picture that can be decoded.
    pub thumbnail: Option<Vec<u8>>,
    /// The same few frames side by side, with depth in grey where a frame has no colour; `None` if none can be decoded.
    pub row: Option<Vec<u8>>,
}

/// Draws a few frames of the clip.
pub fn frame_pictures(clip: &Clip) -> FramePictures {
    let places = candidates(clip.frames().len(), clip.has_video());
    let mut stream = clip.stream(places.clone());
    let mut sharpest: Option<(f32, usize)> = None;
    let mut row: Vec<RgbImage> = Vec::new();
    // One by one: a phone's pictures are large.
    for _ in &places {
        let Some(Ok(frame)) = stream.next_batch(1).pop() else { continue };
        let up = up_in_camera(clip, &frame.header);
        let picture = match &frame.color {
            Some(color) => {
                let found = sharpness(color);
                if sharpest.is_none_or(|(best, _)| found > best) {
                    sharpest = Some((found, row.len()));
                }
                shrunk(color)
            }
            None => shrunk(&grey(&frame.depth)),
        };
        row.push(up.map_or(QuarterTurn::None, |up| QuarterTurn::upright(&up)).of_picture(&picture));
    }
    FramePictures {
        thumbnail: sharpest.and_then(|(_, at)| jpg(&row[at])),
        row: side_by_side(&row).and_then(|picture| jpg(&picture)),
    }
}

fn jpg(picture: &RgbImage) -> Option<Vec<u8>> {
    let mut jpg = Vec::new();
    JpegEncoder::new_with_quality(&mut jpg, QUALITY).encode_image(picture).ok()?;
    Some(jpg)
}

/// Returns the depth in grey: near is bright, no reading is black.
fn grey(depth: &DepthImage) -> RgbImage {
    RgbImage::from_fn(depth.width, depth.height, |x, y| {
        let depth_m = depth.depth_m[(y * depth.width + x) as usize];
        let is_read = depth_m.is_finite() && depth_m > 0.0;
        let bright = if is_read { 255.0 * (1.0 - depth_m / FAR_M).clamp(0.0, 1.0) } else { 0.0 };
        Rgb([bright as u8; 3])
    })
}

/// Returns the pictures in a row, centred; `None` without a picture.
fn side_by_side(pictures: &[RgbImage]) -> Option<RgbImage> {
    let height = pictures.iter().map(RgbImage::height).max()?;
    let width = pictures.iter().map(|picture| picture.width() + GAP_PX).sum::<u32>() - GAP_PX;
    let mut row = RgbImage::from_pixel(width, height, Rgb([255; 3]));
    let mut left = 0;
    for picture in pictures {
        let top = (height - picture.height()) / 2;
        imageops::replace(&mut row, picture, i64::from(left), i64::from(top));
        left += picture.width() + GAP_PX;
    }
    Some(row)
}

/// Returns evenly spaced indices of frames, without the ends of the clip: there the phone is raised and lowered.
fn candidates(frames: usize, of_video: bool) -> Vec<usize> {
    let span = if of_video { frames.min(MAX_VIDEO_FRAMES) } else { frames };
    let count = span.min(CANDIDATES);
    (0..count).map(|i| (2 * i + 1) * span / (2 * count)).collect()
}

fn shrunk(picture: &RgbImage) -> RgbImage {
    let (width, height) = picture.dimensions();
    let longest = width.max(height);
    if longest <= SIDE_PX {
        return picture.clone();
    }
    let side = |length: u32| (length * SIDE_PX).div_ceil(longest).max(1);
    imageops::thumbnail(picture, side(width), side(height))
}

/// Returns the up direction in the camera's axes (x right, y down, z forward); `None` if it is unknown.
fn up_in_camera(clip: &Clip, header: &FrameHeader) -> Option<Vector3> {
    let by_pose = || {
        let up_in_world = clip.up_in_world()?.direction;
        Some(header.world_from_camera?.rotation.inverse() * up_in_world)
    };
    by_pose().or_else(|| header.force_in_camera?.try_normalize(f64::MIN_POSITIVE))
}

#[cfg(test)]
mod tests {
    use super::*;
    use viola_formats::clip::{ClipInfo, Frame};
    use viola_geometry::{Pinhole, Pose3};

    const RED: Rgb<u8> = Rgb([250, 10, 10]);
    const BLUE: Rgb<u8> = Rgb([10, 10, 250]);

    /// Returns a picture of 640 x 360 with stripes of `width_px` in one colour and black.
    fn striped(colour: Rgb<u8>, width_px: u32) -> RgbImage {
        let ink = |x: u32| if (x / width_px).is_multiple_of(2) { colour } else { Rgb([0; 3]) };
        RgbImage::from_fn(640, 360, |x, _| ink(x))
    }

    fn clip(pictures: Vec<RgbImage>, header: &FrameHeader) -> Clip {
        let info = ClipInfo::in_memory(pictures.len(), [640, 360], [1, 1]);
        let (headers, header) = (vec![header.clone(); pictures.len()], header.clone());
        Clip::from_frames(info, headers, Some(Vector3::z()), move |index| {
            let camera = Pinhole { width: 640, height: 360, fx: 500.0, fy: 500.0, cx: 320.0, cy: 180.0 };
            Frame {
                header: header.clone(),
                color_camera: camera,
                color: Some(pictures[index].clone()).filter(|picture| picture.width() > 0),
                depth_camera: camera,
                depth: DepthImage { width: 1, height: 1, depth_m: vec![1.0] },
            }
        })
    }

    fn header(world_from_camera: Option<Pose3>) -> FrameHeader {
        FrameHeader { number: 0, time_s: None, world_from_camera, force_in_camera: None }
    }

    #[test]
    fn the_sharpest_candidate_becomes_a_jpeg_of_320_pixels() {
        // Wide stripes bend less often than narrow ones.
        let mut pictures = vec![striped(RED, 160); 5];
        pictures[3] = striped(BLUE, 20);
        let jpg = frame_pictures(&clip(pictures, &header(None))).thumbnail.unwrap();
        assert_eq!(image::guess_format(&jpg).unwrap(), image::ImageFormat::Jpeg);
        let picture = image::load_from_memory(&jpg).unwrap().to_rgb8();
        assert_eq!(picture.dimensions(), (320, 180));
        let sum = |channel: usize| picture.pixels().map(|pixel| u64::from(pixel.0[channel])).sum::<u64>();
        assert!(sum(2) > 5 * sum(0), "{} of blue, {} of red", sum(2), sum(0));
    }

    #[test]
    fn candidates_are_spread_over_the_clip_and_the_start_of_a_video() {
        assert_eq!(candidates(100, false), [10, 30, 50, 70, 90]);
        assert_eq!(candidates(3, false), [0, 1, 2]);
        assert!(candidates(0, false).is_empty());
        assert_eq!(candidates(100_000, true), [30, 90, 150, 210, 270]);
    }

    #[test]
    fn all_frames_are_shown_in_a_row() {
        let pictures = vec![striped(RED, 160), RgbImage::new(0, 0), striped(BLUE, 160)];
        let row = frame_pictures(&clip(pictures, &header(None))).row.unwrap();
        let row = image::load_from_memory(&row).unwrap().to_rgb8();
        // The depth of the second is one pixel at 1 m.
        assert_eq!(row.dimensions(), (320 + GAP_PX + 1 + GAP_PX + 320, 180));
        let sum = |left: u32, channel: usize| {
            (left..left + 320).map(|x| u32::from(row[(x, 90)].0[channel])).sum::<u32>()
        };
        assert!(sum(0, 0) > 5 * sum(0, 2) && sum(329, 2) > 5 * sum(329, 0));
    }

    #[test]
    fn a_clip_without_colour_has_no_thumbnail_but_shows_its_depth() {
        let drawn = frame_pictures(&clip(vec![RgbImage::new(0, 0)], &header(None)));
        assert_eq!(drawn.thumbnail, None);
        let row = image::load_from_memory(&drawn.row.unwrap()).unwrap().to_luma8();
        assert_eq!(row.dimensions(), (1, 1));
        assert!((i32::from(row[(0, 0)].0[0]) - 204).abs() < 8, "1 m of 5 is a fifth darker than white");
    }

    #[test]
    fn a_clip_without_frames_has_no_pictures() {
        assert_eq!(frame_pictures(&clip(Vec::new(), &header(None))), FramePictures::default());
    }
}
