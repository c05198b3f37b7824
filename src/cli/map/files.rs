//! The files of a home's map.

use super::clip::HomeClip;
use super::content::Content;
use super::document::{ClipDocument, LevelDocument, MapDocument};
use super::earlier;
use super::robot;
use crate::api::{objects_document, pretty_json, rooms_document};
use crate::cli::output;
use crate::jobs::{Described, Earlier, describe};
use anyhow::{Context, Result};
use serde::Serialize;
use std::collections::BTreeMap;
use std::io::Write;
use std::path::Path;
use viola_align::LevelMap;
use viola_formats::lidar::LidarMap;
use viola_geometry::LevelName;
use viola_geometry::progress::Silent;
use viola_home::{
    ClipNumbers, ClipPath, HomeMapInfo, LabelledMap, LookedThrough, MESH_TRIANGLES, Manifest, MapPoint,
    MatterFile, Mesh, MeshObject, Ply, RobotLevel, Tile, TileKey, matter, point_bytes,
};
use viola_storage::{MapClip, MapObject, MapRoom, MapScene, map_file};

/// Revision in `rooms.json` and `objects.json`: each run makes a first one.
const REVISION: i64 = 1;

/// A home's map, ready to be written.
pub struct HomeFiles<'a> {
    pub document: MapDocument,
    pub objects: Vec<MapObject>,
    pub rooms: Vec<MapRoom>,
    matter: MatterFile,
    levels: Vec<LevelFiles<'a>>,
    numbers: ClipNumbers,
    /// Of all clips in the map, with their levels.
    pub(super) paths: Vec<(LevelName, ClipPath)>,
    /// Recording time of the newest clip in the map, if known.
    pub(super) time_ms: Option<i64>,
}

/// The files of one level.
pub(super) struct LevelFiles<'a> {
    pub level: LevelName,
    pub lidar: &'a LidarMap,
    /// By name.
    plan: [(&'static str, Vec<u8>); 6],
    /// By name.
    robot: Vec<(&'static str, Vec<u8>)>,
    tiles: Vec<Tile>,
}

impl<'a> HomeFiles<'a> {
    /// `valetudo` has the files of the LiDAR maps that are Valetudo's.
    pub fn new(
        maps: &[LevelMap<'a>],
        valetudo: &BTreeMap<LevelName, Vec<u8>>,
        map: LabelledMap,
        clips: &[HomeClip],
        paths: Vec<(LevelName, ClipPath)>,
    ) -> Result<HomeFiles<'a>> {
        let LabelledMap { manifest, tiles: all_tiles, looked, .. } = map;
        let (mut objects, mut rooms) = (Vec::new(), Vec::new());
        let (mut levels, mut documents, mut for_robots) = (Vec::new(), Vec::new(), Vec::new());
        for map in maps {
            let of_level = |key: &TileKey| key.level == map.level;
            let tiles = all_tiles.iter().filter(|(key, _)| of_level(key));
            let tiles: Vec<Tile> = tiles.map(|(_, tile)| tile.clone()).collect();
            let unchanged = || LookedThrough::of(map.level, &manifest.clips);
            let looked = looked.get(&map.level).cloned().unwrap_or_else(unchanged);
            let Described { scene, plan, .. } =
                describe(*map, &tiles, &manifest.clips, &looked, &Earlier::default(), &Silent)?;
            let robot_level = robot_level(map, &scene);
            let plan_json = plan.iter().find(|(name, _)| *name == map_file::PLAN_JSON);
            let plan_json = plan_json.map_or(&[][..], |(_, json)| json);
            let json = valetudo.get(&map.level).map(Vec::as_slice);
            let robot = robot::files(&robot_level, &tiles, plan_json, json)?;
            for_robots.push(robot_level);
            let infos = manifest.tiles.iter().filter(|(key, _)| of_level(key)).map(|(_, info)| info);
            documents.push(LevelDocument {
                level: map.level,
                info: HomeMapInfo::of(infos),
                coverage: scene.coverage,
                lidar: map.lidar.info.clone(),
            });
            objects.extend(scene.objects);
            rooms.extend(scene.rooms);
            levels.push(LevelFiles { level: map.level, lidar: map.lidar, plan, robot, tiles });
        }
        let main = documents.iter().find(|level| level.level.is_main()).or(documents.first());
        let main = main.context("no LiDAR map was given")?;
        let document = MapDocument {
            coverage: main.coverage.clone(),
            lidar: main.lidar.clone(),
            clips: clip_documents(&manifest, clips)?,
            info: HomeMapInfo::of_levels(documents.iter().map(|level| &level.info)),
            levels: documents,
        };
        let numbers = ClipNumbers::new(manifest.clips.iter().map(|clip| &clip.clip));
        let time_ms = manifest.clips.iter().filter_map(|clip| clip.recorded_at_ms).max();
        let matter = matter(&for_robots);
        Ok(HomeFiles { document, objects, rooms, matter, levels, numbers, paths, time_ms })
    }

    /// Writes all files into a folder without a `map.json`, which is the last one: a folder that has it is whole.
    pub fn write(&self, out: &Path) -> Result<()> {
        for level in &self.levels {
            let folder = earlier::folder_of(out, level.level);
            output::folder(&folder)?;
            self.write_points(level, &folder.join("points.ply"))?;
            self.write_exports(level, &folder)?;
            let mesh = self.mesh(level);
            let surface =
                [("mesh.glb", mesh.glb()), ("mesh.usdz", mesh.usdz()), ("mesh.obj", mesh.obj().into_bytes())];
            for (name, bytes) in level.plan.iter().chain(&surface).chain(&level.robot) {
                output::write_bytes(&folder.join(name), bytes)?;
            }
        }
        write_json(&out.join("matter.json"), &self.matter)?;
        write_json(&out.join("rooms.json"), &rooms_document(REVISION, self.rooms.clone()))?;
        write_json(&out.join("objects.json"), &objects_document(REVISION, self.objects.clone()))?;
        write_json(&out.join("map.json"), &self.document)
    }

    pub(super) fn objects_on(&self, level: &LevelFiles) -> impl Iterator<Item = &MapObject> {
        self.objects.iter().filter(move |object| object.level == level.level)
    }

    pub(super) fn points(&self, level: &LevelFiles) -> impl Iterator<Item = MapPoint> {
        level.tiles.iter().flat_map(move |tile| self.numbers.in_map(tile))
    }

    /// Returns the surface of a level; each of its objects is a part.
    fn mesh(&self, level: &LevelFiles) -> Mesh {
        let parts: Vec<MeshObject> = self
            .objects_on(level)
            .map(|object| MeshObject { id: &object.id, class: object.class, bounds: object.bounds() })
            .collect();
        Mesh::new(&level.tiles, &parts, MESH_TRIANGLES)
    }

    /// Writes the points of a level as the API sends them.
    fn write_points(&self, level: &LevelFiles, path: &Path) -> Result<()> {
        let count = level.tiles.iter().map(|tile| tile.points.len()).sum();
        output::write_whole(path, |file| {
            file.write_all(&Ply::new(count).head())?;
            Ok(self.points(level).try_for_each(|point| file.write_all(&point_bytes(&point)))?)
        })
    }
}

fn robot_level<'a>(map: &LevelMap<'a>, scene: &MapScene) -> RobotLevel<'a> {
    RobotLevel {
        level: map.level,
        lidar: map.lidar,
        rooms: scene.rooms.iter().map(|room| room.room.clone()).collect(),
        objects: scene.objects.iter().map(MapObject::for_robot).collect(),
    }
}

/// Returns first the clips in the map, in its order, then the others.
fn clip_documents(manifest: &Manifest, clips: &[HomeClip]) -> Result<Vec<ClipDocument>> {
    let id_of = |clip: &HomeClip| clip.content.as_ref().map(Content::id);
    let mut documents = Vec::with_capacity(clips.len());
    for placed in &manifest.clips {
        let map_clip = MapClip::new(placed)?;
        let clip = clips.iter().find(|clip| id_of(clip) == Some(placed.clip));
        documents.extend(clip.map(|clip| ClipDocument::new(clip, Some(&map_clip))));
    }
    let is_placed = |clip: &&HomeClip| manifest.clips.iter().any(|placed| id_of(clip) == Some(placed.clip));
    documents.extend(clips.iter().filter(|clip| !is_placed(clip)).map(|clip| ClipDocument::new(clip, None)));
    Ok(documents)
}

fn write_json(path: &Path, value: &impl Serialize) -> Result<()> {
    let mut text = pretty_json(value);
    text.push(b'\n');
    output::write_bytes(path, text)
}
