//! Triangles of a scene's mesh: PLY, ascii or little-endian (Turk, "The PLY Polygon File Format", 1994).

use std::io::Read;
use std::path::{Path, PathBuf};
use viola_geometry::Point3;

/// A triangle soup with shared corners, in metres.
#[derive(Debug, Clone, PartialEq)]
pub struct Mesh {
    pub vertices_m: Vec<Point3>,
    pub triangles: Vec<[u32; 3]>,
    /// The vertices' property `label`; empty when they have none.
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
    #[error("{path} is no PLY mesh: {reason}")]
    Bad { path: PathBuf, reason: String },
}

const MAX_FILE_BYTES: u64 = 1 << 30;

impl Mesh {
    /// The first mesh, by name, of a folder that has faces; files of labels come after plain ones by name.
    pub fn open_in(folder: &Path) -> Result<Mesh, MeshError> {
        Mesh::open(&Mesh::files_in(folder)?[0])
    }

    /// The first mesh of a folder whose vertices have labels.
    pub fn open_labelled_in(folder: &Path) -> Result<Mesh, MeshError> {
        for path in Mesh::files_in(folder)? {
            let mesh = Mesh::open(&path)?;
            if !mesh.labels.is_empty() {
                return Ok(mesh);
            }
        }
        Err(MeshError::NoLabels { folder: folder.to_owned() })
    }

    /// The folder's PLY files, at least one.
    fn files_in(folder: &Path) -> Result<Vec<PathBuf>, MeshError> {
        let entries = std::fs::read_dir(folder)
            .map_err(|source| MeshError::Unreadable { path: folder.to_owned(), source })?;
        let mut paths: Vec<PathBuf> = entries
            .filter_map(|entry| Some(entry.ok()?.path()))
            .filter(|path| path.extension().is_some_and(|e| e.eq_ignore_ascii_case("ply")))
            .collect();
        // The plain mesh has the shortest name; others are the same surface with something attached.
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
        Mesh::read(&bytes).map_err(|reason| MeshError::Bad { path: path.to_owned(), reason })
    }

    fn read(bytes: &[u8]) -> Result<Mesh, String> {
        let (header, body) = Header::parse(bytes)?;
        let mut values = Values { rest: body, ascii: header.ascii };
        let (mut vertices_m, mut triangles, mut labels) = (Vec::new(), Vec::new(), Vec::new());
        for element in &header.elements {
            let place = |name: &str| element.properties.iter().position(|p| p.name == name);
            let xyz = [place("x"), place("y"), place("z")];
            for _ in 0..element.count {
                let mut at = [f64::NAN; 3];
                for (index, property) in element.properties.iter().enumerate() {
                    match property.count {
                        Some(count) => {
                            let corners = values.next(count)?;
                            if !(0.0..=255.0).contains(&corners) {
                                return Err(format!("a face with {corners} corners"));
                            }
                            let mut face = Vec::with_capacity(corners as usize);
                            for _ in 0..corners as usize {
                                face.push(values.next(property.kind)? as u32);
                            }
                            if element.name == "face" && property.name.starts_with("vertex_ind") {
                                // A polygon is a fan of triangles.
                                triangles.extend(face.windows(2).skip(1).map(|w| [face[0], w[0], w[1]]));
                            }
                        }
                        None => {
                            let value = values.next(property.kind)?;
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
            return Err("a face has a corner that is no vertex with finite x, y and z".into());
        }
        if triangles.is_empty() {
            return Err("it has no faces".into());
        }
        Ok(Mesh { vertices_m, triangles, labels })
    }

    /// The corners of all triangles.
    pub fn corners(&self) -> impl Iterator<Item = [Point3; 3]> + '_ {
        self.triangles.iter().map(|corners| corners.map(|i| self.vertices_m[i as usize]))
    }
}

#[derive(Clone, Copy)]
enum Kind {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Kind {
    fn named(name: &str) -> Result<Kind, String> {
        Ok(match name {
            "char" | "int8" => Kind::I8,
            "uchar" | "uint8" => Kind::U8,
            "short" | "int16" => Kind::I16,
            "ushort" | "uint16" => Kind::U16,
            "int" | "int32" => Kind::I32,
            "uint" | "uint32" => Kind::U32,
            "float" | "float32" => Kind::F32,
            "double" | "float64" => Kind::F64,
            _ => return Err(format!("the type {name:?} is unknown")),
        })
    }
}

struct Property<'a> {
    name: &'a str,
    kind: Kind,
    /// Type of the length, for lists.
    count: Option<Kind>,
}

struct Element<'a> {
    name: &'a str,
    count: u64,
    properties: Vec<Property<'a>>,
}

struct Header<'a> {
    ascii: bool,
    elements: Vec<Element<'a>>,
}

impl<'a> Header<'a> {
    fn parse(bytes: &'a [u8]) -> Result<(Header<'a>, &'a [u8]), String> {
        const END: &[u8] = b"end_header";
        let start = &bytes[..bytes.len().min(1 << 16)];
        let end = start.windows(END.len()).position(|w| w == END).ok_or("its header has no end")?;
        let line_end = bytes[end..].iter().position(|b| *b == b'\n').ok_or("it ends with its header")?;
        let text = std::str::from_utf8(&bytes[..end]).map_err(|_| "its header is not text")?;
        let mut header = Header { ascii: false, elements: Vec::new() };
        for line in text.lines() {
            let words: Vec<&str> = line.split_whitespace().collect();
            match (words.as_slice(), header.elements.last_mut()) {
                (["format", "ascii", _], _) => header.ascii = true,
                (["format", "binary_little_endian", _], _) => {}
                (["format", other, _], _) => return Err(format!("the format {other} is not read")),
                (["element", name, count], _) => {
                    let count = count.parse().map_err(|_| format!("{line:?} has no number"))?;
                    header.elements.push(Element { name, count, properties: Vec::new() });
                }
                (["property", "list", count, kind, name], Some(element)) => {
                    let count = Some(Kind::named(count)?);
                    element.properties.push(Property { name, kind: Kind::named(kind)?, count });
                }
                (["property", kind, name], Some(element)) => {
                    element.properties.push(Property { name, kind: Kind::named(kind)?, count: None });
                }
                _ => {}
            }
        }
        // An element without properties takes no bytes, and its count could be anything.
        header.elements.retain(|element| !element.properties.is_empty());
        Ok((header, &bytes[end + line_end + 1..]))
    }
}

/// The numbers of the body, one after the other.
struct Values<'a> {
    rest: &'a [u8],
    ascii: bool,
}

impl Values<'_> {
    fn next(&mut self, kind: Kind) -> Result<f64, String> {
        if self.ascii {
            let text = self.rest.trim_ascii_start();
            let end = text.iter().position(u8::is_ascii_whitespace).unwrap_or(text.len());
            let (word, rest) = text.split_at(end);
            self.rest = rest;
            let word = std::str::from_utf8(word).ok().filter(|word| !word.is_empty());
            return word.and_then(|word| word.parse().ok()).ok_or_else(|| "a number is missing".into());
        }
        Ok(match kind {
            Kind::I8 => f64::from(i8::from_le_bytes(self.take()?)),
            Kind::U8 => f64::from(u8::from_le_bytes(self.take()?)),
            Kind::I16 => f64::from(i16::from_le_bytes(self.take()?)),
            Kind::U16 => f64::from(u16::from_le_bytes(self.take()?)),
            Kind::I32 => f64::from(i32::from_le_bytes(self.take()?)),
            Kind::U32 => f64::from(u32::from_le_bytes(self.take()?)),
            Kind::F32 => f64::from(f32::from_le_bytes(self.take()?)),
            Kind::F64 => f64::from_le_bytes(self.take()?),
        })
    }

    fn take<const N: usize>(&mut self) -> Result<[u8; N], String> {
        let (value, rest) = self.rest.split_first_chunk().ok_or("it ends too early")?;
        self.rest = rest;
        Ok(*value)
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
