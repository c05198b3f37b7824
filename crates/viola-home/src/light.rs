//! Colours as linear light, for file formats that hold light and not sRGB values, and the colour of what no picture showed.

use viola_reconstruct::NO_COLOR;

/// The colour of a surface that no picture showed.
pub const GREY: [u8; 3] = [150; 3];

/// Returns the colour in which a point is shown. Black points without light are invisible on a dark background.
pub fn shown(color: [u8; 3]) -> [u8; 3] {
    if color == NO_COLOR { GREY } else { color }
}

/// Returns an sRGB value as linear light, 0 to 1 (IEC 61966-2-1).
pub fn linear(value: u8) -> f64 {
    let c = f64::from(value) / 255.0;
    if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }
}

/// Returns an sRGB value as linear light in 65535ths.
pub fn linear_u16(value: u8) -> u16 {
    (linear(value) * f64::from(u16::MAX)).round() as u16
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn light_grows_with_the_value_and_ends_at_one() {
        let all: Vec<f64> = (0..=255).map(linear).collect();
        assert!(all.is_sorted_by(|a, b| a < b));
        assert_eq!((all[0], all[255], linear_u16(255)), (0.0, 1.0, u16::MAX));
        // IEC 61966-2-1: a value of one half is light of 0.214.
        assert!((linear(128) - 0.2159).abs() < 1e-4);
    }
}
