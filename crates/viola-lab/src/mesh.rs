//! Triangle meshes, as PLY: of scenes, and of furniture.

use std::io::Read;
use std::path::{Path, PathBuf};
use viola_formats::ply::{Ply, PlyError};
use viola_geometry::Point3;

/// A triangle mesh with shared vertices, in metres.
#[derive(Debug, Clone, PartialEq)]
pub struct Mesh {
    pub vertices_m: Vec<Point3>,
    pub triangles: Vec<[u32; 3]>,
    /// The vertices' property `label`; empty if absent.
    pub labels: Vec<u32>,
}

#[derive(Debug, thiserror::Error)]
pub enum MeshError {
    #[error("there is no .ply file in {folder}; give a LiDAR map with --lidar instead")]
    NoFile { folder: PathBuf },
    #[error("no mesh in {folder} has vertices with a property 'label'")]
    NoLabels { folder: PathBuf },
    #[error("{path}: {source}")]
    Unreadable { path: PathBuf, source: std::io::Error },
    #[error("{path} is larger than {MAX_FILE_BYTES} bytes")]
    TooLarge { path: PathBuf },
    #[error("{path} is no PLY mesh: {source}")]
    Bad { path: PathBuf, source: PlyError },
}

const MAX_FILE_BYTES: u64 = 1 << 30;

impl Mesh {
    /// Opens the mesh with the shortest file name in a folder: names of labelled meshes are longer.
    pub fn open_in(folder: &Path) -> Result<Mesh, MeshError> {
        Mesh::open(&Mesh::files_in(folder)?[0])
    }

    /// Opens the first mesh of a folder with labelled vertices.
    pub fn open_labelled_in(folder: &Path) -> Result<Mesh, MeshError> {
        for path in Mesh::files_in(folder)? {
            let mesh = Mesh::open(&path)?;
            if !mesh.labels.is_empty() {
                return Ok(mesh);
            }
        }
        Err(MeshError::NoLabels { folder: folder.to_owned() })
    }

    /// Returns the folder's PLY files, at least one.
    fn files_in(folder: &Path) -> Result<Vec<PathBuf>, MeshError> {
        let entries = std::fs::read_dir(folder)
            .map_err(|source| MeshError::Unreadable { path: folder.to_owned(), source })?;
        let mut paths: Vec<PathBuf> = entries
            .filter_map(|entry| Some(entry.ok()?.path()))
            .filter(|path| path.extension().is_some_and(|e| e.eq_ignore_ascii_case("ply")))
            .collect();
        // The plain mesh has the shortest name; others add attributes to the same surface.
        paths.sort_by_key(|path| (path.as_os_str().len(), path.clone()));
        if paths.is_empty() { Err(MeshError::NoFile { folder: folder.to_owned() }) } else { Ok(paths) }
    }

    pub fn open(path: &Path) -> Result<Mesh, MeshError> {
        let unreadable = |source| MeshError::Unreadable { path: path.to_owned(), source };
        let file = std::fs::File::open(path).map_err(unreadable)?;
        let mut bytes = Vec::new();
        file.take(MAX_FILE_BYTES + 1).read_to_end(&mut bytes).map_err(unreadable)?;
        if bytes.len() as u64 > MAX_FILE_BYTES {
            return Err(MeshError::TooLarge { path: path.to_owned() });
        }
        Mesh::read(&bytes).map_err(|source| MeshError::Bad { path: path.to_owned(), source })
    }

    fn read(bytes: &[u8]) -> Result<Mesh, PlyError> {
        let Ply { elements, mut numbers } = Ply::parse(bytes)?;
        let (mut vertices_m, mut triangles, mut labels) = (Vec::new(), Vec::new(), Vec::new());
        for element in elements.iter().filter(|element| !element.properties.is_empty()) {
            let xyz = ["x", "y", "z"].map(|name| element.place(name));
            for _ in 0..element.count {
                let mut at = [f64::NAN; 3];
                for (index, property) in element.properties.iter().enumerate() {
                    match property.length {
                        Some(length) => {
                            let corners = numbers.next(length)?;
                            if !(0.0..=255.0).contains(&corners) {
                                return Err(PlyError::new(format!("a face with {corners} corners")));
                            }
                            let mut face = Vec::with_capacity(corners as usize);
                            for _ in 0..corners as usize {
                                face.push(numbers.next(property.kind)? as u32);
                            }
                            if element.name == "face" && property.name.starts_with("vertex_ind") {
                                // Split polygons into triangle fans.
                                triangles.extend(face.windows(2).skip(1).map(|w| [face[0], w[0], w[1]]));
                            }
                        }
                        None => {
                            let value = numbers.next(property.kind)?;
                            if let Some(axis) = xyz.iter().position(|p| *p == Some(index)) {
                                at[axis] = value;
                            } else if element.name == "vertex" && property.name == "label" {
                                labels.push(value as u32);
                            }
                        }
                    }
                }
                if element.name == "vertex" {
                    vertices_m.push(Point3::from(at));
                }
            }
        }
        let is_placed = |i: &u32| {
            vertices_m.get(*i as usize).is_some_and(|v| v.coords.iter().all(|c: &f64| c.is_finite()))
        };
        if !triangles.iter().flatten().all(is_placed) {
            return Err(PlyError::new("a face has a corner that is no vertex with finite x, y and z"));
        }
        if triangles.is_empty() {
            return Err(PlyError::new("it has no faces"));
        }
        Ok(Mesh { vertices_m, triangles, labels })
    }

    /// Returns the corners of all triangles.
    pub fn corners(&self) -> impl Iterator<Item = [Point3; 3]> + '_ {
        self.triangles.iter().map(|corners| corners.map(|i| self.vertices_m[i as usize]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ASCII: &str = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\n\
        property float z\nproperty uchar red\nelement face 1\nproperty list uchar int vertex_indices\n\
        end_header\n0 0 0 9\n1 0 0 9\n1 1 0.5 9\n0 1 0 9\n4 0 1 2 3\n";

    #[test]
    fn a_quad_is_two_triangles_in_both_encodings() {
        let mesh = Mesh::read(ASCII.as_bytes()).unwrap();
        assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3]]);
        assert_eq!(mesh.vertices_m[2], Point3::new(1.0, 1.0, 0.5));
        let header = ASCII.split_inclusive("end_header\n").next().unwrap();
        let mut binary = header.replace("ascii", "binary_little_endian").into_bytes();
        for vertex in &mesh.vertices_m {
            vertex.coords.iter().for_each(|c| binary.extend((*c as f32).to_le_bytes()));
            binary.push(9);
        }
        binary.push(4);
        [0i32, 1, 2, 3].iter().for_each(|i| binary.extend(i.to_le_bytes()));
        assert_eq!(Mesh::read(&binary).unwrap(), mesh);
        for cut in 0..binary.len() {
            assert!(Mesh::read(&binary[..cut]).is_err(), "{cut}");
        }
    }

    #[test]
    fn refuses_what_is_no_mesh() {
        for (from, to) in [
            ("4 0 1 2 3", "4 0 1 2 9"),                 // no such vertex
            ("4 0 1 2 3", "4 0 1 2 x"),                 // no number
            ("element face 1", "element face 1000000"), // not that many
            ("0 1 0 9\n", "0 nan 0 9\n"),               // not finite
            ("element face 1", "element face 0"),       // no faces
            ("ascii", "binary_big_endian"),
        ] {
            assert!(Mesh::read(ASCII.replace(from, to).as_bytes()).is_err(), "{to}");
        }
    }
}
