//! Boxes of an mp4 or mov file (ISO/IEC 14496-12, section 4.2), found without trusting their sizes.
//!
//! `mp4_atom` reads the content of the relevant boxes, one at a time. Its own walk over a whole `moov` is not
//! used: it refuses a file for any unusual box, and recorders write many irrelevant ones.

use super::{VideoError, region};
use crate::container::Region;
use mp4_atom::Atom;

/// The tables of a hundred thousand frames are 3 MB; recorders add other tracks.
const MAX_MOOV_BYTES: u64 = 32 << 20;
/// Maximum number of boxes at the file's top level: a fragmented hour has some thousands.
const MAX_TOP_BOXES: usize = 10_000;

/// A box: its four letters and its content.
#[derive(Clone, Copy)]
pub struct Box<'a> {
    pub kind: [u8; 4],
    pub body: &'a [u8],
}

/// Returns the body of the file's `moov` box. A fragmented file has its own error.
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
            // Later boxes are checked only for fragments, which a finished file does not have.
        }
        at = end;
    }
    if fragments {
        return Err(VideoError::Fragmented);
    }
    match moov {
        Some(moov) => Ok(moov),
        // An interrupted recorder leaves the pictures without their table.
        None if known => Err(VideoError::Truncated),
        None => Err(VideoError::NotVideo),
    }
}

/// Returns a box's kind, and the lengths of its header and of all of it; size 0 means the rest of the file.
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

/// Returns the boxes directly inside a body. QuickTime ends some lists with zeros, which are skipped.
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

/// Returns the first box of a kind.
pub fn find<'a>(boxes: &[Box<'a>], kind: &[u8; 4]) -> Option<Box<'a>> {
    boxes.iter().find(|found| &found.kind == kind).copied()
}

/// Returns the boxes inside the first box of a kind; `missing` names it in the error.
pub fn inside<'a>(
    boxes: &[Box<'a>],
    kind: &[u8; 4],
    missing: &'static str,
) -> Result<Vec<Box<'a>>, VideoError> {
    children(find(boxes, kind).ok_or(VideoError::malformed(missing))?.body)
}

/// Reads a box of a known layout, if it exists.
pub fn read<T: Atom>(boxes: &[Box<'_>], damaged: &'static str) -> Result<Option<T>, VideoError> {
    let kind: [u8; 4] = T::KIND.into();
    let Some(found) = find(boxes, &kind) else { return Ok(None) };
    T::decode_body(&mut &found.body[..]).map(Some).map_err(|_| VideoError::malformed(damaged))
}
