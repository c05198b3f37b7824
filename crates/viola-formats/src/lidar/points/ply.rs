//! Points as PLY.

use super::records::{Columns, Points};
use crate::lidar::{LidarError, LidarMap, MAX_POINTS};
use crate::ply::{Ply, PlyError};

/// Reads the vertices' x and y, in metres. Heights and further elements (faces) are ignored.
pub(in super::super) fn read_ply(bytes: &[u8]) -> Result<LidarMap, LidarError> {
    let Ply { elements, mut numbers } = Ply::parse(bytes)?;
    let vertex = elements.first().filter(|element| element.name == "vertex");
    let vertex = vertex.ok_or_else(|| bad("its first element is not vertex"))?;
    if vertex.properties.iter().any(|property| property.length.is_some()) {
        return Err(bad("its vertices have list properties"));
    }
    let (Some(x), Some(y)) = (vertex.place("x"), vertex.place("y")) else {
        return Err(bad("its vertices have no x and y"));
    };
    if vertex.count > MAX_POINTS as u64 {
        return Err(LidarError::TooManyPoints { max: MAX_POINTS });
    }
    let columns = Columns { x, y, z: vertex.place("z") };
    let mut points = Points::default();
    let mut values = Vec::with_capacity(vertex.properties.len());
    for index in 0..vertex.count {
        values.clear();
        let row = numbers.begin_row();
        row.map_err(|error| bad(format!("vertex {index} of {}: {error}", vertex.count)))?;
        for property in &vertex.properties {
            let value = numbers.next(property.kind);
            values.push(value.map_err(|error| bad(format!("vertex {index} of {}: {error}", vertex.count)))?);
        }
        points.add(&columns, |column| values[column])?;
    }
    points.into_map("ply_points", Vec::new())
}

fn bad(reason: impl Into<String>) -> LidarError {
    LidarError::BadPly { reason: reason.into() }
}

impl From<PlyError> for LidarError {
    fn from(error: PlyError) -> LidarError {
        bad(error.to_string())
    }
}
