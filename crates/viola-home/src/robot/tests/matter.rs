//! Areas of Matter.

use super::*;

/// Tags of Matter 1.4: Kitchen 0x2e and Bedroom 0x07 (areas), Dining Table 0x12 and Sofa 0x2b (landmarks), Around
/// 0x02 and Next To 0x01 (relative positions).
#[test]
fn areas_have_the_tags_of_matter() {
    let mut main = level(&LIDAR);
    main.objects.push(object("table-2", Class::Table, [2.0, 1.5], [0.8, 0.8, 0.75], "16"));
    main.objects.push(object("picture-1", Class::Picture, [2.0, 1.0], [0.5, 0.02, 0.5], "16"));
    let upper = RobotLevel { level: "upper".parse().unwrap(), objects: vec![], ..level(&LIDAR) };
    let file = json_of(&matter(&[main.clone(), upper]));
    let maps = file["supportedMaps"].as_array().unwrap();
    assert_eq!((&maps[0]["name"], &maps[1]["name"]), (&json!("main"), &json!("upper")));
    let areas = file["supportedAreas"].as_array().unwrap();
    assert_eq!(areas.len(), 2 + 2 + 3);
    let info = |name: &str, floor: i16, area: u8, landmark: Value| json!({"locationInfo": {"locationName": name, "floorNumber": floor, "areaType": area}, "landmarkInfo": landmark});
    let tags = |landmark: u8, position: u8| json!({"landmarkTag": landmark, "relativePositionTag": position});
    let want = [
        (0, info("Kitchen", 0, 0x2e, Value::Null)),
        (0, info("Bedroom", 0, 0x07, Value::Null)),
        (1, info("Kitchen", 1, 0x2e, Value::Null)),
        (1, info("Bedroom", 1, 0x07, Value::Null)),
        (0, info("Kitchen: table", 0, 0x2e, tags(0x12, 0x02))),
        (0, info("Bedroom: sofa", 0, 0x07, tags(0x2b, 0x01))),
        (0, info("Kitchen: table 2", 0, 0x2e, tags(0x12, 0x02))),
    ];
    let mut ids = std::collections::BTreeSet::new();
    for (area, (map, info)) in areas.iter().zip(want) {
        assert_eq!((&area["mapID"], &area["areaInfo"]), (&maps[map]["mapID"], &info));
        assert!(ids.insert(area["areaID"].as_u64().unwrap()), "{area}");
    }
    // Ids do not depend on other areas.
    main.objects.remove(0);
    let less = json_of(&matter(&[main]));
    assert_eq!(less["supportedAreas"][2]["areaID"], areas[5]["areaID"]);
}

/// Tags of Matter 1.4: Bathroom 0x06, Bedroom 0x07, Guest Bedroom 0x27, Kids Room 0x2c, Kids Bedroom 0x2d, Kitchen 0x2e,
/// Living Room 0x32, Studio 0x54.
#[test]
fn the_type_of_an_area_follows_from_its_name_or_its_furniture() {
    let cases: &[(Option<&str>, &[Class], Option<u8>)] = &[
        (None, &[], None),
        (None, &[Class::Refrigerator, Class::Stove], Some(0x2e)),
        (None, &[Class::Chair, Class::Bed], Some(0x07)),
        (None, &[Class::Sofa], Some(0x32)),
        (None, &[Class::Bed, Class::Shower], Some(0x06)),
        (None, &[Class::Sofa, Class::Refrigerator, Class::Bed, Class::Desk], None),
        (None, &[Class::Bed, Class::Stove], None),
        (Some("Studio"), &[Class::Refrigerator, Class::Bed], Some(0x54)),
        (Some("Living/Kitchen"), &[Class::Refrigerator], Some(0x32)),
        (Some("Child's room"), &[Class::Bed], Some(0x2c)),
        (Some("Children’s Room "), &[], Some(0x2c)),
        (Some("Kids' bedroom"), &[], Some(0x2d)),
        (Some("Guest bedroom"), &[Class::Desk], Some(0x27)),
    ];
    for (name, classes, want) in cases {
        let mut level = level(&LIDAR);
        level.rooms[0].name = name.map(str::to_owned);
        let furniture = (0..).zip(*classes);
        level.objects = furniture
            .map(|(number, class)| object(&format!("o-{number}"), *class, [2.0; 2], [0.5; 3], "16"))
            .collect();
        let areas = matter(&[level]).supported_areas;
        assert_eq!(areas[0].info.location_info.area_type, *want, "{name:?} {classes:?}");
    }
}

#[test]
fn objects_above_the_robot_are_no_areas() {
    let mut level = level(&LIDAR);
    for (id, x_m) in [("lamp-1", 2.0), ("lamp-2", 4.0)] {
        level.objects.push(object(id, Class::Lamp, [x_m, 1.5], [0.4, 0.4, 0.3], "16"));
    }
    level.objects[2].bounds.centre_m[2] = 2.2;
    let objects: Vec<String> =
        matter(&[level]).sources.into_iter().filter_map(|source| source.object).collect();
    assert_eq!(objects, ["table-1", "sofa-1", "lamp-2"]);
}

#[test]
fn matter_s_lists_are_bounded() {
    let mut level = level(&LIDAR);
    level.rooms[0].name = Some("ü".repeat(200));
    level.objects =
        (0..400).map(|i| object(&format!("chair-{i}"), Class::Chair, [2.0; 2], [0.5; 3], "16")).collect();
    let file = matter(&[level]);
    assert_eq!(file.supported_areas.len(), 255);
    let names: std::collections::BTreeSet<_> =
        file.supported_areas.iter().map(|area| area.info.location_info.location_name.clone()).collect();
    assert_eq!(names.len(), 255);
    assert!(names.iter().all(|name| name.len() <= 128));
}
