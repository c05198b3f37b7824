//! A plan as GeoJSON.

use super::{Plan, opens};
use crate::rooms::outline::Outline;
use serde_json::{Value, json};

/// Returns the plan as a GeoJSON feature collection (RFC 7946, except that coordinates are metres in the
/// LiDAR map's frame, because a home's map has no place on the Earth; the foreign member `frame` says so).
pub fn plan_geojson(plan: &Plan) -> Value {
    let mut features = Vec::new();
    for room in &plan.rooms {
        let outline = Outline { ring_m: room.polygon_m.clone(), holes_m: room.holes_m.clone() };
        let properties = json!({
            "kind": "room",
            "name": room.name,
            "source": room.source,
            "area_m2": room.area_m2,
            "label_at_m": room.label_at_m,
        });
        features.push(feature(&format!("room/{}", room.id), &outline, properties));
    }
    let structure = [("wall", &plan.walls), ("obstacle", &plan.obstacles)];
    for (kind, outlines) in structure {
        for (number, outline) in (1..).zip(outlines) {
            let properties = json!({ "kind": kind, "area_m2": round(outline.area_m2()) });
            features.push(feature(&format!("{kind}/{number}"), outline, properties));
        }
    }
    for object in &plan.objects {
        let corners = object.bounds().corners().to_vec();
        let outline = Outline { ring_m: corners, holes_m: Vec::new() };
        let properties = json!({
            "kind": if opens(object.class) { "opening" } else { "object" },
            "class": object.class,
            "confidence": object.confidence,
            "room": object.room,
            "area_m2": round(object.size_m[0] * object.size_m[1]),
            "centre_m": object.centre_m,
            "size_m": object.size_m,
            "yaw_rad": object.yaw_rad,
        });
        features.push(feature(&format!("object/{}", object.id), &outline, properties));
    }
    json!({
        "type": "FeatureCollection",
        "frame": "metres in the LiDAR map's own frame, x right and y up; not longitude and latitude",
        "bbox": [plan.min_m[0], plan.min_m[1], plan.max_m[0], plan.max_m[1]],
        "features": features,
    })
}

fn feature(id: &str, outline: &Outline, properties: Value) -> Value {
    let rings = std::iter::once(&outline.ring_m).chain(&outline.holes_m);
    // GeoJSON rings repeat their first position at the end.
    let closed = rings.map(|ring| {
        ring.iter().chain(ring.first()).map(|corner| corner.map(round)).collect::<Vec<[f64; 2]>>()
    });
    json!({
        "type": "Feature",
        "id": id,
        "geometry": { "type": "Polygon", "coordinates": closed.collect::<Vec<_>>() },
        "properties": properties,
    })
}

/// Rounds to a millimetre.
fn round(metres: f64) -> f64 {
    (metres * 1e3).round() / 1e3
}
