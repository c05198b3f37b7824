//! Points as PLY: ascii, or binary of either byte order (Turk, "The PLY Polygon File Format", 1994).

use super::records::{Columns, Points, Scalar};
use crate::lidar::{LidarError, LidarMap, MAX_POINTS};

const MAX_HEADER_BYTES: usize = 64 << 10;

#[derive(Clone, Copy, PartialEq)]
enum Encoding {
    Ascii,
    LittleEndian,
    BigEndian,
}

struct Property<'a> {
    name: &'a str,
    kind: Scalar,
}

struct Header<'a> {
    encoding: Encoding,
    vertices: usize,
    properties: Vec<Property<'a>>,
    body: &'a [u8],
}

/// The vertices' x and y, in metres. Heights and other elements (faces) are ignored.
pub(in super::super) fn read_ply(bytes: &[u8]) -> Result<LidarMap, LidarError> {
    let header = Header::parse(bytes)?;
    let column = |name: &str| header.properties.iter().position(|p| p.name == name);
    let (Some(x), Some(y)) = (column("x"), column("y")) else {
        return Err(bad("its vertices have no x and y"));
    };
    let columns = Columns { x, y, z: column("z") };
    let mut points = Points::default();
    match header.encoding {
        Encoding::Ascii => header.read_lines(&columns, &mut points)?,
        _ => header.read_records(&columns, &mut points)?,
    }
    points.into_map("ply_points", Vec::new())
}

fn bad(reason: impl Into<String>) -> LidarError {
    LidarError::BadPly { reason: reason.into() }
}

impl<'a> Header<'a> {
    fn parse(bytes: &'a [u8]) -> Result<Header<'a>, LidarError> {
        const END: &[u8] = b"end_header";
        let start = &bytes[..bytes.len().min(MAX_HEADER_BYTES)];
        let end =
            start.windows(END.len()).position(|w| w == END).ok_or_else(|| bad("it has no end_header"))?;
        let text = std::str::from_utf8(&bytes[..end]).map_err(|_| bad("its header is not text"))?;
        let newline =
            bytes[end..].iter().position(|&b| b == b'\n').ok_or_else(|| bad("it ends with its header"))?;
        let body = &bytes[end + newline + 1..];

        let (mut encoding, mut vertices, mut properties) = (None, None, Vec::new());
        let mut in_vertex = false;
        for line in text.lines().skip(1) {
            let words: Vec<&str> = line.split_whitespace().collect();
            match words.as_slice() {
                ["format", name, _version] => encoding = Some(encoding_of(name)?),
                ["element", "vertex", count] if vertices.is_none() => {
                    vertices = Some(count.parse().map_err(|_| bad("its number of vertices is no number"))?);
                    in_vertex = true;
                }
                ["element", ..] if vertices.is_none() => return Err(bad("its first element is not vertex")),
                ["element", ..] => in_vertex = false,
                ["property", "list", ..] if in_vertex => {
                    return Err(bad("its vertices have list properties"));
                }
                ["property", kind, name] if in_vertex => {
                    properties.push(Property { name, kind: scalar_of(kind)? });
                }
                _ => {}
            }
        }
        let encoding = encoding.ok_or_else(|| bad("its header names no format"))?;
        let vertices = vertices.ok_or_else(|| bad("it has no vertices"))?;
        if vertices > MAX_POINTS {
            return Err(LidarError::TooManyPoints { max: MAX_POINTS });
        }
        Ok(Header { encoding, vertices, properties, body })
    }

    fn read_lines(&self, columns: &Columns, points: &mut Points) -> Result<(), LidarError> {
        let text = std::str::from_utf8(self.body).map_err(|_| bad("its points are not text"))?;
        let mut lines = text.lines().filter(|line| !line.trim().is_empty());
        let mut values = Vec::new();
        for index in 0..self.vertices {
            let line = lines.next().ok_or_else(|| self.cut(index))?;
            values.clear();
            for word in line.split_whitespace().take(self.properties.len()) {
                values.push(word.parse().map_err(|_| bad(format!("vertex {index} is not made of numbers")))?);
            }
            if values.len() < self.properties.len() {
                return Err(bad(format!(
                    "vertex {index} has {} of {} numbers",
                    values.len(),
                    self.properties.len()
                )));
            }
            points.add(columns, |column| values[column])?;
        }
        Ok(())
    }

    fn read_records(&self, columns: &Columns, points: &mut Points) -> Result<(), LidarError> {
        let mut offsets = Vec::new();
        let mut stride = 0;
        for property in &self.properties {
            offsets.push(stride);
            stride += property.kind.bytes();
        }
        let is_big = self.encoding == Encoding::BigEndian;
        let mut records = self.body.chunks_exact(stride);
        for index in 0..self.vertices {
            let record = records.next().ok_or_else(|| self.cut(index))?;
            points.add(columns, |column| {
                self.properties[column].kind.read(&record[offsets[column]..], is_big)
            })?;
        }
        Ok(())
    }

    fn cut(&self, index: usize) -> LidarError {
        bad(format!("it ends after {index} of {} vertices", self.vertices))
    }
}

fn encoding_of(name: &str) -> Result<Encoding, LidarError> {
    match name {
        "ascii" => Ok(Encoding::Ascii),
        "binary_little_endian" => Ok(Encoding::LittleEndian),
        "binary_big_endian" => Ok(Encoding::BigEndian),
        _ => Err(bad("its format is neither ascii, binary_little_endian nor binary_big_endian")),
    }
}

fn scalar_of(name: &str) -> Result<Scalar, LidarError> {
    Ok(match name {
        "char" | "int8" => Scalar::I8,
        "uchar" | "uint8" => Scalar::U8,
        "short" | "int16" => Scalar::I16,
        "ushort" | "uint16" => Scalar::U16,
        "int" | "int32" => Scalar::I32,
        "uint" | "uint32" => Scalar::U32,
        "float" | "float32" => Scalar::F32,
        "double" | "float64" => Scalar::F64,
        _ => return Err(bad("a property has an unknown type")),
    })
}
