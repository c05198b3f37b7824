//! The files of a home's map.

use super::clip::HomeClip;
use super::content::Content;
use super::document::{ClipDocument, MapDocument};
use crate::api::{objects_document, rooms_document};
use crate::jobs::{Described, Earlier, describe};
use crate::storage::{MapClip, MapObject, MapRoom};
use anyhow::{Context, Result};
use serde::Serialize;
use std::fs::{self, File};
use std::io::{BufWriter, Write};
use std::path::Path;
use viola_formats::lidar::LidarMap;
use viola_home::{Assembly, ClipNumbers, HomeMapInfo, Manifest, Ply, Tile, point_bytes};

/// Revision in `rooms.json` and `objects.json`: each run makes a first one.
const REVISION: i64 = 1;

/// A home's map, ready to be written.
pub struct HomeFiles {
    pub document: MapDocument,
    pub objects: Vec<MapObject>,
    pub rooms: Vec<MapRoom>,
    /// By name.
    plan: [(&'static str, Vec<u8>); 6],
    tiles: Vec<Tile>,
    numbers: ClipNumbers,
}

impl HomeFiles {
    pub fn new(lidar: &LidarMap, map: Assembly, clips: &[HomeClip]) -> Result<HomeFiles> {
        let Assembly { manifest, changed } = map;
        let tiles: Vec<Tile> = changed.into_values().flatten().collect();
        let Described { scene, plan, .. } = describe(lidar, &tiles, &manifest, &Earlier::default());
        let document = MapDocument {
            clips: clip_documents(&manifest, clips)?,
            info: HomeMapInfo::of(manifest.tiles.iter().map(|(_, info)| info)),
            coverage: scene.coverage,
            lidar: lidar.info.clone(),
        };
        let numbers = ClipNumbers::new(manifest.clips.iter().map(|clip| &clip.clip));
        Ok(HomeFiles { document, objects: scene.objects, rooms: scene.rooms, plan, tiles, numbers })
    }

    /// Writes all files; `map.json` is the last one, so that a folder that has it is whole.
    pub fn write(&self, out: &Path) -> Result<()> {
        self.write_points(&out.join("points.ply"))?;
        for (name, bytes) in &self.plan {
            let path = out.join(name);
            fs::write(&path, bytes).with_context(|| format!("cannot write {}", path.display()))?;
        }
        write_json(&out.join("rooms.json"), &rooms_document(REVISION, self.rooms.clone()))?;
        write_json(&out.join("objects.json"), &objects_document(REVISION, self.objects.clone()))?;
        write_json(&out.join("map.json"), &self.document)
    }

    /// Writes the points as the API sends them.
    fn write_points(&self, path: &Path) -> Result<()> {
        let write = || -> std::io::Result<()> {
            let mut file = BufWriter::new(File::create(path)?);
            file.write_all(&Ply::new(self.document.info.points).head())?;
            for point in self.tiles.iter().flat_map(|tile| self.numbers.in_map(tile)) {
                file.write_all(&point_bytes(&point))?;
            }
            file.flush()
        };
        write().with_context(|| format!("cannot write {}", path.display()))
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
    let mut text = serde_json::to_vec_pretty(value)?;
    text.push(b'\n');
    fs::write(path, text).with_context(|| format!("cannot write {}", path.display()))
}
