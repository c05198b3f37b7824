//! The files of a ROS map among others: which yaml file and which image are the map's.

use crate::drawing::*;
use crate::maps::check_home;
use crate::writers::{Files, as_folder, zip_bytes};
use viola_formats::lidar::LidarMap;

/// Adds a yaml file and the image that it names.
fn add(files: &mut Files, name: &str, image: Vec<u8>) {
    let yaml = String::from_utf8(yaml("")).unwrap().replace("map.pgm", &format!("{name}.pgm"));
    files.push((format!("home/{name}.yaml"), yaml.into_bytes()));
    files.push((format!("home/{name}.pgm"), image));
}

#[test]
fn the_yaml_file_of_a_map_is_told_from_those_of_masks_and_other_programs() {
    let parameters = "amcl:\n  ros__parameters:\n    use_sim_time: true\n";
    for (map, masks, others) in [
        ("map", &["keepout_mask"][..], &["nav2_params", "office"][..]),
        ("map", &[], &["nav2_params"]),
        ("semantic_map", &[], &["office"]),
        ("filtered_map", &["keepout_mask"], &[]),
        ("semantic_map", &["speed_filter", "semantic_mask"], &["office"]),
    ] {
        let mut files = Files::new();
        add(&mut files, map, pgm(grey(0, 254, 205)));
        for mask in masks {
            add(&mut files, mask, pgm(grey(254, 254, 0)));
        }
        files.extend(others.iter().map(|name| (format!("home/{name}.yaml"), parameters.as_bytes().to_vec())));
        let read = LidarMap::read(&zip_bytes(&files));
        let read = read.unwrap_or_else(|error| panic!("{map}, {masks:?}, {others:?}: {error}"));
        check_home(map, &read, [-1.0, 2.0]);
        let is_told = read.info.notes.iter().any(|note| note.contains("yaml files of masks"));
        assert_eq!(is_told, !masks.is_empty(), "{:?}", read.info.notes);
    }
}

#[test]
fn a_mask_beside_a_damaged_map_is_not_taken_for_it() {
    for damaged in ["image: map.pgm\norigin: [0, 0, 0]\n", "image: map.pgm\nresolution: [\n"] {
        let mut files = vec![("home/map.yaml".to_string(), damaged.as_bytes().to_vec())];
        add(&mut files, "keepout_mask", pgm(grey(0, 254, 205)));
        let error = LidarMap::read(&zip_bytes(&files)).unwrap_err();
        assert!(error.code() == "bad_yaml" && error.to_string().contains("home/map.yaml"), "{error}");
    }
}

#[test]
fn an_image_whose_name_has_letters_of_another_case_is_read() {
    let files = vec![
        ("map.yaml".to_string(), yaml("")),
        ("map.PGM".to_string(), pgm(grey(0, 254, 205))),
        ("plan.pgm".to_string(), pgm(grey(254, 254, 0))),
    ];
    let folder = as_folder(&files);
    let of_folder = LidarMap::open(&folder.path().join("map.yaml"));
    for read in [of_folder, LidarMap::read(&zip_bytes(&files))] {
        check_home("map.PGM", &read.unwrap(), [-1.0, 2.0]);
    }
}

/// map_server reads the image from the place that the yaml file names. An archive of strangers leads nowhere else.
#[test]
fn an_image_in_another_folder_of_this_machine_is_read() {
    let image = ("maps/home.pgm".to_string(), pgm(grey(0, 254, 205)));
    let folder = as_folder(std::slice::from_ref(&image));
    let absolute = folder.path().join("maps/home.pgm");
    std::fs::create_dir(folder.path().join("config")).unwrap();
    for named in ["../maps/home.pgm", absolute.to_str().unwrap()] {
        let yaml = String::from_utf8(yaml("")).unwrap().replace("map.pgm", named).into_bytes();
        let path = folder.path().join("config/home.yaml");
        std::fs::write(&path, &yaml).unwrap();
        let read = LidarMap::open(&path).unwrap_or_else(|error| panic!("{named}: {error}"));
        check_home(named, &read, [-1.0, 2.0]);
        assert_eq!(read.info.notes, Vec::<String>::new(), "{named}");
        let files = [("config/home.yaml".to_string(), yaml), image.clone()];
        assert!(LidarMap::read(&zip_bytes(&files)).is_err(), "{named}");
    }
}
