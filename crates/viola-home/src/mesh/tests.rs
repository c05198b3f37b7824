use super::{Mesh, MeshObject, Vertex, field::Field, nets, simplify::simplify};
use crate::assemble::Tile;
use crate::objects::UprightBox;
use crate::{MAP_VOXEL_M, MapPoint};
use std::collections::BTreeMap;
use std::io::Read;
use viola_geometry::taxonomy::Class;
use viola_reconstruct::{CloudPoint, Label};

fn point(position_m: [f64; 3], normal: [f32; 3], class: Class) -> MapPoint {
    let point = CloudPoint {
        position_m: position_m.map(|c| c as f32),
        normal,
        color: if position_m[0] < 0.0 { [200, 0, 0] } else { [0, 0, 200] },
        label: Label::new(class, 0.9, 1),
        weight: 1,
    };
    MapPoint { point, clip: 0 }
}

fn tile(points: Vec<MapPoint>) -> Tile {
    Tile { points, ..Tile::default() }
}

/// A sphere with one point for each `MAP_VOXEL_M` squared, seen from outside.
fn sphere(centre_m: [f64; 3], radius_m: f64) -> Vec<MapPoint> {
    let count = (4.0 * std::f64::consts::PI * radius_m.powi(2) / MAP_VOXEL_M.powi(2)) as usize;
    let turn = std::f64::consts::PI * (3.0 - 5.0_f64.sqrt());
    let places = (0..count).map(|i| {
        let z = 1.0 - 2.0 * (i as f64 + 0.5) / count as f64;
        let (sin, cos) = (turn * i as f64).sin_cos();
        [(1.0 - z * z).sqrt() * cos, (1.0 - z * z).sqrt() * sin, z]
    });
    places
        .map(|n| {
            let place = std::array::from_fn(|axis| centre_m[axis] + radius_m * n[axis]);
            point(place, n.map(|c| c as f32), Class::Chair)
        })
        .collect()
}

/// A square on the plane z = `z_m` with a hole in its middle.
fn plane(z_m: f64, up: f32, hole_m: f64, class: Class) -> Vec<MapPoint> {
    let steps = || (-33..=33).map(|i| (f64::from(i) + 0.5) * MAP_VOXEL_M);
    let places = steps().flat_map(|x| steps().map(move |y| [x, y]));
    let kept = places.filter(|[x, y]| x.abs().max(y.abs()) > hole_m);
    kept.map(|[x, y]| point([x, y, z_m], [0.0, 0.0, up], class)).collect()
}

/// The number of triangles at each edge.
fn edges(mesh: &Mesh) -> BTreeMap<[u32; 2], usize> {
    let mut edges = BTreeMap::new();
    for triangle in &mesh.triangles {
        for side in 0..3 {
            let [a, b] = [triangle[side], triangle[(side + 1) % 3]];
            *edges.entry([a.min(b), a.max(b)]).or_insert(0) += 1;
        }
    }
    edges
}

fn distance(a: [f32; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|axis| (f64::from(a[axis]) - b[axis]).powi(2)).sum::<f64>().sqrt()
}

/// The part of triangles whose side agrees with their vertices' normals.
fn outward(mesh: &Mesh) -> f64 {
    let right = mesh.triangles.iter().filter(|triangle| {
        let [a, b, c] =
            triangle.map(|vertex| nalgebra::Vector3::from(mesh.vertices[vertex as usize].position_m));
        let normal = nalgebra::Vector3::from(mesh.vertices[triangle[0] as usize].normal);
        (b - a).cross(&(c - a)).dot(&normal) > 0.0
    });
    right.count() as f64 / mesh.triangles.len() as f64
}

#[test]
fn a_closed_surface_gives_a_closed_mesh_at_its_place() {
    for (centre_m, radius_m) in [([0.0, 0.0, 1.0], 0.5), ([-3.17, 8.03, 0.4], 0.3)] {
        let mesh = Mesh::new(&[tile(sphere(centre_m, radius_m))], &[], usize::MAX);
        assert!(edges(&mesh).values().all(|count| *count == 2), "the sphere has a hole");
        for vertex in &mesh.vertices {
            let error = (distance(vertex.position_m, centre_m) - radius_m).abs();
            assert!(error < 0.01, "a vertex is {error} m off");
        }
        assert_eq!(outward(&mesh), 1.0);
        // Euler's formula for a sphere.
        assert_eq!(mesh.vertices.len() + mesh.triangles.len(), edges(&mesh).len() + 2);
    }
}

#[test]
fn a_hole_stays_a_hole_and_a_plane_needs_few_triangles() {
    let mut mesh = Mesh::new(&[tile(plane(0.0, 1.0, 0.3, Class::Floor))], &[], usize::MAX);
    let area = |mesh: &Mesh| -> f64 {
        let areas = mesh.triangles.iter().map(|triangle| {
            let [a, b, c] =
                triangle.map(|vertex| nalgebra::Vector3::from(mesh.vertices[vertex as usize].position_m));
            f64::from((b - a).cross(&(c - a)).norm() / 2.0)
        });
        areas.sum()
    };
    // Two metres by two without 0.6 by 0.6; a border may be a step off.
    let expected = 2.01_f64.powi(2) - 0.6_f64.powi(2);
    assert!((area(&mesh) - expected).abs() < 0.3, "{} instead of {expected} square metres", area(&mesh));
    let inside = mesh
        .vertices
        .iter()
        .filter(|vertex| vertex.position_m[0].abs().max(vertex.position_m[1].abs()) < 0.25);
    assert_eq!(inside.count(), 0, "the hole is closed");
    let (all, before) = (mesh.triangles.len(), area(&mesh));
    simplify(&mut mesh, all / 20);
    assert!(mesh.triangles.len() <= all / 20);
    assert!(
        (area(&mesh) - before).abs() < 0.05 * before,
        "{} square metres are left of {before}",
        area(&mesh)
    );
    assert!(mesh.vertices.iter().all(|vertex| vertex.position_m[2].abs() < 0.005));
    // The colours' border at x = 0 stays where it is.
    assert!(mesh.vertices.iter().all(|Vertex { position_m, color, .. }| position_m[0].abs() < 0.05
        || (color[0] > color[2]) == (position_m[0] < 0.0)));
}

/// The mesh ends within one step of the last points, however many of them a coarser grid sums.
#[test]
fn an_open_edge_stays_where_it_is_on_a_coarser_grid() {
    let points = plane(0.01, 1.0, 0.0, Class::Floor);
    let surface: Vec<&CloudPoint> = points.iter().map(|MapPoint { point, .. }| point).collect();
    let last_m = surface.iter().map(|point| point.position_m[0]).fold(0.0, f32::max);
    for step_m in [0.03, 0.042, 0.05] {
        let net = nets::net(&Field::new(&surface, step_m));
        let used = net.triangles.iter().flatten().map(|vertex| net.positions_m[*vertex as usize][0]);
        let beyond_m = used.fold(0.0, f32::max) - last_m;
        assert!(beyond_m.abs() < 1.01 * step_m, "{beyond_m} m beyond at a step of {step_m} m");
    }
}

#[test]
fn both_sides_of_a_thin_wall_are_there() {
    for half_m in [0.05, 0.02] {
        let mut points = plane(half_m, 1.0, 0.0, Class::Wall);
        points.extend(plane(-half_m, -1.0, 0.0, Class::Wall));
        let mesh = Mesh::new(&[tile(points)], &[], usize::MAX);
        assert_eq!(outward(&mesh), 1.0, "{half_m}");
        let inner = mesh
            .vertices
            .iter()
            .filter(|vertex| vertex.position_m[0].abs().max(vertex.position_m[1].abs()) < 0.9);
        let mut above_less_below = 0;
        for vertex in inner {
            let z_m = f64::from(vertex.position_m[2]);
            let error = (z_m.abs() - half_m).abs();
            assert!(error < 0.01, "{half_m}: a vertex is {error} m off its side");
            above_less_below += if z_m > 0.0 { 1 } else { -1 };
        }
        assert_eq!(above_less_below, 0, "{half_m}");
    }
}

/// Two clips saw one surface 8 cm apart.
#[test]
fn no_surface_is_between_two_sheets_that_face_the_same_way() {
    let sheets_m = [0.005, 0.085];
    let points = sheets_m.iter().flat_map(|z_m| plane(*z_m, 1.0, 0.0, Class::Wall)).collect();
    let mesh = Mesh::new(&[tile(points)], &[], usize::MAX);
    assert_eq!(outward(&mesh), 1.0);
    for vertex in &mesh.vertices {
        let errors = sheets_m.map(|z_m| (f64::from(vertex.position_m[2]) - z_m).abs());
        assert!(errors[0].min(errors[1]) < 0.01, "a vertex is {errors:?} m off the sheets");
    }
}

#[test]
fn a_budget_is_kept_and_any_order_of_threads_gives_the_same_mesh() {
    let points = sphere([0.0, 0.0, 1.0], 0.5);
    let make = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| Mesh::new(&[tile(points.clone())], &[], 500))
    };
    let mesh = make(1);
    assert!(mesh.triangles() <= 500 && mesh.triangles() > 400, "{} triangles", mesh.triangles());
    assert!(edges(&mesh).values().all(|count| *count == 2), "the simplified sphere has a hole");
    for vertex in &mesh.vertices {
        let error = (distance(vertex.position_m, [0.0, 0.0, 1.0]) - 0.5).abs();
        assert!(error < 0.02, "a vertex is {error} m off");
    }
    assert_eq!(mesh, make(3));
}

#[test]
fn objects_are_parts_by_their_ids() {
    let mut points = plane(0.0, 1.0, 0.0, Class::Floor);
    points.extend(sphere([0.4, 0.4, 0.5], 0.25));
    let bounds = UprightBox { centre_m: [0.4, 0.4, 0.5], size_m: [0.5; 3], yaw_rad: 0.7 };
    let chair = MeshObject { id: "chair-1", class: Class::Chair, bounds };
    let mesh = Mesh::new(&[tile(points)], &[chair], usize::MAX);
    let names: Vec<&str> = mesh.parts.iter().map(|part| part.name.as_str()).collect();
    assert_eq!(names, ["floor", "chair-1"]);
    assert_eq!(mesh.parts.iter().map(|part| part.triangles.len()).sum::<usize>(), mesh.triangles.len());
    let obj = mesh.obj();
    assert_eq!(obj.matches("\nf ").count(), mesh.triangles.len());
    // Blender divides a file by `o`, others by `g`.
    for name in names {
        assert!(obj.contains(&format!("\no {name}\ng {name}\nf ")), "{name}");
    }
    let glb = mesh.glb();
    assert_eq!(&glb[..4], b"glTF");
    assert_eq!(u32::from_le_bytes([glb[8], glb[9], glb[10], glb[11]]) as usize, glb.len());
    let length = u32::from_le_bytes([glb[12], glb[13], glb[14], glb[15]]) as usize;
    let document: serde_json::Value = serde_json::from_slice(&glb[20..20 + length]).unwrap();
    assert_eq!(document["nodes"][1]["name"], "chair-1");
    assert_eq!(document["buffers"][0]["byteLength"].as_u64().unwrap() as usize, glb.len() - 28 - length);
}

/// Returns the places of all triangles' corners in the picture, in the order of the file.
fn places(stage: &str) -> Vec<[f64; 2]> {
    let lists = stage.split("primvars:st = [").skip(1).filter_map(|rest| rest.split(']').next());
    let pairs = lists.flat_map(|list| list.split("), "));
    pairs
        .map(|pair| {
            let (s, t) = pair.trim_matches(['(', ')']).split_once(", ").unwrap();
            [s, t].map(|number| number.parse::<f64>().unwrap())
        })
        .collect()
}

/// Phones ignore colours of vertices.
#[test]
fn a_picture_in_the_usdz_has_the_colours_of_every_corner() {
    let mut points = plane(0.0, 1.0, 0.0, Class::Floor);
    points.extend(sphere([0.0, 0.4, 0.5], 0.25));
    let mesh = Mesh::new(&[tile(points)], &[], 3000);
    assert_eq!(mesh.parts.len(), 2);
    let mut archive = zip::ZipArchive::new(std::io::Cursor::new(mesh.usdz())).unwrap();
    let mut files = ["home.usda", "colors.png"].into_iter().enumerate().map(|(index, name)| {
        let mut file = archive.by_index(index).unwrap();
        assert_eq!(
            (file.name().unwrap().as_ref(), file.compression()),
            (name, zip::CompressionMethod::Stored)
        );
        assert_eq!(file.data_start().unwrap() % 64, 0, "{name}");
        let mut bytes = Vec::new();
        file.read_to_end(&mut bytes).unwrap();
        bytes
    });
    let stage = String::from_utf8(files.next().unwrap()).unwrap();
    let picture = image::load_from_memory(&files.next().unwrap()).unwrap().into_rgb8();
    assert!(stage.contains("asset inputs:file = @colors.png@"));
    let size_px = f64::from(picture.width());
    assert_eq!(picture.width(), picture.height());
    let places = places(&stage);
    assert_eq!(places.len(), 3 * mesh.triangles.len());
    for (triangle, places) in mesh.triangles.iter().zip(places.chunks(3)) {
        let colors = triangle.map(|vertex| mesh.vertices[vertex as usize].color);
        // Rows of a picture begin at the top, texture coordinates at the bottom.
        let texels =
            [0, 1, 2].map(|corner| [places[corner][0] * size_px, (1.0 - places[corner][1]) * size_px]);
        for (texel, color) in texels.iter().zip(colors) {
            assert!(
                texel.iter().all(|c| (c.fract() - 0.5).abs() < 0.01),
                "{texel:?} is no centre of a texel"
            );
            assert_eq!(picture.get_pixel(texel[0] as u32, texel[1] as u32).0, color);
        }
        // Bilinear interpolation is linear if the four corners are a parallelogram.
        let across = picture.get_pixel(texels[1][0] as u32, texels[2][1] as u32).0;
        for (channel, value) in across.into_iter().enumerate() {
            let [a, b, c] = colors.map(|color| i32::from(color[channel]));
            assert_eq!(i32::from(value), (b + c - a).clamp(0, 255));
        }
    }
}

/// Labels below say chair; the object is a sofa by its size, or because a person said so.
#[test]
fn an_object_of_another_class_than_its_surface_is_a_part() {
    let mut points = plane(0.0, 1.0, 0.0, Class::Floor);
    points.extend(sphere([0.4, 0.4, 0.5], 0.25));
    let bounds = |size_m| UprightBox { centre_m: [0.4, 0.4, 0.5], size_m, yaw_rad: 0.0 };
    let objects = [
        MeshObject { id: "bed-1", class: Class::Bed, bounds: bounds([2.0, 2.0, 1.2]) },
        MeshObject { id: "sofa-1", class: Class::Sofa, bounds: bounds([0.6; 3]) },
    ];
    let mesh = Mesh::new(&[tile(points)], &objects, usize::MAX);
    let names: Vec<&str> = mesh.parts.iter().map(|part| part.name.as_str()).collect();
    assert_eq!(names, ["floor", "sofa-1"]);
}

#[test]
fn nothing_gives_an_empty_mesh_that_can_be_written() {
    let mesh = Mesh::new(&[], &[], 10);
    assert_eq!((mesh.triangles(), mesh.parts.len()), (0, 0));
    assert!(mesh.glb().len() > 20 && !mesh.usdz().is_empty() && !mesh.obj().is_empty());
    // A single point has no surface.
    assert_eq!(
        Mesh::new(&[tile(vec![point([0.0; 3], [0.0, 0.0, 1.0], Class::Wall)])], &[], 10).triangles(),
        0
    );
}
