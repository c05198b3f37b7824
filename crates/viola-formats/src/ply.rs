//! PLY files of points and meshes (Turk, "The PLY Polygon File Format", 1994): ascii, or binary of either byte order.

use crate::scalar::Scalar;

const MAX_HEADER_BYTES: usize = 64 << 10;

/// A file that is not PLY, or is damaged.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct PlyError(String);

impl PlyError {
    pub fn new(reason: impl Into<String>) -> PlyError {
        PlyError(reason.into())
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Encoding {
    Ascii,
    LittleEndian,
    BigEndian,
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Property<'a> {
    pub name: &'a str,
    pub kind: Scalar,
    /// Type of the length of a list; none for a single number.
    pub length: Option<Scalar>,
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Element<'a> {
    pub name: &'a str,
    pub count: u64,
    pub properties: Vec<Property<'a>>,
}

impl Element<'_> {
    /// Returns whether the properties have these types and names, in this order.
    pub fn has_properties(&self, properties: &[(&str, &str)]) -> bool {
        let is_same = |(own, (kind, name)): (&Property, &(&str, &str))| {
            own.length.is_none() && own.name == *name && scalar_of(kind) == Ok(own.kind)
        };
        self.properties.len() == properties.len() && self.properties.iter().zip(properties).all(is_same)
    }

    /// Returns the index of the property of this name, else of one that differs only in capital letters.
    pub fn place(&self, name: &str) -> Option<usize> {
        let exact = self.properties.iter().position(|property| property.name == name);
        exact.or_else(|| self.properties.iter().position(|property| property.name.eq_ignore_ascii_case(name)))
    }
}

/// The header of a file, and its numbers.
#[derive(Debug, Clone)]
pub struct Ply<'a> {
    /// Elements without properties take no bytes, and their counts may be anything.
    pub elements: Vec<Element<'a>>,
    pub numbers: Numbers<'a>,
}

impl<'a> Ply<'a> {
    pub fn parse(bytes: &'a [u8]) -> Result<Ply<'a>, PlyError> {
        const END: &[u8] = b"end_header";
        let start = &bytes[..bytes.len().min(MAX_HEADER_BYTES)];
        let end = start
            .windows(END.len())
            .position(|w| w == END)
            .ok_or_else(|| PlyError::new("it has no end_header"))?;
        let text = std::str::from_utf8(&bytes[..end]).map_err(|_| PlyError::new("its header is not text"))?;
        let newline = bytes[end..].iter().position(|&b| b == b'\n');
        let newline = newline.ok_or_else(|| PlyError::new("it ends with its header"))?;
        let (mut encoding, mut elements) = (None, Vec::<Element>::new());
        for line in text.lines().skip(1) {
            let words: Vec<&str> = line.split_whitespace().collect();
            match (words.as_slice(), elements.last_mut()) {
                (["format", name, _version], _) => encoding = Some(encoding_of(name)?),
                (["element", name, count], _) => {
                    let count =
                        count.parse().map_err(|_| PlyError::new(format!("{line:?} has no number")))?;
                    elements.push(Element { name, count, properties: Vec::new() });
                }
                (["property", "list", length, kind, name], Some(element)) => {
                    let length = Some(scalar_of(length)?);
                    element.properties.push(Property { name, kind: scalar_of(kind)?, length });
                }
                (["property", kind, name], Some(element)) => {
                    element.properties.push(Property { name, kind: scalar_of(kind)?, length: None });
                }
                _ => {}
            }
        }
        let encoding = encoding.ok_or_else(|| PlyError::new("its header names no format"))?;
        Ok(Ply { elements, numbers: Numbers { rest: &bytes[end + newline + 1..], encoding, lines: None } })
    }
}

/// The vertices of a file, one after the other. Elements before them are skipped; those after them (faces) are not read.
#[derive(Debug)]
pub struct Vertices<'a> {
    pub element: Element<'a>,
    numbers: Numbers<'a>,
    index: u64,
    values: Vec<f64>,
}

impl<'a> Vertices<'a> {
    pub fn parse(bytes: &'a [u8]) -> Result<Vertices<'a>, PlyError> {
        let Ply { elements, mut numbers } = Ply::parse(bytes)?;
        let mut elements = elements.into_iter();
        let element = loop {
            match elements.next() {
                Some(element) if element.name == "vertex" => break element,
                Some(other) => numbers.skip(&other)?,
                None => return Err(PlyError::new("it has no element vertex")),
            }
        };
        if element.properties.iter().any(|property| property.length.is_some()) {
            return Err(PlyError::new("its vertices have list properties"));
        }
        Ok(Vertices { values: Vec::with_capacity(element.properties.len()), element, numbers, index: 0 })
    }

    /// Returns the numbers of the next vertex, in the order of its properties; `None` after the last one.
    pub fn read(&mut self) -> Result<Option<&[f64]>, PlyError> {
        if self.index == self.element.count {
            return Ok(None);
        }
        let (index, count) = (self.index, self.element.count);
        let of_vertex = |error: PlyError| PlyError::new(format!("vertex {index} of {count}: {error}"));
        self.values.clear();
        self.numbers.begin_row().map_err(of_vertex)?;
        for property in &self.element.properties {
            self.values.push(self.numbers.next(property.kind).map_err(of_vertex)?);
        }
        self.index += 1;
        Ok(Some(&self.values))
    }
}

/// The numbers of a file's body, in their order.
#[derive(Debug, Clone)]
pub struct Numbers<'a> {
    pub rest: &'a [u8],
    pub encoding: Encoding,
    /// The lines after the current row; none before the first call of [`Numbers::begin_row`].
    lines: Option<&'a [u8]>,
}

impl Numbers<'_> {
    /// Skips the rows of an element. One without properties takes no bytes, whatever its count.
    fn skip(&mut self, element: &Element) -> Result<(), PlyError> {
        let rows = if element.properties.is_empty() { 0 } else { element.count };
        for index in 0..rows {
            self.skip_row(&element.properties)
                .map_err(|error| PlyError::new(format!("{:.40} {index} of {rows}: {error}", element.name)))?;
        }
        Ok(())
    }

    /// Skips a row. Each number takes at least one byte, so a length that the file invents ends with the file.
    fn skip_row(&mut self, properties: &[Property]) -> Result<(), PlyError> {
        self.begin_row()?;
        for property in properties {
            let count = property.length.map_or(Ok(1.0), |length| self.next(length))?;
            let is_whole = count >= 0.0 && count.fract() == 0.0;
            if !is_whole {
                return Err(PlyError::new(format!("a list of {count} numbers")));
            }
            for _ in 0..count as u64 {
                self.next(property.kind)?;
            }
        }
        Ok(())
    }

    /// Limits an ascii file's next numbers to those of its next line that is not blank.
    pub fn begin_row(&mut self) -> Result<(), PlyError> {
        if self.encoding == Encoding::Ascii {
            let lines = self.lines.unwrap_or(self.rest).trim_ascii_start();
            if lines.is_empty() {
                return Err(PlyError::new("it ends too early"));
            }
            let end = lines.iter().position(|byte| *byte == b'\n').unwrap_or(lines.len());
            (self.rest, self.lines) = (&lines[..end], Some(&lines[end..]));
        }
        Ok(())
    }

    pub fn next(&mut self, kind: Scalar) -> Result<f64, PlyError> {
        if self.encoding == Encoding::Ascii {
            let text = self.rest.trim_ascii_start();
            let end = text.iter().position(u8::is_ascii_whitespace).unwrap_or(text.len());
            let (word, rest) = text.split_at(end);
            self.rest = rest;
            let word = std::str::from_utf8(word).ok().filter(|word| !word.is_empty());
            return word
                .and_then(|word| word.parse().ok())
                .ok_or_else(|| PlyError::new("a number is missing"));
        }
        let (number, rest) =
            self.rest.split_at_checked(kind.bytes()).ok_or_else(|| PlyError::new("it ends too early"))?;
        self.rest = rest;
        Ok(kind.read(number, self.encoding == Encoding::BigEndian))
    }
}

fn encoding_of(name: &str) -> Result<Encoding, PlyError> {
    match name {
        "ascii" => Ok(Encoding::Ascii),
        "binary_little_endian" => Ok(Encoding::LittleEndian),
        "binary_big_endian" => Ok(Encoding::BigEndian),
        _ => Err(PlyError::new("its format is neither ascii, binary_little_endian nor binary_big_endian")),
    }
}

fn scalar_of(name: &str) -> Result<Scalar, PlyError> {
    Ok(match name {
        "char" | "int8" => Scalar::I8,
        "uchar" | "uint8" => Scalar::U8,
        "short" | "int16" => Scalar::I16,
        "ushort" | "uint16" => Scalar::U16,
        "int" | "int32" => Scalar::I32,
        "uint" | "uint32" => Scalar::U32,
        "float" | "float32" => Scalar::F32,
        "double" | "float64" => Scalar::F64,
        _ => return Err(PlyError::new(format!("the type {name:?} is unknown"))),
    })
}

/// The header of a binary little-endian file of vertices. `properties` are types and names.
pub fn header(comments: &[&str], vertices: usize, properties: &[(&str, &str)]) -> String {
    let comments: String = comments.iter().map(|comment| format!("comment {comment}\n")).collect();
    let properties: String =
        properties.iter().map(|(kind, name)| format!("property {kind} {name}\n")).collect();
    format!(
        "ply\nformat binary_little_endian 1.0\n{comments}element vertex {vertices}\n{properties}end_header\n"
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A camera, a face of two vertices and an element without properties stand before the vertices.
    const HEADER: &str = "ply\nformat ascii 1.0\nelement camera 1\nproperty float view\nelement face 2\n\
        property list uchar ushort vertex_indices\nproperty uchar red\nelement note 9\nelement vertex 2\n\
        property float X\nproperty double Y\nend_header\n";

    fn read(bytes: &[u8]) -> Result<Vec<Vec<f64>>, PlyError> {
        let mut vertices = Vertices::parse(bytes)?;
        let places = ["x", "y"].map(|name| vertices.element.place(name));
        assert_eq!(places, [Some(0), Some(1)]);
        let mut all = Vec::new();
        while let Some(values) = vertices.read()? {
            all.push(values.to_vec());
        }
        Ok(all)
    }

    #[test]
    fn elements_before_the_vertices_are_skipped() {
        let expected: Result<_, PlyError> = Ok(vec![vec![1.5, 2.5], vec![3.5, 4.5]]);
        let ascii = format!("{HEADER}7.25\n2 0 1 200\n0 100\n1.5 2.5\n3.5 4.5\n");
        assert_eq!(read(ascii.as_bytes()), expected);
        let mut binary = HEADER.replace("ascii", "binary_little_endian").into_bytes();
        binary.extend(7.25f32.to_le_bytes());
        // Two indices and a colour, then no index and a colour.
        binary.extend([2, 0, 0, 1, 0, 200, 0, 100]);
        for [x, y] in [[1.5, 2.5], [3.5, 4.5]] {
            binary.extend((x as f32).to_le_bytes());
            binary.extend(f64::to_le_bytes(y));
        }
        assert_eq!(read(&binary), expected);
        for (from, to) in
            [("face 2", "face 3"), ("2 0 1 200", "-1 200"), ("2 0 1 200", "1e9 0"), ("vertex 2", "point 2")]
        {
            assert!(ascii.contains(from) && read(ascii.replace(from, to).as_bytes()).is_err(), "{to}");
        }
    }

    #[test]
    fn small_letters_come_before_capitals() {
        let header =
            "ply\nformat ascii 1.0\nelement vertex 0\nproperty float X\nproperty float x\nend_header\n";
        let vertices = Vertices::parse(header.as_bytes()).unwrap();
        assert_eq!(["x", "X", "y"].map(|name| vertices.element.place(name)), [Some(1), Some(0), None]);
    }
}
