//! Evidence of room names, on simulated homes.

use viola_align::{Landmark, NamedRooms, PoseScorer, Target, VirtualScan};
use viola_formats::lidar::{MAX_ROOMS, Room};
use viola_geometry::taxonomy::{Class, Purposes};
use viola_geometry::{Point2, Pose2, Vector2};
use viola_lab::simulate::{Home, HomeParams, Set};

#[test]
fn a_bed_in_a_kitchen_speaks_against_a_pose() {
    let mut lidar = Home::generate(&HomeParams::new(Set::Normal, 3)).survey().lidar_map().unwrap();
    let names = ["Kitchen", "Bedroom"];
    lidar.rooms.truncate(2);
    lidar.rooms.iter_mut().zip(names).for_each(|(room, name)| room.name = Some(name.to_owned()));
    let [kitchen, bedroom] = [0, 1].map(|i| lidar.rooms[i].cells_m[0].coords);
    let thing =
        |class, fraction| Landmark { point_m: Point2::origin(), from_m: Point2::origin(), class, fraction };
    let landmarks = vec![thing(Class::Bed, 0.2), thing(Class::Stove, 0.1), thing(Class::Chair, 0.05)];
    let scan = VirtualScan { landmarks, ..VirtualScan::default() };
    let scorer = PoseScorer::new(&[], &scan, 0.6);
    let target = Target::new(&lidar).unwrap();
    for (at, want) in [(kitchen, 0.2), (bedroom, 0.1), (Vector2::new(-99.0, 0.0), 0.0)] {
        let evidence = scorer.evidence(&Pose2::new(at.x, at.y, 0.0), &target);
        assert!((evidence.misplaced - want).abs() < 1e-9, "{at} {evidence:?}");
    }
}

#[test]
fn furniture_stands_in_its_room_for_whoever_looks_from_there() {
    let (mut right, mut wrong) = (0, Vec::new());
    for seed in 0..6 {
        let home = Home::generate(&HomeParams::new(Set::Normal, seed));
        let (truth, survey) = (home.truth(), home.survey());
        let rooms = NamedRooms::new(&survey.lidar_map().unwrap()).unwrap();
        let map_from_home = survey.valetudo_from_home();
        let on_map = |x: f64, y: f64| map_from_home.apply(&Point2::new(x, y));
        for thing in &truth.objects {
            let room = truth.rooms.iter().find(|room| room.name == thing.room).unwrap();
            let purposes = Purposes::of_name(&room.name);
            if purposes.suit(thing.class).is_some() {
                let middle = room.inner.centre();
                let [x, y, _] = thing.centre_m;
                let around = rooms.around(&on_map(x, y), &on_map(middle.x, middle.y));
                right += usize::from(around == purposes);
                if !around.is_none() && around != purposes {
                    wrong.push((seed, thing.class, around, purposes));
                }
            }
        }
    }
    // Exceptions: there may be no floor before a bed that fills its room, and objects between an open kitchen
    // and the living room may belong to either.
    assert!(right > 90 && 20 * wrong.len() < right, "{right} right, but {wrong:?}");
}

#[test]
fn rooms_without_a_telling_name_say_nothing() {
    let mut lidar = Home::generate(&HomeParams::new(Set::Normal, 1)).survey().lidar_map().unwrap();
    let inside = lidar.rooms[0].cells_m[0];
    assert!(!NamedRooms::new(&lidar).unwrap().around(&inside, &inside).is_none());
    lidar.rooms[0].name = Some("Anna".to_owned());
    assert!(NamedRooms::new(&lidar).unwrap().around(&inside, &inside).is_none());
    lidar.rooms.iter_mut().for_each(|room| room.name = None);
    assert!(NamedRooms::new(&lidar).is_none());
    // Too many rooms: every name costs time.
    let named = Room { name: Some("Kitchen".to_owned()), ..lidar.rooms[0].clone() };
    lidar.rooms[0].name = None;
    lidar.rooms.resize(MAX_ROOMS, lidar.rooms[0].clone());
    lidar.rooms.push(named);
    assert!(NamedRooms::new(&lidar).is_none());
}
