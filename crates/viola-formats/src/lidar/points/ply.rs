//! Points as PLY.

use super::{Columns, Points};
use crate::lidar::{LidarError, LidarMap, MAX_POINTS};
use crate::ply::{PlyError, Vertices};

/// Reads the vertices' x and y, in metres. Heights and further elements (faces) are ignored.
pub(in super::super) fn read_ply(bytes: &[u8]) -> Result<LidarMap, LidarError> {
    let mut vertices = Vertices::parse(bytes)?;
    let vertex = &vertices.element;
    let (Some(x), Some(y)) = (vertex.place("x"), vertex.place("y")) else {
        return Err(bad("its vertices have no x and y"));
    };
    if vertex.count > MAX_POINTS as u64 {
        return Err(LidarError::TooManyPoints { max: MAX_POINTS });
    }
    let columns = Columns { x, y, z: vertex.place("z") };
    let mut points = Points::default();
    while let Some(values) = vertices.read()? {
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
