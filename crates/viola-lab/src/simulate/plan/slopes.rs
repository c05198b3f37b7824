//! Sloped ceilings of attics.

use super::{OpeningKind, Plan, RoomKind};
use crate::simulate::rng::Rng;
use viola_geometry::Point2;

/// A roof window in a slope, as intervals in metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::simulate) struct RoofWindow {
    /// Along the outer wall, in the home's frame.
    pub along: [f64; 2],
    /// Along the slope, from the knee wall on.
    pub up: [f64; 2],
}

/// A part of a room's ceiling that slopes down to a knee wall at an outer wall.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::simulate) struct Slope {
    pub room: usize,
    /// True if the outer wall is along x.
    pub along_x: bool,
    /// Interval of the wall within the room.
    pub along: [f64; 2],
    /// Coordinate of the outer wall's inner face, across the wall.
    pub face: f64,
    /// Direction into the room across the wall, -1 or 1.
    pub inward: f64,
    /// Height of the knee wall, and of the slope's upper edge.
    pub heights_m: [f64; 2],
    /// Horizontal distance of the upper edge from the outer wall.
    pub run_m: f64,
    pub windows: Vec<RoofWindow>,
}

impl Slope {
    /// Returns the height of the slope's plane above a point of the floor; beyond its upper edge higher than
    /// the ceiling.
    pub fn height_at(&self, point: &Point2) -> f64 {
        let across = if self.along_x { point.y } else { point.x };
        let fraction = (across - self.face) * self.inward / self.run_m;
        self.heights_m[0] + fraction * (self.heights_m[1] - self.heights_m[0])
    }

    pub fn length_m(&self) -> f64 {
        self.run_m.hypot(self.heights_m[1] - self.heights_m[0])
    }
}

/// Gives some homes sloped ceilings along one or two opposite sides. Windows under a slope are removed.
pub(super) fn add(plan: &mut Plan, rng: &mut Rng) {
    if !rng.chance(0.2) {
        return;
    }
    let along_x = rng.chance(0.5);
    let (knee_m, steep) = (rng.between(0.9, 1.6), rng.between(0.7, 1.3));
    for room in 0..plan.rooms.len() {
        for inward in [1.0, -1.0] {
            if let Some(slope) = slope(plan, room, along_x, inward, knee_m, steep, rng)
                && !plan.slopes.iter().any(|other| other.room == room)
            {
                plan.openings.retain(|opening| !is_cut(&slope, opening));
                plan.slopes.push(slope);
            }
        }
    }
}

/// Returns the slope at a side of a room; none if the side is not entirely an outer wall, if the room is too
/// narrow, or if a door is in the way.
fn slope(
    plan: &Plan,
    room: usize,
    along_x: bool,
    inward: f64,
    knee_m: f64,
    steep: f64,
    rng: &mut Rng,
) -> Option<Slope> {
    let space = &plan.rooms[room];
    let (along, across) = if along_x { (0, 1) } else { (1, 0) };
    let edge = |rect: &super::Rect| if inward > 0.0 { rect.min[across] } else { rect.max[across] };
    let line = edge(&space.outline);
    plan.walls.iter().find(|wall| {
        wall.along_x == along_x
            && (wall.line - line).abs() < 1e-6
            && wall.rooms == if inward > 0.0 { [None, Some(room)] } else { [Some(room), None] }
            && wall.from <= space.outline.min[along] + 1e-6
            && wall.to >= space.outline.max[along] - 1e-6
    })?;
    // The lamp in the middle hangs from the level part.
    let run_m = ((plan.ceiling_m - knee_m) / steep).min(0.4 * space.inner.size(across));
    if run_m < 0.5 || space.inner.size(across) < 2.2 || space.kind == RoomKind::Corridor {
        return None;
    }
    let mut slope = Slope {
        room,
        along_x,
        along: [space.inner.min[along], space.inner.max[along]],
        face: edge(&space.inner),
        inward,
        heights_m: [knee_m, plan.ceiling_m],
        run_m,
        windows: vec![],
    };
    let blocks = |opening: &&super::Opening| opening.kind != OpeningKind::Window && is_cut(&slope, opening);
    if plan.openings.iter().any(|opening| blocks(&opening)) {
        return None;
    }
    let length = slope.length_m();
    let wide = slope.along[1] - slope.along[0];
    if length > 1.3 && wide > 1.6 && rng.chance(0.8) {
        let width = rng.between(0.55, 0.95);
        let at = rng.between(slope.along[0] + 0.3, slope.along[1] - width - 0.3);
        let low = rng.between(0.2, length - 1.0);
        let up = [low, (low + rng.between(0.7, 1.2)).min(length - 0.15)];
        slope.windows.push(RoofWindow { along: [at, at + width], up });
    }
    Some(slope)
}

/// Returns whether an opening of the slope's room reaches above the slope.
fn is_cut(slope: &Slope, opening: &super::Opening) -> bool {
    let zone = opening.zone(0.3);
    opening.rooms.contains(&Some(slope.room))
        && zone.corners().iter().any(|corner| slope.height_at(corner) < opening.head_m + 0.1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::{Home, HomeParams, Set};
    use viola_geometry::taxonomy::Class;
    use viola_geometry::{Point3, Vector3};

    #[test]
    fn sloped_ceilings_bound_their_rooms() {
        let (mut sloped, mut checked) = (0, 0);
        for seed in 0..40 {
            let home = Home::generate(&HomeParams::new(Set::Normal, seed));
            for slope in &home.plan.slopes {
                sloped += 1;
                for k in 1..20 {
                    for fraction in [0.1, 0.5, 0.9] {
                        let along = slope.along[0] + f64::from(k) / 20.0 * (slope.along[1] - slope.along[0]);
                        let across = slope.face + slope.inward * fraction * slope.run_m;
                        let at = if slope.along_x { [along, across] } else { [across, along] };
                        let eye = Point3::new(at[0], at[1], 0.75 * slope.heights_m[0]);
                        let hit = home.scene().cast(&eye, &Vector3::z(), 9.0);
                        let Some(hit) = hit.filter(|_| !home.scene().is_inside(&eye)) else { continue };
                        // Furniture and chimneys are below, the reveals of roof windows above.
                        if home.scene().class(hit.solid) == Class::Ceiling {
                            let above = eye.z + hit.distance - slope.height_at(&eye.xy());
                            assert!(above > -1e-6 && above < 0.5, "{seed}: {eye} {above}");
                            checked += usize::from(above < 1e-6);
                        }
                    }
                }
            }
        }
        assert!(sloped >= 4 && checked > 20 * sloped, "{sloped} slopes, {checked} rays");
    }

    #[test]
    fn nobody_walks_where_the_ceiling_is_low() {
        for seed in 0..25 {
            let home = Home::generate(&HomeParams::new(Set::Normal, seed));
            if home.plan.slopes.is_empty() {
                continue;
            }
            let clip = home.clip(&home.survey(), 0, &Default::default());
            for pose in &clip.truth.home_from_camera {
                let at = Point2::from(pose.translation.vector.xy());
                let Some(room) = home.plan.room_at(&at) else { continue };
                let mut slopes = home.plan.slopes.iter().filter(|slope| slope.room == room);
                assert!(slopes.all(|slope| slope.height_at(&at) > 1.9), "{seed}: {at}");
            }
        }
    }
}
