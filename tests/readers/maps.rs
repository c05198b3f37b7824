//! Maps in each format: the drawing is read.

use crate::drawing::*;
use crate::writers::{as_folder, encode, zip_bytes};
use image::{DynamicImage, ImageFormat, LumaA};
use serde_json::json;
use viola_formats::lidar::{Cell, LidarMap};
use viola_geometry::{Point2, Pose2, angle_between};

/// Checks that the map shows the drawing with its lower-left corner at `corner`: cells, points and info.
pub fn check_home(what: &str, map: &LidarMap, corner: [f64; 2]) {
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
    // With a byte order mark, as some tools write it.
    assert!(LidarMap::read(&[b"\xef\xbb\xbf", text(&valetudo(true, true)).as_slice()].concat()).is_ok());
}

#[test]
fn a_map_with_hardly_any_wall_takes_the_floors_border() {
    for (walls, noted) in [(json!([42, 30, 2]), "only 2 wall cells"), (json!([]), "no wall cells")] {
        let mut file = valetudo(true, true);
        file["layers"][0]["compressedPixels"] = walls;
        let map = LidarMap::read(&text(&file)).unwrap_or_else(|error| panic!("{noted}: {error}"));
        assert!(map.info.notes.iter().any(|note| note.contains(noted)), "{:?}", map.info.notes);
        // Every cell beside the floor: by hand from the drawing, all walls but the four corners that touch no
        // floor, and the gap in the lowest row.
        let cell = |x: usize, y: usize| {
            let at = Point2::new(2.0 + (x as f64 + 0.5) * CELL_M, 4.0 - (y as f64 + 30.5) * CELL_M);
            map.cells.as_ref().unwrap().at(&at).unwrap_or(Cell::Unknown)
        };
        assert_eq!(cell(2, 1), Cell::Occupied, "{noted}");
        assert_eq!(cell(4, 5), Cell::Occupied, "{noted}: the gap below the floor");
        assert_eq!(cell(6, 0), Cell::Unknown, "{noted}: a corner");
        assert_eq!(cell(3, 1), Cell::Free, "{noted}");
    }
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
    let no =
        String::from_utf8(yaml("")).unwrap().replace("negate: 0", "negate: no").replace("0.65", "'0.65'");
    check("as yaml-cpp reads it", format!("\u{feff}{no}").as_bytes(), &saved);
    check("scale", &yaml("mode: scale\n"), &pgm(grey(10, 250, 128)));
    check("raw", &yaml("mode: raw\n"), &pgm(grey(100, 0, 255)));
    // nav2's saver writes 0.25, under which its own unknown would be floor.
    let wide = String::from_utf8(yaml("")).unwrap().replace("0.196", "0.25").into_bytes();
    let map = check("free_thresh 0.25", &wide, &saved);
    assert!(map.info.notes[0].contains("205"), "{:?}", map.info.notes);
    // A saver's image is still one after an eraser stroke, and in red, green and blue.
    let mut cleaned = grey(0, 254, 205);
    cleaned.put_pixel(3, 1, image::Luma([255]));
    let rgb = DynamicImage::from(cleaned.clone()).to_rgb8();
    for (what, image) in [("cleaned", pgm(cleaned)), ("rgb", encode(&rgb.into(), ImageFormat::Png))] {
        let map = check(what, &wide, &image);
        assert!(map.info.notes[0].contains("205"), "{what}: {:?}", map.info.notes);
    }
    // For an image that is not a saver's, the file's threshold applies.
    let map = LidarMap::read(&ros_zip(&wide, &pgm(grey(0, 250, 205)))).unwrap();
    assert_eq!(map.info.free_cells, 48 - map.info.occupied_points);
    // In scale mode transparent pixels are unknown.
    let mut clear = image::GrayAlphaImage::from_pixel(8, 6, LumaA([255, 0]));
    for (x, y, symbol) in cells().filter(|(_, _, symbol)| *symbol != ' ') {
        clear.put_pixel(x as u32, y as u32, LumaA([if symbol == '#' { 0 } else { 255 }, 255]));
    }
    // An opaque alpha channel counts nothing.
    let opaque = DynamicImage::from(grey(0, 254, 205));
    check("opaque grey", &yaml(""), &encode(&opaque.to_luma_alpha8().into(), ImageFormat::Png));
    check("opaque colour", &yaml(""), &encode(&opaque.to_rgba8().into(), ImageFormat::Png));
    check("a mode in capitals", &yaml("mode: Scale\n"), &pgm(grey(10, 250, 128)));
    check("scale with alpha", &yaml("mode: scale\n"), &encode(&clear.into(), ImageFormat::Png));
}

#[test]
fn a_ros_map_is_read_from_its_yaml_file() {
    let image = pgm(grey(0, 254, 205));
    let absolute = String::from_utf8(yaml("")).unwrap().replace("map.pgm", "/home/robot/maps/map.pgm");
    for (name, yaml) in [("map.yaml", yaml("")), ("MAP.YAML", absolute.into_bytes())] {
        let folder = as_folder(&[(name.into(), yaml), ("map.pgm".into(), image.clone())]);
        check_home(name, &LidarMap::open(&folder.path().join(name)).unwrap(), [-1.0, 2.0]);
    }
}

#[test]
fn the_masks_beside_a_ros_map_are_ignored() {
    let named = |image: &str| String::from_utf8(yaml("")).unwrap().replace("map.pgm", image).into_bytes();
    let (map, mask) = (pgm(grey(0, 254, 205)), pgm(grey(254, 254, 0)));
    let masks = ["keepout_mask", "semantic_mask", "room_mask", "Speed_Filter"];
    let mut files: Vec<(String, Vec<u8>)> = Vec::new();
    for name in masks {
        files.push((format!("home/{name}.yaml"), named(&format!("{name}.pgm"))));
        files.push((format!("home/{name}.pgm"), mask.clone()));
    }
    let masks_alone = zip_bytes(&files);
    files.push(("home/map.yaml".into(), named("map.pgm")));
    // The image of the map may have another name; those of the masks do not count.
    for image in ["home/map.pgm", "home/plan.pgm"] {
        let files = [&files[..], &[(image.to_string(), map.clone())]].concat();
        let read = LidarMap::read(&zip_bytes(&files)).unwrap_or_else(|error| panic!("{image}: {error}"));
        check_home(image, &read, [-1.0, 2.0]);
        assert!(read.info.notes.iter().any(|note| note.starts_with("4 yaml files of masks")), "{image}");
    }
    // A mask alone is a map.
    assert!(LidarMap::read(&zip_bytes(&files[..2])).is_ok());
    let two_maps = zip_bytes(&[("a.yaml".into(), yaml("")), ("b.yaml".into(), yaml("")), files[0].clone()]);
    for (zip, names) in [
        (
            &masks_alone,
            "(home/Speed_Filter.yaml, home/keepout_mask.yaml, home/room_mask.yaml, home/semantic_mask.yaml)",
        ),
        (&two_maps, "(a.yaml, b.yaml)"),
    ] {
        let error = LidarMap::read(zip).unwrap_err();
        assert!(error.code() == "bad_yaml" && error.to_string().contains(names), "{error}");
    }
}

#[test]
fn a_ros_image_in_an_absent_folder_is_taken_beside_its_yaml_file() {
    let image = pgm(grey(0, 254, 205));
    let relative = String::from_utf8(yaml("")).unwrap().replace("map.pgm", "maps/map.pgm").into_bytes();
    for (place, is_noted) in [("map.pgm", true), ("maps/map.pgm", false)] {
        let folder = as_folder(&[("map.yaml".into(), relative.clone()), (place.into(), image.clone())]);
        let zip = zip_bytes(&[
            ("home/map.yaml".into(), relative.clone()),
            (format!("home/{place}"), image.clone()),
        ]);
        for map in [LidarMap::open(&folder.path().join("map.yaml")), LidarMap::read(&zip)] {
            let map = map.unwrap();
            check_home(place, &map, [-1.0, 2.0]);
            let notes = &map.info.notes;
            assert_eq!(notes.iter().any(|note| note.contains("absent; map.pgm")), is_noted, "{notes:?}");
        }
    }
}

#[test]
fn the_only_image_of_a_ros_map_is_taken_under_another_name() {
    let files = |images: &[&str]| {
        let mut files = vec![("home/map.yaml".to_string(), yaml(""))];
        files.extend(images.iter().map(|name| (name.to_string(), pgm(grey(0, 254, 205)))));
        zip_bytes(&files)
    };
    for images in [&["home/Home.PGM"][..], &["home/home.png"], &["home/home.pgm", "home/old/map.pgm"]] {
        let map = LidarMap::read(&files(images)).unwrap_or_else(|error| panic!("{images:?}: {error}"));
        check_home(images[0], &map, [-1.0, 2.0]);
        let other = images[0].trim_start_matches("home/");
        let words = format!("image is map.pgm, which is absent; {other} beside");
        assert!(map.info.notes.iter().any(|note| note.starts_with(&words)), "{:?}", map.info.notes);
    }
    let map = LidarMap::read(&files(&["home/map.pgm", "home/plan.pgm"])).unwrap();
    assert_eq!(map.info.notes, Vec::<String>::new());
}

#[test]
fn a_map_that_is_the_only_file_of_a_zip_is_read() {
    for (what, bytes) in one_of_each_format() {
        let alone = LidarMap::read(&bytes).unwrap();
        let name = "home/what the robot sent".to_string();
        let zip = zip_bytes(&[("__MACOSX/._map".to_string(), vec![7]), (name, bytes.clone())]);
        match LidarMap::read(&zip) {
            Ok(map) => assert_eq!(map.info, alone.info, "{what}"),
            Err(error) => {
                assert!(bytes.starts_with(b"PK") && error.code() == "not_an_archive", "{what}: {error}")
            }
        }
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

#[test]
fn csv_points_with_any_header_and_separator() {
    let lines = |separator: &str, with: &dyn Fn(&Point2) -> Vec<f64>| {
        let line = |p: &Point2| with(p).iter().map(f64::to_string).collect::<Vec<_>>().join(separator);
        hits().iter().map(line).collect::<Vec<_>>().join("\n")
    };
    let plain = |p: &Point2| vec![p.x, p.y];
    let swapped = |p: &Point2| vec![9.0, p.y, p.x];
    let level = |p: &Point2| vec![p.x, p.y, 0.125, 200.0];
    let thousands = |p: &Point2| vec![1000.0 * p.x, 1000.0 * p.y];
    let timed = |p: &Point2| vec![9.0, p.x, p.y];
    let commas = lines(";", &plain).replace('.', ",");
    let quoted = lines("\" \"", &plain).replace('.', ",").replace('\n', "\"\n\"");
    for (what, csv) in [
        ("comma", format!("x_m,y_m\n{}", lines(",", &plain))),
        ("capitals and tabs", format!("X\tY\n{}\n", lines("\t", &plain))),
        ("capitals", format!("X;Y\r\n{}\r\n", lines(";", &plain).replace('\n', "\r\n"))),
        ("blanks", format!("\n# drawn\nx y\n{}\n\n", lines("  ", &plain))),
        ("tabs", lines("\t", &plain)),
        ("other columns", format!("\"intensity\", \"y [m]\", \"x [m]\"\n{}", lines(", ", &swapped))),
        ("a mark in front", format!("\u{feff}x,y\n{}", lines(",", &plain))),
        ("CloudCompare", format!("//X Y Z Intensity\n{}", lines(" ", &level))),
        ("decimal commas", format!("x;y\n{commas}")),
        ("decimal commas without a header", commas.clone()),
        ("quoted decimal commas", format!("\"x [m]\",\"y [m]\"\n\"{}\"", quoted.replace(' ', ","))),
        ("quoted decimal commas between blanks", format!("\"x [m]\" \"y [m]\"\n\"{quoted}\"")),
        ("units in brackets", format!("\u{feff}X (m);Y (m)\n{}", lines(";", &plain))),
        ("units between blanks", format!("X (m) Y (m)\n{}", lines(" ", &plain))),
        ("units between tabs", format!("x [m]\ty [m]\n{}", lines("\t", &plain))),
        ("positions", format!("intensity,pos_y,pos_x\n{}", lines(",", &swapped))),
        ("millimetres", format!("x_mm,y [mm]\n{}", lines(",", &thousands))),
        ("blanks in brackets", format!("x [ mm ] y [ mm ]\n{}", lines(" ", &thousands))),
        ("blanks between tabs", format!("Time (s)\tPosition X\tPosition Y\n{}", lines("\t", &timed))),
        ("one name with a blank", format!("Scan Id\tx\ty\n{}", lines("\t", &timed))),
        ("tabs above blanks", format!("x\ty\n{}", lines("  ", &plain))),
        ("separators at the ends", format!("x,y\n{},", lines(",", &plain).replace('\n', ",\n"))),
        ("NumPy", format!("# drawn\n# time x y\n{}", lines(" ", &timed))),
        ("NumPy, with units", format!("# x [mm], y [mm]\n{}", lines(",", &thousands))),
        ("another comment", format!("# x and y of the walls\n{}", lines(" ", &plain))),
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

#[test]
fn a_third_column_of_points_is_refused_only_as_the_heights_of_a_3d_scan() {
    let read = |head: &str, third: fn(f64) -> f64| {
        let line = |(index, p): (usize, &Point2)| format!("{},{},{}\n", p.x, p.y, third(index as f64));
        let lines: String = hits().iter().enumerate().map(line).collect();
        LidarMap::read(format!("{head}{lines}").as_bytes())
    };
    type Case = (&'static str, &'static str, fn(f64) -> f64);
    let heights = |index: f64| 0.1 * index;
    let scans: [Case; 4] = [
        ("heights without a header", "", heights),
        ("a column z", "x,y,z\n", heights),
        ("a column z of whole metres", "x,y,z\n", |index| index % 3.0),
        ("CloudCompare", "//X,Y,Z\n", heights),
    ];
    for (what, head, third) in scans {
        let error = read(head, third).err().unwrap_or_else(|| panic!("{what}: not refused"));
        assert_eq!(error.code(), "three_dimensional_map", "{what}");
    }
    let maps: [Case; 6] = [
        ("qualities", "", |index| index),
        ("intensities up to 1", "", |index| index / 25.0),
        ("intensities up to 255", "", |index| index * 10.2),
        ("one height", "", |_| 0.25),
        ("another column", "x,y,intensity\n", heights),
        ("heights of a tilted laser", "x,y,z\n", |index| index / 50.0),
    ];
    for (what, head, third) in maps {
        let map = read(head, third).unwrap_or_else(|error| panic!("{what}: {error}"));
        assert_eq!(map.occupied_m, hits(), "{what}");
        let has_heights = map.info.notes.iter().any(|note| note.contains("z was ignored"));
        assert_eq!(has_heights, head.contains('z'), "{what}: {:?}", map.info.notes);
    }
    let mut short: String = hits().iter().map(|p| format!("{},{},{}\n", p.x, p.y, 2.0 * p.x)).collect();
    short.push_str("0,7\n");
    assert!(LidarMap::read(short.as_bytes()).is_ok(), "one line has no third value");
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
