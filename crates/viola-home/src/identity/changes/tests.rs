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

/// Returns an earlier revision with objects that are gone in the later one, which has new ones.
fn exchanged(gone: &[KnownObject], added: &[KnownObject]) -> [Vec<KnownObject>; 2] {
    let is_new = added.iter().cloned().map(new);
    let to = is_new.chain(gone.iter().cloned().map(|object| missed(object, true))).collect();
    [gone.to_vec(), to]
}

fn moved(pairs: &[(usize, usize)]) -> ObjectChanges {
    ObjectChanges { moved: pairs.to_vec(), ..ObjectChanges::default() }
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
fn check<const N: usize>(cases: [(&str, [Vec<KnownObject>; 2], ObjectChanges); N]) {
    for (name, [from, to], expected) in cases {
        assert_eq!(told(&from, &to), expected, "{name}");
    }
}

#[test]
fn added_moved_and_gone() {
    let none = ObjectChanges::default;
    let sofa = || known("sofa-1", Class::Sofa, 9.0, SOFA);
    let table = |id: &str, x: f64, size_m: [f64; 3]| known(id, Class::Table, x, size_m);
    let one = || chair("chair-1", 0.0);
    let added_and_gone = || ObjectChanges { added: vec![0], gone: vec![0], ..none() };
    check([
        ("nothing", [vec![one()], vec![chair("chair-1", 0.1)]], none()),
        ("by id", [vec![one()], vec![KnownObject { moves: 1, ..chair("chair-1", 0.5) }]], moved(&[(0, 0)])),
        ("seen better", [vec![one()], vec![chair("chair-1", 0.5)]], none()),
        (
            "by class and size",
            [vec![sofa(), one()], vec![new(chair("chair-2", 3.0)), sofa(), missed(one(), true)]],
            moved(&[(1, 0)]),
        ),
        (
            "from a place that nobody looked at again",
            [vec![one()], vec![new(chair("chair-2", 3.0)), missed(one(), false)]],
            ObjectChanges { added: vec![0], lost: vec![0], ..none() },
        ),
        (
            "into a place that nobody had looked at",
            [vec![one()], vec![chair("chair-2", 3.0), missed(one(), true)]],
            ObjectChanges { discovered: vec![0], gone: vec![0], ..none() },
        ),
        ("another class", exchanged(&[sofa()], &[chair("chair-1", 3.0)]), added_and_gone()),
        (
            "another size",
            exchanged(&[table("table-1", 0.0, [1.6, 0.9, 0.75])], &[table("table-2", 3.0, [0.6, 0.6, 0.5])]),
            added_and_gone(),
        ),
        (
            "the nearer of two",
            exchanged(&[one()], &[chair("chair-2", 8.0), chair("chair-3", 2.0)]),
            ObjectChanges { added: vec![0], ..moved(&[(0, 1)]) },
        ),
        (
            "the first clips of a place",
            [vec![], vec![one()]],
            ObjectChanges { discovered: vec![0], ..none() },
        ),
    ]);
}

#[test]
fn visits_show_parts_of_objects() {
    let chair = |id: &str, x: f64, size_m: [f64; 3]| known(id, Class::Chair, x, size_m);
    let [large, small] =
        [chair("chair-1", 2.9, [0.94, 0.84, 1.0]), chair("chair-2", 0.0, [0.85, 0.66, 0.87])];
    check([
        (
            "a part of it was seen",
            exchanged(&[chair("chair-1", 0.0, [0.6, 0.2, 0.2])], &[chair("chair-2", 3.0, [0.5, 0.4, 0.6])]),
            moved(&[(0, 0)]),
        ),
        (
            "of two that fit by a part only, the more alike",
            exchanged(&[large, small], &[chair("chair-3", 4.0, [0.68, 0.64, 0.47])]),
            ObjectChanges { gone: vec![0], ..moved(&[(1, 0)]) },
        ),
    ]);
}

#[test]
fn small_steps_and_to_and_fro() {
    let later =
        |moves: u32| [vec![chair("chair-1", 0.0)], vec![KnownObject { moves, ..chair("chair-1", 0.1) }]];
    check([
        ("by the last of many small steps", later(1), moved(&[(0, 0)])),
        ("to and fro", later(2), ObjectChanges::default()),
    ]);
}

#[test]
fn labels_may_take_a_moved_object_for_another_of_its_family() {
    let shelf = || known("shelf-1", Class::Shelf, 0.0, [1.6, 0.4, 0.6]);
    let cabinet = |size_m: [f64; 3]| known("cabinet-1", Class::Cabinet, 3.0, size_m);
    check([
        ("of the same height", exchanged(&[shelf()], &[cabinet([1.7, 0.7, 0.6])]), moved(&[(0, 0)])),
        (
            "of another height",
            exchanged(&[shelf()], &[cabinet([1.7, 0.7, 0.9])]),
            ObjectChanges { added: vec![0], gone: vec![0], ..ObjectChanges::default() },
        ),
        (
            "beside one of its class, of which a part was seen",
            exchanged(
                &[shelf()],
                &[known("shelf-2", Class::Shelf, 3.0, [1.1, 1.1, 1.1]), cabinet([1.6, 0.4, 0.6])],
            ),
            ObjectChanges { added: vec![1], ..moved(&[(0, 0)]) },
        ),
    ]);
}

#[test]
fn an_object_that_is_missed_for_a_while() {
    let none = ObjectChanges::default;
    let one = || chair("chair-1", 0.0);
    let (is_missed, is_gone) = (|| vec![missed(one(), false)], || vec![missed(one(), true)]);
    let found_again = || ObjectChanges { found_again: vec![0], ..none() };
    check([
        ("missed in between", [is_missed(), vec![new(one())]], found_again()),
        (
            "missed in between, in a place that nobody had looked through",
            [
                vec![missed(one(), false), chair("chair-2", 4.0)],
                vec![one(), chair("chair-2", 4.0), chair("chair-3", 8.0)],
            ],
            ObjectChanges { discovered: vec![2], ..found_again() },
        ),
        ("taken for gone by a clip that was removed since", [is_gone(), vec![one()]], found_again()),
        ("missed, and gone since", [is_missed(), is_gone()], ObjectChanges { gone: vec![0], ..none() }),
        ("missed for longer", [is_missed(), is_missed()], none()),
        ("it came back", [is_gone(), vec![new(one())]], ObjectChanges { added: vec![0], ..none() }),
    ]);
}

#[test]
fn a_person_moves_an_object() {
    let (then, now) = (chair("chair-1", 0.0), chair("chair-1", 2.0));
    let history = |known: &KnownObject| History { objects: vec![known.clone()], ..History::default() };
    let (then, now) = (history(&then), history(&now));
    let mut later = revision(&now);
    later.objects[0].is_put = true;
    assert_eq!(object_changes(&revision(&then), &later), moved(&[(0, 0)]));
    assert!(object_changes(&revision(&now), &later).is_empty());
}
