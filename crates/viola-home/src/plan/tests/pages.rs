//! Titles, names, sheets and resolution of the pages.

use super::super::*;
use super::plan_of;
use flate2::Crc;
use viola_geometry::taxonomy::Class;

/// Returns a plan with one wall around a box.
fn box_of(size_m: [f64; 2]) -> Plan {
    let [x, y] = size_m;
    let ring_m = vec![[0.0, 0.0], [x, 0.0], [x, y], [0.0, y]];
    let masonry = vec![Outline { ring_m, holes_m: Vec::new() }];
    Plan { masonry, rooms: Vec::new(), furniture: Vec::new(), ..plan_of("") }
}

fn titled(level: &str, home_name: Option<&str>) -> Plan {
    let home_name = home_name.map(str::to_owned);
    Plan { level: level.parse().unwrap(), home_name, ..plan_of("Kitchen") }
}

fn has(bytes: &[u8], words: &str) -> bool {
    bytes.windows(words.len()).any(|part| part == words.as_bytes())
}

#[test]
fn pictures_show_the_letters_that_the_font_has() {
    for (name, shown) in [
        ("\u{53a8}\u{623f}", ""),
        ("\u{30ea}\u{30d3}\u{30f3}\u{30b0}", ""),
        ("\u{2728}!", ""),
        ("Bad \u{1f6c1}", "Bad"),
        (
            "\u{1f6cf}\u{fe0f} \u{421}\u{43f}\u{430}\u{43b}\u{44c}\u{43d}\u{44f}",
            "\u{421}\u{43f}\u{430}\u{43b}\u{44c}\u{43d}\u{44f}",
        ),
        ("K\u{fc}che \u{53a8}\u{623f}", "K\u{fc}che"),
    ] {
        let (plan, other) = (plan_of(name), plan_of(shown));
        assert!(plan_svg(&plan).contains(name));
        assert_eq!(plan_json(&plan)["rooms"][0]["name"], name);
        assert!(plan_png(&plan) == plan_png(&other) && plan_pdf(&plan) == plan_pdf(&other), "{name}");
    }
    assert!(plan_pdf(&plan_of("K\u{fc}che")) != plan_pdf(&plan_of("")));
}

#[test]
fn a_long_name_ends_behind_a_word_with_an_ellipsis() {
    for (name, shown) in [
        ("Wohnzimmer mit sehr langem Namen", "Wohnzimmer mit sehr langem\u{2026}"),
        ("Wohnzimmer mit sehr langen Na", "Wohnzimmer mit sehr langen\u{2026}"),
        ("Wohnzimmer mit langem Namen.", "Wohnzimmer mit langem Namen."),
        ("a bcdefghijklmnopqrstuvwxyzabcdefgh", "a bcdefghijklmnopqrstuvwxyz\u{2026}"),
    ] {
        let svg = plan_svg(&plan_of(name));
        assert!(svg.contains(&format!(">{shown}</text>")), "{name}");
    }
    assert!(crate::svg::has_letters("\u{2026}"));
}

#[test]
fn the_title_has_the_level_and_the_home() {
    for (level, home_name, title) in [
        ("main", None, "Floor plan"),
        ("main", Some(" "), "Floor plan"),
        ("upper", None, "Floor plan, upper"),
        ("main", Some("Elm Street 3"), "Floor plan: Elm Street 3"),
        ("upper", Some("K\u{fc}ster"), "Floor plan, upper: K\u{fc}ster"),
    ] {
        let plan = titled(level, home_name);
        let svg = plan_svg(&plan);
        assert!(svg.contains(&format!("<title>{title}</title>")), "{title}");
        assert!(svg.contains(&format!(">{title}</text>")), "{title}");
        let hex: String = title.encode_utf16().map(|unit| format!("{unit:04X}")).collect();
        assert!(has(&plan_pdf(&plan), &format!("/Title <FEFF{hex}>")), "{title}");
    }
    let svg = plan_svg(&titled("main", Some("<Elm> & Co")));
    assert!(svg.contains(">Floor plan: &lt;Elm&gt; &amp; Co</text>"));
    let long = "Elm ".repeat(50);
    let svg = plan_svg(&titled("main", Some(&long)));
    assert!(svg.contains(" Elm\u{2026}</text>") && svg.contains(&format!(": {}</title>", long.trim())));
    // Pictures leave letters out that the font lacks.
    let drawn = |home_name| plan_png(&titled("main", home_name));
    assert!(drawn(Some("Elm \u{1f3e0}")) == drawn(Some("Elm")) && drawn(Some("\u{5bb6}")) == drawn(None));
    assert!(drawn(Some("Elm")) != drawn(None));
}

#[test]
fn a_page_fits_on_a_sheet_at_a_usual_scale() {
    for (size_m, scale, sheet_points) in [
        ([4.0, 3.0], 25, "595.28 841.89"),
        ([10.0, 9.0], 75, "595.28 841.89"),
        ([16.0, 6.0], 75, "841.89 595.28"),
        ([30.0, 20.0], 100, "1190.55 841.89"),
        ([200.0, 200.0], 1000, "841.89 1190.55"),
    ] {
        let plan = box_of(size_m);
        assert!(
            plan_svg(&plan).contains(&format!(">Scale 1:{scale}, measures in metres</text>")),
            "{size_m:?}"
        );
        assert!(has(&plan_pdf(&plan), &format!("/MediaBox [0 0 {sheet_points}]")), "{size_m:?}");
    }
}

/// A home without rooms whose walls are along the axes, and begin right beside the origin.
#[test]
fn no_number_is_minus_zero() {
    let mut plan = Plan { map_from_plan: Pose2::IDENTITY, ..box_of([4.0, 3.0]) };
    plan.masonry[0].ring_m[0] = [-1e-5, 0.0];
    let (svg, dxf) = (plan_svg(&plan), plan_dxf(&plan));
    assert!(svg.contains(">0 rooms, 0.0 m\u{b2}</text>"));
    assert!(
        svg.contains("frame is turned by 0.0 degrees") && dxf.contains("frame is turned by 0.000 degrees")
    );
    assert!(dxf.contains("\nTurn by 0.000 degrees about") && !dxf.lines().any(|line| line == "-0"));
    for json in [plan_geojson(&plan), plan_json(&plan)] {
        let text = json.to_string();
        assert!(!text.contains("-0.0,") && !text.contains("-0.0]"), "{text}");
    }
}

/// Returns the number of an attribute of the text with some words.
fn of_text(svg: &str, attribute: &str, words: &str) -> f64 {
    let line = svg.lines().find(|line| line.contains(&format!(">{words}</text>"))).unwrap();
    let (_, value) = line.split_once(&format!(" {attribute}=\"")).unwrap();
    value.split('"').next().unwrap().parse().unwrap()
}

#[test]
fn the_scale_bar_ends_before_the_caption_of_the_axes() {
    // The narrowest pages, with bars of 50 mm.
    for (size_m, scale, last) in
        [([1.0, 1.0], 20, "1 m"), ([5.0, 20.0], 100, "5 m"), ([5.0, 60.0], 200, "10 m")]
    {
        let svg = plan_svg(&box_of(size_m));
        assert!(svg.contains(" width=\"150.0mm\"") && svg.contains(&format!(">Scale 1:{scale},")), "{last}");
        let half_mm =
            |words: &str| of_text(&svg, "font-size", words) * crate::svg::text_width(words, false) / 2.0;
        let bar_mm = of_text(&svg, "x", last) + half_mm(last);
        let caption_mm = of_text(&svg, "x", "map axes") - half_mm("map axes");
        assert!(bar_mm + 1.0 < caption_mm, "{bar_mm} {caption_mm}");
        // The line with the scale is about 40 mm long.
        assert!(of_text(&svg, "x", last) - 50.0 > 55.0, "{last}");
    }
}

#[test]
fn a_bold_name_fits_into_its_room() {
    // Its letters are 7.415 times as wide as high, and the room is 22 mm wide on the page.
    let ring_m = vec![[0.0, 0.0], [0.44, 0.0], [0.44, 3.0], [0.0, 3.0]];
    let mut narrow = room(Outline { ring_m, holes_m: Vec::new() }, 0, &[]);
    narrow.name = Some("WOHNZIMMER".to_owned());
    let svg = plan_svg(&Plan { rooms: vec![narrow], ..box_of([1.0, 3.0]) });
    assert!(svg.contains(">Scale 1:20,"));
    let size_mm = of_text(&svg, "font-size", "WOHNZIMMER");
    assert!(size_mm * 7.415 <= 22.0 && size_mm > 2.5, "{size_mm}");
}

#[test]
fn a_name_is_beside_the_swing_of_a_door() {
    let plan = Plan { furniture: Vec::new(), ..plan_of("Kitchen") };
    let [x, y] = plan.rooms[0].label_at_m;
    // A swing of 1 m around the place of the name.
    let [hinge_m, open_m, closed_m] = [[-0.5, -0.5], [-0.5, 0.5], [0.5, -0.5]].map(|[u, v]| [x + u, y + v]);
    let mut swung = plan.clone();
    swung.openings[0].swing = Some(Swing { hinge_m, open_m, closed_m });
    let places = [&plan, &swung].map(|plan| {
        let svg = plan_svg(plan);
        ["x", "y"].map(|axis| of_text(&svg, axis, "Kitchen"))
    });
    let moved_mm = (places[0][0] - places[1][0]).hypot(places[0][1] - places[1][1]);
    // The swing is 20 mm wide and high on the page.
    assert!(moved_mm > 10.0, "{places:?}");
}

#[test]
fn a_picture_has_its_resolution() {
    let plan = box_of([4.0, 3.0]);
    let png = plan_png(&plan);
    let word = |at: usize| u32::from_be_bytes(png[at..at + 4].try_into().unwrap());
    assert_eq!((&png[12..16], &png[37..41], word(33), png[49]), (&b"IHDR"[..], &b"pHYs"[..], 9, 1));
    let mut sum = Crc::new();
    sum.update(&png[37..50]);
    assert_eq!(sum.sum(), word(50));
    // The page is 160 mm and 120 mm with the spaces around the drawing.
    assert!(plan_svg(&plan).contains("width=\"198.0mm\" height=\"182.0mm\""));
    for (px, px_per_m, side_mm) in [(word(16), word(41), 198.0), (word(20), word(45), 182.0)] {
        assert!((f64::from(px) / f64::from(px_per_m) * 1e3 - side_mm).abs() < 0.2, "{px} {px_per_m}");
    }
    assert!(image::load_from_memory(&png).is_ok());
}

#[test]
fn a_drawing_tells_its_unit_and_its_frame() {
    let mut plan = titled("upper", Some("Elm"));
    plan.map_from_plan = Pose2::new(0.0, 0.0, 37.2f64.to_radians());
    let dxf = plan_dxf(&plan);
    assert_eq!(dxf.matches("\nTEXT\n8\nNOTES\n").count(), 3);
    for line in [
        "Floor plan, upper: Elm",
        "Units: metres",
        "Turn by 37.200 degrees about 0,0 for the LiDAR map's frame",
    ] {
        assert!(dxf.contains(&format!("\n1\n{line}\n")), "{line}");
    }
}

/// The origin of a robot's map may be far from its home.
#[test]
fn a_drawing_opens_on_the_home() {
    for size_m in [[8.0, 3.0], [3.0, 8.0]] {
        let mut plan = box_of(size_m);
        let low = [25.0, 30.0];
        for corner in plan.masonry.iter_mut().flat_map(|outline| &mut outline.ring_m) {
            *corner = [corner[0] + low[0], corner[1] + low[1]];
        }
        let dxf = plan_dxf(&plan);
        let (_, view) = dxf.split_once("\nVPORT\n2\n*ACTIVE\n").unwrap();
        let lines: Vec<&str> = view.lines().collect();
        let value = |code: &str| -> f64 {
            lines.chunks(2).find(|pair| pair[0] == code).and_then(|pair| pair[1].parse().ok()).unwrap()
        };
        let (height_m, aspect) = (value("40"), value("41"));
        let half_m = [aspect * height_m / 2.0, height_m / 2.0];
        for (axis, code) in ["12", "22"].into_iter().enumerate() {
            let middle = value(code);
            assert!(middle - half_m[axis] < low[axis], "{size_m:?}");
            assert!(middle + half_m[axis] > low[axis] + size_m[axis], "{size_m:?}");
        }
        assert!(height_m < 1.5 * 8.0, "{height_m}");
    }
}

#[test]
fn all_formats_draw_a_corner_sofa_as_an_l() {
    let sofa = Furniture {
        id: "sofa-1".to_owned(),
        class: Class::Sofa,
        centre_m: [2.0, 1.5],
        size_m: [2.4, 1.6],
        yaw_rad: 0.0,
        back: Some(0),
        recess: Some([0.625, 0.5]),
    };
    let corners = [[0.8, 0.7], [3.2, 0.7], [3.2, 1.5], [1.7, 1.5], [1.7, 2.3], [0.8, 2.3]];
    let plan = Plan { map_from_plan: Pose2::IDENTITY, furniture: vec![sofa], ..plan_of("Kitchen") };
    let near = |ring: &[[f64; 2]]| {
        let off_m = |(a, b): (&[f64; 2], &[f64; 2])| (a[0] - b[0]).hypot(a[1] - b[1]);
        ring.len() == corners.len() && ring.iter().zip(&corners).map(off_m).all(|off_m| off_m < 1e-3)
    };
    let svg = plan_svg(&plan);
    let (_, symbol) = svg.split_once("<title>sofa-1</title>").unwrap();
    let outline = symbol.lines().find(|line| line.contains("fill=\"#ffffff\"")).unwrap();
    assert_eq!(outline.matches('L').count(), 5, "{outline}");
    let dxf = plan_dxf(&plan);
    let (_, outline) = dxf.split_once("\nPOLYLINE\n8\nFURNITURE\n").unwrap();
    let (outline, _) = outline.split_once("\nSEQEND\n").unwrap();
    let lines: Vec<&str> = outline.lines().collect();
    let values = |code: &str| -> Vec<f64> {
        let pairs = lines.chunks(2).filter(|pair| pair[0] == code);
        pairs.skip(1).map(|pair| pair[1].parse().unwrap()).collect()
    };
    let ring: Vec<[f64; 2]> = values("10").into_iter().zip(values("20")).map(|(x, y)| [x, y]).collect();
    assert!(near(&ring), "{ring:?}");
    // The box in the model stays.
    let json = plan_json(&plan)["furniture"][0].clone();
    assert_eq!((&json["size_m"], &json["centre_m"]), (&vec![2.4, 1.6].into(), &vec![2.0, 1.5].into()));
    let geojson = plan_geojson(&plan);
    let features = geojson["features"].as_array().unwrap();
    let feature = features.iter().find(|feature| feature["id"] == "object/sofa-1").unwrap();
    let mut closed: Vec<[f64; 2]> =
        serde_json::from_value(feature["geometry"]["coordinates"][0].clone()).unwrap();
    assert_eq!(closed.pop(), closed.first().copied());
    assert!(near(&closed), "{closed:?}");
    let ring: Vec<[f64; 2]> = serde_json::from_value(json["polygon_m"].clone()).unwrap();
    assert!(near(&ring), "{ring:?}");
}
