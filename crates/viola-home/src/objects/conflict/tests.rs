use super::super::Object;
use super::*;
use viola_geometry::progress::Silent;
use viola_reconstruct::Label;

/// An object filled with points 10 cm apart.
fn object(class: Class, centre_m: [f64; 3], size_m: [f64; 3], confidence: f64) -> (Found, Vec<MapPoint>) {
    let bounds = UprightBox { centre_m, size_m, yaw_rad: 0.0 };
    let count = size_m.map(|side| (side / 0.1).round() as usize);
    let place = |i: usize| {
        let at = [i % count[0], i / count[0] % count[1], i / count[0] / count[1]];
        [0, 1, 2].map(|axis| centre_m[axis] - size_m[axis] / 2.0 + (at[axis] as f64 + 0.5) * 0.1)
    };
    let point = |i: usize| MapPoint::new(place(i), [0.0, 0.0, 1.0], Label::NONE);
    let points: Vec<MapPoint> = (0..count.iter().product()).map(point).collect();
    let object = Object::new(class, confidence, &bounds, points.len());
    (Found { object, members: (0..points.len() as u32).collect() }, points)
}

fn both_resolved(a: (Found, Vec<MapPoint>), b: (Found, Vec<MapPoint>)) -> Vec<Found> {
    let (mut points, mut second) = (a.1, b.0);
    second.members.iter_mut().for_each(|member| *member += points.len() as u32);
    points.extend(b.1);
    resolve(vec![second, a.0], &points, &Silent).unwrap()
}

fn classes(kept: &[Found]) -> Vec<Class> {
    kept.iter().map(|found| found.object.class).collect()
}

#[test]
fn only_things_that_belong_together_share_their_space() {
    use Class::*;
    let table = ([0.0, 0.0, 0.375], [1.6, 0.9, 0.75]);
    let counter = ([0.0, 0.0, 0.45], [2.4, 0.6, 0.9]);
    for (class, host, other, at, is_conflict) in [
        (Table, table, Chair, ([0.0, 0.4, 0.45], [0.5, 0.5, 0.9]), false),
        (Table, table, Sofa, ([0.0, 0.4, 0.45], [2.0, 0.9, 0.9]), true),
        (Table, table, Table, ([0.1, 0.0, 0.25], [1.0, 0.6, 0.5]), true),
        // Beside it, and a television on it.
        (Table, table, Sofa, ([0.0, 1.0, 0.45], [2.0, 0.9, 0.9]), false),
        (Table, table, Television, ([0.0, 0.0, 1.1], [1.0, 0.1, 0.6]), false),
        (Counter, counter, Sink, ([0.5, 0.0, 0.85], [0.6, 0.45, 0.2]), false),
        (Counter, counter, Stove, ([-0.5, 0.0, 0.45], [0.6, 0.58, 0.9]), false),
        (Counter, ([0.0, 0.0, 0.88], [2.4, 0.6, 0.04]), Cabinet, ([0.0, 0.0, 0.45], [2.4, 0.6, 0.9]), false),
        (Counter, counter, Bed, ([-0.5, 0.0, 0.45], [0.6, 0.58, 0.9]), true),
        // A wall unit above the run.
        (Counter, counter, Cabinet, ([0.0, 0.1, 1.8], [2.4, 0.35, 0.7]), false),
    ] {
        let (a, b) = (object(class, host.0, host.1, 0.9), object(other, at.0, at.1, 0.8));
        let (of_a, of_b) = (a.0.object.bounds(), b.0.object.bounds());
        let both = [conflicts((class, &of_a), (other, &of_b)), conflicts((other, &of_b), (class, &of_a))];
        assert_eq!(both, [is_conflict; 2], "{class:?} {other:?} {at:?}");
        let kept = both_resolved(a, b);
        assert_eq!(kept[0].object.class, class);
        let host = kept[0].object.bounds();
        let in_way = |f: &Found| conflicts((f.object.class, &f.object.bounds()), (class, &host));
        assert!(!kept.iter().skip(1).any(in_way));
    }
}

#[test]
fn a_box_that_is_too_large_is_trimmed() {
    let bed = object(Class::Bed, [0.0, 0.0, 0.3], [2.0, 1.6, 0.6], 0.9);
    // A stray point stretches the box of the nightstand over the bed.
    let mut stand = object(Class::Cabinet, [0.9, 1.05, 0.3], [0.5, 0.4, 0.6], 0.8);
    (stand.0.object.centre_m, stand.0.object.size_m) = ([0.9, 0.85, 0.3], [0.5, 0.8, 0.6]);
    let kept = both_resolved(bed, stand);
    assert_eq!(kept.len(), 2);
    let [bed, stand] = [0, 1].map(|i| kept[i].object.bounds());
    assert!(shared(&bed, &stand) <= MAX_SHARED_FRACTION);
    let [top, long_m] = [stand.centre_m[1] + stand.size_m[1] / 2.0, stand.size_m[0]];
    assert!(long_m >= stand.size_m[1] && (0.4..=0.8).contains(&long_m) && top > 0.9, "{stand:?}");
}

/// A corner sofa without its recess.
fn corner_sofa() -> (Found, Vec<MapPoint>) {
    let (mut found, points) = object(Class::Sofa, [0.0, 0.0, 0.4], [2.4, 2.4, 0.8], 0.6);
    let is_seat = |member: &u32| {
        let [x, y, _] = points[*member as usize].point.position_m;
        x < -0.4 || y < -0.4
    };
    found.members.retain(is_seat);
    (found, points)
}

#[test]
fn a_table_may_stand_before_a_corner_sofa_but_not_on_its_seats() {
    for (centre_m, size_m, is_kept) in [
        ([0.4, 0.4, 0.2], [0.8, 0.6, 0.4], true),
        ([-0.8, 0.0, 0.2], [0.6, 0.6, 0.4], false),
        ([-0.2, 0.4, 0.2], [0.8, 0.6, 0.4], false),
    ] {
        let table = object(Class::Table, centre_m, size_m, 0.9);
        let kept = both_resolved(table, corner_sofa());
        let want: &[Class] = if is_kept { &[Class::Table, Class::Sofa] } else { &[Class::Sofa] };
        assert_eq!(classes(&kept), want, "{centre_m:?}");
    }
}

#[test]
fn a_large_object_stays_where_a_small_one_is_more_confident() {
    use Class::*;
    let large = |class, size_m: [f64; 3]| object(class, [0.0, 0.0, size_m[2] / 2.0], size_m, 0.6);
    let small =
        |class, at: [f64; 2], size_m: [f64; 3]| object(class, [at[0], at[1], size_m[2] / 2.0], size_m, 0.9);
    let (run, desk, bed) = ([2.4, 0.6, 0.9], [1.4, 0.7, 0.8], [2.0, 1.6, 0.5]);
    let recess = [0.5, 0.5];
    for (name, large, small, want) in [
        (
            "a fridge in a kitchen",
            large(Cabinet, run),
            small(Refrigerator, [0.9, 0.0], [0.6, 0.6, 1.8]),
            &[Refrigerator, Cabinet][..],
        ),
        (
            "drawers below a desk",
            large(Desk, desk),
            small(Cabinet, [0.4, 0.0], [0.4, 0.6, 0.6]),
            &[Cabinet, Desk],
        ),
        ("a box below a desk", large(Desk, desk), small(Box, [0.4, 0.0], [0.4, 0.3, 0.3]), &[Box, Desk]),
        ("a shelf through a desk", large(Desk, desk), small(Shelf, [0.4, 0.0], [0.4, 0.4, 1.8]), &[Desk]),
        (
            "a desk taken for a cabinet",
            large(Desk, desk),
            small(Cabinet, [0.0; 2], [1.2, 0.7, 0.6]),
            &[Cabinet],
        ),
        ("a chair on a bed", large(Bed, bed), small(Chair, [0.0; 2], [0.6, 0.6, 0.8]), &[Bed]),
        ("a plant in a corner", corner_sofa(), small(Plant, recess, [0.5, 0.5, 1.2]), &[Plant, Sofa]),
        ("a lamp in a corner", corner_sofa(), small(Lamp, recess, [0.4, 0.4, 1.6]), &[Lamp, Sofa]),
        ("a chair in a corner", corner_sofa(), small(Chair, recess, [0.6, 0.6, 0.8]), &[Chair, Sofa]),
    ] {
        assert_eq!(classes(&both_resolved(small, large)), want, "{name}");
    }
}

#[test]
fn an_object_of_which_only_the_front_was_measured_has_no_recess() {
    let mut wardrobe = object(Class::Cabinet, [0.0, 0.0, 1.0], [2.4, 0.6, 2.0], 0.6);
    let is_front = |member: &u32| wardrobe.1[*member as usize].point.position_m[1] < -0.2;
    wardrobe.0.members.retain(is_front);
    let part = object(Class::Box, [0.0, -0.1, 0.3], [0.6, 0.4, 0.6], 0.9);
    assert_eq!(classes(&both_resolved(part, wardrobe)), [Class::Cabinet]);
}
