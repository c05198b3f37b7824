//! The exponential function over rows of numbers, written so that the compiler vectorises it.

/// Returns e^`x` for finite `x <= 88`, to a few units in the last place; e^-87 below -87.
///
/// `x` is split into a multiple of ln(2) and a remainder within +-ln(2)/2, whose exponential is the Taylor
/// series to the sixth order. Adding 1.5 * 2^23 leaves the binary exponent in the lowest bits of the sum.
#[inline(always)]
pub(super) fn exp(x: f32) -> f32 {
    const WHOLE: f32 = 12_582_912.0;
    const LN2_HIGH: f32 = 0.693_359_4;
    const LN2_LOW: f32 = -2.121_944_4e-4;
    let x = if x > -87.0 { x } else { -87.0 };
    let turns = x * std::f32::consts::LOG2_E + WHOLE;
    let whole = turns - WHOLE;
    let rest = (x - whole * LN2_HIGH) - whole * LN2_LOW;
    let series = 1.0 / 720.0;
    let series = series * rest + 1.0 / 120.0;
    let series = series * rest + 1.0 / 24.0;
    let series = series * rest + 1.0 / 6.0;
    let series = series * rest + 0.5;
    let series = series * rest + 1.0;
    let series = series * rest + 1.0;
    f32::from_bits(series.to_bits().wrapping_add(turns.to_bits() << 23))
}

/// Returns 1 / (1 + e^-x).
#[inline(always)]
pub(super) fn sigmoid(x: f32) -> f32 {
    let x = if x < 80.0 { x } else { 80.0 };
    let power = exp(if x > -80.0 { x } else { -80.0 });
    power / (1.0 + power)
}

/// Returns whether all values are finite; without branches, so that it costs little.
pub fn all_finite(values: &[f32]) -> bool {
    // Zero times a finite value is zero; zero times any other value is NaN.
    let mut sums = [0.0f32; 16];
    let chunks = values.chunks_exact(16);
    let rest: f32 = chunks.remainder().iter().map(|v| v * 0.0).sum();
    for chunk in chunks {
        for (sum, value) in sums.iter_mut().zip(chunk) {
            *sum += value * 0.0;
        }
    }
    (sums.iter().sum::<f32>() + rest) == 0.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn powers_are_those_of_the_standard_library() {
        for step in 0..=175_000 {
            let x = step as f32 * 1e-3 - 87.0;
            let (got, want) = (f64::from(exp(x)), f64::from(x).exp());
            assert!((got / want - 1.0).abs() < 5e-7, "{x}: {got} {want}");
            let want = 1.0 / (1.0 + f64::from(-x).exp());
            assert!((f64::from(sigmoid(x)) - want).abs() < 3e-7, "{x}");
        }
        assert!(exp(-1e9) < 1e-37);
        assert!(sigmoid(-1e30) < 1e-30);
        assert_eq!(sigmoid(1e30), 1.0);
    }

    #[test]
    fn every_place_is_looked_at() {
        let mut values = vec![1e30f32; 37];
        assert!(all_finite(&values));
        for place in 0..values.len() {
            for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
                let good = std::mem::replace(&mut values[place], bad);
                assert!(!all_finite(&values), "{bad} at {place}");
                values[place] = good;
            }
        }
    }
}
