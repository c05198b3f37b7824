//! A clip's contribution to its home's map, and its storage format.

use super::MAP_VOXEL_M;
use super::carved::CarvedSpace;
use super::ply::{UnknownFileFormat, read_cloud_ply};
use flate2::Compression;
use flate2::read::ZlibDecoder;
use flate2::write::ZlibEncoder;
use nalgebra::{Quaternion, Translation3, UnitQuaternion};
use serde::{Deserialize, Serialize};
use std::io::{Read, Write};
use std::sync::OnceLock;
use viola_align::Aligned;
use viola_geometry::{Pinhole, Pose3, Vector3};
use viola_reconstruct::{PointCloud, Readings, View};

/// A clip's points and views, in the clip's frame.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ClipContribution {
    pub cloud_in_clip: PointCloud,
    pub views: Vec<View>,
    /// The space that the views looked through; from the file, or made of the views when it is asked for.
    carved: OnceLock<CarvedSpace>,
}

impl ClipContribution {
    pub fn new(cloud_in_clip: PointCloud, views: Vec<View>) -> ClipContribution {
        ClipContribution { cloud_in_clip, views, carved: OnceLock::new() }
    }

    /// Reads a clip's files: the cloud of [`cloud_ply`](super::cloud_ply) and [`views_bytes`].
    pub fn read(cloud: &[u8], views: &[u8]) -> Result<ClipContribution, UnknownFileFormat> {
        let cloud_in_clip = read_cloud_ply(cloud, MAP_VOXEL_M)?;
        let (views, carved) = read_views(views)?;
        let carved = carved.map(OnceLock::from).unwrap_or_default();
        Ok(ClipContribution { cloud_in_clip, views, carved })
    }

    pub(crate) fn carved(&self) -> &CarvedSpace {
        self.carved.get_or_init(|| carved_space(&self.cloud_in_clip, &self.views))
    }
}

/// Returns the space that the views looked through, without that of the clip's own surface.
fn carved_space(cloud_in_clip: &PointCloud, views: &[View]) -> CarvedSpace {
    let mut carved = CarvedSpace::of(views);
    carved.keep_off(cloud_in_clip.points.iter().map(|point| &point.position_m));
    carved
}

/// A clip's virtual LiDAR hits and cameras, for drawing it at any pose.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ClipScan {
    /// Hits at the vacuum's height, in the clip's frame: z up, origin on the floor below the first camera.
    pub hits_m: Vec<[f32; 2]>,
    /// The key frames in the order of recording.
    pub cameras: Vec<ScanCamera>,
}

/// A key frame's camera in the clip's frame.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ScanCamera {
    pub position_m: [f32; 3],
    /// Viewing direction, of unit length.
    pub forward: [f32; 3],
}

impl ClipScan {
    pub fn of(aligned: &Aligned) -> ClipScan {
        let camera = |view: &View| {
            let position = view.clip_from_camera.translation.vector.map(|c| c as f32);
            let forward = (view.clip_from_camera * Vector3::z()).map(|c| c as f32);
            ScanCamera { position_m: position.into(), forward: forward.into() }
        };
        let hits = aligned.scan.hits.iter();
        ClipScan {
            hits_m: hits.map(|hit| [hit.point_m.x as f32, hit.point_m.y as f32]).collect(),
            cameras: aligned.views.iter().map(camera).collect(),
        }
    }
}

const MAGIC: &[u8; 8] = b"violav02";
/// Files of the previous version have no carved space.
const MAGIC_01: &[u8; 8] = b"violav01";
/// Maximum size of a file after inflation: far above the maximum number of key frames.
const MAX_BYTES: u64 = 64 << 20;

/// Returns a clip's views and the space that they looked through as file bytes, which [`ClipContribution::read`] reads
/// together with those of the cloud.
pub fn views_bytes(cloud_in_clip: &PointCloud, views: &[View]) -> Vec<u8> {
    let carved = carved_space(cloud_in_clip, views).to_bytes();
    let mut plain = Vec::from((carved.len() as u32).to_le_bytes());
    plain.extend_from_slice(&carved);
    for view in views {
        let (turn, place) = (view.clip_from_camera.rotation, view.clip_from_camera.translation);
        let camera = view.readings.camera();
        let pose = [turn.i, turn.j, turn.k, turn.w, place.x, place.y, place.z];
        pose.iter().for_each(|value| plain.extend_from_slice(&value.to_le_bytes()));
        [camera.width, camera.height].iter().for_each(|side| plain.extend_from_slice(&side.to_le_bytes()));
        let lens = [camera.fx, camera.fy, camera.cx, camera.cy];
        lens.iter().for_each(|value| plain.extend_from_slice(&value.to_le_bytes()));
        plain.extend_from_slice(&view.readings.width().to_le_bytes());
        plain.extend_from_slice(&view.readings.stride().to_le_bytes());
        plain.extend_from_slice(&(view.readings.depth_mm().len() as u32).to_le_bytes());
        view.readings.depth_mm().iter().for_each(|mm| plain.extend_from_slice(&mm.to_le_bytes()));
    }
    let mut packer = ZlibEncoder::new(MAGIC.to_vec(), Compression::fast());
    // Writing into a vector cannot fail.
    let _ = packer.write_all(&plain);
    packer.finish().unwrap_or_default()
}

/// Inverse of [`views_bytes`]; files of the previous version have no carved space.
fn read_views(bytes: &[u8]) -> Result<(Vec<View>, Option<CarvedSpace>), UnknownFileFormat> {
    let (magic, packed) = bytes.split_at_checked(MAGIC.len()).ok_or(UnknownFileFormat)?;
    if magic != MAGIC && magic != MAGIC_01 {
        return Err(UnknownFileFormat);
    }
    let mut plain = Vec::new();
    let unpacked = ZlibDecoder::new(packed).take(MAX_BYTES + 1).read_to_end(&mut plain);
    if unpacked.is_err() || plain.len() as u64 > MAX_BYTES {
        return Err(UnknownFileFormat);
    }
    let mut rest = plain.as_slice();
    let carved = if magic == MAGIC {
        let length = u32::from_le_bytes(take(&mut rest)?) as usize;
        Some(CarvedSpace::read(take_slice(&mut rest, length)?)?)
    } else {
        None
    };
    let mut views = Vec::new();
    while !rest.is_empty() {
        views.push(read_view(&mut rest)?);
    }
    Ok((views, carved))
}

fn read_view(rest: &mut &[u8]) -> Result<View, UnknownFileFormat> {
    let pose: [f64; 7] = take_floats(rest)?;
    let (width, height) = (u32::from_le_bytes(take(rest)?), u32::from_le_bytes(take(rest)?));
    let [fx, fy, cx, cy] = take_floats(rest)?;
    let (columns, stride) = (u16::from_le_bytes(take(rest)?), u16::from_le_bytes(take(rest)?));
    let count = u32::from_le_bytes(take(rest)?) as usize;
    let depths = take_slice(rest, count.checked_mul(2).ok_or(UnknownFileFormat)?)?;
    let [i, j, k, w, x, y, z] = pose;
    let turn = Quaternion::new(w, i, j, k);
    // Not normalised again: that would change its last bits.
    if pose.iter().any(|value| !value.is_finite()) || (turn.norm() - 1.0).abs() > 1e-6 {
        return Err(UnknownFileFormat);
    }
    let depth_mm = depths.chunks_exact(2).map(|two| u16::from_le_bytes([two[0], two[1]])).collect();
    let camera = Pinhole { width, height, fx, fy, cx, cy };
    Ok(View {
        clip_from_camera: Pose3::from_parts(Translation3::new(x, y, z), UnitQuaternion::new_unchecked(turn)),
        readings: Readings::new(camera, columns, stride, depth_mm).ok_or(UnknownFileFormat)?,
    })
}

/// Takes the next bytes.
fn take<const N: usize>(rest: &mut &[u8]) -> Result<[u8; N], UnknownFileFormat> {
    rest.split_off(..N).and_then(|head| head.try_into().ok()).ok_or(UnknownFileFormat)
}

fn take_slice<'a>(rest: &mut &'a [u8], length: usize) -> Result<&'a [u8], UnknownFileFormat> {
    rest.split_off(..length).ok_or(UnknownFileFormat)
}

fn take_floats<const N: usize>(rest: &mut &[u8]) -> Result<[f64; N], UnknownFileFormat> {
    let mut values = [0.0; N];
    for value in &mut values {
        *value = f64::from_le_bytes(take(rest)?);
    }
    Ok(values)
}

/// Returns the poses of the key frames' cameras in the clip's frame, out of the file of [`views_bytes`].
pub fn camera_poses(views: &[u8]) -> Result<Vec<Pose3>, UnknownFileFormat> {
    let (views, _) = read_views(views)?;
    Ok(views.iter().map(|view| view.clip_from_camera).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Views from nearly one place.
    fn views() -> Vec<View> {
        let camera = Pinhole { width: 640, height: 480, fx: 577.6, fy: 578.7, cx: 318.9, cy: 242.7 };
        let view = |i: u16| View {
            clip_from_camera: Pose3::new(
                Vector3::new(f64::from(i) * 0.1, 0.3, 1.4),
                Vector3::new(0.1, 0.2, 0.3),
            ),
            readings: Readings::new(camera, 4, 160, (0..12).map(|k| k * 10 + 2500 + i).collect()).unwrap(),
        };
        (0..5).map(view).collect()
    }

    #[test]
    fn what_is_written_is_read() {
        let carved = CarvedSpace::of(&views());
        assert_eq!(read_views(&views_bytes(&PointCloud::default(), &views())), Ok((views(), Some(carved))));
        assert_eq!(
            read_views(&views_bytes(&PointCloud::default(), &[])),
            Ok((Vec::new(), Some(CarvedSpace::default())))
        );
    }

    #[test]
    fn files_of_the_previous_version_are_read() {
        let now = views_bytes(&PointCloud::default(), &views());
        let mut plain = Vec::new();
        ZlibDecoder::new(&now[8..]).read_to_end(&mut plain).unwrap();
        let carved = u32::from_le_bytes(plain[..4].try_into().unwrap()) as usize;
        let mut packer = ZlibEncoder::new(MAGIC_01.to_vec(), Compression::fast());
        packer.write_all(&plain[4 + carved..]).unwrap();
        let before = packer.finish().unwrap();
        assert_eq!(read_views(&before), Ok((views(), None)));
        let cloud = super::super::cloud_ply(&PointCloud::default(), None);
        let [old, new] = [&before, &now].map(|views| ClipContribution::read(&cloud, views).unwrap());
        assert!(!new.carved().to_bytes().is_empty());
        assert_eq!(old.carved(), new.carved());
    }

    #[test]
    fn carved_space_beyond_any_home_is_refused() {
        for (place, is_near) in
            [(0, true), (1 << 20, false), (-(1 << 20), false), (i32::MAX, false), (i32::MIN, false)]
        {
            // A block: its place along x, y and z, and eight layers.
            let mut bytes = i32::to_le_bytes(place).to_vec();
            bytes.resize(3 * 4 + 8 * 8, 1);
            bytes[4..12].fill(0);
            assert_eq!(CarvedSpace::read(&bytes).is_ok(), is_near, "{place}");
        }
    }

    #[test]
    fn other_bytes_are_refused() {
        let good = views_bytes(&PointCloud::default(), &views());
        for length in 0..good.len() {
            assert_eq!(read_views(&good[..length]), Err(UnknownFileFormat), "{length}");
        }
        for at in 0..good.len() {
            let mut bytes = good.clone();
            bytes[at] ^= 0x55;
            assert!(read_views(&bytes).is_err() || at < 16, "{at}");
        }
    }
}
