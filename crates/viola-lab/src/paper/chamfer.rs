//! Gradient descent on the one-directional Chamfer distance (paper III-C).

use super::Descended;
use super::nearest::Nearest;
use nalgebra::Vector3;
use viola_geometry::{Point2, Pose2};

/// Adam: number of steps, learning rate in metres and radians, and the steps that halve the rate.
const STEPS: usize = 180;
const RATE: f64 = 0.1;
const HALVED_AT: [usize; 3] = [50, 100, 150];

/// Refines one start with Adam (Kingma and Ba, 2015); each step searches the nearest map points again.
pub(super) fn descend(start: &Pose2, hits_m: &[Point2], nearest: &Nearest) -> Descended {
    const KEEP_GRADIENT: f64 = 0.9;
    const KEEP_SQUARE: f64 = 0.999;
    const TINY: f64 = 1e-8;
    let mut pose = Vector3::new(start.x_m, start.y_m, start.yaw_rad);
    let (mut mean, mut square) = (Vector3::zeros(), Vector3::zeros());
    let mut rate = RATE;
    for step in 0..STEPS {
        if HALVED_AT.contains(&step) {
            rate *= 0.5;
        }
        let (_, gradient) = loss_and_gradient(&pose, hits_m, nearest);
        mean = mean * KEEP_GRADIENT + gradient * (1.0 - KEEP_GRADIENT);
        square = square * KEEP_SQUARE + gradient.component_mul(&gradient) * (1.0 - KEEP_SQUARE);
        let count = step as i32 + 1;
        let unbiased_mean = mean / (1.0 - KEEP_GRADIENT.powi(count));
        let unbiased_square = square / (1.0 - KEEP_SQUARE.powi(count));
        pose -= unbiased_mean.zip_map(&unbiased_square, |m, s| rate * m / (s.sqrt() + TINY));
    }
    let (loss, _) = loss_and_gradient(&pose, hits_m, nearest);
    Descended { map_from_clip: Pose2::new(pose.x, pose.y, pose.z), loss_m: loss / hits_m.len().max(1) as f64 }
}

/// Returns the sum of the distances and its gradient in (x, y, yaw).
fn loss_and_gradient(pose: &Vector3<f64>, hits_m: &[Point2], nearest: &Nearest) -> (f64, Vector3<f64>) {
    let (sin, cos) = pose.z.sin_cos();
    let (mut loss, mut gradient) = (0.0, Vector3::zeros());
    for hit in hits_m {
        let (rx, ry) = (cos * hit.x - sin * hit.y, sin * hit.x + cos * hit.y);
        let placed = Point2::new(rx + pose.x, ry + pose.y);
        let offset = placed - nearest.nearest(&placed);
        let distance_m = offset.norm();
        loss += distance_m;
        if distance_m > 1e-12 {
            let (ux, uy) = (offset.x / distance_m, offset.y / distance_m);
            gradient += Vector3::new(ux, uy, uy * rx - ux * ry);
        }
    }
    (loss, gradient)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_gradient_is_that_of_the_loss() {
        let points: Vec<Point2> =
            (0..40).map(|i| Point2::new((f64::from(i) * 1.7).sin() * 3.0, f64::from(i % 7))).collect();
        let hits: Vec<Point2> =
            (0..25).map(|i| Point2::new(f64::from(i % 5) * 0.61, f64::from(i / 5) * 0.43)).collect();
        let nearest = Nearest::new(&points);
        let pose = Vector3::new(0.31, -0.2, 0.4);
        let (_, gradient) = loss_and_gradient(&pose, &hits, &nearest);
        for axis in 0..3 {
            let mut step = Vector3::zeros();
            step[axis] = 1e-6;
            let loss = |p| loss_and_gradient(&p, &hits, &nearest).0;
            let slope = (loss(pose + step) - loss(pose - step)) / 2e-6;
            assert!((slope - gradient[axis]).abs() < 1e-4, "axis {axis}: {slope} {}", gradient[axis]);
        }
    }
}
