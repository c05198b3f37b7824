//! RTAB-Map's database, as its apps for iOS and Android and its ROS nodes write it: `Node` has poses, `Data` pictures
//! and the camera's model, `Admin` the optimised poses (introlab/rtabmap, DatabaseSchema.sql, CameraModel.cpp,
//! Compression.cpp).

mod camera;

use super::text::pose_from_rows;
use super::{Cameras, ClipError, ColorAt, DepthAt, Intrinsics, Layout, Numbers, Source};
use crate::clip::files::{Coding, Part, has_ending};
use crate::clip::sqlite::{Database, Row, Table};
use crate::clip::{MAX_FRAMES, depth, picture};
use crate::container::{Container, Scratch, Spool};
use camera::Camera;
use flate2::read::ZlibDecoder;
use std::collections::BTreeMap;
use std::io::Read;
use viola_geometry::{Pose3, Vector3};

/// Maximum size of a database: an hour of a phone.
const MAX_BYTES: u64 = 64 << 30;
/// Maximum size of one packed picture.
const MAX_PICTURE_BYTES: u64 = 64 << 20;
/// Twelve numbers for each node, packed.
const MAX_POSES_BYTES: u64 = MAX_FRAMES as u64 * 64;
/// Begins depth that is packed with RVL; width and height follow.
const RVL: &[u8; 8] = b"DEPTHRVL";
/// The kind of a link that only tells the direction of gravity (rtabmap, Link.h).
const GRAVITY_LINK: i64 = 9;

/// Finds the database in a container; returns `None` if there is none.
pub(super) fn find(container: &dyn Container) -> Result<Option<Layout>, ClipError> {
    let names = container.names();
    // A file that was sent alone may have any name.
    let is_candidate = |name: &&String| names.len() == 1 || has_ending(name, ".db");
    let mut found: Option<(&String, Layout)> = None;
    for name in names.iter().filter(is_candidate) {
        let region = container.region(name, MAX_BYTES)?;
        let Some(database) = Database::open(&region, name)? else { continue };
        let (Some(node), Some(data)) = (database.table("Node"), database.table("Data")) else { continue };
        if let Some((first, _)) = found {
            return Err(ClipError::SeveralClips { first: first.clone(), second: name.clone() });
        }
        let mut notes = Vec::new();
        if container.contains(&format!("{name}-wal")) {
            notes.push(format!(
                "{name}-wal was not read: it has what RTAB-Map wrote last; close RTAB-Map first"
            ));
        }
        found = Some((
            name,
            Reader { database: &database, name, scratch: container.scratch() }.layout(node, data, notes)?,
        ));
    }
    Ok(found.map(|(_, layout)| layout))
}

/// A node's data beside its pictures.
struct Node {
    time_s: Option<f64>,
    map: i64,
    world_from_base: Option<Pose3>,
}

struct Reader<'a> {
    database: &'a Database<'a>,
    name: &'a str,
    scratch: Scratch,
}

impl Reader<'_> {
    fn layout(&self, node: &Table, data: &Table, mut notes: Vec<String>) -> Result<Layout, ClipError> {
        let mut nodes = self.nodes(node)?;
        let optimized = self.optimized()?;
        let pose_files = if optimized.is_empty() { "Node.pose" } else { "Admin.opt_poses" };
        if optimized.is_empty() {
            drop_other_maps(&mut nodes, &mut notes);
        } else {
            for (id, node) in &mut nodes {
                node.world_from_base = optimized.get(id).copied();
            }
        }
        let mut pictures = Pictures::new(self.database, &self.scratch)?;
        let columns =
            Columns::find(data).ok_or_else(|| self.bad("Data has not the columns of RTAB-Map".into()))?;
        let mut sources = Vec::new();
        self.database.rows(data, &mut |row| {
            if let Some(source) = pictures.source(self, row, &columns, &nodes)? {
                sources.push(source);
            }
            check_count(sources.len())
        })?;
        let numbers =
            pictures.numbers.unwrap_or(Numbers { fx: 0.0, fy: 0.0, cx: 0.0, cy: 0.0, of: super::Of::Depth });
        if pictures.is_distorted {
            notes.push("the lens distortion in Data.calibration was not applied".to_string());
        }
        if pictures.has_other_confidence {
            notes.push("Data.depth_confidence is in an unknown form, and was not used".to_string());
        }
        let has_gravity = self.has_gravity()?;
        let cameras = Cameras::One(Intrinsics { name: format!("{}, Data.calibration", self.name), numbers });
        Ok(Layout {
            pose_files,
            depth_unit: "millimetres of 16 bits, or metres as 32-bit floats",
            gravity: if has_gravity { "world z is up (gravity links)" } else { "unknown" }.to_string(),
            up_in_world: has_gravity.then(Vector3::z),
            color_pictures: pictures.color,
            depth_pictures: pictures.depth,
            incomplete: super::incomplete(pictures.color, pictures.depth, sources.len()),
            intrinsics: "Data.calibration, for each frame; depth is scaled to it".to_string(),
            notes,
            region: Some(pictures.spool.finish()?),
            ..Layout::new("rtabmap", cameras, sources)
        })
    }

    fn bad(&self, reason: String) -> ClipError {
        ClipError::BadMetadata { name: self.name.to_string(), reason }
    }

    fn nodes(&self, table: &Table) -> Result<BTreeMap<i64, Node>, ClipError> {
        let column = |name| table.column(name).ok_or_else(|| self.bad(format!("Node has no column {name}")));
        let (id, map, stamp, pose) = (column("id")?, column("map_id")?, column("stamp")?, column("pose")?);
        let mut nodes = BTreeMap::new();
        self.database.rows(table, &mut |row| {
            let time_s = row.real(stamp)?.filter(|time_s| time_s.is_finite() && *time_s > 0.0);
            let world_from_base = row.blob(pose, 48)?.and_then(|bytes| pose_of(&bytes));
            nodes.insert(row.id(id)?, Node { time_s, map: row.integer(map)?.unwrap_or(0), world_from_base });
            check_count(nodes.len())
        })?;
        Ok(nodes)
    }

    /// Returns the optimised poses by node; empty if RTAB-Map saved none.
    fn optimized(&self) -> Result<BTreeMap<i64, Pose3>, ClipError> {
        let mut poses = BTreeMap::new();
        let Some(admin) = self.database.table("Admin") else { return Ok(poses) };
        let (Some(ids), Some(values)) = (admin.column("opt_ids"), admin.column("opt_poses")) else {
            return Ok(poses);
        };
        self.database.rows(admin, &mut |row| {
            let unpacked = |column| {
                let packed = row.blob(column, MAX_POSES_BYTES)?;
                Ok::<_, ClipError>(packed.and_then(|bytes| unpack(&bytes)))
            };
            if let (Some(ids), Some(values)) = (unpacked(ids)?, unpacked(values)?) {
                let ids = ids.as_chunks().0.iter().map(|id| i64::from(i32::from_le_bytes(*id)));
                let values = values.as_chunks::<48>().0.iter().map(|pose| pose_of(pose));
                poses.extend(ids.zip(values).filter_map(|(id, pose)| Some((id, pose?))));
            }
            check_count(poses.len())
        })?;
        Ok(poses)
    }

    fn has_gravity(&self) -> Result<bool, ClipError> {
        let mut has_gravity = false;
        if let Some(link) = self.database.table("Link")
            && let Some(kind) = link.column("type")
        {
            self.database.rows(link, &mut |row| {
                has_gravity |= row.integer(kind)? == Some(GRAVITY_LINK);
                Ok(())
            })?;
        }
        Ok(has_gravity)
    }
}

/// Refuses more frames, nodes or poses than a clip may have frames.
fn check_count(frames: usize) -> Result<(), ClipError> {
    if frames > MAX_FRAMES {
        return Err(ClipError::TooManyFrames { frames, max: MAX_FRAMES });
    }
    Ok(())
}

/// Drops the poses of all sessions but the largest: each session has a world of its own until it is optimised.
fn drop_other_maps(nodes: &mut BTreeMap<i64, Node>, notes: &mut Vec<String>) {
    let mut counts = BTreeMap::new();
    for node in nodes.values() {
        *counts.entry(node.map).or_insert(0) += 1;
    }
    let Some((&largest, _)) = counts.iter().max_by_key(|(map, count)| (**count, std::cmp::Reverse(**map)))
    else {
        return;
    };
    if counts.len() > 1 {
        notes.push(format!(
            "the poses of {} other sessions were not used: they were not optimised",
            counts.len() - 1
        ));
        for node in nodes.values_mut().filter(|node| node.map != largest) {
            node.world_from_base = None;
        }
    }
}

struct Columns {
    id: usize,
    image: usize,
    depth: usize,
    /// `None` before version 0.22.
    confidence: Option<usize>,
    calibration: usize,
}

impl Columns {
    fn find(data: &Table) -> Option<Columns> {
        Some(Columns {
            id: data.column("id")?,
            image: data.column("image")?,
            depth: data.column("depth")?,
            confidence: data.column("depth_confidence"),
            calibration: data.column("calibration")?,
        })
    }
}

/// The pictures, copied into one file: in the database each lies scattered over many pages.
struct Pictures {
    spool: Spool,
    color: usize,
    depth: usize,
    /// Of the first frame.
    numbers: Option<Numbers>,
    is_distorted: bool,
    /// True if a confidence is not in RTAB-Map's form.
    has_other_confidence: bool,
    /// True if frames have colour: only frames with both pictures are used then.
    has_color: Option<bool>,
}

impl Pictures {
    fn new(database: &Database, scratch: &Scratch) -> Result<Pictures, ClipError> {
        let spool = Spool::new(scratch, database.bytes())?;
        Ok(Pictures {
            spool,
            color: 0,
            depth: 0,
            numbers: None,
            is_distorted: false,
            has_other_confidence: false,
            has_color: None,
        })
    }

    /// Returns the frame of a row; `None` if a picture is missing.
    fn source(
        &mut self,
        reader: &Reader,
        row: &Row,
        columns: &Columns,
        nodes: &BTreeMap<i64, Node>,
    ) -> Result<Option<Source>, ClipError> {
        let id = row.id(columns.id)?;
        let number =
            u32::try_from(id).map_err(|_| reader.bad(format!("node {id} has no possible number")))?;
        let not_empty = |bytes: &Vec<u8>| !bytes.is_empty();
        let color = row.blob(columns.image, MAX_PICTURE_BYTES)?.filter(not_empty);
        let depth = row.blob(columns.depth, MAX_PICTURE_BYTES)?.filter(not_empty);
        self.color += usize::from(color.is_some());
        self.depth += usize::from(depth.is_some());
        let Some(depth) = depth else { return Ok(None) };
        if *self.has_color.get_or_insert(color.is_some()) != color.is_some() {
            return Ok(None);
        }
        let confidence = match columns.confidence {
            Some(column) => row.blob(column, MAX_PICTURE_BYTES)?.filter(not_empty),
            None => None,
        };
        let Some(calibration) = row.blob(columns.calibration, Camera::MAX_BYTES)? else { return Ok(None) };
        let camera = Camera::parse(&calibration).map_err(|reason| ClipError::BadIntrinsics {
            name: format!("Data.calibration of node {id}"),
            reason,
        })?;
        self.is_distorted |= camera.is_distorted;
        self.numbers.get_or_insert(camera.numbers);
        let node = nodes.get(&id);
        let depth = self.depth_at(&depth, confidence.as_deref(), number)?;
        let color = match color {
            Some(bytes) => {
                let part = self.part(&bytes, Coding::Picture, number)?;
                ColorAt::Part { part, size: picture::size_of(&bytes, &part.name("colour"))? }
            }
            None => ColorAt::Absent,
        };
        Ok(Some(Source {
            time_s: node.and_then(|node| node.time_s),
            world_from_camera: node
                .and_then(|node| node.world_from_base)
                .map(|base| base * camera.base_from_camera),
            numbers: Some(camera.numbers),
            ..Source::new(number, color, depth)
        }))
    }

    /// Copies depth, and its confidence behind it.
    fn depth_at(
        &mut self,
        bytes: &[u8],
        confidence: Option<&[u8]>,
        number: u32,
    ) -> Result<DepthAt, ClipError> {
        let (part, size) = self.depth_part(bytes, number)?;
        let Some(confidence) = confidence else { return Ok(DepthAt::Part { part, size }) };
        if depth::size_of_packed(confidence).is_none() {
            self.has_other_confidence = true;
            return Ok(DepthAt::Part { part, size });
        }
        self.spool.append(confidence)?;
        // A blob has at most `MAX_PICTURE_BYTES`.
        Ok(DepthAt::Part { part: Part { confidence_bytes: confidence.len() as u32, ..part }, size })
    }

    fn depth_part(&mut self, bytes: &[u8], number: u32) -> Result<(Part, (u32, u32)), ClipError> {
        if let Some((size, packed)) = bytes.strip_prefix(RVL).and_then(<[u8]>::split_first_chunk::<8>) {
            let [width, height] = [&size[..4], &size[4..]]
                .map(|side| side.first_chunk().map_or(0, |side| u32::from_le_bytes(*side)));
            let size = picture::check_pixels(&format!("the depth of frame {number}"), width, height)?;
            return Ok((self.part(packed, Coding::Rvl(size), number)?, size));
        }
        let part = self.part(bytes, Coding::Picture, number)?;
        let name = part.name("depth");
        let coding =
            if picture::has_four_channels(bytes, &name)? { Coding::FloatPicture } else { Coding::Picture };
        Ok((Part { coding, ..part }, picture::size_of(bytes, &name)?))
    }

    fn part(&mut self, bytes: &[u8], coding: Coding, number: u32) -> Result<Part, ClipError> {
        // A blob has at most `MAX_PICTURE_BYTES`.
        let at = self.spool.append(bytes)?;
        Ok(Part { at, bytes: bytes.len() as u32, coding, number, confidence_bytes: 0 })
    }
}

/// Returns a pose of 3x4 floats, row by row; `None` if it is not a rigid motion: RTAB-Map writes zeros.
fn pose_of(bytes: &[u8]) -> Option<Pose3> {
    let rows: Vec<f64> =
        bytes.as_chunks().0.iter().map(|value| f64::from(f32::from_le_bytes(*value))).collect();
    pose_from_rows(&rows)
}

/// Unpacks RTAB-Map's arrays: zlib, then rows, columns and type in 32 bits each.
fn unpack(bytes: &[u8]) -> Option<Vec<u8>> {
    let packed = bytes.get(..bytes.len().checked_sub(12)?)?;
    let mut unpacked = Vec::new();
    ZlibDecoder::new(packed).take(MAX_POSES_BYTES).read_to_end(&mut unpacked).ok()?;
    Some(unpacked)
}
