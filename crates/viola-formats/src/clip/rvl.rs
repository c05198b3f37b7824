//! Depth packed by RVL: runs of missing and of valid readings, and differences in groups of three bits (Wilson, "Fast
//! Lossless Depth Image Compression", 2017).

/// Unpacks `pixels` readings; returns `None` if there are fewer, or if a run is longer than the picture.
pub(super) fn unpack(bytes: &[u8], pixels: usize) -> Option<Vec<u16>> {
    let mut numbers = Numbers { words: bytes.as_chunks().0, word: 0, nibbles: 0 };
    let mut readings = Vec::with_capacity(pixels);
    let mut last = 0u16;
    while readings.len() < pixels {
        let zeros = numbers.next()? as usize;
        let valid_from = readings.len().checked_add(zeros).filter(|end| *end <= pixels)?;
        readings.resize(valid_from, 0);
        let valid = numbers.next()? as usize;
        if valid > pixels - readings.len() || zeros + valid == 0 {
            return None;
        }
        for _ in 0..valid {
            let zigzag = numbers.next()?;
            let difference = (zigzag >> 1) as i32 ^ -((zigzag & 1) as i32);
            last = last.wrapping_add(difference as u16);
            readings.push(last);
        }
    }
    Some(readings)
}

/// The numbers of a stream of nibbles, the highest of each 32-bit word first.
struct Numbers<'a> {
    words: &'a [[u8; 4]],
    word: u32,
    nibbles: u32,
}

impl Numbers<'_> {
    fn next(&mut self) -> Option<u32> {
        let mut value = 0;
        // Eleven groups hold 33 bits.
        for group in 0..11 {
            if self.nibbles == 0 {
                let (word, rest) = self.words.split_first()?;
                (self.word, self.words, self.nibbles) = (u32::from_le_bytes(*word), rest, 8);
            }
            let nibble = self.word >> 28;
            self.word <<= 4;
            self.nibbles -= 1;
            value |= (nibble & 7).checked_shl(3 * group).unwrap_or(0);
            if nibble < 8 {
                return Some(value);
            }
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::unpack;
    use proptest::prelude::*;

    /// Packs as the paper does.
    fn pack(readings: &[u16]) -> Vec<u8> {
        let mut nibbles = Vec::new();
        let mut put = |mut value: u32| {
            while value > 7 {
                nibbles.push(8 | (value & 7) as u8);
                value >>= 3;
            }
            nibbles.push(value as u8);
        };
        let (mut rest, mut last) = (readings, 0i32);
        while !rest.is_empty() {
            let zeros = rest.iter().take_while(|reading| **reading == 0).count();
            let valid = rest[zeros..].iter().take_while(|reading| **reading != 0).count();
            put(zeros as u32);
            put(valid as u32);
            for &reading in &rest[zeros..zeros + valid] {
                let difference = i32::from(reading) - last;
                put(((difference << 1) ^ (difference >> 31)) as u32);
                last = i32::from(reading);
            }
            rest = &rest[zeros + valid..];
        }
        nibbles.resize(nibbles.len().next_multiple_of(8), 0);
        let word = |eight: &[u8]| eight.iter().fold(0u32, |word, nibble| (word << 4) | u32::from(*nibble));
        nibbles.chunks(8).flat_map(|eight| word(eight).to_le_bytes()).collect()
    }

    proptest! {
        #[test]
        fn packed_readings_are_unpacked(
            readings in prop::collection::vec(prop_oneof![Just(0u16), 1..5000u16, Just(u16::MAX)], 1..200),
        ) {
            prop_assert_eq!(unpack(&pack(&readings), readings.len()), Some(readings));
        }

        #[test]
        fn any_bytes_end(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
            let readings = unpack(&bytes, 1000);
            prop_assert!(readings.is_none_or(|readings| readings.len() == 1000));
        }
    }
}
