//! The file of a clip's features.

use super::ply::UnknownFileFormat;
use flate2::Compression;
use flate2::read::ZlibDecoder;
use flate2::write::ZlibEncoder;
use std::io::{Read, Write};
use viola_reconstruct::{DESCRIPTOR_BYTES, Descriptor, Feature, MAX_FEATURES};

const MAGIC: &[u8; 8] = b"violaf01";
/// Position, heading and description of a feature.
const FEATURE_BYTES: usize = 4 * 4 + DESCRIPTOR_BYTES;

/// Returns the features of a clip as file bytes, which [`read_features`] reads.
pub fn features_bytes(features: &[Feature]) -> Vec<u8> {
    let mut packer = ZlibEncoder::new(MAGIC.to_vec(), Compression::fast());
    for feature in features {
        let [x, y, z] = feature.position_m;
        // Writing into a vector cannot fail.
        for number in [x, y, z, feature.heading_rad] {
            let _ = packer.write_all(&number.to_le_bytes());
        }
        let _ = packer.write_all(&feature.descriptor.0);
    }
    packer.finish().unwrap_or_default()
}

/// Inverse of [`features_bytes`]. Refuses more than [`MAX_FEATURES`] features and numbers that are not finite.
pub fn read_features(bytes: &[u8]) -> Result<Vec<Feature>, UnknownFileFormat> {
    let (magic, packed) = bytes.split_at_checked(MAGIC.len()).ok_or(UnknownFileFormat)?;
    if magic != MAGIC {
        return Err(UnknownFileFormat);
    }
    let most = MAX_FEATURES * FEATURE_BYTES;
    let mut plain = Vec::new();
    let unpacked = ZlibDecoder::new(packed).take(most as u64 + 1).read_to_end(&mut plain);
    let (features, rest) = plain.as_chunks::<FEATURE_BYTES>();
    if unpacked.is_err() || plain.len() > most || !rest.is_empty() {
        return Err(UnknownFileFormat);
    }
    features.iter().map(feature).collect()
}

fn feature(bytes: &[u8; FEATURE_BYTES]) -> Result<Feature, UnknownFileFormat> {
    let (numbers, descriptor) = bytes.split_at(4 * 4);
    let values = [0, 1, 2, 3].map(|at| f32::from_le_bytes(numbers.as_chunks::<4>().0[at]));
    if values.iter().any(|value| !value.is_finite()) {
        return Err(UnknownFileFormat);
    }
    let [x, y, z, heading_rad] = values;
    let descriptor = Descriptor(descriptor.try_into().map_err(|_| UnknownFileFormat)?);
    Ok(Feature { position_m: [x, y, z], heading_rad, descriptor })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn some(count: usize) -> Vec<Feature> {
        let feature = |i: usize| Feature {
            position_m: [i as f32 * 0.01, -0.5, 1.5],
            heading_rad: 0.1,
            descriptor: Descriptor(std::array::from_fn(|k| (i * 7 + k * 13) as u8)),
        };
        (0..count).map(feature).collect()
    }

    #[test]
    fn what_is_written_is_read() {
        for count in [0, 1, MAX_FEATURES] {
            assert_eq!(read_features(&features_bytes(&some(count))), Ok(some(count)));
        }
    }

    #[test]
    fn too_many_features_and_other_bytes_are_refused() {
        assert_eq!(read_features(&features_bytes(&some(MAX_FEATURES + 1))), Err(UnknownFileFormat));
        let mut infinite = some(2);
        infinite[1].heading_rad = f32::INFINITY;
        assert_eq!(read_features(&features_bytes(&infinite)), Err(UnknownFileFormat));
        let good = features_bytes(&some(5));
        for length in 0..good.len() {
            assert_eq!(read_features(&good[..length]), Err(UnknownFileFormat), "{length}");
        }
    }
}
