//! Objects that people moved or hid.

use super::*;

/// An object that a person moved.
fn put(from: Object, to: Object) -> Statement {
    Statement { put_from: Some(from.bounds()), ..named_as(&to) }
}

#[test]
fn an_object_is_found_where_people_put_it() {
    let mut history = History::default();
    assert_eq!(next(&mut history, vec![chair(0.0, 0.0)]), ["chair-1"]);
    let mut objects = vec![chair(7.1, 3.0)];
    let stated = stated(&[("chair-1", put(chair(0.0, 0.0), chair(7.0, 3.0)))]);
    history.identify_objects(&mut objects, &stated, &LookedThrough::of_times(&[]));
    assert_eq!(objects[0].id, "chair-1");
}

#[test]
fn an_object_that_a_person_moved_is_shown_once() {
    // The person moved the chair at 25, from x = 1 to x = 3.
    let times = [Some(10), Some(20), Some(30), None];
    let looked = LookedThrough::of_times(&times);
    let stated = stated(&[("chair-1", put(chair(1.0, 1.0), chair(3.0, 1.0)))]);
    for (name, objects, expected) in [
        ("no clip shows its new place", vec![seen_chair(1.0, 1)], vec![("chair-1", 1.0)]),
        ("a clip of its new place", vec![seen_chair(1.0, 1), seen_chair(3.1, 2)], vec![("chair-1", 3.1)]),
        (
            "a later clip of another chair in its old place",
            vec![seen_chair(1.0, 2), seen_chair(3.1, 2)],
            vec![("chair-2", 1.0), ("chair-1", 3.1)],
        ),
        (
            "a clip of unknown time of its old place",
            vec![seen_chair(1.0, 3), seen_chair(3.1, 2)],
            vec![("chair-2", 1.0), ("chair-1", 3.1)],
        ),
    ] {
        let mut history = History::default();
        identified(&mut history, vec![seen_chair(1.0, 0)], &looked);
        // The next revision shows the same.
        for _ in 0..2 {
            let mut found = objects.clone();
            history.identify_objects(&mut found, &stated, &looked);
            let found: Vec<(&str, f64)> =
                found.iter().map(|object| (object.id.as_str(), object.centre_m[0])).collect();
            assert_eq!(found, expected, "{name}");
        }
    }
}

#[test]
fn a_hidden_object_hides_no_other() {
    let sofa = object(Class::Sofa, [1.0, 1.0, 0.4], [2.2, 0.9, 0.8]);
    let times = [Some(10), Some(20), Some(30)];
    let hidden = |object: Object| Statement { is_hidden: true, ..named_as(&object) };
    let stated = stated(&[("chair-1", hidden(chair(1.0, 1.0)))]);
    // (name, what a clip looked through before, what is found then, its id)
    for (name, empty, found, id) in [
        ("the same", None, seen_chair(1.05, 0), "chair-1"),
        ("a sofa around its place", None, sofa, "sofa-1"),
        ("a chair beside it", None, chair(1.25, 1.15), "chair-2"),
        ("another one after it was gone", Some(space(1.0, 0.8, 1)), seen_chair(1.0, 2), "chair-2"),
        ("what is left of it", Some(space(1.0, 0.8, 1)), seen_chair(1.0, 0), "chair-1"),
    ] {
        let mut history = History::default();
        let empty: Vec<_> = empty.into_iter().collect();
        let looked = LookedThrough::of_boxes(&times, &empty);
        identified(&mut history, vec![seen_chair(1.0, 0)], &looked);
        if !empty.is_empty() {
            history.identify_objects(&mut vec![], &stated, &looked);
        }
        let mut objects = vec![found];
        history.identify_objects(&mut objects, &stated, &looked);
        assert_eq!(objects[0].id, id, "{name}");
    }
}
