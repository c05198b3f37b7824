use super::*;

const CHAIR: [f64; 3] = [0.5, 0.5, 0.9];
const SOFA: [f64; 3] = [2.0, 0.9, 0.8];

/// An object in a revision, and what is known of it.
fn known(id: &str, class: Class, x: f64, size_m: [f64; 3]) -> KnownObject {
    let bounds = UprightBox { centre_m: [x, 1.0, size_m[2] / 2.0], size_m, yaw_rad: 0.3 };
    KnownObject::found(id.to_owned(), class, &bounds)
}

fn chair(id: &str, x: f64) -> KnownObject {
    known(id, Class::Chair, x, CHAIR)
}

fn new(object: KnownObject) -> KnownObject {
    KnownObject { is_new: true, ..object }
}

/// Missing since the last revision.
fn missed(object: KnownObject, is_gone: bool) -> KnownObject {
    KnownObject { missing: 1, is_gone, ..object }
}

/// Indices are those of `from` and `to`.
fn told(from: &[KnownObject], to: &[KnownObject]) -> ObjectChanges {
    let history = |known: &[KnownObject]| History { objects: known.to_vec(), ..History::default() };
    let (then, now) = (history(from), history(to));
    let mut later = revision(&now);
    later.objects.retain(|object| object.is_found);
    object_changes(&revision(&then), &later)
}

fn revision(ids: &History) -> RevisionObjects<'_> {
    let objects = ids.objects.iter().filter(|known| !known.is_gone).map(|known| MovedObject {
        id: &known.id,
        class: known.class,
        bounds: known.bounds(),
        is_put: false,
        is_found: known.missing == 0,
    });
    RevisionObjects { objects: objects.collect(), ids }
}

/// Each case is its name, the objects of both revisions, and their changes.
fn check<const N: usize>(cases: [(&str, Vec<KnownObject>, Vec<KnownObject>, ObjectChanges); N]) {
    for (name, from, to, expected) in cases {
        assert_eq!(told(&from, &to), expected, "{name}");
    }
}

#[test]
fn added_moved_and_gone() {
    let none = ObjectChanges::default;
    let sofa = || known("sofa-1", Class::Sofa, 9.0, SOFA);
    let cases = [
        ("nothing", vec![chair("chair-1", 0.0)], vec![chair("chair-1", 0.1)], none()),
        (
            "by id",
            vec![chair("chair-1", 0.0)],
            vec![KnownObject { moves: 1, ..chair("chair-1", 0.5) }],
            ObjectChanges { moved: vec![(0, 0)], ..none() },
        ),
        ("seen better", vec![chair("chair-1", 0.0)], vec![chair("chair-1", 0.5)], none()),
        (
            "by class and size",
            vec![sofa(), chair("chair-1", 0.0)],
            vec![new(chair("chair-2", 3.0)), sofa(), missed(chair("chair-1", 0.0), true)],
            ObjectChanges { moved: vec![(1, 0)], ..none() },
        ),
        (
            "from a place that nobody looked at again",
            vec![chair("chair-1", 0.0)],
            vec![new(chair("chair-2", 3.0)), missed(chair("chair-1", 0.0), false)],
            ObjectChanges { added: vec![0], lost: vec![0], ..none() },
        ),
        (
            "into a place that nobody had looked at",
            vec![chair("chair-1", 0.0)],
            vec![chair("chair-2", 3.0), missed(chair("chair-1", 0.0), true)],
            ObjectChanges { discovered: vec![0], gone: vec![0], ..none() },
        ),
        (
            "another class",
            vec![sofa()],
            vec![new(chair("chair-1", 3.0)), missed(sofa(), true)],
            ObjectChanges { added: vec![0], gone: vec![0], ..none() },
        ),
        (
            "another size",
            vec![known("table-1", Class::Table, 0.0, [1.6, 0.9, 0.75])],
            vec![
                new(known("table-2", Class::Table, 3.0, [0.6, 0.6, 0.5])),
                missed(known("table-1", Class::Table, 0.0, [1.6, 0.9, 0.75]), true),
            ],
            ObjectChanges { added: vec![0], gone: vec![0], ..none() },
        ),
        (
            "the nearer of two",
            vec![chair("chair-1", 0.0)],
            vec![new(chair("chair-2", 8.0)), new(chair("chair-3", 2.0)), missed(chair("chair-1", 0.0), true)],
            ObjectChanges { added: vec![0], moved: vec![(0, 1)], ..none() },
        ),
        (
            "the first clips of a place",
            vec![],
            vec![chair("chair-1", 0.0)],
            ObjectChanges { discovered: vec![0], ..none() },
        ),
    ];
    check(cases);
}

#[test]
fn visits_show_parts_of_objects() {
    let none = ObjectChanges::default;
    let cases = [
        (
            "a part of it was seen",
            vec![known("chair-1", Class::Chair, 0.0, [0.6, 0.2, 0.2])],
            vec![
                new(known("chair-2", Class::Chair, 3.0, [0.5, 0.4, 0.6])),
                missed(known("chair-1", Class::Chair, 0.0, [0.6, 0.2, 0.2]), true),
            ],
            ObjectChanges { moved: vec![(0, 0)], ..none() },
        ),
        (
            "of two that fit by a part only, the more alike",
            vec![
                known("chair-1", Class::Chair, 2.9, [0.94, 0.84, 1.0]),
                known("chair-2", Class::Chair, 0.0, [0.85, 0.66, 0.87]),
            ],
            vec![
                new(known("chair-3", Class::Chair, 4.0, [0.68, 0.64, 0.47])),
                missed(known("chair-1", Class::Chair, 2.9, [0.94, 0.84, 1.0]), true),
                missed(known("chair-2", Class::Chair, 0.0, [0.85, 0.66, 0.87]), true),
            ],
            ObjectChanges { moved: vec![(1, 0)], gone: vec![0], ..none() },
        ),
    ];
    check(cases);
}

#[test]
fn small_steps_and_to_and_fro() {
    let none = ObjectChanges::default;
    let cases = [
        (
            "by the last of many small steps",
            vec![chair("chair-1", 0.0)],
            vec![KnownObject { moves: 1, ..chair("chair-1", 0.1) }],
            ObjectChanges { moved: vec![(0, 0)], ..none() },
        ),
        (
            "to and fro",
            vec![chair("chair-1", 0.0)],
            vec![KnownObject { moves: 2, ..chair("chair-1", 0.1) }],
            none(),
        ),
    ];
    check(cases);
}

#[test]
fn labels_may_take_a_moved_object_for_another_of_its_family() {
    let none = ObjectChanges::default;
    let cases = [
        (
            "of the same height",
            vec![known("shelf-1", Class::Shelf, 0.0, [1.6, 0.4, 0.6])],
            vec![
                new(known("cabinet-1", Class::Cabinet, 3.0, [1.7, 0.7, 0.6])),
                missed(known("shelf-1", Class::Shelf, 0.0, [1.6, 0.4, 0.6]), true),
            ],
            ObjectChanges { moved: vec![(0, 0)], ..none() },
        ),
        (
            "of another height",
            vec![known("shelf-1", Class::Shelf, 0.0, [1.6, 0.4, 0.6])],
            vec![
                new(known("cabinet-1", Class::Cabinet, 3.0, [1.7, 0.7, 0.9])),
                missed(known("shelf-1", Class::Shelf, 0.0, [1.6, 0.4, 0.6]), true),
            ],
            ObjectChanges { added: vec![0], gone: vec![0], ..none() },
        ),
        (
            "beside one of its class, of which a part was seen",
            vec![known("shelf-1", Class::Shelf, 0.0, [1.6, 0.4, 0.6])],
            vec![
                new(known("shelf-2", Class::Shelf, 3.0, [1.1, 1.1, 1.1])),
                new(known("cabinet-1", Class::Cabinet, 3.0, [1.6, 0.4, 0.6])),
                missed(known("shelf-1", Class::Shelf, 0.0, [1.6, 0.4, 0.6]), true),
            ],
            ObjectChanges { added: vec![1], moved: vec![(0, 0)], ..none() },
        ),
    ];
    check(cases);
}

#[test]
fn an_object_that_is_missed_for_a_while() {
    let none = ObjectChanges::default;
    let cases = [
        (
            "missed in between",
            vec![missed(chair("chair-1", 0.0), false)],
            vec![new(chair("chair-1", 0.0))],
            ObjectChanges { found_again: vec![0], ..none() },
        ),
        (
            "missed in between, in a place that nobody had looked through",
            vec![missed(chair("chair-1", 0.0), false), chair("chair-2", 4.0)],
            vec![chair("chair-1", 0.0), chair("chair-2", 4.0), chair("chair-3", 8.0)],
            ObjectChanges { found_again: vec![0], discovered: vec![2], ..none() },
        ),
        (
            "taken for gone by a clip that was removed since",
            vec![missed(chair("chair-1", 0.0), true)],
            vec![chair("chair-1", 0.0)],
            ObjectChanges { found_again: vec![0], ..none() },
        ),
        (
            "missed, and gone since",
            vec![missed(chair("chair-1", 0.0), false)],
            vec![missed(chair("chair-1", 0.0), true)],
            ObjectChanges { gone: vec![0], ..none() },
        ),
        (
            "missed for longer",
            vec![missed(chair("chair-1", 0.0), false)],
            vec![missed(chair("chair-1", 0.0), false)],
            none(),
        ),
        (
            "it came back",
            vec![missed(chair("chair-1", 0.0), true)],
            vec![new(chair("chair-1", 0.0))],
            ObjectChanges { added: vec![0], ..none() },
        ),
    ];
    check(cases);
}

#[test]
fn a_person_moves_an_object() {
    let (then, now) = (chair("chair-1", 0.0), chair("chair-1", 2.0));
    let history = |known: &KnownObject| History { objects: vec![known.clone()], ..History::default() };
    let (then, now) = (history(&then), history(&now));
    let mut later = revision(&now);
    later.objects[0].is_put = true;
    let expected = ObjectChanges { moved: vec![(0, 0)], ..ObjectChanges::default() };
    assert_eq!(object_changes(&revision(&then), &later), expected);
    assert!(object_changes(&revision(&now), &later).is_empty());
}
