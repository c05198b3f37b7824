//! The PNG of Valetudo's map for Home Assistant: a picture that says to install the map card, with the JSON,
//! deflated, in a `zTXt` chunk with the keyword `ValetudoMap` (Hypfer/Valetudo,
//! `backend/lib/mqtt/handles/MapNodeMqttHandle.js`; read back by Hypfer/lovelace-valetudo-map-card,
//! `src/lib/pngUtils.ts`).

use crate::lidar::LidarError;
use crate::lidar::robot::inflate;

const SIGNATURE: &[u8] = b"\x89PNG\r\n\x1a\n";
const KEYWORD: &[u8] = b"ValetudoMap";

/// Returns the JSON in the picture; a picture without one is refused as a ROS map's image.
pub(super) fn json_in(bytes: &[u8]) -> Result<Vec<u8>, LidarError> {
    let Some(deflated) = map_chunk(bytes) else { return Err(LidarError::ImageWithoutYaml) };
    inflate(deflated)
}

/// Returns the data after the keyword and the compression method in the map's chunk.
fn map_chunk(bytes: &[u8]) -> Option<&[u8]> {
    let mut rest = bytes.strip_prefix(SIGNATURE)?;
    loop {
        let (length, after) = rest.split_first_chunk::<4>()?;
        let (kind, after) = after.split_first_chunk::<4>()?;
        let length = u32::from_be_bytes(*length) as usize;
        let data = after.get(..length)?;
        if kind == b"zTXt"
            && let Some([0, 0, deflated @ ..]) = data.strip_prefix(KEYWORD)
        {
            return Some(deflated);
        }
        // The chunk's own checksum is skipped; the deflated stream has one.
        rest = after.get(length.checked_add(4)?..)?;
    }
}
