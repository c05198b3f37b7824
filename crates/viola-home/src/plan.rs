//! A home's semantic floor plan: the LiDAR map's walls, its rooms, and the furniture that the fused map shows.

mod geojson;
mod paper;
mod png;
mod svg;

use super::map_point::MapPoint;
use super::objects::Object;
use super::rooms::outline::{Outline, pieces, trace};
use super::rooms::space::Space;
use super::rooms::{Room, close};
use viola_formats::lidar::LidarMap;
use viola_geometry::Grid;
use viola_geometry::taxonomy::Class;

pub use geojson::plan_geojson;
pub use png::plan_png;
pub use svg::plan_svg;

/// Wall gaps up to twice this are closed as artefacts of the LiDAR.
const CLOSE_M: f64 = 0.05;
/// Tolerance of outlines to the cells' border: less than a cell, or walls one cell thick collapse.
const TOLERANCE_M: f64 = 0.045;
/// Minimum area of a wall piece.
const SPECK_M2: f64 = 0.015;
/// Occupied cells this near a piece of furniture belong to it.
const NEAR_FURNITURE_M: f64 = 0.06;

/// A floor plan, in metres in the LiDAR map's frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    pub min_m: [f64; 2],
    pub max_m: [f64; 2],
    /// Occupied cells that no furniture explains.
    pub walls: Vec<Outline>,
    /// Occupied cells of furniture.
    pub obstacles: Vec<Outline>,
    pub rooms: Vec<Room>,
    /// Objects with a footprint, the largest first.
    pub objects: Vec<Object>,
}

/// Returns the plan of a home. `points` is its fused map.
pub fn plan(lidar: &LidarMap, points: &[MapPoint], rooms: &[Room], objects: &[Object]) -> Plan {
    let space = Space::new(lidar, points);
    let furniture = objects.iter().filter(|object| !opens(object.class));
    let boxes: Vec<_> = furniture.map(Object::bounds).collect();
    let mut walls = Grid::filled(space.frame, false);
    let mut obstacles = walls.clone();
    for (at, _) in space.occupied.iter().enumerate().filter(|(_, occupied)| **occupied) {
        let centre = space.centre(at);
        let is_furniture = space.furniture[at]
            || boxes.iter().any(|b| {
                b.bottom_m() < 0.3 && b.holds(&[centre.x, centre.y, b.centre_m[2]], NEAR_FURNITURE_M)
            });
        let kind = if is_furniture { &mut obstacles } else { &mut walls };
        kind.cells[at] = true;
    }
    close(&mut walls, CLOSE_M);
    let least = (SPECK_M2 / (space.frame.cell_m * space.frame.cell_m)).ceil() as usize;
    let outlines = |mask: &mut Grid<bool>| {
        let (piece, count) = pieces(mask);
        let mut sizes = vec![0usize; count + 1];
        piece.iter().for_each(|piece| sizes[*piece as usize] += 1);
        for (cell, piece) in mask.cells.iter_mut().zip(piece) {
            *cell = *cell && sizes[piece as usize] >= least;
        }
        trace(mask).iter().filter_map(|outline| outline.simplified(TOLERANCE_M)).collect()
    };
    let mut drawn: Vec<Object> = objects.to_vec();
    let area = |object: &Object| object.size_m[0] * object.size_m[1];
    drawn.sort_by(|a, b| area(b).total_cmp(&area(a)).then(a.id.cmp(&b.id)));
    let (mut min_m, mut max_m) = (lidar.info.min_m, lidar.info.max_m);
    for corner in rooms.iter().flat_map(|room| &room.polygon_m) {
        for axis in 0..2 {
            min_m[axis] = min_m[axis].min(corner[axis]);
            max_m[axis] = max_m[axis].max(corner[axis]);
        }
    }
    // An object seen far outside, as in a mirror, must not shrink the home.
    drawn.retain(|object| {
        !overhead(object)
            && (0..2).all(|axis| (min_m[axis] - 0.5..max_m[axis] + 0.5).contains(&object.centre_m[axis]))
    });
    for corner in drawn.iter().flat_map(|object| object.bounds().corners()) {
        for axis in 0..2 {
            // No object is longer than this.
            min_m[axis] = min_m[axis].min(corner[axis].max(min_m[axis] - 3.0));
            max_m[axis] = max_m[axis].max(corner[axis].min(max_m[axis] + 3.0));
        }
    }
    Plan {
        min_m,
        max_m,
        walls: outlines(&mut walls),
        obstacles: outlines(&mut obstacles),
        rooms: rooms.to_vec(),
        objects: drawn,
    }
}

/// Returns whether a class is an opening, drawn as part of the walls.
pub(super) fn opens(class: Class) -> bool {
    matches!(class, Class::Door | Class::Window)
}

/// Returns whether an object hangs overhead and is not drawn. Wall units are drawn: they belong to a kitchen.
pub(super) fn overhead(object: &Object) -> bool {
    matches!(object.class, Class::Lamp | Class::Other) && object.bounds().bottom_m() > 1.5
}

/// Returns whether a class is flat on a wall or covers it: too thin for a label.
pub(super) fn hangs(class: Class) -> bool {
    matches!(class, Class::Mirror | Class::Picture | Class::Curtain)
}

/// Returns the class name with spaces: `living room` for `living_room`.
pub(super) fn words(class: Class) -> String {
    class.name().replace('_', " ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rooms::RoomSource;

    fn home(name: &str) -> (LidarMap, Vec<Room>, Vec<Object>) {
        let csv: String = (0..=60)
            .flat_map(|i| {
                let t = f64::from(i) * 0.05;
                [[t, 0.0], [t, 3.0], [0.0, t], [3.0, t]]
            })
            .map(|[x, y]| format!("{x},{y}\n"))
            .collect();
        let room = Room {
            id: "1".into(),
            name: Some(name.into()),
            source: RoomSource::LidarMap,
            area_m2: 9.0,
            polygon_m: vec![[0.0, 0.0], [3.0, 0.0], [3.0, 3.0], [0.0, 3.0]],
            holes_m: vec![vec![[1.0, 1.0], [1.0, 1.2], [1.2, 1.2], [1.2, 1.0]]],
            label_at_m: [2.0, 2.0],
        };
        let object = |class: Class, x: f64| Object {
            id: format!("{}-1", class.name()),
            class,
            confidence: 0.8,
            centre_m: [x, 1.0, 0.4],
            size_m: [0.9, 0.5, 0.8],
            yaw_rad: 0.3,
            room: Some("1".into()),
            points: 100,
            clips: vec![0],
            samples: Vec::new(),
        };
        let objects = vec![object(Class::Table, 1.5), object(Class::Door, 0.0), object(Class::Sofa, 90.0)];
        (LidarMap::read(csv.as_bytes()).unwrap(), vec![room], objects)
    }

    fn plan_of(name: &str) -> Plan {
        let (lidar, rooms, objects) = home(name);
        plan(&lidar, &[], &rooms, &objects)
    }

    #[test]
    fn a_square_of_points_has_walls_around_it() {
        let plan = plan_of("Kitchen");
        let area: f64 = plan.walls.iter().map(Outline::area_m2).sum();
        // Four walls of 3 m, one or two cells thick.
        assert!((0.4..1.6).contains(&area), "{area}");
        // An object far outside does not shrink the home.
        assert_eq!(plan.objects.len(), 2);
    }

    #[test]
    fn hostile_names_stay_text() {
        let svg = plan_svg(&plan_of("<script>alert('x')</script>&\u{0}\""));
        assert!(!svg.contains("<script") && !svg.contains('\u{0}'));
        assert!(svg.contains("&lt;script&gt;") && svg.contains("&amp;"));
        for name in ["", "\u{202e}evil", "K\u{fc}che", &"long ".repeat(1000)] {
            let plan = plan_of(name);
            assert!(image::load_from_memory(&plan_png(&plan)).is_ok(), "{name:?}");
            assert!(plan_svg(&plan).ends_with("</svg>\n"));
        }
    }

    #[test]
    fn rings_of_geojson_are_closed_and_turn_the_right_way() {
        let json = plan_geojson(&plan_of("Kitchen"));
        assert_eq!(json["type"], "FeatureCollection");
        assert!(json["frame"].as_str().unwrap().contains("metres"));
        let features = json["features"].as_array().unwrap();
        for feature in features {
            let rings = feature["geometry"]["coordinates"].as_array().unwrap();
            for (place, ring) in rings.iter().enumerate() {
                let ring: Vec<[f64; 2]> = serde_json::from_value(ring.clone()).unwrap();
                assert!(ring.len() >= 4 && ring.first() == ring.last(), "{feature}");
                let area = crate::rooms::outline::signed_area_m2(&ring);
                assert!((area > 0.0) == (place == 0), "{feature}");
            }
        }
        let kinds: Vec<&str> = features.iter().filter_map(|f| f["properties"]["kind"].as_str()).collect();
        for kind in ["room", "wall", "object", "opening"] {
            assert!(kinds.contains(&kind), "{kind}");
        }
    }

    #[test]
    fn a_map_of_one_point_has_a_plan() {
        let lidar = LidarMap::read(b"1,2\n").unwrap();
        let plan = plan(&lidar, &[], &[], &[]);
        assert!(image::load_from_memory(&plan_png(&plan)).is_ok());
    }
}
