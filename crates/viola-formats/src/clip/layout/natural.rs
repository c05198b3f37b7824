//! The order of names with numbers that have no zeros in front.

use std::cmp::Ordering;

/// Compares two names with each run of digits as one number: `images/9.png` is before `images/10.png`.
pub(super) fn natural_order(a: &str, b: &str) -> Ordering {
    let (mut a_rest, mut b_rest) = (a.as_bytes(), b.as_bytes());
    while let ([a_byte, a_next @ ..], [b_byte, b_next @ ..]) = (a_rest, b_rest) {
        let order = if a_byte.is_ascii_digit() && b_byte.is_ascii_digit() {
            let ((a_digits, a_after), (b_digits, b_after)) = (split_number(a_rest), split_number(b_rest));
            (a_rest, b_rest) = (a_after, b_after);
            a_digits.len().cmp(&b_digits.len()).then_with(|| a_digits.cmp(b_digits))
        } else {
            (a_rest, b_rest) = (a_next, b_next);
            a_byte.cmp(b_byte)
        };
        if order.is_ne() {
            return order;
        }
    }
    // Names that differ only in zeros in front of a number are in the order of their bytes.
    a_rest.len().cmp(&b_rest.len()).then_with(|| a.cmp(b))
}

/// Splits off the number at the start of a text, without its leading zeros.
fn split_number(text: &[u8]) -> (&[u8], &[u8]) {
    let end = text.iter().position(|byte| !byte.is_ascii_digit()).unwrap_or(text.len());
    let (digits, rest) = text.split_at(end);
    let zeros = digits.iter().take_while(|digit| **digit == b'0').count();
    (&digits[zeros..], rest)
}

#[cfg(test)]
mod tests {
    use super::natural_order;

    #[test]
    fn numbers_in_names_are_compared_by_their_values() {
        let sorted = [
            "",
            "10/2.png",
            "a",
            "a0",
            "a00",
            "a1.jpg",
            "a01.png",
            "a1.png",
            "a2.png",
            "a9b1.png",
            "a9b10.png",
            "a10.png",
            "a18446744073709551616.png",
            "a18446744073709551617.png",
            "aa.png",
            "b/frame_00009.png",
            "b/frame_00010.png",
            "ä1",
        ];
        for (index, a) in sorted.iter().enumerate() {
            for (other, b) in sorted.iter().enumerate() {
                assert_eq!(natural_order(a, b), index.cmp(&other), "{a} and {b}");
            }
        }
    }
}
