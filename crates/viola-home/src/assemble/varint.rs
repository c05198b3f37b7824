//! Numbers in few bytes: seven bits a byte, the lowest first.

use crate::ply::UnknownFileFormat;

pub(super) fn put(out: &mut Vec<u8>, mut value: u64) {
    while value >= 0x80 {
        out.push(value as u8 | 0x80);
        value >>= 7;
    }
    out.push(value as u8);
}

/// The same for numbers of either sign that are small.
pub(super) fn put_signed(out: &mut Vec<u8>, value: i64) {
    put(out, ((value << 1) ^ (value >> 63)) as u64);
}

/// The same for the three numbers of a place in a grid.
pub(super) fn put_place(out: &mut Vec<u8>, place: [i32; 3]) {
    place.iter().for_each(|c| put_signed(out, i64::from(*c)));
}

/// Reader of bytes from an untrusted file.
pub(super) struct Reader<'a>(pub &'a [u8]);

impl<'a> Reader<'a> {
    pub fn bytes(&mut self, count: usize) -> Result<&'a [u8], UnknownFileFormat> {
        let (bytes, rest) = self.0.split_at_checked(count).ok_or(UnknownFileFormat)?;
        self.0 = rest;
        Ok(bytes)
    }

    pub fn number(&mut self) -> Result<u64, UnknownFileFormat> {
        let mut value = 0;
        for shift in (0..64).step_by(7) {
            let byte = self.bytes(1)?[0];
            value |= u64::from(byte & 0x7f) << shift;
            if byte < 0x80 {
                return Ok(value);
            }
        }
        Err(UnknownFileFormat)
    }

    pub fn signed(&mut self) -> Result<i64, UnknownFileFormat> {
        let value = self.number()?;
        Ok((value >> 1) as i64 ^ -((value & 1) as i64))
    }

    pub fn place(&mut self) -> Result<[i32; 3], UnknownFileFormat> {
        let mut place = [0; 3];
        for c in &mut place {
            *c = i32::try_from(self.signed()?).map_err(|_| UnknownFileFormat)?;
        }
        Ok(place)
    }

    /// Returns a number of items of at least one byte each.
    pub fn count(&mut self) -> Result<usize, UnknownFileFormat> {
        let count = usize::try_from(self.number()?).map_err(|_| UnknownFileFormat)?;
        (count <= self.0.len()).then_some(count).ok_or(UnknownFileFormat)
    }

    pub fn narrow<T: TryFrom<u64>>(&mut self) -> Result<T, UnknownFileFormat> {
        T::try_from(self.number()?).map_err(|_| UnknownFileFormat)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn what_is_written_is_read(value in any::<u64>(), signed in any::<i64>(), small in -70i64..70) {
            let mut out = Vec::new();
            put(&mut out, value);
            put_signed(&mut out, signed);
            let before = out.len();
            put_signed(&mut out, small);
            prop_assert!(out.len() - before <= 2);
            let mut reader = Reader(&out);
            prop_assert_eq!((reader.number(), reader.signed(), reader.signed()), (Ok(value), Ok(signed), Ok(small)));
            prop_assert_eq!(reader.number(), Err(UnknownFileFormat));
        }
    }

    #[test]
    fn a_length_beyond_the_file_is_refused() {
        let mut out = Vec::new();
        put(&mut out, 3);
        out.extend([0; 3]);
        assert_eq!(Reader(&out).count(), Ok(3));
        assert_eq!(Reader(&out[..3]).count(), Err(UnknownFileFormat));
        assert_eq!(Reader(&[0xff; 12]).number(), Err(UnknownFileFormat));
    }
}
