//! The start of an HEVC sequence parameter set, up to the colours (ITU-T H.265, sections 7.3.2.2, 7.3.3,
//! 7.3.4, 7.3.7 and E.2.1). The decoder parses all of it again, but does not return the colours.

use super::parameters::Sequence;

/// Returns the parameters of the pictures, or `None` if the set is broken.
pub fn parse(unit: &[u8]) -> Option<Sequence> {
    let payload = unescape(unit.get(2..)?);
    let mut bits = Bits { bytes: &payload, at: 0 };
    bits.skip(4)?;
    let sub_layers = bits.take(3)?;
    bits.skip(1)?;
    profile_tier_level(&mut bits, sub_layers)?;
    bits.exp_golomb()?;
    let chroma_format = bits.exp_golomb()?;
    if chroma_format == 3 {
        bits.skip(1)?;
    }
    let (coded_width, coded_height) = (u64::from(bits.exp_golomb()?), u64::from(bits.exp_golomb()?));
    let mut crop = [0u64; 4];
    if bits.flag()? {
        for side in &mut crop {
            *side = u64::from(bits.exp_golomb()?);
        }
    }
    let bits_luma = bits.exp_golomb()?.checked_add(8)?;
    let bits_chroma = bits.exp_golomb()?.checked_add(8)?;
    let log2_max_order = bits.exp_golomb()?.checked_add(4)?;
    let each_layer = bits.flag()?;
    for _ in 0..if each_layer { sub_layers + 1 } else { 1 } {
        for _ in 0..3 {
            bits.exp_golomb()?;
        }
    }
    for _ in 0..6 {
        bits.exp_golomb()?;
    }
    if bits.flag()? && bits.flag()? {
        scaling_lists(&mut bits)?;
    }
    bits.skip(2)?;
    if bits.flag()? {
        bits.skip(8)?;
        bits.exp_golomb()?;
        bits.exp_golomb()?;
        bits.skip(1)?;
    }
    reference_sets(&mut bits)?;
    if bits.flag()? {
        for _ in 0..bits.exp_golomb().filter(|count| *count <= 32)? {
            bits.skip(log2_max_order as usize + 1)?;
        }
    }
    bits.skip(2)?;
    let (full_range, matrix, fields) = if bits.flag()? { usability(&mut bits)? } else { (false, 2, false) };
    // The crop counts chroma samples: half the width for 4:2:0 and 4:2:2, half the height for 4:2:0.
    let unit = (if matches!(chroma_format, 1 | 2) { 2 } else { 1 }, if chroma_format == 1 { 2 } else { 1 });
    Some(Sequence {
        width: coded_width.checked_sub(unit.0 * (crop[0] + crop[1]))?,
        height: coded_height.checked_sub(unit.1 * (crop[2] + crop[3]))?,
        coded_width,
        coded_height,
        chroma_format,
        bits_luma,
        bits_chroma,
        progressive: !fields,
        matrix,
        full_range,
    })
}

fn profile_tier_level(bits: &mut Bits<'_>, sub_layers: u32) -> Option<()> {
    bits.skip(96)?;
    let mut present = Vec::new();
    for _ in 0..sub_layers {
        present.push((bits.flag()?, bits.flag()?));
    }
    if sub_layers > 0 {
        bits.skip(2 * (8 - sub_layers as usize))?;
    }
    for (profile, level) in present {
        bits.skip(if profile { 88 } else { 0 } + if level { 8 } else { 0 })?;
    }
    Some(())
}

fn scaling_lists(bits: &mut Bits<'_>) -> Option<()> {
    for size in 0..4 {
        for _ in (0..6).step_by(if size == 3 { 3 } else { 1 }) {
            if !bits.flag()? {
                bits.exp_golomb()?;
                continue;
            }
            if size > 1 {
                bits.exp_golomb()?;
            }
            for _ in 0..64.min(1 << (4 + 2 * size)) {
                bits.exp_golomb()?;
            }
        }
    }
    Some(())
}

/// Skips the short-term reference picture sets; a set may be coded as a change of the one before it.
fn reference_sets(bits: &mut Bits<'_>) -> Option<()> {
    let count = bits.exp_golomb().filter(|count| *count <= 64)?;
    let mut pictures = 0;
    for set in 0..count {
        if set > 0 && bits.flag()? {
            bits.skip(1)?;
            bits.exp_golomb()?;
            let before = pictures;
            pictures = 0;
            for _ in 0..=before {
                let used = bits.flag()?;
                if used || bits.flag()? {
                    pictures += 1;
                }
            }
        } else {
            let negative = bits.exp_golomb().filter(|count| *count <= 16)?;
            let positive = bits.exp_golomb().filter(|count| *count <= 16)?;
            pictures = negative + positive;
            for _ in 0..pictures {
                bits.exp_golomb()?;
                bits.skip(1)?;
            }
        }
    }
    Some(())
}

/// Returns full range, the code of the matrix, and whether pictures are fields.
fn usability(bits: &mut Bits<'_>) -> Option<(bool, u8, bool)> {
    const EXTENDED_ASPECT: u32 = 255;
    if bits.flag()? && bits.take(8)? == EXTENDED_ASPECT {
        bits.skip(32)?;
    }
    if bits.flag()? {
        bits.skip(1)?;
    }
    let (mut full_range, mut matrix) = (false, 2);
    if bits.flag()? {
        bits.skip(3)?;
        full_range = bits.flag()?;
        if bits.flag()? {
            bits.skip(16)?;
            matrix = bits.take(8)? as u8;
        }
    }
    if bits.flag()? {
        bits.exp_golomb()?;
        bits.exp_golomb()?;
    }
    bits.skip(1)?;
    Some((full_range, matrix, bits.flag()?))
}

/// Removes the emulation prevention bytes (section 7.3.1.1).
fn unescape(bytes: &[u8]) -> Vec<u8> {
    let mut out = Vec::with_capacity(bytes.len());
    let mut zeros = 0;
    for &byte in bytes {
        if zeros >= 2 && byte == 3 {
            zeros = 0;
            continue;
        }
        zeros = if byte == 0 { zeros + 1 } else { 0 };
        out.push(byte);
    }
    out
}

struct Bits<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl Bits<'_> {
    fn flag(&mut self) -> Option<bool> {
        let byte = self.bytes.get(self.at / 8)?;
        let bit = byte >> (7 - self.at % 8) & 1;
        self.at += 1;
        Some(bit == 1)
    }

    fn take(&mut self, count: usize) -> Option<u32> {
        let mut value = 0;
        for _ in 0..count {
            value = value << 1 | u32::from(self.flag()?);
        }
        Some(value)
    }

    fn skip(&mut self, count: usize) -> Option<()> {
        self.at += count;
        (self.at <= 8 * self.bytes.len()).then_some(())
    }

    /// Reads an unsigned or signed Exp-Golomb code as an unsigned number (section 9.2).
    fn exp_golomb(&mut self) -> Option<u32> {
        let mut zeros = 0;
        while !self.flag()? {
            zeros += 1;
            if zeros > 31 {
                return None;
            }
        }
        Some((1u32 << zeros) - 1 + self.take(zeros)?)
    }
}
