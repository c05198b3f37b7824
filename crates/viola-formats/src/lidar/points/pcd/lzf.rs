//! LZF of PCD files (Marc Lehmann's liblzf): runs of bytes, and copies of earlier bytes.

/// A control byte below this is the length of a run, less one.
const FIRST_COPY: u8 = 32;
/// A copy of this length has more of its length in the next byte.
const LONG_COPY: usize = 7;

/// Unpacks exactly `size` bytes; `None` if the data is broken or has another size. Memory grows with the
/// unpacked bytes, because `size` is not trusted.
pub(super) fn unpack(packed: &[u8], size: usize) -> Option<Vec<u8>> {
    let mut out: Vec<u8> = Vec::new();
    let mut bytes = packed;
    while let Some((&control, rest)) = bytes.split_first() {
        if control < FIRST_COPY {
            let (run, rest) = rest.split_at_checked(usize::from(control) + 1)?;
            if out.len() + run.len() > size {
                return None;
            }
            out.extend_from_slice(run);
            bytes = rest;
            continue;
        }
        let mut length = usize::from(control >> 5);
        let mut rest = rest;
        if length == LONG_COPY {
            let (&more, after) = rest.split_first()?;
            length += usize::from(more);
            rest = after;
        }
        let (&low, after) = rest.split_first()?;
        let back = (usize::from(control & 0x1f) << 8 | usize::from(low)) + 1;
        let from = out.len().checked_sub(back)?;
        if out.len() + length + 2 > size {
            return None;
        }
        // A copy may overlap its own output, which repeats it.
        for index in from..from + length + 2 {
            out.push(out[index]);
        }
        bytes = after;
    }
    (out.len() == size).then_some(out)
}

#[cfg(test)]
mod tests {
    use super::unpack;

    #[test]
    fn runs_and_copies() {
        // A run of three, then a copy of six from three back: abcabcabc.
        assert_eq!(unpack(&[2, b'a', b'b', b'c', 4 << 5, 2], 9).unwrap(), b"abcabcabc");
        // A copy of 7 + 1 + 2 bytes from one back.
        assert_eq!(unpack(&[0, b'x', 7 << 5, 1, 0], 11).unwrap(), b"xxxxxxxxxxx");
        assert_eq!(unpack(&[], 0).unwrap(), b"");
        for broken in
            [&[2, b'a'][..], &[32, 0], &[0, b'a', 32, 1], &[0, b'a', 224], &[0, b'a', 224, 9], &[0, b'a', 64]]
        {
            assert_eq!(unpack(broken, 3), None, "{broken:?}");
        }
        assert_eq!(unpack(&[0, b'a'], 2), None);
        assert_eq!(unpack(&[1, b'a', b'b'], 1), None);
    }
}
