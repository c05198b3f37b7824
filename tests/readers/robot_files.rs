//! The drawing in the layouts of robots' own files.

pub use crate::archives::gzip;
use crate::drawing::*;
use base64::Engine;
use base64::engine::general_purpose::{STANDARD, URL_SAFE_NO_PAD};
use flate2::Compression;
use flate2::write::ZlibEncoder;
use serde_json::{Value, json};
use std::io::Write;

pub fn zlib(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::default());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

/// Returns the drawing's bytes, row after row from the bottom.
fn image(value: impl Fn(char) -> u8) -> Vec<u8> {
    HOME.iter().rev().flat_map(|row| row.chars().map(&value).collect::<Vec<_>>()).collect()
}

fn u16s(values: &[u16]) -> Vec<u8> {
    values.iter().flat_map(|v| v.to_le_bytes()).collect()
}

fn i16s(values: &[i16]) -> Vec<u8> {
    values.iter().flat_map(|v| v.to_le_bytes()).collect()
}

fn u32s(values: &[u32]) -> Vec<u8> {
    values.iter().flat_map(|v| v.to_le_bytes()).collect()
}

fn f32s(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|v| v.to_le_bytes()).collect()
}

/// Returns a block; its header is eight bytes followed by `header`.
pub fn block(kind: u16, header: &[u8], data: &[u8]) -> Vec<u8> {
    let head = u16s(&[kind, 8 + header.len() as u16]);
    [head, u32s(&[data.len() as u32]), header.to_vec(), data.to_vec()].concat()
}

pub fn rrmap(blocks: &[Vec<u8>]) -> Vec<u8> {
    let body = blocks.concat();
    let header = [u16s(&[20]), u32s(&[body.len() as u32]), u16s(&[1, 1]), u32s(&[7, 9])].concat();
    [b"rr".to_vec(), header, body].concat()
}

/// The corner of the drawing in [`roborock`], in metres.
pub const ROBOROCK_CORNER: [f64; 2] = [2.0, 5.0];

/// Returns the image block of a generation with this header size, and segments 16 and 17 if `segments`.
pub fn roborock_image(header_bytes: usize, segments: bool) -> Vec<u8> {
    let cells = image(|symbol| match symbol {
        '#' => 1,
        ' ' => 0,
        'a' if segments => 16 << 3 | 7,
        'b' if segments => 17 << 3 | 7,
        _ if segments => 7,
        _ => 0xff,
    });
    let place = u32s(&[100, 40, 6, 8]);
    let more = vec![0; header_bytes - 24];
    block(2, &[more, place].concat(), &cells)
}

/// Returns all blocks that are read of an RRMap, in the layout of the third generation.
pub fn roborock_blocks() -> Vec<Vec<u8>> {
    let mut materials = vec![0; 18];
    (materials[16], materials[17]) = (3, 4);
    vec![
        block(1, &[], &u32s(&[2_300, 5_050, 90])),
        roborock_image(28, true),
        block(3, &u32s(&[2, 4, 0]), &u16s(&[2_000, 5_000, 2_000, 5_100])),
        block(8, &[], &u32s(&[2_100, 5_100])),
        block(9, &u32s(&[1]), &u16s(&[2_000, 5_000, 2_100, 5_000, 2_100, 5_200, 2_000, 5_200])),
        block(10, &u32s(&[1]), &u16s(&[2_000, 5_000, 2_400, 5_000])),
        block(12, &u32s(&[0]), &[]),
        block(15, &u32s(&[1]), &u16s(&[2_200, 5_100, 2, 9_000, 0, 0, 0])),
        block(24, &[], &materials),
        block(99, &u32s(&[1, 2]), b"new"),
        block(1024, &[], &[0; 20]),
    ]
}

pub fn roborock() -> Vec<u8> {
    rrmap(&roborock_blocks())
}

/// Returns the header of a Dreame frame of 8 x 6 cells of 50 mm at -2000, -1000.
fn dreame_header(kind: u8, robot: [i16; 3], charger: [i16; 3]) -> Vec<u8> {
    [i16s(&[1, 2]), vec![kind], i16s(&robot), i16s(&charger), i16s(&[50, 8, 6, -2_000, -1_000])].concat()
}

/// The corner of the drawing in [`dreame_inflated`]: -2000 and -1000 mm are 3077 and 3177 cm from the sheet's
/// edges: cell 615 from the left, and cell 675 (1310.8 - 635.4) from the top of 65.54 m.
pub const DREAME_CORNER: [f64; 2] = [30.75, 65.54 - 676.0 * 0.05];

/// Returns floor, walls and a room in the image; the other room, names and restrictions in the saved map.
pub fn dreame_inflated(kind: u8) -> Vec<u8> {
    let unset = [32_767, 32_767, 0];
    let saved_cells = image(|symbol| match symbol {
        '#' => 0x80,
        'a' => 16,
        'b' => 17,
        _ => 0,
    });
    let saved_extra = json!({
        "seg_inf": {"16": {"name": STANDARD.encode("Kitchen"), "material": 1, "direction": 90}, "17": {}},
        "vw": {"line": [[-2000, -1000, -1600, -1000]], "rect": [[-2000, -1000, -1900, -800]], "mop": []},
    });
    let saved = [dreame_header(b'I', unset, [-1_700, -900, 90]), saved_cells, text(&saved_extra)].concat();
    let extra = json!({"ris": 2, "rism": URL_SAFE_NO_PAD.encode(zlib(&saved)), "tr": "S1,2L3,4",
        "ai_obstacle": [["-1900", "-900", "133", "0.5"]]});
    let cells = image(|symbol| match symbol {
        '#' => 63 << 2 | 2,
        ' ' => 0,
        'a' => 16 << 2 | 1,
        'b' => 62 << 2 | 3,
        _ => 1,
    });
    [dreame_header(kind, [-1_900, -900, 0], unset), cells, text(&extra)].concat()
}

pub fn dreame(inflated: &[u8]) -> Vec<u8> {
    URL_SAFE_NO_PAD.encode(zlib(inflated)).into_bytes()
}

/// The corner of the drawing in [`viomi_inflated`], whose image of 60 x 50 cells begins at -20, -20 m.
pub const VIOMI_CORNER: [f64; 2] = [1.0, 0.5];

pub fn viomi_inflated(number: u32) -> Vec<u8> {
    let id = u32s(&[number]);
    let mut cells = vec![0u8; 60 * 50];
    for (index, value) in image(|symbol| match symbol {
        '#' => 255,
        ' ' => 0,
        'a' => 16,
        'b' => 67,
        _ => 1,
    })
    .into_iter()
    .enumerate()
    {
        cells[(10 + index / 8) * 60 + 20 + index % 8] = value;
    }
    let image_head = [u32s(&[0, 1, 50, 60]), f32s(&[-20.0, -20.0, -17.0, -17.5, 0.05])].concat();
    let area = |corners: [f32; 8]| [vec![0; 12], f32s(&corners), vec![0; 48]].concat();
    let wall = area([-19.0, -19.5, -19.0, -19.5, -18.6, -19.5, -18.6, -19.5]);
    let zone = area([-19.0, -19.5, -18.9, -19.5, -18.9, -19.3, -19.0, -19.3]);
    let name =
        |id: u8, name: &str| [vec![id, name.len() as u8], name.as_bytes().to_vec(), vec![0; 9]].concat();
    let flags = 0b1_1000_1111_1111u32;
    [
        [u32s(&[flags]), id.clone(), vec![0; 40]].concat(),
        [id.clone(), image_head, cells].concat(),
        [id.clone(), u32s(&[0, 0])].concat(),
        [id.clone(), f32s(&[-18.7, -19.45, std::f32::consts::FRAC_PI_2])].concat(),
        [id.clone(), u32s(&[0, 2]), wall, zone].concat(),
        [id.clone(), u32s(&[0, 0])].concat(),
        [id.clone(), vec![0; 16]].concat(),
        [id.clone(), vec![0; 5], f32s(&[-18.9, -19.4, 0.0])].concat(),
        [id.clone(), vec![0; 4]].concat(),
        [id, vec![2], b"up".to_vec(), vec![0; 4], u32s(&[2]), name(16, "Kitchen"), name(17, "")].concat(),
    ]
    .concat()
}

/// Returns the JSON in a PNG, as Valetudo writes it.
pub fn valetudo_png(json: &Value) -> Vec<u8> {
    let chunk = |kind: &[u8], data: &[u8]| {
        let crc = [0; 4];
        [&(data.len() as u32).to_be_bytes()[..], kind, data, &crc].concat()
    };
    let map = [b"ValetudoMap\0\0".to_vec(), zlib(&text(json))].concat();
    [
        b"\x89PNG\r\n\x1a\n".to_vec(),
        chunk(b"IHDR", &[0; 13]),
        chunk(b"zTXt", b"Comment\0\0"),
        chunk(b"zTXt", &map),
        chunk(b"IEND", b""),
    ]
    .concat()
}

/// Returns the walls as PCD with a colour between the coordinates and two numbers at the end.
pub fn pcd(data: &str) -> Vec<u8> {
    let hits = hits();
    let mut bytes = format!(
        "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\nFIELDS x rgb y z normal\nSIZE 4 4 8 4 2\n\
         TYPE F U F F I\nCOUNT 1 1 1 1 2\nWIDTH {}\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {}\nDATA {data}\n",
        hits.len(),
        hits.len()
    )
    .into_bytes();
    let field = |index: usize| -> Vec<Vec<u8>> {
        let one = |p: &viola_geometry::Point2| match index {
            0 => (p.x as f32).to_le_bytes().to_vec(),
            1 => 0x00ff_8040u32.to_le_bytes().to_vec(),
            2 => p.y.to_le_bytes().to_vec(),
            3 => 0.5f32.to_le_bytes().to_vec(),
            _ => i16s(&[1, -1]),
        };
        hits.iter().map(one).collect()
    };
    let fields: Vec<_> = (0..5).map(field).collect();
    match data {
        "ascii" => {
            hits.iter().for_each(|p| bytes.extend(format!("{} 16744512 {} 0.5 1 -1\n", p.x, p.y).bytes()))
        }
        "binary" => (0..hits.len()).for_each(|i| fields.iter().for_each(|field| bytes.extend(&field[i]))),
        _ => {
            let planes: Vec<u8> = fields.iter().flatten().flatten().copied().collect();
            // Runs of at most 32 bytes, which need no copies.
            let runs = planes.chunks(32).map(|run| [&[run.len() as u8 - 1], run].concat());
            let packed: Vec<u8> = runs.flatten().collect();
            bytes.extend(u32s(&[packed.len() as u32, planes.len() as u32]));
            bytes.extend(packed);
        }
    }
    bytes
}

/// Returns a log of three scans in a room of 4 x 3 m with a box in it; the robot moves along x.
pub fn carmen(name: &str) -> Vec<u8> {
    let mut lines = vec!["# CARMEN Logfile".to_string(), "PARAM robot_length 0.4 host 0.0".to_string()];
    for step in 0..3 {
        let x = 1.0 + 0.3 * f64::from(step);
        let ranges: Vec<String> =
            (0..181).map(|i| format!("{:.3}", range_in_room(x, f64::from(i) - 90.0))).collect();
        let ranges = ranges.join(" ");
        let pose = format!("{x} 0.0 0.0");
        lines.push(format!("ODOM {pose} 0.1 0.0 0.0 {step}.0 host {step}.0"));
        lines.push(match name {
            "FLASER" => format!("FLASER 181 {ranges} {pose} {pose} {step}.0 host {step}.0"),
            _ => format!(
                "ROBOTLASER1 0 -1.5707963 3.1415927 0.0174533 80.0 0.01 0 181 {ranges} 0 {pose} {pose} 0 0 0 0 0 {step}.0 \
                 host {step}.0"
            ),
        });
    }
    lines.join("\n").into_bytes()
}

/// Returns the range from (x, 0) in the room [0, 4] x [-1, 2], whose corner beyond x = 3, y = 1 is filled.
fn range_in_room(x: f64, angle_deg: f64) -> f64 {
    let (s, c) = angle_deg.to_radians().sin_cos();
    let mut range_m = 0.0;
    let is_free =
        |x: f64, y: f64| (0.0..4.0).contains(&x) && (-1.0..2.0).contains(&y) && !(x > 3.0 && y > 1.0);
    while is_free(x + range_m * c, range_m * s) {
        range_m += 0.002;
    }
    range_m
}

/// Returns a small valid file of each of these formats.
pub fn robot_files() -> Vec<(&'static str, Vec<u8>)> {
    vec![
        ("roborock", roborock()),
        ("roborock gzip", gzip(&roborock())),
        ("dreame", dreame(&dreame_inflated(b'I'))),
        ("dreame inflated", dreame_inflated(b'I')),
        ("viomi", zlib(&viomi_inflated(77))),
        ("valetudo png", valetudo_png(&valetudo(true, true))),
        ("pcd ascii", pcd("ascii")),
        ("pcd binary", pcd("binary")),
        ("pcd compressed", pcd("binary_compressed")),
        ("carmen old", carmen("FLASER")),
        ("carmen", carmen("ROBOTLASER1")),
    ]
}
