//! A network that classifies the fused surface itself, without pictures.

use super::SegmentError;
use super::columns::{Columns, PLANES, TOP_M, VOXEL_NUMBERS, View, surface_from_grid};
use super::instances::agree;
use super::likeliest::ByClass;
use super::numbers::all_finite;
use super::sites::Sites;
use rayon::prelude::*;
use std::sync::Arc;
use viola_geometry::taxonomy::CLASSES;
use viola_geometry::{Point3, Vector3};
use viola_network::Element::{F32, I64};
use viola_network::manifest::ModelEntry;
use viola_network::signature::{expect, one};
use viola_network::{Data, Network, Tensor};

/// The views of a clip's surface whose answers are averaged (docs/experiments.md, Surface network).
const VIEWS: [View; 4] = [
    View { mirrored: false, transposed: false, between: false },
    View { mirrored: false, transposed: true, between: false },
    View { mirrored: true, transposed: false, between: true },
    View { mirrored: true, transposed: true, between: true },
];

/// Numbers of a voxel's box: from the voxel to the centre of its object, and the object's size.
const BOX_NUMBERS: usize = 6;

/// Classifies the voxels of a surface. Made by `models/train`.
pub struct SurfaceNetwork {
    name: String,
    version: String,
    network: Arc<Network>,
}

impl SurfaceNetwork {
    /// Returns the network after a check of its inputs and outputs.
    pub fn new(entry: &ModelEntry, network: Arc<Network>) -> Result<SurfaceNetwork, SegmentError> {
        let misfit = |problem: String| SegmentError::Misfit { network: entry.name.clone(), problem };
        let inputs = [
            ("grid", F32, vec![Some(1), Some(PLANES), None, None]),
            ("column", I64, vec![None]),
            ("place", I64, vec![None]),
            ("own", F32, vec![None, Some(VOXEL_NUMBERS)]),
        ];
        for (name, element, axes) in inputs {
            let input = one(network.inputs(), Some(name), "input").map_err(misfit)?;
            expect(input, "input", element, &axes).map_err(misfit)?;
        }
        for (name, numbers) in [("logits", CLASSES), ("box", BOX_NUMBERS)] {
            let output = one(network.outputs(), Some(name), "output").map_err(misfit)?;
            expect(output, "output", F32, &[None, Some(numbers)]).map_err(misfit)?;
        }
        let name = format!("{}, {}", entry.name, network.runtime());
        let weights = entry.sha256.as_deref().unwrap_or("weights without a checksum");
        Ok(SurfaceNetwork { version: format!("{name}, {weights}"), name, network })
    }

    /// Returns the network, its runtime and the checksum of its weights: those of the same version give the same
    /// answers.
    pub fn version(&self) -> &str {
        &self.version
    }

    /// Returns the network and its runtime, for the answer.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Returns the probability of each class for each site: the mean of the answers for all [`VIEWS`], and of the sites of
    /// one piece of furniture. `sites` are in the clip frame. None for sites outside the network's grid.
    pub(super) fn classify(&self, sites: &Sites) -> Result<Vec<Option<ByClass>>, SegmentError> {
        let OfSites { mut said, centres_m } = self.classify_alone(sites)?;
        agree(&mut said, &centres_m);
        Ok(said)
    }

    /// Returns the answer for each site by itself, and the centre of its object.
    fn classify_alone(&self, sites: &Sites) -> Result<OfSites, SegmentError> {
        let mut sums = vec![([0f32; CLASSES], Vector3::zeros(), 0f32); sites.len()];
        for view in &VIEWS {
            let said = self.classify_in(view, sites, sites.len())?;
            sums.par_iter_mut().enumerate().for_each(|(site, (sum, to_centre_m, count))| {
                let (Some(of_view), Some(towards_m)) = (said.of(site), said.to_centre(site)) else {
                    return;
                };
                sum.iter_mut().zip(of_view).for_each(|(sum, p)| *sum += p);
                *to_centre_m += towards_m;
                *count += 1.0;
            });
        }
        let of_sites = sums.into_iter().zip(&sites.positions_m).map(|((sum, to_centre_m, count), at)| {
            let is_told = count > 0.0;
            let centre = at + to_centre_m / f64::from(count.max(1.0));
            (is_told.then(|| sum.map(|p| p / count)), is_told.then_some(centre))
        });
        let (said, centres_m) = of_sites.unzip();
        Ok(OfSites { said, centres_m })
    }

    /// Returns the answer for the first `asked` sites in one view only. `sites` are in a frame whose floor is at 0.
    pub(super) fn classify_in(
        &self,
        view: &View,
        sites: &Sites,
        asked: usize,
    ) -> Result<VoxelClasses, SegmentError> {
        let Sites { positions_m, normals, .. } = sites;
        let columns = Columns::new(positions_m, normals, asked, view);
        let columns = columns.filter(|columns| !columns.column.is_empty());
        let Some(columns) = columns else { return Err(SegmentError::NoSurface { height_m: TOP_M }) };
        let voxels = columns.column.len();
        let numbers = |values: Vec<i64>| Tensor { shape: vec![voxels], data: Data::I64(values) };
        let inputs = [
            ("grid", Tensor::f32([1, PLANES, columns.height, columns.width], columns.grid)),
            ("column", numbers(columns.column)),
            ("place", numbers(columns.place)),
            ("own", Tensor::f32([voxels, VOXEL_NUMBERS], columns.own)),
        ];
        let [logits, boxes] = self.network.run(&inputs, ["logits", "box"])?;
        let (logits, boxes) = (finite(&logits, [voxels, CLASSES])?, finite(&boxes, [voxels, BOX_NUMBERS])?);
        let turned = surface_from_grid(normals, view);
        let to_centre = |numbers: &[f32]| turned(&Vector3::from_fn(|axis, _| f64::from(numbers[axis])));
        let of_voxel = logits.par_chunks_exact(CLASSES).map(softmax).collect();
        let to_centre_m = boxes.chunks_exact(BOX_NUMBERS).map(to_centre).collect();
        Ok(VoxelClasses { of_voxel, to_centre_m, of_site: columns.of_site })
    }
}

/// Returns the finite numbers of a tensor of this shape.
fn finite(tensor: &Tensor, shape: [usize; 2]) -> Result<&[f32], SegmentError> {
    let values = tensor.as_f32().filter(|_| tensor.shape == shape).ok_or_else(|| SegmentError::Shape {
        got: format!("{:?} {:?}", tensor.data.element(), tensor.shape),
        want: format!("F32 {shape:?}"),
    })?;
    if all_finite(values) { Ok(values) } else { Err(SegmentError::NotFinite) }
}

/// Probabilities of the classes of sites, and the centres of their objects.
struct OfSites {
    said: Vec<Option<ByClass>>,
    centres_m: Vec<Option<Point3>>,
}

/// Probabilities of the classes of voxels, and the centres of their objects.
pub(super) struct VoxelClasses {
    of_voxel: Vec<ByClass>,
    to_centre_m: Vec<Vector3>,
    of_site: Vec<Option<u32>>,
}

impl VoxelClasses {
    /// Returns the probabilities of a site; `None` outside the network's grid.
    pub(super) fn of(&self, site: usize) -> Option<ByClass> {
        self.of_site[site].map(|voxel| self.of_voxel[voxel as usize])
    }

    /// Returns the vector from a site to the centre of its object; `None` outside the network's grid.
    pub(super) fn to_centre(&self, site: usize) -> Option<Vector3> {
        self.of_site[site].map(|voxel| self.to_centre_m[voxel as usize])
    }

    #[cfg(test)]
    fn of_sites(&self) -> Vec<Option<ByClass>> {
        (0..self.of_site.len()).map(|site| self.of(site)).collect()
    }
}

fn softmax(logits: &[f32]) -> ByClass {
    let highest = logits.iter().copied().fold(f32::MIN, f32::max);
    let mut out = [0f32; CLASSES];
    for (p, logit) in out.iter_mut().zip(logits) {
        *p = (logit - highest).exp();
    }
    let total: f32 = out.iter().sum();
    out.map(|p| p / total)
}

#[cfg(test)]
mod tests {
    use super::super::columns::SLICES;
    use super::*;
    use crate::label::columns::CELL_M;
    use nalgebra::Rotation3;
    use serde::Deserialize;
    use std::path::Path;
    use viola_geometry::taxonomy::Class;
    use viola_network::RuntimeParams;
    use viola_network::manifest::{self, Manifest, Task};

    fn opened(file: &str) -> Result<SurfaceNetwork, String> {
        let models = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/models");
        let network = viola_network::open(&models.join(file), &RuntimeParams::default());
        let manifest = Manifest::built_in().unwrap();
        let network = network.map_err(|error| error.to_string())?;
        SurfaceNetwork::new(manifest.find("columns").unwrap(), network).map_err(|error| error.to_string())
    }

    #[derive(Deserialize)]
    struct Expected {
        yaw_rad: f64,
        cells: Vec<[i32; 3]>,
        sites: Vec<ExpectedSite>,
    }

    #[derive(Deserialize)]
    struct ExpectedSite {
        site: usize,
        class: usize,
        probability: f32,
        #[serde(rename = "box")]
        bounds: [f64; BOX_NUMBERS],
    }

    /// A network with random weights against PyTorch (`models/train/small.py`): a floor and a wall.
    #[test]
    fn classes_are_those_of_pytorch() {
        let expected: Expected =
            serde_json::from_str(include_str!("../../../../tests/models/columns.json")).unwrap();
        let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), expected.yaw_rad);
        let middle = |cell: &[i32; 3]| {
            let [x, y, z] = cell.map(f64::from);
            turn * (Point3::new(x + 0.5, y + 0.5, z) * CELL_M)
        };
        let normal = |cell: &[i32; 3]| if cell[2] == 0 { Vector3::z() } else { turn * -Vector3::y() };
        let positions_m: Vec<Point3> = expected.cells.iter().map(middle).collect();
        let normals: Vec<Vector3> = expected.cells.iter().map(normal).collect();
        let network = opened("columns.onnx").unwrap();
        let sites = Sites { positions_m: positions_m.clone(), normals, ..Sites::default() };
        let one = |view: &View| network.classify_in(view, &sites, sites.len()).unwrap();
        let said = one(&View::default());
        let classes = said.of_sites();
        assert!(expected.sites.len() > 10);
        for ExpectedSite { site, class, probability, bounds } in expected.sites {
            let [x, y, z, ..] = bounds;
            let off = said.to_centre(site).unwrap() - turn * Vector3::new(x, y, z);
            assert!(off.norm() < 1e-4, "{site}: {off}");
            let got = classes[site].expect("it is in the grid");
            let best = (0..CLASSES).max_by(|a, b| got[*a].total_cmp(&got[*b])).unwrap();
            assert!((got[class] - probability).abs() < 1e-4 && best == class, "{site}: {got:?}");
        }
        // The answer is the mean over all views, of which this is the first.
        let of_views: Vec<VoxelClasses> = VIEWS.iter().map(one).collect();
        assert_eq!(of_views[0].of_sites(), classes);
        let OfSites { said, centres_m } = network.classify_alone(&sites).unwrap();
        for (site, (all, centre_m)) in said.into_iter().zip(centres_m).enumerate() {
            let (all, centre_m) = (all.expect("it is in the grid"), centre_m.expect("as its class"));
            let to_centres: Vector3 = of_views.iter().map(|view| view.to_centre(site).unwrap()).sum();
            assert!((centre_m - positions_m[site] - to_centres / 4.0).norm() < 1e-6, "{site}");
            for (class, all) in all.iter().enumerate() {
                let sum: f32 = of_views.iter().map(|view| view.of(site).unwrap()[class]).sum();
                assert!((all - sum / 4.0).abs() < 1e-6, "{site}, class {class}");
            }
        }
    }

    /// A view of a surface is the grid of the surface that is mirrored, exchanged and moved.
    #[test]
    fn views_are_those_of_other_surfaces() {
        // Away from the sides of voxels, with most walls along the axes.
        let at =
            |i: usize| [0.013 + 0.05 * i as f64, 0.037 + 0.15 * (i % 7) as f64, 0.012 + 0.1 * (i % 5) as f64];
        let positions_m: Vec<Point3> = (0..40).map(|i| Point3::from(at(i))).collect();
        let normals = vec![Vector3::new(0.0, 1.0, 0.0); positions_m.len()];
        for view in VIEWS {
            let changed = |v: &Vector3, shift_m: f64| {
                let x = if view.mirrored { -v.x } else { v.x };
                let (x, y) = if view.transposed { (v.y, x) } else { (x, v.y) };
                Vector3::new(x + shift_m, y + shift_m, v.z)
            };
            let shift_m = if view.between { CELL_M / 2.0 } else { 0.0 };
            let moved: Vec<Point3> =
                positions_m.iter().map(|p| Point3::from(changed(&p.coords, shift_m))).collect();
            let turned: Vec<Vector3> = normals.iter().map(|n| changed(n, 0.0)).collect();
            let got = Columns::new(&positions_m, &normals, 40, &view).unwrap();
            assert_eq!(got, Columns::new(&moved, &turned, 40, &View::default()).unwrap(), "{view:?}");
            let (v, same) = (Vector3::new(0.3, -0.7, 0.2), View::default());
            let back = surface_from_grid(&normals, &view)(&changed(&v, 0.0));
            assert!((back - surface_from_grid(&normals, &same)(&v)).norm() < 1e-12, "{view:?}");
        }
    }

    #[test]
    fn other_networks_and_their_answers_are_refused() {
        let sites =
            Sites { positions_m: vec![Point3::origin()], normals: vec![Vector3::z()], ..Sites::default() };
        let nan = opened("columns_nan.onnx").unwrap().classify(&sites);
        assert_eq!(nan, Err(SegmentError::NotFinite));
        assert!(opened("red.onnx").err().unwrap().contains("it has no input grid"));
        assert!(opened("missing.onnx").is_err());
        let nothing = opened("columns.onnx").unwrap().classify(&Sites::default());
        assert_eq!(nothing, Err(SegmentError::NoSurface { height_m: TOP_M }));
    }

    /// Only its form is tested: the classes are in the evaluation.
    #[test]
    fn the_built_in_network_has_the_right_form() {
        let installed = manifest::installed(Task::Surface, None).unwrap().unwrap();
        let network = viola_network::open_weights(&installed.weights, &RuntimeParams::default()).unwrap();
        let network = SurfaceNetwork::new(&installed.entry, network).unwrap();
        assert!(network.name().starts_with("columns, "), "{}", network.name());
        let sites =
            Sites { positions_m: vec![Point3::origin()], normals: vec![Vector3::z()], ..Sites::default() };
        let [Some(classes)] = network.classify(&sites).unwrap()[..] else { panic!("it has one site") };
        assert!((classes.iter().sum::<f32>() - 1.0).abs() < 1e-5, "{classes:?}");
    }

    #[test]
    fn probabilities_sum_to_one() {
        let mut logits = [0f32; CLASSES];
        logits[Class::Bed as usize] = 90.0;
        let p = softmax(&logits);
        assert!((p.iter().sum::<f32>() - 1.0).abs() < 1e-5 && p[Class::Bed as usize] > 0.99);
    }

    /// The voxels that `models/train/voxels.py` makes of the same points.
    #[test]
    fn columns_are_those_of_the_training() {
        let positions = [
            Point3::new(1.02, -0.33, 0.01),
            Point3::new(1.04, -0.31, -0.02),
            Point3::new(1.02, -0.33, 0.31),
            Point3::new(2.0, 0.5, 2.91),
            Point3::new(0.0, 0.0, 3.0),
            Point3::new(0.0, 0.0, -0.08),
        ];
        let normals = [1.0, 0.5, -1.0, 0.25, 0.0, 0.0].map(|z| Vector3::new(0.0, 0.25, z));
        let columns = Columns::new(&positions, &normals, positions.len(), &View::default()).unwrap();
        assert_eq!((columns.height, columns.width), (32, 32));
        assert_eq!(columns.of_site, [Some(0), Some(0), Some(1), Some(2), None, None]);
        // The third is in row 17 and place 20 of its row.
        assert_eq!(columns.column, [0, 0, 8 * 16 + 10]);
        assert_eq!(columns.place, [4, 4 * 7, 4 * 59 + 2]);
        let plane = 32 * 32;
        assert_eq!(columns.grid.iter().filter(|value| **value != 0.0).count(), 9);
        assert_eq!((columns.grid[plane], columns.grid[(SLICES + 1) * plane]), (1.0, 0.75));
        // The normals' y, halved, is in the last planes: of slices 0 and 1, and of 58 and 59.
        let half = |voxel: usize| {
            columns.grid[(2 * SLICES + SLICES / 2 + [0, 3, 29][voxel]) * plane..][..plane].to_vec()
        };
        assert_eq!((half(0)[0], half(1)[0], half(2)[17 * 32 + 20]), (0.125, 0.125, 0.125));
        let own = |voxel: usize| &columns.own[voxel * VOXEL_NUMBERS..][..VOXEL_NUMBERS];
        // The voxel itself is in the middle; the one above the first is six slices further.
        assert_eq!((own(0)[10], own(0)[16], own(0)[21 + 10], own(0)[21 + 16]), (1.0, 1.0, 0.75, -1.0));
        assert!(own(0)[42..66].iter().all(|value| *value == 0.0));
        assert_eq!((own(1)[4], own(1)[10]), (1.0, 1.0));
        assert_eq!(own(2)[66..68], [0.0, 0.25]);
        assert!(own(2)[68..].iter().all(|value| *value == 0.0), "nothing is beside it");
        // The network is asked about the voxels of the first places, with all of the surface.
        let first = Columns::new(&positions, &normals, 3, &View::default()).unwrap();
        assert_eq!(
            (&first.grid, &first.column[..], &first.place[..]),
            (&columns.grid, &[0, 0][..], &[4, 28][..])
        );
        assert_eq!(first.own[..], columns.own[..2 * VOXEL_NUMBERS]);
        assert_eq!(first.of_site, [Some(0), Some(0), Some(1), None, None, None]);
    }
}
