//! Points as PCD: ascii, binary, or binary with all values of a field together and compressed by LZF. The
//! header and the order of values are those of isl-org/Open3D, `cpp/open3d/io/file_format/FilePCD.cpp`.

mod lzf;

use super::{Columns, Points};
use crate::lidar::{LidarError, LidarMap, MAX_FILE_BYTES, MAX_POINTS};
use crate::scalar::Scalar;

const MAX_HEADER_BYTES: usize = 64 << 10;
const MAX_FIELDS: usize = 256;
/// Maximum number of values in one field of a point; descriptors have hundreds.
const MAX_COUNT: usize = 4096;

#[derive(Clone, Copy, PartialEq)]
enum Encoding {
    Ascii,
    Binary,
    Compressed,
}

struct Field<'a> {
    name: &'a str,
    kind: Scalar,
    count: usize,
}

struct Header<'a> {
    encoding: Encoding,
    fields: Vec<Field<'a>>,
    points: usize,
    has_viewpoint: bool,
    body: &'a [u8],
}

fn bad(reason: impl Into<String>) -> LidarError {
    LidarError::BadPcd { reason: reason.into() }
}

/// Returns whether a text begins like a PCD file.
pub(in super::super) fn is_pcd(text: &[u8]) -> bool {
    // Comments may stand in front.
    let mut lines = text.split(|byte| *byte == b'\n').skip_while(|line| line.starts_with(b"#"));
    let is_header = |line: &[u8]| line.starts_with(b"VERSION ") || line.starts_with(b"FIELDS ");
    text.starts_with(b"# .PCD") || lines.next().is_some_and(is_header)
}

/// Reads the points' x and y, in metres. Other fields are ignored.
pub(in super::super) fn read_pcd(bytes: &[u8]) -> Result<LidarMap, LidarError> {
    let header = Header::parse(bytes)?;
    let column = |name: &str| header.fields.iter().position(|field| field.name == name);
    let (Some(x), Some(y)) = (column("x"), column("y")) else {
        return Err(bad("its points have no x and y"));
    };
    let columns = Columns { x, y, z: column("z") };
    let mut points = Points::default();
    match header.encoding {
        Encoding::Ascii => header.read_lines(&columns, &mut points)?,
        Encoding::Binary => header.read_records(&columns, &mut points)?,
        Encoding::Compressed => header.read_planes(&columns, &mut points)?,
    }
    let mut notes = Vec::new();
    if header.has_viewpoint {
        notes.push("VIEWPOINT was not applied: points are taken to be in the file's frame".to_string());
    }
    points.into_map("pcd_points", notes)
}

impl<'a> Header<'a> {
    fn parse(bytes: &'a [u8]) -> Result<Header<'a>, LidarError> {
        let (mut names, mut sizes, mut kinds, mut counts) = (vec![], vec![], vec![], vec![]);
        let (mut width, mut height, mut points, mut has_viewpoint) = (None, None, None, false);
        let number = |word: Option<&&str>, what: &str| -> Result<usize, LidarError> {
            word.and_then(|word| word.parse().ok()).ok_or_else(|| bad(format!("its {what} is no number")))
        };
        let mut rest = &bytes[..bytes.len().min(MAX_HEADER_BYTES)];
        let encoding = loop {
            let end = rest.iter().position(|b| *b == b'\n').ok_or_else(|| bad("its header has no DATA"))?;
            let line = std::str::from_utf8(&rest[..end]).map_err(|_| bad("its header is not text"))?;
            rest = &rest[end + 1..];
            let words: Vec<&str> = line.split_whitespace().take(MAX_FIELDS + 2).collect();
            let Some((keyword, values)) = words.split_first() else { continue };
            if values.len() > MAX_FIELDS {
                return Err(bad(format!("it has more than {MAX_FIELDS} fields")));
            }
            match *keyword {
                "FIELDS" | "COLUMNS" => names = values.to_vec(),
                "SIZE" => sizes = values.to_vec(),
                "TYPE" => kinds = values.to_vec(),
                "COUNT" => counts = values.to_vec(),
                "WIDTH" => width = Some(number(values.first(), "WIDTH")?),
                "HEIGHT" => height = Some(number(values.first(), "HEIGHT")?),
                "POINTS" => points = Some(number(values.first(), "POINTS")?),
                "VIEWPOINT" => has_viewpoint = !is_identity(values),
                "DATA" => break encoding_of(values.first().copied().unwrap_or_default())?,
                _ => {}
            }
        };
        let body = &bytes[bytes.len().min(MAX_HEADER_BYTES) - rest.len()..];
        let area = width.zip(height).and_then(|(width, height): (usize, usize)| width.checked_mul(height));
        let points = points.or(area).ok_or_else(|| bad("it tells no number of points"))?;
        if points > MAX_POINTS {
            return Err(LidarError::TooManyPoints { max: MAX_POINTS });
        }
        if sizes.len() != names.len() || kinds.len() != names.len() {
            return Err(bad("FIELDS, SIZE and TYPE are not of one length"));
        }
        let mut fields = Vec::with_capacity(names.len());
        for (index, name) in names.into_iter().enumerate() {
            let count = counts.get(index).map_or(Ok(1), |count| number(Some(count), "COUNT"))?;
            if !(1..=MAX_COUNT).contains(&count) {
                return Err(bad(format!("the field {name:.40} has {count} numbers")));
            }
            fields.push(Field { name, kind: scalar_of(kinds[index], sizes[index])?, count });
        }
        Ok(Header { encoding, fields, points, has_viewpoint, body })
    }

    fn cut(&self, index: usize) -> LidarError {
        bad(format!("it ends after {index} of {} points", self.points))
    }

    fn read_lines(&self, columns: &Columns, points: &mut Points) -> Result<(), LidarError> {
        let text = std::str::from_utf8(self.body).map_err(|_| bad("its points are not text"))?;
        let mut lines = text.lines().filter(|line| !line.trim().is_empty());
        // Index of each field's first number in a line.
        let starts = self.starts(|field| field.count);
        let mut words: Vec<&str> = Vec::new();
        for index in 0..self.points {
            let line = lines.next().ok_or_else(|| self.cut(index))?;
            words.clear();
            words.extend(line.split_whitespace());
            let number = |column: usize| words.get(starts[column]).and_then(|word| word.parse::<f64>().ok());
            let wanted = [Some(columns.x), Some(columns.y), columns.z];
            if wanted.into_iter().flatten().any(|column| number(column).is_none()) {
                return Err(bad(format!("point {index} is not made of numbers")));
            }
            points.add(columns, |column| number(column).unwrap_or(f64::NAN))?;
        }
        Ok(())
    }

    fn read_records(&self, columns: &Columns, points: &mut Points) -> Result<(), LidarError> {
        let starts = self.starts(|field| field.count * field.kind.bytes());
        let stride = self.stride();
        if stride == 0 {
            return Ok(());
        }
        let mut records = self.body.chunks_exact(stride);
        for index in 0..self.points {
            let record = records.next().ok_or_else(|| self.cut(index))?;
            points.add(columns, |column| self.fields[column].kind.read(&record[starts[column]..], false))?;
        }
        Ok(())
    }

    /// Reads all values of the first field, then all of the second, and so on.
    fn read_planes(&self, columns: &Columns, points: &mut Points) -> Result<(), LidarError> {
        let size = |at: usize| {
            let bytes = self.body.get(at..).and_then(|rest| rest.first_chunk::<4>());
            bytes.map(|bytes| u32::from_le_bytes(*bytes) as usize).ok_or_else(|| self.cut(0))
        };
        let (packed, unpacked) = (size(0)?, size(4)?);
        let wanted = self.stride().checked_mul(self.points);
        if Some(unpacked) != wanted || unpacked as u64 > MAX_FILE_BYTES {
            return Err(bad(format!("its {} points are said to have {unpacked} bytes", self.points)));
        }
        let packed = self.body.get(8..).and_then(|rest| rest.get(..packed)).ok_or_else(|| self.cut(0))?;
        let planes = lzf::unpack(packed, unpacked).ok_or_else(|| bad("its compressed points are broken"))?;
        let starts = self.starts(|field| field.count * field.kind.bytes() * self.points);
        for index in 0..self.points {
            points.add(columns, |column| {
                let field = &self.fields[column];
                field.kind.read(&planes[starts[column] + index * field.count * field.kind.bytes()..], false)
            })?;
        }
        Ok(())
    }

    fn stride(&self) -> usize {
        self.fields.iter().map(|field| field.count * field.kind.bytes()).sum()
    }

    fn starts(&self, length: impl Fn(&Field) -> usize) -> Vec<usize> {
        let next = |at: &mut usize, field: &Field| {
            let start = *at;
            *at += length(field);
            Some(start)
        };
        self.fields.iter().scan(0, next).collect()
    }
}

/// Returns whether the sensor's pose (x, y, z, and a quaternion with w first) is the identity.
fn is_identity(viewpoint: &[&str]) -> bool {
    let numbers: Vec<f64> = viewpoint.iter().filter_map(|word| word.parse().ok()).collect();
    numbers == [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]
}

fn encoding_of(name: &str) -> Result<Encoding, LidarError> {
    match name {
        "ascii" => Ok(Encoding::Ascii),
        "binary" => Ok(Encoding::Binary),
        "binary_compressed" => Ok(Encoding::Compressed),
        _ => Err(bad("its DATA is neither ascii, binary nor binary_compressed")),
    }
}

fn scalar_of(kind: &str, size: &str) -> Result<Scalar, LidarError> {
    Ok(match (kind, size) {
        ("I", "1") => Scalar::I8,
        ("U", "1") => Scalar::U8,
        ("I", "2") => Scalar::I16,
        ("U", "2") => Scalar::U16,
        ("I", "4") => Scalar::I32,
        ("U", "4") => Scalar::U32,
        ("I", "8") => Scalar::I64,
        ("U", "8") => Scalar::U64,
        ("F", "4") => Scalar::F32,
        ("F", "8") => Scalar::F64,
        _ => return Err(bad("a field has an unknown type or size")),
    })
}
