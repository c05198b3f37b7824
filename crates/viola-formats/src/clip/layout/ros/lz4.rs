//! LZ4 frames (lz4/lz4, doc/lz4_Frame_format.md and lz4_Block_format.md). Checksums are not checked.

const MAGIC: u32 = 0x184d_2204;
/// In a block's length: the block is stored as it is.
const STORED: u32 = 1 << 31;
const HAS_DICTIONARY: u8 = 1;
const HAS_CONTENT_CHECKSUM: u8 = 1 << 2;
const HAS_CONTENT_BYTES: u8 = 1 << 3;
const HAS_BLOCK_CHECKSUMS: u8 = 1 << 4;

/// Unpacks frames to at most `max_bytes`; returns `None` for anything else.
pub(super) fn unpack(bytes: &[u8], max_bytes: usize) -> Option<Vec<u8>> {
    let mut unpacked = Vec::new();
    let mut rest = bytes;
    while !rest.is_empty() {
        rest = frame(rest, &mut unpacked, max_bytes)?;
    }
    Some(unpacked)
}

/// Unpacks a frame and returns the bytes after it.
fn frame<'a>(bytes: &'a [u8], unpacked: &mut Vec<u8>, max_bytes: usize) -> Option<&'a [u8]> {
    let (magic, bytes) = u32_of(bytes)?;
    let ([flags, _sizes], bytes) = bytes.split_first_chunk::<2>()?;
    if magic != MAGIC || flags >> 6 != 1 || flags & HAS_DICTIONARY != 0 {
        return None;
    }
    let told = if flags & HAS_CONTENT_BYTES != 0 { 8 } else { 0 };
    // The header ends with a checksum of one byte.
    let mut rest = bytes.get(told + 1..)?;
    loop {
        let (length, behind) = u32_of(rest)?;
        if length == 0 {
            return behind.get(if flags & HAS_CONTENT_CHECKSUM != 0 { 4 } else { 0 }..);
        }
        let (packed, behind) = behind.split_at_checked((length & !STORED) as usize)?;
        rest = behind.get(if flags & HAS_BLOCK_CHECKSUMS != 0 { 4 } else { 0 }..)?;
        if length & STORED != 0 {
            unpacked.extend_from_slice(packed);
        } else {
            block(packed, unpacked, max_bytes)?;
        }
        if unpacked.len() > max_bytes {
            return None;
        }
    }
}

/// Unpacks a block: literals, then a copy of earlier bytes, in turns.
fn block(mut rest: &[u8], unpacked: &mut Vec<u8>, max_bytes: usize) -> Option<()> {
    loop {
        let (&token, behind) = rest.split_first()?;
        let (literals, behind) = length(token >> 4, behind)?;
        let (literals, behind) = behind.split_at_checked(literals)?;
        unpacked.extend_from_slice(literals);
        if behind.is_empty() {
            return Some(());
        }
        let (offset, behind) = behind.split_first_chunk()?;
        let (copied, behind) = length(token & 15, behind)?;
        let copied = copied + 4;
        let from = unpacked.len().checked_sub(usize::from(u16::from_le_bytes(*offset)))?;
        if from == unpacked.len() || unpacked.len() + copied > max_bytes {
            return None;
        }
        // The copy may overlap its own end.
        for at in from..from + copied {
            unpacked.push(unpacked[at]);
        }
        rest = behind;
    }
}

/// Reads a length whose first four bits are known.
fn length(start: u8, mut rest: &[u8]) -> Option<(usize, &[u8])> {
    let mut length = usize::from(start);
    if start == 15 {
        loop {
            let (&more, behind) = rest.split_first()?;
            (length, rest) = (length + usize::from(more), behind);
            if more < 255 {
                break;
            }
        }
    }
    Some((length, rest))
}

fn u32_of(bytes: &[u8]) -> Option<(u32, &[u8])> {
    let (number, rest) = bytes.split_first_chunk()?;
    Some((u32::from_le_bytes(*number), rest))
}

#[cfg(test)]
mod tests {
    use super::unpack;

    #[test]
    fn copies_may_overlap_and_blocks_may_be_stored() {
        let header = [4, 0x22, 0x4d, 0x18, 0x60, 0x40, 0x82];
        // Four literals, a copy of 36 bytes at offset 4, then three literals.
        let block = [0x4f, b'a', b'b', b'c', b'd', 4, 0, 17, 0x30, b'x', b'y', b'z'];
        let stored = b"!?";
        let mut frame = header.to_vec();
        frame.extend((block.len() as u32).to_le_bytes());
        frame.extend(block);
        frame.extend((stored.len() as u32 | 1 << 31).to_le_bytes());
        frame.extend(stored);
        frame.extend([0; 4]);
        let wanted = ["abcd".repeat(10).as_str(), "xyz!?"].concat();
        assert_eq!(unpack(&frame, 100).as_deref(), Some(wanted.as_bytes()));
        assert_eq!(unpack(&frame, 20), None);
        for end in 1..frame.len() {
            assert_eq!(unpack(&frame[..end], 100), None, "{end}");
        }
    }
}
