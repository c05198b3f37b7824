//! Maps in each format: what is drawn is read, and what cannot be used is refused by name.

use crate::memory::peak_bytes;
use crate::writers::{as_folder, encode, zip_bytes};
use image::{DynamicImage, GrayImage, ImageFormat, Luma, LumaA};
use serde_json::{Value, json};
use viola::geometry::{Point2, Pose2, angle_between};
use viola::lidar::{Cell, LidarMap};

/// A home from above, the top row first: `#` wall, `.` floor, `a` and `b` floor of two rooms. No symmetry.
const HOME: [&str; 6] = [
    "  ##### ", //
    "  #aa.# ", //
    "###aa.##", //
    "#....bb#", //
    "#.##.bb#", //
    "#### ###", //
];
const CELL_M: f64 = 0.05;

fn cell(symbol: char) -> Cell {
    match symbol {
        '#' => Cell::Occupied,
        ' ' => Cell::Unknown,
        _ => Cell::Free,
    }
}

/// Every cell of the drawing with its column from the left and its row from the top.
fn cells() -> impl Iterator<Item = (usize, usize, char)> {
    HOME.iter().enumerate().flat_map(|(y, row)| row.chars().enumerate().map(move |(x, c)| (x, y, c)))
}

/// The map must show the drawing with its lower-left corner at `corner`: cells, points and what is told.
fn check_home(what: &str, map: &LidarMap, corner: [f64; 2]) {
    let centre = |x: usize, y: usize| {
        let from_bottom = (HOME.len() - 1 - y) as f64;
        Point2::new(corner[0] + (x as f64 + 0.5) * CELL_M, corner[1] + (from_bottom + 0.5) * CELL_M)
    };
    let grid = map.cells.as_ref().unwrap();
    let mut walls = 0;
    for (x, y, symbol) in cells() {
        let point = centre(x, y);
        assert_eq!(grid.at(&point).unwrap_or(Cell::Unknown), cell(symbol), "{what}: column {x}, row {y}");
        let is_hit = map.occupied_m.iter().any(|p| (p - point).norm() < 1e-9);
        assert_eq!(is_hit, symbol == '#', "{what}: column {x}, row {y}");
        walls += usize::from(symbol == '#');
    }
    let free = cells().filter(|(_, _, symbol)| cell(*symbol) == Cell::Free).count();
    assert_eq!((map.info.occupied_points, map.info.free_cells), (walls, free), "{what}");
    assert!((map.info.free_area_m2 - free as f64 * CELL_M * CELL_M).abs() < 1e-9, "{what}");
    assert_eq!(map.info.cell_m, Some(CELL_M), "{what}");
    for axis in 0..2 {
        let side_m = [8.0, 6.0][axis] * CELL_M;
        assert!((map.info.min_m[axis] - corner[axis]).abs() < 1e-9, "{what}: {:?}", map.info);
        assert!((map.info.max_m[axis] - corner[axis] - side_m).abs() < 1e-9, "{what}: {:?}", map.info);
    }
}

/// The drawing on a sheet of 100 x 80 pixels, its top-left corner at pixel (40, 30).
fn valetudo(runs_of_walls: bool, runs_of_floors: bool) -> Value {
    let layer = |kind: &str, symbols: &str, runs: bool, meta: Value| {
        let (mut pixels, mut compressed): (Vec<usize>, Vec<usize>) = Default::default();
        for (x, y, _) in cells().filter(|(_, _, symbol)| symbols.contains(*symbol)) {
            let (x, y) = (x + 40, y + 30);
            match compressed.as_mut_slice() {
                _ if !runs => pixels.extend([x, y]),
                [.., last_x, last_y, count] if *last_y == y && *last_x + *count == x => *count += 1,
                _ => compressed.extend([x, y, 1]),
            }
        }
        json!({"__class": "MapLayer", "type": kind, "metaData": meta, "pixels": pixels, "compressedPixels": compressed,
               "dimensions": {"pixelCount": 3}})
    };
    json!({
        "__class": "ValetudoMap",
        "metaData": {"version": if runs_of_walls { 2 } else { 1 }},
        "size": {"x": 500, "y": 400},
        "pixelSize": 5,
        "layers": [
            layer("wall", "#", runs_of_walls, json!({})),
            layer("floor", ".ab", runs_of_floors, json!({"area": 1})),
            layer("segment", "a", true, json!({"segmentId": "16", "name": "Kitchen"})),
            layer("segment", "b", runs_of_walls, json!({"segmentId": 17})),
        ],
        "entities": [
            {"__class": "PathMapEntity", "type": "path", "points": [1, 2, 3, 4], "metaData": {}},
            {"__class": "PointMapEntity", "type": "charger_location", "points": [230, 170], "metaData": {"angle": 90}},
        ],
    })
}

fn text(value: &Value) -> Vec<u8> {
    serde_json::to_vec(value).unwrap()
}

#[test]
fn valetudo_in_both_versions_is_y_up_from_the_lower_left_corner() {
    for (walls, floors) in [(true, true), (false, false), (true, false), (false, true)] {
        let map = LidarMap::read(&text(&valetudo(walls, floors))).unwrap();
        assert_eq!(map.info.format, "valetudo");
        // 400 cm high, and the drawing ends 36 pixels from the top.
        check_home("valetudo", &map, [2.0, 4.0 - 36.0 * CELL_M]);
        assert_eq!(map.rooms.len(), 2);
        assert_eq!((map.rooms[0].id.as_str(), map.rooms[0].name.as_deref()), ("16", Some("Kitchen")));
        assert_eq!((map.rooms[1].id.as_str(), map.rooms[1].name.as_deref()), ("17", None));
        assert_eq!((map.rooms[0].cells_m.len(), map.rooms[1].cells_m.len()), (4, 4));
        // Room a: columns 3 and 4, rows 1 and 2 of the drawing.
        let centre_m = map.info.rooms[0].centre_m;
        assert!((centre_m[0] - 2.2).abs() < 1e-9 && (centre_m[1] - 2.4).abs() < 1e-9, "{centre_m:?}");
        // 90 degrees clockwise from up is along x.
        let charger = map.charger.unwrap();
        assert!(charger.distance_m(&Pose2::new(2.3, 2.3, 0.0)) < 1e-9 && charger.yaw_rad.abs() < 1e-9);
    }
    // A mark in front, as some tools write.
    assert!(LidarMap::read(&[b"\xef\xbb\xbf", text(&valetudo(true, true)).as_slice()].concat()).is_ok());
}

#[test]
fn a_map_with_hardly_any_wall_takes_the_floors_border() {
    let mut file = valetudo(true, true);
    file["layers"][0]["compressedPixels"] = json!([42, 30, 2]);
    let map = LidarMap::read(&text(&file)).unwrap();
    assert!(map.info.notes.iter().any(|note| note.contains("only 2 wall cells")), "{:?}", map.info.notes);
    // The two wall cells, and every cell beside the floor: by hand from the drawing, all walls but the four
    // corners that touch no floor, and the gap in the lowest row.
    let cell = |x: usize, y: usize| {
        let at = Point2::new(2.0 + (x as f64 + 0.5) * CELL_M, 4.0 - (y as f64 + 30.5) * CELL_M);
        map.cells.as_ref().unwrap().at(&at).unwrap_or(Cell::Unknown)
    };
    assert_eq!(cell(2, 1), Cell::Occupied);
    assert_eq!(cell(4, 5), Cell::Occupied, "the gap below the floor");
    assert_eq!(cell(6, 0), Cell::Unknown, "a corner");
    assert_eq!(cell(3, 1), Cell::Free);
}

fn yaml(extra: &str) -> Vec<u8> {
    format!("image: map.pgm\nresolution: 0.05\norigin: [-1.0, 2.0, 0.0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n{extra}")
        .into_bytes()
}

/// The drawing as an image with these values for wall, floor and unknown.
fn grey(wall: u8, floor: u8, unknown: u8) -> GrayImage {
    let mut image = GrayImage::new(8, 6);
    for (x, y, symbol) in cells() {
        let value = match cell(symbol) {
            Cell::Occupied => wall,
            Cell::Free => floor,
            Cell::Unknown => unknown,
        };
        image.put_pixel(x as u32, y as u32, Luma([value]));
    }
    image
}

fn pgm(image: GrayImage) -> Vec<u8> {
    let header = format!("P5\n# drawn\n{} {}\n255\n", image.width(), image.height());
    [header.as_bytes(), image.as_raw()].concat()
}

fn ros_zip(yaml: &[u8], image: &[u8]) -> Vec<u8> {
    zip_bytes(&[("home/map.yaml".into(), yaml.to_vec()), ("home/map.pgm".into(), image.to_vec())])
}

#[test]
fn ros_maps_in_each_mode_and_encoding() {
    let corner = [-1.0, 2.0];
    let check = |what: &str, yaml: &[u8], image: &[u8]| {
        let map = LidarMap::read(&ros_zip(yaml, image)).unwrap_or_else(|error| panic!("{what}: {error}"));
        assert_eq!(map.info.format, "ros_map_server");
        check_home(what, &map, corner);
        map
    };
    let saved = pgm(grey(0, 254, 205));
    let map = check("P5", &yaml(""), &saved);
    assert_eq!(map.info.notes, Vec::<String>::new());
    let values: Vec<String> = grey(0, 254, 205).into_raw().iter().map(u8::to_string).collect();
    check("P2", &yaml(""), format!("P2\n# drawn\n8 6\n255\n{}\n", values.join(" ")).as_bytes());
    let small: Vec<String> = grey(0, 15, 12).into_raw().iter().map(u8::to_string).collect();
    // 12 of 15 is an occupancy of 0.2.
    check("P2, 15 is white", &yaml(""), format!("P2 8 6 15 {}", small.join(" ")).as_bytes());
    check("png", &yaml(""), &encode(&grey(0, 254, 205).into(), ImageFormat::Png));
    check(
        "rgb png",
        &yaml(""),
        &encode(&DynamicImage::from(grey(0, 254, 205)).to_rgb8().into(), ImageFormat::Png),
    );
    check(
        "16-bit png",
        &yaml(""),
        &encode(&DynamicImage::from(grey(0, 254, 205)).to_luma16().into(), ImageFormat::Png),
    );
    check(
        "negate",
        &String::from_utf8(yaml("")).unwrap().replace("negate: 0", "negate: true").into_bytes(),
        &pgm(grey(255, 0, 50)),
    );
    check("scale", &yaml("mode: scale\n"), &pgm(grey(10, 250, 128)));
    check("raw", &yaml("mode: raw\n"), &pgm(grey(100, 0, 255)));
    // nav2's saver writes 0.25, under which its own unknown would be floor.
    let wide = String::from_utf8(yaml("")).unwrap().replace("0.196", "0.25").into_bytes();
    let map = check("free_thresh 0.25", &wide, &saved);
    assert!(map.info.notes[0].contains("205"), "{:?}", map.info.notes);
    // Where the image is not a saver's, the file's threshold holds.
    let map = LidarMap::read(&ros_zip(&wide, &pgm(grey(0, 250, 205)))).unwrap();
    assert_eq!(map.info.free_cells, 48 - map.info.occupied_points);
    // In scale mode what is transparent is unknown.
    let mut clear = image::GrayAlphaImage::from_pixel(8, 6, LumaA([255, 0]));
    for (x, y, symbol) in cells().filter(|(_, _, symbol)| *symbol != ' ') {
        clear.put_pixel(x as u32, y as u32, LumaA([if symbol == '#' { 0 } else { 255 }, 255]));
    }
    check("scale with alpha", &yaml("mode: scale\n"), &encode(&clear.into(), ImageFormat::Png));
}

#[test]
fn a_ros_map_is_read_from_its_yaml_file() {
    let image = pgm(grey(0, 254, 205));
    let absolute = String::from_utf8(yaml("")).unwrap().replace("map.pgm", "/home/robot/maps/map.pgm");
    for yaml in [yaml(""), absolute.into_bytes()] {
        let folder = as_folder(&[("map.yaml".into(), yaml), ("map.pgm".into(), image.clone())]);
        check_home("yaml", &LidarMap::open(&folder.path().join("map.yaml")).unwrap(), [-1.0, 2.0]);
    }
}

#[test]
fn a_turned_ros_map_is_turned() {
    let straight = LidarMap::read(&ros_zip(&yaml(""), &pgm(grey(0, 254, 205)))).unwrap();
    for yaw_rad in [0.3, -2.0, std::f64::consts::FRAC_PI_2] {
        let turned = String::from_utf8(yaml("")).unwrap().replace("2.0, 0.0]", &format!("2.0, {yaw_rad}]"));
        let map = LidarMap::read(&ros_zip(turned.as_bytes(), &pgm(grey(0, 254, 205)))).unwrap();
        // About the image's lower-left corner, which is the origin.
        let corner = Pose2::new(-1.0, 2.0, 0.0);
        let map_from_straight = Pose2::new(-1.0, 2.0, yaw_rad).compose(&corner.inverse());
        assert!(angle_between(map_from_straight.yaw_rad, yaw_rad) < 1e-12);
        assert_eq!(map.occupied_m.len(), straight.occupied_m.len());
        for point in &straight.occupied_m {
            let expected = map_from_straight.apply(point);
            assert!(map.occupied_m.iter().any(|p| (p - expected).norm() < 1e-9), "{yaw_rad}: {expected}");
            assert_eq!(map.cells.as_ref().unwrap().at(&expected), Some(Cell::Occupied));
        }
        assert!(map.info.notes.iter().any(|note| note.contains("yaw")));
    }
}

/// The centres of the drawing's walls.
fn hits() -> Vec<Point2> {
    let walls = cells().filter(|(_, _, symbol)| *symbol == '#');
    walls.map(|(x, y, _)| Point2::new(x as f64 * 0.25 - 1.0, 7.5 - y as f64 * 0.25)).collect()
}

#[test]
fn csv_points_with_any_header_and_separator() {
    let lines = |separator: &str, with: &dyn Fn(&Point2) -> Vec<f64>| {
        let line = |p: &Point2| with(p).iter().map(f64::to_string).collect::<Vec<_>>().join(separator);
        hits().iter().map(line).collect::<Vec<_>>().join("\n")
    };
    let plain = |p: &Point2| vec![p.x, p.y];
    let swapped = |p: &Point2| vec![9.0, p.y, p.x];
    for (what, csv) in [
        ("comma", format!("x_m,y_m\n{}", lines(",", &plain))),
        ("capitals", format!("X;Y\r\n{}\r\n", lines(";", &plain).replace('\n', "\r\n"))),
        ("blanks", format!("\n# drawn\nx y\n{}\n\n", lines("  ", &plain))),
        ("tabs", lines("\t", &plain)),
        ("other columns", format!("\"intensity\", \"y [m]\", \"x [m]\"\n{}", lines(", ", &swapped))),
        ("a mark in front", format!("\u{feff}x,y\n{}", lines(",", &plain))),
    ] {
        let map = LidarMap::read(csv.as_bytes()).unwrap_or_else(|error| panic!("{what}: {error}"));
        assert_eq!(map.info.format, "csv_points", "{what}");
        assert_eq!(map.occupied_m, hits(), "{what}");
        assert!(map.cells.is_none() && map.rooms.is_empty() && map.charger.is_none());
        assert_eq!((map.info.min_m, map.info.max_m), ([-1.0, 6.25], [0.75, 7.5]));
    }
    let map = LidarMap::read(b"1,2\nNaN,3\n3,inf\n1e9,4\n1,2\n0,-0\n-0,0\n").unwrap();
    assert_eq!(map.occupied_m, [Point2::new(1.0, 2.0), Point2::new(0.0, 0.0)]);
    assert!(
        map.info.notes.iter().any(|note| note.starts_with("3 points that are not finite")),
        "{:?}",
        map.info.notes
    );
    assert!(map.info.notes.iter().any(|note| note.starts_with("2 points that are there twice")));
}

/// The walls as PLY with a colour between the coordinates, a height, and a face behind.
fn ply(format: &str) -> Vec<u8> {
    let hits = hits();
    let mut bytes = format!(
        "ply\nformat {format} 1.0\ncomment drawn\nelement vertex {}\nproperty float x\nproperty uchar red\n\
         property double y\nproperty short z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n",
        hits.len()
    )
    .into_bytes();
    for (index, p) in hits.iter().enumerate() {
        let (x, red, y, z) = (p.x as f32, 200u8, p.y, index as i16 - 4);
        match format {
            "ascii" => bytes.extend(format!("{x} {red} {y} {z}\n").bytes()),
            "binary_little_endian" => {
                bytes.extend(x.to_le_bytes());
                bytes.push(red);
                bytes.extend(y.to_le_bytes());
                bytes.extend(z.to_le_bytes());
            }
            _ => {
                bytes.extend(x.to_be_bytes());
                bytes.push(red);
                bytes.extend(y.to_be_bytes());
                bytes.extend(z.to_be_bytes());
            }
        }
    }
    bytes.extend(b"3 0 1 2\n");
    bytes
}

#[test]
fn ply_points_in_each_encoding() {
    for format in ["ascii", "binary_little_endian", "binary_big_endian"] {
        let map = LidarMap::read(&ply(format)).unwrap_or_else(|error| panic!("{format}: {error}"));
        assert_eq!(map.info.format, "ply_points");
        assert_eq!(map.occupied_m, hits(), "{format}");
        assert!(map.info.notes[0].contains("z was ignored"), "{:?}", map.info.notes);
    }
}

/// A small valid file of each format.
pub fn one_of_each_format() -> Vec<(&'static str, Vec<u8>)> {
    let csv: Vec<String> = hits().iter().map(|p| format!("{},{}", p.x, p.y)).collect();
    vec![
        ("valetudo 2", text(&valetudo(true, true))),
        ("valetudo 1", text(&valetudo(false, false))),
        ("ros pgm", ros_zip(&yaml(""), &pgm(grey(0, 254, 205)))),
        ("ros png", ros_zip(&yaml("mode: scale"), &encode(&grey(0, 254, 205).into(), ImageFormat::Png))),
        ("csv", format!("x,y\n{}", csv.join("\n")).into_bytes()),
        ("ply ascii", ply("ascii")),
        ("ply binary", ply("binary_little_endian")),
    ]
}

fn check_refused(what: &str, bytes: &[u8], code: &str) {
    let (result, peak) = peak_bytes(|| LidarMap::read(bytes).map(drop));
    let error = result.err().unwrap_or_else(|| panic!("{what}: was not refused"));
    assert_eq!(error.code(), code, "{what}: {error}");
    assert!(
        peak < (8 * bytes.len()).min(192 << 20) + (16 << 20),
        "{what}: {peak} bytes at once for {} read",
        bytes.len()
    );
}

#[test]
fn valetudo_maps_that_cannot_be_used_are_refused_by_name() {
    let edited = |pointer: &str, value: Value| {
        let mut file = valetudo(true, false);
        *file.pointer_mut(pointer).unwrap() = value;
        text(&file)
    };
    let runs = "/layers/0/compressedPixels";
    let cases: [(&str, Vec<u8>, &str); 22] = [
        ("a run of 10^9 cells", edited(runs, json!([0, 0, 1_000_000_000])), "bad_field"),
        ("a run of 10^12 cells", edited(runs, json!([0, 0, 1_000_000_000_000i64])), "bad_field"),
        ("an empty run", edited(runs, json!([0, 0, 0])), "bad_field"),
        ("a run beyond the sheet", edited(runs, json!([99, 0, 2])), "bad_field"),
        ("a run below the sheet", edited(runs, json!([0, 80, 1])), "bad_field"),
        ("a negative x", edited(runs, json!([-1, 0, 1])), "bad_field"),
        ("a cut run", edited(runs, json!([1, 1])), "bad_field"),
        ("a run of text", edited(runs, json!(["a", 1, 1])), "bad_json"),
        ("a run of fractions", edited(runs, json!([1.5, 1, 1])), "bad_json"),
        ("a pixel outside", edited("/layers/1/pixels", json!([100, 0])), "bad_field"),
        ("half a pixel", edited("/layers/1/pixels", json!([1, 2, 3])), "bad_field"),
        ("a sheet of 10^9", edited("/size/x", json!(1_000_000_000)), "bad_field"),
        ("a sheet of -1", edited("/size/y", json!(-1)), "bad_field"),
        ("pixels of no size", edited("/pixelSize", json!(0)), "bad_field"),
        ("pixels of 10 m", edited("/pixelSize", json!(1000)), "bad_field"),
        ("pixels of text", edited("/pixelSize", json!("5")), "bad_json"),
        ("no wall", edited(runs, json!([])), "no_walls"),
        ("no layers", edited("/layers", json!([])), "no_walls"),
        ("layers that are no list", edited("/layers", json!({})), "bad_json"),
        ("other JSON", b"{\"a\": 1}".to_vec(), "bad_json"),
        ("half the file", text(&valetudo(true, true))[..200].to_vec(), "bad_json"),
        ("nesting", b"{\"layers\":".iter().copied().chain([b'['; 100_000]).collect(), "bad_json"),
    ];
    for (what, bytes, code) in cases {
        check_refused(what, &bytes, code);
    }
}

#[test]
fn large_hostile_json_costs_little_more_than_itself() {
    let many = |head: &str, item: &str, count: usize, tail: &str| {
        format!("{head}{}{item}{tail}", format!("{item},").repeat(count)).into_bytes()
    };
    let head = r#"{"size":{"x":100000,"y":100000},"pixelSize":1,"#;
    let layers = many(&format!(r#"{head}"layers":["#), r#"{"type":""}"#, 4_000_000, "]}");
    check_refused("four million layers", &layers, "bad_json");
    let entities = many(&format!(r#"{head}"layers":[],"entities":["#), r#"{"type":""}"#, 4_000_000, "]}");
    check_refused("four million entities", &entities, "bad_json");
    let pixels = many(&format!(r#"{head}"layers":[{{"type":"wall","pixels":["#), "1", 20_000_000, "]}]}");
    check_refused("twenty million numbers", &pixels, "bad_json");
    let runs = r#"{"type":"wall","compressedPixels":[0,0,100000]}"#;
    let runs = many(&format!(r#"{head}"layers":["#), runs, 900, "]}");
    check_refused("runs over 90 million cells", &runs, "too_many_cells");
    let apart = format!(r#"{head}"layers":[{{"type":"wall","compressedPixels":[0,0,1,99999,99999,1]}}]}}"#);
    check_refused("two cells a kilometre apart", apart.as_bytes(), "too_many_cells");
    check_refused("65 MiB", &vec![b' '; 65 << 20], "file_too_large");
}

#[test]
fn ros_maps_that_cannot_be_used_are_refused_by_name() {
    let image = pgm(grey(0, 254, 205));
    let good = String::from_utf8(yaml("")).unwrap();
    for (what, from, to, code) in [
        ("no image named", "image: map.pgm", "", "bad_yaml"),
        ("an image elsewhere", "map.pgm", "../map.pgm", "bad_yaml"),
        ("another image", "map.pgm", "other.pgm", "yaml_without_image"),
        ("no resolution", "resolution: 0.05", "", "bad_yaml"),
        ("resolution 0", "0.05", "0", "bad_yaml"),
        ("resolution -1", "0.05", "-1", "bad_yaml"),
        ("resolution NaN", "0.05", ".nan", "bad_yaml"),
        ("an origin of two", "2.0, 0.0]", "2.0]", "bad_yaml"),
        ("an infinite origin", "2.0, 0.0]", ".inf, 0.0]", "bad_yaml"),
        ("no threshold", "free_thresh: 0.196", "", "bad_yaml"),
        ("thresholds the wrong way", "0.65", "0.1", "bad_yaml"),
        ("a mode of its own", "negate: 0", "negate: 0\nmode: ternary", "bad_yaml"),
        ("no yaml", "image", "[", "bad_yaml"),
    ] {
        assert!(good.contains(from), "{what}");
        check_refused(what, &ros_zip(good.replace(from, to).as_bytes(), &image), code);
    }
    let no_wall = pgm(GrayImage::from_pixel(8, 6, Luma([254])));
    check_refused("no wall", &ros_zip(&yaml(""), &no_wall), "no_walls");
    check_refused("a cut image", &ros_zip(&yaml(""), &image[..20]), "bad_image");
    check_refused("no image", &ros_zip(&yaml(""), b"nothing"), "bad_image");
    check_refused("100 000 x 100 000", &ros_zip(&yaml(""), b"P5 100000 100000 255\n"), "too_many_cells");
    check_refused("8 000 x 8 000 of nothing", &ros_zip(&yaml(""), b"P2 8000 8000 255\n0 0 0"), "bad_image");
    check_refused("0 x 5", &ros_zip(&yaml(""), b"P5 0 5 255\n"), "bad_image");
    check_refused("an image alone", &image, "image_without_yaml");
    check_refused("a yaml alone", &yaml(""), "yaml_without_image");
    check_refused(
        "a zip of something else",
        &zip_bytes(&[("a.txt".into(), b"a".to_vec())]),
        "unknown_format",
    );
    let two = [("a.yaml", yaml("")), ("b.yaml", yaml(""))].map(|(name, bytes)| (name.to_string(), bytes));
    check_refused("two maps", &zip_bytes(&two), "bad_yaml");
    check_refused("half a zip", &ros_zip(&yaml(""), &image)[..60], "zip_truncated");
    let up = zip_bytes(&[("../map.yaml".into(), yaml("")), ("../map.pgm".into(), image)]);
    check_refused("a zip that leads out", &up, "path_escapes");
}

#[test]
fn points_that_cannot_be_used_are_refused_by_name() {
    check_refused("nothing", b"", "empty");
    check_refused("blanks", b" \n\t ", "empty");
    check_refused("a text", b"This is a text file that somebody sent by mistake.", "unknown_format");
    check_refused("bytes", &[0xfe, 1, 2, 0xff], "unknown_format");
    check_refused("a list", b"[1, 2, 3]", "unknown_format");
    check_refused("a header alone", b"x,y\n", "no_walls");
    check_refused("no finite point", b"x,y\nnan,nan\n", "no_walls");
    check_refused("a word", b"x,y\n1,2\n1,two\n", "bad_points");
    check_refused("one column", b"x,y\n1\n", "bad_points");
    check_refused("five million and one points", &b"1 2\n".repeat(5_000_001), "too_many_points");

    let ascii = String::from_utf8(ply("ascii")).unwrap();
    let edited = |from: &str, to: &str| {
        assert!(ascii.contains(from), "{from}");
        ascii.replacen(from, to, 1).into_bytes()
    };
    let vertices = format!("vertex {}", hits().len());
    check_refused("no y", &edited("double y", "double w"), "bad_ply");
    check_refused("no end", &edited("end_header", "end"), "bad_ply");
    check_refused("a format of its own", &edited("ascii", "binary"), "bad_ply");
    check_refused("10^9 vertices", &edited(&vertices, "vertex 1000000000"), "too_many_points");
    check_refused("-1 vertices", &edited(&vertices, "vertex -1"), "bad_ply");
    check_refused(
        "lists in vertices",
        &edited("property uchar red", "property list uchar int red"),
        "bad_ply",
    );
    check_refused("faces first", &edited("element vertex", "element face 1\nelement vertex"), "bad_ply");
    check_refused("words for numbers", &edited("-0.5 200", "-0.5 red"), "bad_ply");
    check_refused("no vertices", &edited(&vertices, "vertex 0"), "no_walls");
    let binary = ply("binary_big_endian");
    check_refused("half of it", &binary[..binary.len() - 40], "bad_ply");
    check_refused("its header", b"ply\nformat ascii 1.0\nend_header", "bad_ply");
}
