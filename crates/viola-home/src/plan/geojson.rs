//! A plan as GeoJSON and as plain JSON, in the LiDAR map's frame.

use super::model::{Opening, Plan};
use super::page::image::PlanImage;
use super::symbols::outline_m;
use crate::rooms::outline::Outline;
use serde_json::{Value, json};
use viola_geometry::Point2;

/// Name of the coordinate system: as WKT (OGC 01-009), which GDAL and its users read.
const CRS: &str = "LOCAL_CS[\"LiDAR map\",UNIT[\"metre\",1]]";
const FRAME: &str = "metres in the LiDAR map's own frame, x right and y up; not longitude and latitude";

/// Returns the plan as a GeoJSON feature collection (RFC 7946, except that coordinates are metres in the
/// LiDAR map's frame, because a home's map has no place on the Earth; the member `crs` of GeoJSON 2008 tells it to programs,
/// the foreign member `frame` to people).
pub fn plan_geojson(plan: &Plan) -> Value {
    let mut features = Vec::new();
    for (number, room) in (1..).zip(&plan.rooms) {
        // A room in several parts has several features.
        let id = match &room.id {
            Some(id) if plan.is_further_part(number - 1) => format!("{id}/{number}"),
            Some(id) => id.clone(),
            None => format!("plan-{number}"),
        };
        let properties = json!({
            "kind": "room",
            "name": room.name,
            "room": room.id,
            "area_m2": round(room.area_m2),
            "label_at_m": in_map(plan, room.label_at_m),
        });
        features.push(polygon(plan, &format!("room/{id}"), &room.outline, properties));
    }
    for (number, outline) in (1..).zip(&plan.masonry) {
        let properties = json!({ "kind": "wall", "area_m2": round(outline.area_m2()) });
        features.push(polygon(plan, &format!("wall/{number}"), outline, properties));
    }
    for wall in &plan.walls {
        features.push(json!({
            "type": "Feature",
            "id": format!("wall-line/{}", wall.id),
            "geometry": {
                "type": "LineString",
                "coordinates": [in_map(plan, wall.from_m), in_map(plan, wall.to_m)],
            },
            "properties": {
                "kind": "wall_line",
                "thickness_m": round(wall.thickness_m),
                "is_measured": wall.is_measured,
                "filmed_fraction": wall.filmed_fraction,
            },
        }));
    }
    for opening in &plan.openings {
        let outline = Outline { ring_m: opening.corners_m().to_vec(), holes_m: Vec::new() };
        let properties = json!({
            "kind": "opening",
            "class": opening.kind,
            "width_m": round(opening.width_m()),
            "sill_m": opening.sill_m.map(round),
            "head_m": opening.head_m.map(round),
            "swing": swing(plan, opening),
        });
        features.push(polygon(plan, &format!("opening/{}", opening.id), &outline, properties));
    }
    for piece in &plan.furniture {
        let outline = Outline { ring_m: outline_m(piece), holes_m: Vec::new() };
        let properties = json!({ "kind": "object", "class": piece.class, "object": piece.id });
        features.push(polygon(plan, &format!("object/{}", piece.id), &outline, properties));
    }
    let (low, high) = bounds(&features);
    json!({
        "type": "FeatureCollection",
        "crs": { "type": "name", "properties": { "name": CRS } },
        "frame": FRAME,
        "plan_yaw_rad": plan.map_from_plan.yaw_rad,
        "bbox": [low[0], low[1], high[0], high[1]],
        "features": features,
    })
}

/// Returns the plan's model as JSON: `walls`, `openings`, `rooms` and `furniture`, and the frame of the PNG as `image`.
pub fn plan_json(plan: &Plan) -> Value {
    let ring = |ring: &Vec<[f64; 2]>| ring.iter().map(|p| in_map(plan, *p)).collect::<Vec<_>>();
    let walls = plan.walls.iter().map(|wall| {
        let mut rooms: Vec<&String> = Vec::new();
        for id in wall.rooms.iter().filter_map(|at| plan.rooms.get(*at)?.id.as_ref()) {
            if !rooms.contains(&id) {
                rooms.push(id);
            }
        }
        json!({
            "id": wall.id,
            "from_m": in_map(plan, wall.from_m),
            "to_m": in_map(plan, wall.to_m),
            "length_m": round(wall.length_m()),
            "thickness_m": round(wall.thickness_m),
            "is_measured": wall.is_measured,
            "filmed_fraction": wall.filmed_fraction,
            "rooms": rooms,
        })
    });
    let openings = plan.openings.iter().map(|opening| {
        json!({
            "id": opening.id,
            "kind": opening.kind,
            "from_m": in_map(plan, opening.from_m),
            "to_m": in_map(plan, opening.to_m),
            "width_m": round(opening.width_m()),
            "thickness_m": round(opening.thickness_m),
            "sill_m": opening.sill_m.map(round),
            "head_m": opening.head_m.map(round),
            "swing": swing(plan, opening),
        })
    });
    let rooms = plan.rooms.iter().map(|room| {
        json!({
            "id": room.id,
            "name": room.name,
            "area_m2": round(room.area_m2),
            "polygon_m": ring(&room.outline.ring_m),
            "holes_m": room.outline.holes_m.iter().map(ring).collect::<Vec<_>>(),
            "label_at_m": in_map(plan, room.label_at_m),
        })
    });
    let furniture = plan.furniture.iter().map(|piece| {
        json!({
            "object": piece.id,
            "class": piece.class,
            "centre_m": in_map(plan, piece.centre_m),
            "size_m": piece.size_m.map(round),
            "yaw_rad": piece.yaw_rad + plan.map_from_plan.yaw_rad,
            "polygon_m": ring(&outline_m(piece)),
        })
    });
    json!({
        "frame": FRAME,
        "plan_yaw_rad": plan.map_from_plan.yaw_rad,
        "image": PlanImage::of(plan),
        "walls": walls.collect::<Vec<_>>(),
        "openings": openings.collect::<Vec<_>>(),
        "rooms": rooms.collect::<Vec<_>>(),
        "furniture": furniture.collect::<Vec<_>>(),
    })
}

fn swing(plan: &Plan, opening: &Opening) -> Value {
    opening.swing.map_or(Value::Null, |swing| {
        json!({
            "hinge_m": in_map(plan, swing.hinge_m),
            "open_m": in_map(plan, swing.open_m),
            "closed_m": in_map(plan, swing.closed_m),
        })
    })
}

fn polygon(plan: &Plan, id: &str, outline: &Outline, properties: Value) -> Value {
    let rings = std::iter::once(&outline.ring_m).chain(&outline.holes_m);
    // GeoJSON rings repeat their first position at the end.
    let closed = rings.map(|ring| {
        ring.iter().chain(ring.first()).map(|corner| in_map(plan, *corner)).collect::<Vec<[f64; 2]>>()
    });
    json!({
        "type": "Feature",
        "id": id,
        "geometry": { "type": "Polygon", "coordinates": closed.collect::<Vec<_>>() },
        "properties": properties,
    })
}

/// Returns the box of all positions of features.
fn bounds(features: &[Value]) -> ([f64; 2], [f64; 2]) {
    fn visit(value: &Value, low: &mut [f64; 2], high: &mut [f64; 2]) {
        let Some(list) = value.as_array() else { return };
        if let [Some(x), Some(y)] = [0, 1].map(|axis| list.get(axis).and_then(Value::as_f64)) {
            for (axis, at) in [x, y].into_iter().enumerate() {
                low[axis] = low[axis].min(at);
                high[axis] = high[axis].max(at);
            }
        } else {
            list.iter().for_each(|inner| visit(inner, low, high));
        }
    }
    let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    features.iter().for_each(|feature| visit(&feature["geometry"]["coordinates"], &mut low, &mut high));
    if low[0] > high[0] { ([0.0; 2], [0.0; 2]) } else { (low, high) }
}

fn in_map(plan: &Plan, [x, y]: [f64; 2]) -> [f64; 2] {
    let at = plan.map_from_plan.apply(&Point2::new(x, y));
    [round(at.x), round(at.y)]
}

/// Rounds to a millimetre.
fn round(metres: f64) -> f64 {
    // Adding zero makes -0 and 0 equal.
    (metres * 1e3).round() / 1e3 + 0.0
}
