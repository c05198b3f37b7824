//! ROS 2's encoding of messages: CDR of OMG's RTPS, with numbers aligned to their size after a header of four bytes.

/// Reads the members of a message in order; each returns `None` after the end.
pub(super) struct Cdr<'a> {
    bytes: &'a [u8],
    at: usize,
    is_big_endian: bool,
}

impl<'a> Cdr<'a> {
    /// Returns `None` if the message is not plain CDR.
    pub fn new(message: &'a [u8]) -> Option<Cdr<'a>> {
        let (header, bytes) = message.split_first_chunk::<4>()?;
        let is_plain = header[0] == 0 && header[1] <= 1;
        is_plain.then_some(Cdr { bytes, at: 0, is_big_endian: header[1] == 0 })
    }

    fn take<const N: usize>(&mut self) -> Option<[u8; N]> {
        let from = self.at.next_multiple_of(N);
        let mut bytes: [u8; N] = self.bytes.get(from..)?.first_chunk().copied()?;
        self.at = from + N;
        if self.is_big_endian {
            bytes.reverse();
        }
        Some(bytes)
    }

    pub fn u8(&mut self) -> Option<u8> {
        self.take().map(u8::from_le_bytes)
    }

    pub fn u32(&mut self) -> Option<u32> {
        self.take().map(u32::from_le_bytes)
    }

    fn f64(&mut self) -> Option<f64> {
        self.take().map(f64::from_le_bytes)
    }

    pub fn f64s<const N: usize>(&mut self) -> Option<[f64; N]> {
        let mut values = [0.0; N];
        for value in &mut values {
            *value = self.f64()?;
        }
        Some(values)
    }

    /// Returns the bytes of a sequence of bytes.
    pub fn bytes(&mut self) -> Option<&'a [u8]> {
        let count = self.u32()? as usize;
        let bytes = self.bytes.get(self.at..)?.get(..count)?;
        self.at += count;
        Some(bytes)
    }

    pub fn text(&mut self) -> Option<&'a str> {
        let bytes = self.bytes()?;
        std::str::from_utf8(bytes.strip_suffix(&[0]).unwrap_or(bytes)).ok()
    }
}

#[cfg(test)]
mod tests {
    use super::Cdr;

    #[test]
    fn numbers_are_aligned_in_both_byte_orders() {
        let little = [0, 1, 0, 0, 7, 0, 0, 0, 2, 0, 0, 0, b'a', 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0xf0, 0x3f];
        let little = [&little[..], &[0; 0]].concat();
        let mut cdr = Cdr::new(&little[..]).unwrap();
        assert_eq!((cdr.u8(), cdr.text()), (Some(7), Some("a")));
        let mut big = vec![0, 0, 0, 0];
        big.extend(9u32.to_be_bytes());
        big.extend([0; 4]);
        big.extend(2.5f64.to_be_bytes());
        let mut cdr = Cdr::new(&big).unwrap();
        assert_eq!((cdr.u32(), cdr.f64s()), (Some(9), Some([2.5])));
        assert_eq!(cdr.u8(), None);
        assert!(Cdr::new(&[0, 3, 0, 0]).is_none() && Cdr::new(&[]).is_none());
    }
}
