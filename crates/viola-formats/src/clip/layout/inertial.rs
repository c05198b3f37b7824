//! Accelerometer samples by time.

use super::trajectory::Timed;
use viola_geometry::Vector3;

/// Samples this near to a frame's time belong to it; a hand's tremor averages out in it.
const WINDOW_S: f64 = 0.02;
/// Maximum number of samples of a frame, from the first one: 25 000 a second. A hostile file has millions at one time.
const MAX_NEAR: usize = 1000;
/// Plausible forces, in g or in m/s2.
const POSSIBLE: std::ops::Range<f64> = 1e-3..1e4;

/// Samples in the order of time.
#[derive(Default)]
pub(in crate::clip) struct Forces(Vec<Timed<Vector3>>);

impl Forces {
    /// Takes samples in the camera's axes, in any order; drops those that are not finite, or implausible for
    /// gravity and a hand in any unit.
    pub(super) fn new(mut samples: Vec<Timed<Vector3>>) -> Forces {
        samples.retain(|sample| sample.time_s.is_finite() && POSSIBLE.contains(&sample.value.norm()));
        samples.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
        Forces(samples)
    }

    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Returns the mean around a time, or `None` without a sample near it.
    pub fn around(&self, time_s: f64) -> Option<Vector3> {
        let first = self.0.partition_point(|sample| sample.time_s < time_s - WINDOW_S);
        let near = self.0[first..].iter().take_while(|sample| sample.time_s <= time_s + WINDOW_S);
        let near = near.take(MAX_NEAR);
        let (sum, count) =
            near.fold((Vector3::zeros(), 0), |(sum, count), sample| (sum + sample.value, count + 1));
        (count > 0).then(|| sum / f64::from(count))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::{Duration, Instant};

    #[test]
    fn the_mean_of_what_is_near() {
        let sample = |time_s: f64, x: f64| Timed { time_s, value: Vector3::new(x, 0.0, 0.0) };
        let wrong = [f64::NAN, 1e200, 1e-200].map(|x| sample(1.0, x));
        let right = [sample(1.01, 4.0), sample(0.99, 2.0), sample(1.5, 9.0)];
        let forces = Forces::new(wrong.into_iter().chain(right).collect());
        assert_eq!(forces.around(1.0).map(|force| force.x), Some(3.0));
        assert_eq!(forces.around(1.5).map(|force| force.x), Some(9.0));
        assert_eq!(forces.around(1.25), None);
        assert!(Forces::default().around(f64::NAN).is_none());
    }

    #[test]
    fn many_samples_of_one_time_cost_a_frame_little() {
        let samples = (0..500_000).map(|_| Timed { time_s: 1.0, value: Vector3::x() });
        let forces = Forces::new(samples.collect());
        let start = Instant::now();
        assert!((0..40_000).all(|_| forces.around(1.0) == Some(Vector3::x())));
        assert!(start.elapsed() < Duration::from_secs(5), "{:?}", start.elapsed());
    }
}
