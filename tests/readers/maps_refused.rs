//! Maps that cannot be used are refused by name, in little memory.

use crate::drawing::*;
use crate::memory::peak_bytes;
use crate::writers::zip_bytes;
use image::{GrayImage, Luma};
use serde_json::{Value, json};
use viola_formats::lidar::LidarMap;

pub fn check_refused(what: &str, bytes: &[u8], code: &str) {
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
        (
            "neither wall nor floor",
            edited("/layers", json!([{"type": "lava", "pixels": [42, 30]}])),
            "no_walls",
        ),
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
fn a_value_of_another_type_is_named_by_its_member() {
    let map = valetudo(true, false);
    for (pointer, member) in [
        ("/pixelSize", "pixelSize: "),
        ("/layers/0/compressedPixels", "layers[0].compressedPixels: "),
        ("/layers/1/metaData/segmentId", "layers[1].metaData.segmentId: "),
        ("/entities/0/points/1", "entities[0].points[1]: "),
    ] {
        let mut file = map.clone();
        let (parent, name) = pointer.rsplit_once('/').unwrap();
        match file.pointer_mut(parent).unwrap() {
            Value::Array(items) => items[name.parse::<usize>().unwrap()] = json!(true),
            other => other[name] = json!(true),
        }
        for (bytes, path) in [
            (text(&file), member.to_string()),
            (text(&json!({ "map": file, "attributes": [] })), format!("map.{member}")),
        ] {
            let told = LidarMap::read(&bytes).unwrap_err().to_string();
            assert!(told.contains(&format!(": {path}invalid type: boolean `true`")), "{path}: {told}");
        }
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
    let id = format!(r#"{head}"layers":[{{"type":"segment","metaData":{{"segmentId":["#);
    check_refused("twenty million numbers of a segment", &many(&id, "1", 20_000_000, "]}}]}"), "bad_json");
    let runs = r#"{"type":"wall","compressedPixels":[0,0,100000]}"#;
    let runs = many(&format!(r#"{head}"layers":["#), runs, 900, "]}");
    check_refused("runs over 90 million cells", &runs, "too_many_cells");
    let apart = format!(r#"{head}"layers":[{{"type":"wall","compressedPixels":[0,0,1,99999,99999,1]}}]}}"#);
    check_refused("two cells a kilometre apart", apart.as_bytes(), "too_many_cells");
    check_refused("65 MiB", &vec![b' '; 65 << 20], "file_too_large");
}

#[test]
fn a_map_that_is_too_large_tells_how_large_and_what_may_be() {
    let told = LidarMap::read(b"x,y\n0,0\n99999,1.5\n").unwrap_err().to_string();
    assert!(["99999.0 m by 1.5 m", "250 m", "metres"].iter().all(|part| told.contains(part)), "{told}");
}

#[test]
fn ros_maps_that_cannot_be_used_are_refused_by_name() {
    let image = pgm(grey(0, 254, 205));
    let good = String::from_utf8(yaml("")).unwrap();
    for (what, from, to, code) in [
        ("no image named", "image: map.pgm", "", "bad_yaml"),
        ("an image elsewhere", "map.pgm", "../map.pgm", "bad_yaml"),
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
    // Only known cells count, so a home on a large sheet is accepted.
    let mut sheet = GrayImage::from_pixel(600, 400, Luma([205]));
    (0..8).for_each(|x| sheet.put_pixel(x, 3, Luma([0])));
    let metres = good.replace("0.05", "1.0");
    assert!(LidarMap::read(&ros_zip(metres.as_bytes(), &pgm(sheet.clone()))).is_ok());
    sheet.put_pixel(300, 3, Luma([254]));
    check_refused("300 m of floor", &ros_zip(metres.as_bytes(), &pgm(sheet)), "map_too_large");
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
    let inner = zip_bytes(&[("map.zip".into(), ros_zip(&yaml(""), &image))]);
    check_refused("a zip in a zip", &inner, "not_an_archive");
    // Either image could be the one that the yaml file names.
    let named = good.replace("map.pgm", "other.pgm").into_bytes();
    let two = [("map.yaml", named), ("map.pgm", image.clone()), ("plan.PNG", image.clone())];
    let two = zip_bytes(&two.map(|(name, bytes)| (name.to_string(), bytes)));
    check_refused("another image", &two, "yaml_without_image");
    let told = LidarMap::read(&two).unwrap_err().to_string();
    assert!(told.contains("no image other.pgm") && told.contains("map.yaml"), "{told}");
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
    check_refused("columns of other names", b"lat;lon [deg]\n48.1;11.5\n", "bad_points");
    let told = LidarMap::read(b"lat;lon [deg]\n48.1;11.5\n").unwrap_err().to_string();
    assert!(told.contains("line 1: the columns are lat, lon [deg]"), "{told}");
    // Between blanks it is unknown where a name ends.
    let names = b"Time (s) Position X Position Y\n0.5 1 2\n";
    check_refused("names of two words", names, "bad_points");
    let told = LidarMap::read(names).unwrap_err().to_string();
    assert!(told.contains("line 1: it has 5 names") && told.contains("line 2 has 3 values"), "{told}");
    check_refused("a value without a name", b"x,y\n0,1,2\n", "bad_points");
    check_refused("a hundred kilometres", b"x,y\n0,0\n99999,99999\n", "map_too_large");
    check_refused("millimetres", b"x,y\n0,0\n8200,4100\n", "map_too_large");
    assert!(LidarMap::read(b"x,y\n-90000,0\n-89750,250\n").is_ok(), "where the map lies does not matter");
    check_refused("a UTM zone", b"x,y\n412345.5,5789012\n412349,5789015\n", "map_far_from_origin");
    check_refused("a map at the limit", b"x,y\n0,99998\n1,100001\n", "map_far_from_origin");
    let points: String = (0..200).map(|n| format!("{},0\n", f64::from(n) * 0.05)).collect();
    let map = LidarMap::read(format!("x,y\n{points}412345,5\n").as_bytes()).unwrap();
    assert!(
        map.info.max_m[0] < 11.0 && map.info.notes.iter().any(|note| note.starts_with("1 points")),
        "{:?}",
        map.info
    );
    let told = LidarMap::read(b"x,y\n412345.5,5789012\n412349,5789015\n").unwrap_err().to_string();
    assert!(
        told.contains("x 412345.5 m, y 5789012.0 m") && told.contains("subtract the same offset"),
        "{told}"
    );
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
    check_refused("no vertices named", &edited("element vertex", "element point"), "bad_ply");
    let faces = "element face 1\nproperty list uchar int vertex_indices\nelement vertex";
    check_refused("faces with bytes first", &edited("element vertex", faces), "bad_ply");
    check_refused("a number short", &edited("-0.5 200", "-0.5"), "bad_ply");
    check_refused("words for numbers", &edited("-0.5 200", "-0.5 red"), "bad_ply");
    check_refused("no vertices", &edited(&vertices, "vertex 0"), "no_walls");
    let binary = ply("binary_big_endian");
    check_refused("half of it", &binary[..binary.len() - 40], "bad_ply");
    check_refused("its header", b"ply\nformat ascii 1.0\nend_header", "bad_ply");
}
