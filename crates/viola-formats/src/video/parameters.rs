//! Parameters of the pictures from the sequence parameter set, checked before decoding.

use super::hevc_sps;
use super::{Codec, VideoError};
use mp4_atom::Colr;
use rust_h264::nal::{parse_avcc, parse_sps_info};

/// 8K is 7680 wide.
const MAX_SIDE: u32 = 8192;
/// A child's memory holds 16 reference pictures of this size, and as many that wait to be shown.
const MAX_PIXELS: u64 = 16 << 20;
/// The code for "unspecified" of ITU-T H.273.
const UNSPECIFIED: u8 = 2;

/// Size, depth and colour of the pictures of a track.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Format {
    pub width: u32,
    pub height: u32,
    /// Bits per sample: 8 or 10.
    pub bits: u8,
    pub colour: Colour,
}

/// Matrix and range of the conversion to RGB (ITU-T H.273).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Colour {
    /// Code of the matrix, table 4; 2 is "unspecified".
    pub matrix: u8,
    pub full_range: bool,
}

/// Parameters of the pictures, for either codec.
pub struct Sequence {
    pub width: u64,
    pub height: u64,
    pub coded_width: u64,
    pub coded_height: u64,
    pub chroma_format: u32,
    pub bits_luma: u32,
    pub bits_chroma: u32,
    pub progressive: bool,
    pub matrix: u8,
    pub full_range: bool,
}

impl Format {
    /// Reads the track's parameter set; the file's `colr` box is the fallback for unspecified colours.
    pub fn read(codec: Codec, sps: &[u8], box_colour: Option<&Colr>) -> Result<Format, VideoError> {
        let sequence = match codec {
            Codec::H264 => h264(sps),
            Codec::Hevc => hevc_sps::parse(sps),
        };
        let s = sequence.ok_or(VideoError::malformed("the sequence parameters"))?;
        if s.chroma_format != 1 {
            return Err(VideoError::Unsupported { what: "a chroma format other than 4:2:0" });
        }
        if s.bits_luma != s.bits_chroma || !matches!(s.bits_luma, 8 | 10) {
            return Err(VideoError::Unsupported { what: "neither 8 nor 10 bits a sample" });
        }
        if !s.progressive {
            return Err(VideoError::Unsupported { what: "interlaced pictures" });
        }
        let (width, height) = (s.width, s.height);
        let side = u64::from(MAX_SIDE);
        let pixels = s.coded_width.saturating_mul(s.coded_height);
        if width == 0 || height == 0 || s.coded_width > side || s.coded_height > side || pixels > MAX_PIXELS {
            return Err(VideoError::Size { width, height, max_side: MAX_SIDE, max_pixels: MAX_PIXELS });
        }
        if width % 2 != 0 || height % 2 != 0 {
            return Err(VideoError::Unsupported { what: "an odd width or height" });
        }
        let colour = colour(&s, box_colour);
        if !super::colour::is_known(colour) {
            return Err(VideoError::Unsupported {
                what: "a colour matrix other than BT.601, BT.709 and BT.2020",
            });
        }
        Ok(Format { width: width as u32, height: height as u32, bits: s.bits_luma as u8, colour })
    }
}

fn colour(sequence: &Sequence, from_box: Option<&Colr>) -> Colour {
    let said = Colour { matrix: sequence.matrix, full_range: sequence.full_range };
    if said.matrix != UNSPECIFIED {
        return said;
    }
    match from_box {
        Some(Colr::Nclx { matrix_coefficients, full_range_flag, .. }) => Colour {
            matrix: u8::try_from(*matrix_coefficients).unwrap_or(u8::MAX),
            full_range: said.full_range || *full_range_flag,
        },
        Some(Colr::Nclc { matrix_coefficients, .. }) => {
            Colour { matrix: u8::try_from(*matrix_coefficients).unwrap_or(u8::MAX), ..said }
        }
        _ => said,
    }
}

fn h264(sps: &[u8]) -> Option<Sequence> {
    let mut sized = u32::try_from(sps.len()).ok()?.to_be_bytes().to_vec();
    sized.extend_from_slice(sps);
    let units = parse_avcc(&sized, 4);
    let info = parse_sps_info(units.first()?).ok()?;
    Some(Sequence {
        width: info.width.into(),
        height: info.height.into(),
        coded_width: info.coded_width.into(),
        coded_height: info.coded_height.into(),
        chroma_format: info.chroma_format,
        bits_luma: info.bit_depth_luma,
        bits_chroma: info.bit_depth_chroma,
        progressive: info.progressive,
        matrix: info.matrix,
        full_range: info.full_range,
    })
}
