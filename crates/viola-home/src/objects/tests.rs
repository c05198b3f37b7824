mod shape;

use super::*;
use viola_reconstruct::Label;

/// Points on a box's surface, 3 cm apart, without its underside.
pub fn surface(class: Class, low: [f64; 3], high: [f64; 3], clip: u16) -> Vec<MapPoint> {
    let count = [0, 1, 2].map(|axis| ((high[axis] - low[axis]) / 0.03).round() as usize + 1);
    let mut points = Vec::new();
    for i in 0..count[0] {
        for j in 0..count[1] {
            for k in 0..count[2] {
                let at = [i, j, k];
                let normal = if k + 1 == count[2] {
                    [0.0, 0.0, 1.0]
                } else if i == 0 || i + 1 == count[0] {
                    [if i == 0 { -1.0 } else { 1.0 }, 0.0, 0.0]
                } else if j == 0 || j + 1 == count[1] {
                    [0.0, if j == 0 { -1.0 } else { 1.0 }, 0.0]
                } else {
                    continue;
                };
                let position_m = [0, 1, 2].map(|axis| low[axis] + at[axis] as f64 * 0.03);
                points
                    .push(MapPoint { clip, ..MapPoint::new(position_m, normal, Label::new(class, 0.8, 4)) });
            }
        }
    }
    points
}

pub fn found(points: &[MapPoint]) -> Vec<Object> {
    objects(points, &[], crate::MAP_VOXEL_M)
}

pub fn classes(objects: &[Object]) -> Vec<Class> {
    objects.iter().map(|object| object.class).collect()
}

#[test]
fn a_bed_is_a_bed_with_its_box_and_clips() {
    let mut points = surface(Class::Bed, [1.0, 1.0, 0.1], [2.6, 3.0, 0.5], 0);
    points.extend(surface(Class::Pillow, [1.2, 2.5, 0.5], [1.8, 2.9, 0.62], 3));
    // A patch with the label of a confusable class.
    points.iter_mut().filter(|p| p.point.position_m[1] < 1.4).for_each(|p| {
        p.point.label = Label::new(Class::Sofa, 0.6, 4);
    });
    let objects = found(&points);
    assert_eq!(objects.len(), 1, "{objects:?}");
    let bed = &objects[0];
    assert_eq!((bed.class, bed.id.as_str(), bed.clips.as_slice()), (Class::Bed, "bed-1", &[0, 3][..]));
    let want = UprightBox {
        centre_m: [1.8, 2.0, 0.28],
        size_m: [2.0, 1.6, 0.56],
        yaw_rad: std::f64::consts::FRAC_PI_2,
    };
    assert!(bed.bounds().iou(&want) > 0.8, "{bed:?}");
    // The box extends to the floor although nothing was seen below.
    assert!(bed.bounds().bottom_m().abs() < 1e-9);
    assert!(bed.confidence > 0.5);
}

/// Another clip called the inner part of a bed sofa.
#[test]
fn an_object_has_the_clips_of_a_part_that_it_takes_in() {
    let mut points = surface(Class::Bed, [0.0, 0.0, 0.1], [1.6, 2.0, 0.6], 0);
    points.extend(surface(Class::Sofa, [0.2, 0.25, 0.1], [1.4, 1.75, 0.45], 1));
    let objects = found(&points);
    assert_eq!(classes(&objects), [Class::Bed]);
    assert_eq!(objects[0].clips, [0, 1]);
}

/// Shapes are more often mistaken for furniture than pictures.
#[test]
fn doubtful_objects_need_pictures() {
    let with = |probability: f32, views: u16| {
        let mut points = surface(Class::Sofa, [1.0, 1.0, 0.1], [3.0, 1.9, 0.8], 0);
        points.iter_mut().for_each(|p| p.point.label = Label::new(Class::Sofa, probability, views));
        found(&points).first().map(|sofa| sofa.confidence)
    };
    assert_eq!([with(0.2, 4), with(0.4, 0)], [None, None]);
    let [in_pictures, sure] = [with(0.4, 4), with(0.8, 0)].map(Option::unwrap);
    assert!((0.3..0.4).contains(&in_pictures) && (0.7..0.8).contains(&sure), "{in_pictures} {sure}");
}

#[test]
fn chairs_side_by_side_are_several() {
    let mut points = Vec::new();
    for i in 0..3 {
        let x = f64::from(i) * 0.63;
        points.extend(surface(Class::Chair, [x, 0.0, 0.42], [x + 0.48, 0.45, 0.46], 0));
        points.extend(surface(Class::Chair, [x, 0.42, 0.46], [x + 0.48, 0.45, 0.9], 0));
    }
    let chairs = found(&points);
    assert_eq!(chairs.iter().filter(|o| o.class == Class::Chair).count(), 3, "{chairs:?}");
}

#[test]
fn a_kitchen_has_units_below_and_above() {
    let mut points = surface(Class::Cabinet, [0.0, 0.0, 0.06], [2.0, 0.6, 0.9], 0);
    points.extend(surface(Class::Cabinet, [0.0, 0.3, 1.4], [2.0, 0.6, 2.1], 0));
    // A part of the wall between them, mislabelled as cabinet.
    points.extend(surface(Class::Cabinet, [0.6, 0.6, 0.9], [1.0, 0.63, 1.4], 0));
    let units = found(&points);
    assert_eq!(units.len(), 2, "{units:?}");
    assert!(units.iter().any(|unit| unit.bounds().bottom_m() > 1.0));
}

#[test]
fn a_worktop_around_a_corner_is_two() {
    let mut points = surface(Class::Counter, [0.0, 0.0, 0.86], [3.0, 0.6, 0.9], 0);
    points.extend(surface(Class::Counter, [0.0, 0.6, 0.86], [0.6, 2.6, 0.9], 0));
    points.extend(surface(Class::Wall, [0.0, -0.1, 0.0], [3.0, 0.0, 2.4], 0));
    let tops = found(&points);
    assert_eq!(tops.len(), 2, "{tops:?}");
    // The fronts of units below one of them, whose tops are hidden.
    points.extend(surface(Class::Cabinet, [1.0, 0.57, 0.06], [3.0, 0.6, 0.86], 0));
    let units = found(&points);
    let unit = units.iter().find(|object| object.class == Class::Cabinet).expect("the units are found");
    assert!((unit.size_m[1] - 0.6).abs() < 0.1 && units.len() == 3, "{units:?}");
    assert!(tops.iter().all(|top| top.size_m[1] < 0.75), "{tops:?}");
}

#[test]
fn a_small_table_at_a_bed_is_a_nightstand() {
    let mut points = surface(Class::Bed, [0.0, 0.0, 0.1], [1.6, 2.0, 0.5], 0);
    points.extend(surface(Class::Table, [1.75, 1.5, 0.05], [2.2, 1.95, 0.6], 0));
    points.extend(surface(Class::Table, [4.75, 1.5, 0.05], [5.2, 1.95, 0.6], 0));
    assert_eq!(classes(&found(&points)), [Class::Bed, Class::Table, Class::Cabinet]);
}

#[test]
fn structure_specks_and_people_are_no_objects() {
    let mut points = surface(Class::Wall, [0.0, 0.0, 0.0], [3.0, 0.1, 2.4], 0);
    points.extend(surface(Class::Chair, [1.0, 1.0, 0.4], [1.1, 1.1, 0.45], 0));
    points.extend(surface(Class::Person, [2.0, 1.0, 0.1], [2.4, 1.3, 1.7], 0));
    points.extend(surface(Class::Floor, [0.0, 0.0, 0.0], [3.0, 3.0, 0.02], 0));
    assert_eq!(found(&points), []);
    assert_eq!(found(&[]), []);
}

#[test]
fn places_beyond_any_home_are_left_out() {
    let mut points = surface(Class::Sofa, [1.0, 1.0, 0.1], [3.0, 1.9, 0.8], 0);
    let far = MapPoint { clip: 0, ..points[0] };
    for x in [f32::MAX, -f32::MAX, 1e9] {
        let mut far = far;
        far.point.position_m[0] = x;
        points.push(far);
    }
    assert_eq!(found(&points).len(), 1);
}

#[test]
fn furniture_of_different_heights_side_by_side_is_several() {
    for (name, boxes, want) in [
        ("a chest beside a wardrobe", [[[0.0; 3], [1.0, 0.5, 0.9]], [[1.0, 0.0, 0.0], [2.0, 0.6, 2.0]]], 2),
        ("two wardrobes of one height", [[[0.0; 3], [1.0, 0.6, 2.0]], [[1.0, 0.0, 0.0], [2.0, 0.6, 2.0]]], 1),
        (
            "a wall unit beside a tall one",
            [[[0.0; 3], [0.6, 0.6, 2.1]], [[0.6, 0.0, 1.4], [2.4, 0.35, 2.1]]],
            2,
        ),
        (
            "a wardrobe that is lower at a narrow end",
            [[[0.0; 3], [2.0, 0.6, 2.0]], [[2.0, 0.0, 0.0], [2.2, 0.6, 1.7]]],
            1,
        ),
        (
            "a chest with a gap to a wardrobe",
            [[[-0.05, 0.1, 0.0], [1.0, 0.6, 0.9]], [[1.22, 0.1, 0.0], [2.2, 0.7, 2.0]]],
            2,
        ),
    ] {
        let mut points = surface(Class::Wall, [-1.0, -0.1, 0.0], [4.0, 0.0, 2.4], 0);
        boxes.iter().for_each(|[low, high]| points.extend(surface(Class::Cabinet, *low, *high, 0)));
        assert_eq!(found(&points).len(), want, "{name}: {:?}", found(&points));
    }
}

#[test]
fn parts_above_each_other_are_one_lamp_and_one_toilet() {
    let mut lamp = surface(Class::Lamp, [1.0, 1.0, 0.0], [1.3, 1.3, 0.06], 0);
    lamp.extend(surface(Class::Lamp, [1.0, 1.0, 1.3], [1.3, 1.3, 1.6], 0));
    let lamps = found(&lamp);
    assert_eq!(lamps.len(), 1, "{lamps:?}");
    assert!(lamps[0].size_m[2] > 1.4, "{lamps:?}");
    // The plate of a toilet on the wall, and a lamp beside it.
    let mut toilet = surface(Class::Toilet, [1.0, 0.0, 0.1], [1.36, 0.55, 0.45], 0);
    toilet.extend(surface(Class::Toilet, [1.04, 0.0, 0.95], [1.32, 0.03, 1.15], 0));
    let toilets = found(&toilet);
    assert_eq!((toilets.len(), toilets[0].size_m[2] > 1.0), (1, true), "{toilets:?}");
}

#[test]
fn boxes_reach_where_nothing_was_measured() {
    // Of a table only the top, of a shower only the tray.
    for (class, low, high, top_m) in [
        (Class::Table, [0.0, 0.0, 0.7], [1.6, 0.9, 0.74], 0.74),
        (Class::Shower, [0.0, 0.0, 0.05], [0.9, 0.9, 0.12], 2.0),
    ] {
        let objects = found(&surface(class, low, high, 0));
        assert_eq!(objects.len(), 1, "{class:?}");
        let bounds = objects[0].bounds();
        assert!(bounds.bottom_m().abs() < 1e-9 && (bounds.top_m() - top_m).abs() < 0.05, "{bounds:?}");
    }
}

#[test]
fn lamps_hang_from_high_ceilings_which_are_none() {
    let facing_down = |class: Class, low: [f64; 3], high: [f64; 3]| {
        let mut points = surface(class, low, high, 0);
        points.iter_mut().for_each(|p| p.point.normal = [0.0, 0.0, -1.0]);
        points
    };
    let mut points = facing_down(Class::Ceiling, [0.0, 0.0, 3.0], [4.0, 4.0, 3.03]);
    // A patch of the ceiling that a network takes for a shelf.
    points.extend(facing_down(Class::Shelf, [0.2, 0.2, 3.0], [1.0, 1.0, 3.0]));
    points.extend(surface(Class::Lamp, [2.0, 2.0, 2.6], [2.4, 2.4, 2.9], 0));
    assert_eq!(classes(&found(&points)), [Class::Lamp]);
}

/// Even surfaces alone do not make a cabinet of a shelf.
#[test]
fn a_tidy_shelf_is_a_shelf() {
    let shelf = surface(Class::Shelf, [0.0, 0.0, 0.0], [1.2, 0.35, 1.8], 0);
    assert_eq!(found(&shelf)[0].class, Class::Shelf);
}

/// A network takes a part of a wall for a cabinet; the same surface in front of the wall is one.
#[test]
fn patches_of_a_wall_are_no_furniture() {
    for (out_m, want) in [(0.0, 0), (0.3, 1)] {
        let mut points = surface(Class::Wall, [0.0, 0.0, 0.0], [4.0, 0.0, 2.4], 0);
        points.retain(|p| !((1.0..1.5).contains(&p.point.position_m[0]) && p.point.position_m[2] < 0.6));
        points.extend(surface(Class::Cabinet, [1.0, out_m, 0.0], [1.5, out_m, 0.6], 0));
        points.iter_mut().for_each(|p| p.point.normal = [0.0, 1.0, 0.0]);
        let cabinets = found(&points);
        assert_eq!(cabinets.len(), want, "{out_m}: {cabinets:?}");
    }
}

#[test]
fn toilets_stand_where_toilets_are() {
    use Class::*;
    let rooms = [
        Room::rectangle("kitchen", [0.0, 0.0], [5.0, 5.0]),
        Room::rectangle("bath", [6.0, 0.0], [11.0, 5.0]),
    ];
    let stove = surface(Stove, [0.2, 0.2, 0.0], [0.8, 0.8, 0.9], 0);
    let toilet = |x: f64| surface(Toilet, [x, 3.0, 0.1], [x + 0.4, 3.6, 0.6], 0);
    let shower = |x: f64| surface(Shower, [x, 4.0, 0.0], [x + 0.9, 4.9, 2.0], 0);
    for (name, things, want) in [
        ("a bin in the kitchen", vec![stove.clone(), toilet(3.0)], vec![Stove]),
        ("a toilet alone", vec![stove.clone(), toilet(8.0)], vec![Stove, Toilet]),
        ("a toilet behind a wall, in no room", vec![stove.clone(), toilet(5.2)], vec![Stove, Toilet]),
        (
            "a bathroom that is open to the kitchen",
            vec![stove, toilet(3.0), shower(4.0)],
            vec![Stove, Toilet, Shower],
        ),
    ] {
        let objects = objects(&things.concat(), &rooms, crate::MAP_VOXEL_M);
        assert_eq!(classes(&objects), want, "{name}");
    }
}
