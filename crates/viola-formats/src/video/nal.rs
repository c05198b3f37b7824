//! NAL units of a sample: its kind of picture, and a check that the decoders number it like the file.
//!
//! Decoders return pictures without the number of their sample. They are counted instead, which is right only
//! if every sample is exactly one picture; this is checked here before a sample is decoded.

use super::Codec;

/// Suitability of a sample as the start of decoding.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Entry {
    /// Nothing after it needs an earlier sample (IDR).
    Closed,
    /// Pictures shown before it may need earlier samples (HEVC's CRA).
    Open,
    /// It needs other samples.
    None,
}

/// Splits a sample; each unit follows its length in `length_bytes` bytes (ISO/IEC 14496-15, section 5.3.3).
pub fn split(sample: &[u8], length_bytes: u8) -> Option<Vec<&[u8]>> {
    let mut units = Vec::new();
    let mut rest = sample;
    while !rest.is_empty() {
        let (length, after) = rest.split_at_checked(usize::from(length_bytes))?;
        let length = length.iter().fold(0usize, |length, byte| length << 8 | usize::from(*byte));
        let (unit, after) = after.split_at_checked(length)?;
        units.push(unit);
        rest = after;
    }
    Some(units)
}

/// Data of a sample for the decoders.
pub struct Picture<'a> {
    /// Units of the base layer, in order.
    pub units: Vec<&'a [u8]>,
    pub entry: Entry,
}

impl Codec {
    /// Splits a sample, and refuses what the decoders would silently ignore: a sample that is not one
    /// picture, a sequence parameter set other than the track's, and pictures after a splice.
    pub(super) fn picture<'a>(
        self,
        sample: &'a [u8],
        length_bytes: u8,
        sps: &[u8],
    ) -> Result<Picture<'a>, &'static str> {
        let units = split(sample, length_bytes).ok_or("a unit is longer than its sample")?;
        let mut picture = Picture { units: Vec::with_capacity(units.len()), entry: Entry::None };
        let mut pictures = 0;
        for unit in units {
            let Some(kind) = self.kind(unit) else { continue };
            match kind {
                Kind::Slice { first, entry } => {
                    pictures += usize::from(first);
                    if pictures == 1 && first {
                        picture.entry = entry;
                    }
                }
                Kind::Sequence if unit != sps => return Err("the sequence parameters change"),
                Kind::Refused(what) => return Err(what),
                Kind::Sequence | Kind::Other => {}
            }
            picture.units.push(unit);
        }
        if pictures == 1 { Ok(picture) } else { Err("a sample is not one picture") }
    }

    /// Returns the kind of a unit (tables 7-1 of ITU-T H.264 and H.265), or `None` if decoders ignore it.
    fn kind(self, unit: &[u8]) -> Option<Kind> {
        let head = *unit.first().filter(|head| *head & 0x80 == 0)?;
        match self {
            Codec::H264 => Some(match head & 0x1f {
                // The number of its first macroblock is an Exp-Golomb code, and 0 is a single set bit.
                kind @ (1 | 5) => Kind::Slice {
                    first: unit.get(1)? & 0x80 != 0,
                    entry: if kind == 5 { Entry::Closed } else { Entry::None },
                },
                2..=4 => Kind::Refused("data partitioning"),
                7 => Kind::Sequence,
                _ => Kind::Other,
            }),
            Codec::Hevc => {
                let second = *unit.get(1)?;
                let layer = (head & 1) << 5 | second >> 3;
                if layer != 0 || second & 7 == 0 {
                    return None;
                }
                Some(match head >> 1 {
                    16..=18 => Kind::Refused("a splice"),
                    kind @ 0..=31 => Kind::Slice {
                        first: unit.get(2)? & 0x80 != 0,
                        entry: match kind {
                            19 | 20 => Entry::Closed,
                            21 => Entry::Open,
                            _ => Entry::None,
                        },
                    },
                    33 => Kind::Sequence,
                    36 | 37 => Kind::Refused("an end of sequence within the track"),
                    _ => Kind::Other,
                })
            }
        }
    }
}

enum Kind {
    Slice { first: bool, entry: Entry },
    Sequence,
    Other,
    Refused(&'static str),
}
