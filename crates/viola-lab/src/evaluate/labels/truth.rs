//! True classes of a mesh's vertices.

use super::coarse;
use crate::evaluate::{Mesh, MeshError};
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use viola_geometry::Point3;
use viola_geometry::taxonomy::{Class, ClassTable};

/// Vertices of a labelled mesh, in the recording's world.
pub struct Truth {
    pub vertices_m: Vec<Point3>,
    /// Coarse classes; none if unlabelled.
    pub classes: Vec<Option<usize>>,
}

#[derive(Debug, thiserror::Error)]
pub enum TruthError {
    #[error("the labelled mesh: {0}")]
    Mesh(#[from] MeshError),
    #[error("{path}: {source}")]
    Unreadable { path: PathBuf, source: std::io::Error },
    #[error("{path} has no columns 'id' and 'nyu40id', separated by tabs")]
    NoColumns { path: PathBuf },
}

/// ScanNet's table from its label ids to NYU40's.
const TABLE: &str = "scannet-labels.combined.tsv";

/// Mapping from a mesh's label numbers to classes.
pub struct Folding {
    /// From the data set's ids to NYU40's; none if the mesh has NYU40's.
    nyu40: Option<HashMap<u32, usize>>,
}

impl Folding {
    /// Opens the mapping: labels are ScanNet's ids if ScanNet's table is in the scene's folder or its parent,
    /// otherwise NYU40's ids.
    pub fn open(scene: &Path) -> Result<Folding, TruthError> {
        let folders = [Some(scene), scene.parent()];
        let table = folders.into_iter().flatten().map(|f| f.join(TABLE)).find(|path| path.is_file());
        Ok(Folding { nyu40: table.map(|path| read(&path)).transpose()? })
    }

    /// Returns our class of a label; none for 0, which is unlabelled.
    pub fn class(&self, label: u32) -> Option<Class> {
        let id = match &self.nyu40 {
            Some(table) => table.get(&label).copied().unwrap_or(0),
            None => label as usize,
        };
        // Labels missing from the table are still labelled: their class is `Other`.
        (label != 0).then(|| ClassTable::Nyu40.fold(id))
    }
}

impl Truth {
    /// Opens the labelled mesh in `scene/mesh`; [`Folding`] maps its labels.
    pub fn open(scene: &Path) -> Result<Truth, TruthError> {
        let mesh = Mesh::open_labelled_in(&scene.join("mesh"))?;
        let folding = Folding::open(scene)?;
        let class = |label: &u32| folding.class(*label).map(coarse);
        Ok(Truth { classes: mesh.labels.iter().map(class).collect(), vertices_m: mesh.vertices_m })
    }
}

fn read(path: &Path) -> Result<HashMap<u32, usize>, TruthError> {
    let text = std::fs::read_to_string(path)
        .map_err(|source| TruthError::Unreadable { path: path.to_owned(), source })?;
    let mut lines = text.lines().map(|line| line.split('\t').collect::<Vec<_>>());
    let header = lines.next().unwrap_or_default();
    let column = |name: &str| header.iter().position(|column| *column == name);
    let (Some(id), Some(nyu40)) = (column("id"), column("nyu40id")) else {
        return Err(TruthError::NoColumns { path: path.to_owned() });
    };
    // Skip rows without a number in either column.
    let row = |row: Vec<&str>| Some((row.get(id)?.parse().ok()?, row.get(nyu40)?.parse().ok()?));
    Ok(lines.filter_map(row).collect())
}
