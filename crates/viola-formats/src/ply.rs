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

    /// Returns the index of a property.
    pub fn place(&self, name: &str) -> Option<usize> {
        self.properties.iter().position(|property| property.name == name)
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

/// The vertices of a file, one after the other. Further elements (faces) are not read.
#[derive(Debug)]
pub struct Vertices<'a> {
    pub element: Element<'a>,
    numbers: Numbers<'a>,
    index: u64,
    values: Vec<f64>,
}

impl<'a> Vertices<'a> {
    pub fn parse(bytes: &'a [u8]) -> Result<Vertices<'a>, PlyError> {
        let Ply { elements, numbers } = Ply::parse(bytes)?;
        let element = elements.into_iter().next().filter(|element| element.name == "vertex");
        let element = element.ok_or_else(|| PlyError::new("its first element is not vertex"))?;
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
