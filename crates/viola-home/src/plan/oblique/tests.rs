use super::super::evidence::Facing;
use super::*;

pub(in crate::plan) fn face(from_m: [f64; 2], direction_deg: f64, length_m: f64) -> Oblique {
    let (sin, cos) = direction_deg.to_radians().sin_cos();
    Oblique {
        from_m: Point2::from(from_m),
        along: Vector2::new(cos, sin),
        normal: Vector2::new(-sin, cos),
        length_m,
        cover: vec![1.0; (length_m / ALONG_M) as usize],
    }
}

/// An oblique wall that meets the line of a long one keeps the surface that is near this line.
#[test]
fn a_long_face_explains_surface_that_looks_its_way() {
    let long = Face {
        facing: Facing { axis: 0, up: false },
        line_m: 4.0,
        from_m: 0.0,
        to_m: 5.0,
        cover: vec![1.0; 100],
        along_m: 0.05,
        weight: 1.0,
    };
    let column = |x: f64, degrees: Option<f64>| Upright {
        at: Point2::new(x, 1.2),
        bits: 1,
        normal: degrees
            .map_or(Vector2::zeros(), |d| Vector2::new(d.to_radians().cos(), d.to_radians().sin())),
    };
    for (x, degrees, is) in [
        (4.02, Some(180.0), true),
        (4.02, Some(160.0), true),
        (4.02, Some(0.0), true),
        (4.02, Some(140.0), false),
        (4.02, None, true),
        (4.2, Some(180.0), false),
    ] {
        assert_eq!(is_explained(&column(x, degrees), &[&long]), is, "{x} {degrees:?}");
    }
}

#[test]
fn layers_of_a_face_are_one() {
    let wall = face([0.0, 0.0], 40.0, 2.0);
    // Places in the frame of the wall: along it, before it.
    for (place, direction_deg, is) in [
        ([0.5, 0.05], 40.0, true),
        ([0.5, -0.05], 45.0, true),
        ([0.5, 0.25], 40.0, true),
        ([0.5, -0.2], 40.0, false),
        ([0.5, 0.5], 40.0, false),
        ([2.5, 0.05], 40.0, false),
        ([0.5, 0.05], 70.0, false),
        ([0.5, 0.05], 220.0, false),
    ] {
        let from = wall.at(place[0]) + wall.normal * place[1];
        assert_eq!(
            is_same(&wall, &face([from.x, from.y], direction_deg, 0.8)),
            is,
            "{place:?} {direction_deg}"
        );
    }
}
