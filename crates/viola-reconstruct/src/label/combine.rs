//! Combines pictures, shapes and segments into one class for each site.

use super::likeliest::{ByClass, by_class, likeliest, likeliest_in_structure};
use super::structure::Shape;
use super::vote::Votes;
use crate::cloud::Label;
use rayon::prelude::*;
use viola_geometry::taxonomy::{CLASSES, Class};

/// Maximum number of pictures that count for a site's weight in its segment.
const MAX_VIEWS: f32 = 20.0;

/// Returns the labels by pictures alone.
pub(super) fn voted(votes: &Votes) -> Vec<Label> {
    let sites = votes.sums.par_chunks_exact(CLASSES).zip(&votes.views);
    sites.map(|(sums, &views)| likeliest(sums, views)).collect()
}

/// Returns the labels by shapes alone.
pub(super) fn shaped(shapes: &[Shape]) -> Vec<Label> {
    shapes.iter().map(by_shape).collect()
}

// Chosen by reasoning, not measured: level planes are rarely wrong; doors and curtains look like walls.
fn by_shape(shape: &Shape) -> Label {
    match shape {
        Shape::Floor => Label::new(Class::Floor, 0.95, 0),
        Shape::Wall => Label::new(Class::Wall, 0.8, 0),
        Shape::Ceiling => Label::new(Class::Ceiling, 0.95, 0),
        Shape::Front | Shape::Upright | Shape::Loose => Label::new(Class::Other, 0.8, 0),
    }
}

/// Returns the labels by the surface network, and by shapes alone where it has no answer: the geometric mean of the
/// probabilities `said` of a site and those of the site's segment, times the square root of the shape's likelihood.
/// Chosen on simulated homes (docs/experiments.md, Classes).
pub(super) fn surfaced(
    segments: &[u32],
    shapes: &[Shape],
    said: impl Fn(usize) -> Option<ByClass> + Sync,
) -> Vec<Label> {
    let mut pools = pools(segments);
    for (site, segment) in segments.iter().enumerate() {
        let pool = &mut pools[*segment as usize];
        pool.iter_mut().zip(said(site).iter().flatten()).for_each(|(sum, p)| *sum += p);
    }
    let label = |(site, (shape, segment)): (usize, (&Shape, &u32))| {
        let Some(said) = said(site) else { return by_shape(shape) };
        let pool = &pools[*segment as usize];
        let weight = |i: usize| (said[i] * pool[i] * likelihood(*shape, Class::ALL[i])).sqrt();
        likeliest(&std::array::from_fn::<f32, CLASSES, _>(weight), 0)
    };
    shapes.par_iter().zip(segments).enumerate().map(label).collect()
}

/// Returns zeros for each segment.
fn pools(segments: &[u32]) -> Vec<ByClass> {
    vec![[0f32; CLASSES]; segments.iter().max().map_or(0, |last| *last as usize + 1)]
}

/// Weight of the surface network beside the pictures, as an exponent of its probabilities.
const SURFACE_WEIGHT: f32 = 1.0 / 3.0;
/// Added to the surface network's probabilities, so that no class is ruled out by it.
const SURFACE_DOUBT: f32 = 0.02;

/// Labels without pictures, for segments that no picture saw.
pub(super) struct Alone {
    pub labels: Vec<Label>,
    /// True if they also count beside the pictures, with [`SURFACE_WEIGHT`].
    pub is_voter: bool,
}

impl Alone {
    /// Returns the factor of each class at a site beside the pictures.
    fn factors(&self, site: usize) -> ByClass {
        if !self.is_voter {
            return [1.0; CLASSES];
        }
        by_class(&self.labels[site]).map(|p| (p + SURFACE_DOUBT).powf(SURFACE_WEIGHT))
    }
}

/// Returns the labels by both, pooled over segments. The shape counts twice: it weights a site's votes for
/// its segment, and then the votes of the segment for each site. The likeliest structure is chosen first.
/// `votes` are those of the pictures for a site, and their number.
pub(super) fn combined(
    segments: &[u32],
    shapes: &[Shape],
    votes: impl Fn(usize) -> (ByClass, u16) + Sync,
    alone: &Alone,
) -> Vec<Label> {
    let mut pieces = pools(segments);
    for (site, &segment) in segments.iter().enumerate() {
        let (sums, views) = votes(site);
        let Some(said) = weighed(sums, views, shapes[site]) else { continue };
        let views = f32::from(views).min(MAX_VIEWS);
        for (sum, p) in pieces[segment as usize].iter_mut().zip(said) {
            *sum += views * p;
        }
    }
    segments
        .par_iter()
        .enumerate()
        .map(|(site, &segment)| {
            let mut said = pieces[segment as usize];
            let factors = alone.factors(site);
            for ((p, class), factor) in said.iter_mut().zip(Class::ALL).zip(factors) {
                *p *= likelihood(shapes[site], *class) * factor;
            }
            if said.iter().sum::<f32>() > 0.0 {
                likeliest_in_structure(&said, votes(site).1)
            } else {
                alone.labels[site]
            }
        })
        .collect()
}

/// Returns the votes for a site weighted by its shape, with sum one; `None` if no picture saw it.
fn weighed(sums: ByClass, views: u16, shape: Shape) -> Option<ByClass> {
    if views == 0 {
        return None;
    }
    let said: ByClass = std::array::from_fn(|i| sums[i] * likelihood(shape, Class::ALL[i]));
    let total: f32 = said.iter().sum();
    (total > 0.0).then(|| said.map(|p| p / total))
}

/// Returns the likelihood of a shape given a class, up to a factor for each shape. Walls carry doors,
/// windows, pictures and curtains; a floor carries rugs; hardly anything else lies in these planes. Wall is
/// weighted below its fraction of the surface, because networks call unknown surface a wall.
fn likelihood(shape: Shape, class: Class) -> f32 {
    use Class::*;
    match shape {
        Shape::Floor => match class {
            Floor => 1.0,
            Rug => 0.6,
            _ => 0.05,
        },
        Shape::Ceiling => match class {
            Ceiling => 1.0,
            Wall => 0.07,
            _ => 0.05,
        },
        Shape::Wall => match class {
            Door | Window => 1.0,
            Curtain => 0.8,
            Wall => 0.55,
            Mirror | Picture => 0.6,
            // Some are as tall as the room and as flat as a wall.
            Cabinet | Shelf | Refrigerator | Shower => 0.6,
            Floor | Ceiling => 0.01,
            _ => 0.3,
        },
        Shape::Front => match class {
            Wall => 0.18,
            Door => 0.7,
            Window => 0.5,
            Floor | Ceiling => 0.01,
            _ => 1.0,
        },
        Shape::Upright => match class {
            Wall => 0.28,
            Door | Window => 0.7,
            Floor | Ceiling => 0.01,
            _ => 1.0,
        },
        Shape::Loose => match class {
            Wall => 0.08,
            Floor => 0.03,
            Ceiling => 0.05,
            Door => 0.4,
            Window => 0.5,
            _ => 1.0,
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wall_with_openings_is_no_furniture_if_a_picture_saw_it() {
        let mut said = [0f32; CLASSES];
        for (class, p) in
            [(Class::Wall, 0.25), (Class::Door, 0.16), (Class::Window, 0.14), (Class::Cabinet, 0.45)]
        {
            said[class as usize] = p;
        }
        let alone = Alone { labels: vec![Label::NONE], is_voter: false };
        let class = |shape: Shape, views: u16| {
            let votes = |_| (if views > 0 { said } else { [0.0; CLASSES] }, views);
            combined(&[0], &[shape], votes, &alone)[0].class
        };
        assert_eq!(class(Shape::Wall, 3), Class::Door);
        assert_eq!(class(Shape::Front, 3), Class::Cabinet);
        assert_eq!(class(Shape::Wall, 0), Label::NONE.class);
        // The surface network alone decides by families.
        assert_eq!(surfaced(&[0], &[Shape::Wall], |_| Some(said))[0].class, Class::Cabinet);
    }
}
