//! The boxes of an mp4 or mov file (ISO/IEC 14496-12, section 4.2): finding them, without trusting their sizes.
//!
//! What is inside the boxes that matter is read by `mp4_atom`, one box at a time. Its own walk over a whole `moov` is
//! not used because it refuses a file for any odd box in it, and recorders write many that are of no interest here.

use super::{VideoError, region};
use crate::container::Region;
use mp4_atom::Atom;

/// The tables of a hundred thousand frames are 3 MB; recorders add other tracks.
const MAX_MOOV_BYTES: u64 = 32 << 20;
/// Boxes at the file's top level: a fragmented hour has some thousands.
const MAX_TOP_BOXES: usize = 10_000;

/// A box's four letters and what is inside.
#[derive(Clone, Copy)]
pub struct Box<'a> {
    pub kind: [u8; 4],
    pub body: &'a [u8],
}

/// The body of the file's `moov` box. A fragmented file is refused by name.
pub fn read_moov(region: &Region) -> Result<Vec<u8>, VideoError> {
    let mut at = 0;
    let mut known = false;
    let mut fragments = false;
    let mut moov = None;
    for _ in 0..MAX_TOP_BOXES {
        if region.bytes.saturating_sub(at) < 8 {
            break;
        }
        let (kind, header, size) = top_header(region, at)?;
        known |=
            matches!(&kind, b"ftyp" | b"moov" | b"mdat" | b"wide" | b"free" | b"skip" | b"pnot" | b"styp");
        if !known {
            return Err(VideoError::NotVideo);
        }
        fragments |= &kind == b"moof";
        let Some(end) = at.checked_add(size) else { break };
        if &kind == b"moov" && moov.is_none() {
            let bytes = size - header;
            if bytes > MAX_MOOV_BYTES {
                return Err(VideoError::TooLarge { what: "table", bytes, max: MAX_MOOV_BYTES });
            }
            moov = Some(region::read(region, at + header, bytes as usize)?);
            // What comes after is only looked at for fragments, which a finished file has none of.
        }
        at = end;
    }
    if fragments {
        return Err(VideoError::Fragmented);
    }
    match moov {
        Some(moov) => Ok(moov),
        // A recorder that was interrupted leaves the pictures without their table.
        None if known => Err(VideoError::Truncated),
        None => Err(VideoError::NotVideo),
    }
}

/// Kind of the box at `at`, length of its header, and length of all of it; 0 stands for the rest of the file.
fn top_header(region: &Region, at: u64) -> Result<([u8; 4], u64, u64), VideoError> {
    let head = region::read(region, at, 8)?;
    let kind = [head[4], head[5], head[6], head[7]];
    let size = u32::from_be_bytes([head[0], head[1], head[2], head[3]]);
    let (header, size) = match size {
        0 => (8, region.bytes - at),
        1 => {
            let long = region::read(region, at + 8, 8)?;
            (16, long.iter().fold(0, |size, byte| size << 8 | u64::from(*byte)))
        }
        _ => (8, u64::from(size)),
    };
    if size < header {
        return Err(VideoError::malformed("a box smaller than its own head"));
    }
    Ok((kind, header, size))
}

/// The boxes directly inside a body. QuickTime ends some lists with zeros, which are passed over.
pub fn children(mut body: &[u8]) -> Result<Vec<Box<'_>>, VideoError> {
    let mut found = Vec::new();
    while let Some((head, rest)) = body.split_first_chunk::<8>() {
        let size = u32::from_be_bytes([head[0], head[1], head[2], head[3]]) as usize;
        let kind = [head[4], head[5], head[6], head[7]];
        let (size, rest) = match size {
            0 if kind == [0; 4] => break,
            0 => (rest.len(), rest),
            1 => {
                let (long, rest) =
                    rest.split_first_chunk::<8>().ok_or(VideoError::malformed("a box without its size"))?;
                let size = u64::from_be_bytes(*long).checked_sub(16);
                (size.and_then(|size| usize::try_from(size).ok()).unwrap_or(usize::MAX), rest)
            }
            _ => (size.checked_sub(8).ok_or(VideoError::malformed("a box smaller than its own head"))?, rest),
        };
        let (inside, after) = rest
            .split_at_checked(size)
            .ok_or(VideoError::malformed("a box larger than the one around it"))?;
        found.push(Box { kind, body: inside });
        body = after;
    }
    Ok(found)
}

/// The first box of a kind.
pub fn find<'a>(boxes: &[Box<'a>], kind: &[u8; 4]) -> Option<Box<'a>> {
    boxes.iter().find(|found| &found.kind == kind).copied()
}

/// The boxes inside the first box of a kind; `missing` names it in the refusal.
pub fn inside<'a>(
    boxes: &[Box<'a>],
    kind: &[u8; 4],
    missing: &'static str,
) -> Result<Vec<Box<'a>>, VideoError> {
    children(find(boxes, kind).ok_or(VideoError::malformed(missing))?.body)
}

/// Reads a box of a known layout, if it is there.
pub fn read<T: Atom>(boxes: &[Box<'_>], damaged: &'static str) -> Result<Option<T>, VideoError> {
    let kind: [u8; 4] = T::KIND.into();
    let Some(found) = find(boxes, &kind) else { return Ok(None) };
    T::decode_body(&mut &found.body[..]).map(Some).map_err(|_| VideoError::malformed(damaged))
}
