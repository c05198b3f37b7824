//! Furniture that others modelled, in place of our own pieces: training sees more shapes.

use super::model::Model;
use super::piece::Piece;
use super::rng::Rng;
use super::solid::{Shape, Solid};
use crate::mesh::{Mesh, MeshError};
use std::path::{Path, PathBuf};
use viola_geometry::taxonomy::Class;

/// Largest ratio of a piece's side to the model's: a stool is no table.
const STRETCH: f64 = 1.4;
/// Depth below a piece's top where things still stand on it, in metres.
const ON_TOP_M: f64 = 0.03;

/// Meshes of furniture with their classes.
#[derive(Debug, Default)]
pub struct Catalogue {
    entries: Vec<Entry>,
}

#[derive(Debug)]
struct Entry {
    class: Class,
    /// Full size: width, depth, height.
    size_m: [f64; 3],
    model: &'static Model,
}

#[derive(Debug, thiserror::Error)]
pub enum CatalogueError {
    #[error("{folder}: {source}")]
    Unreadable { folder: PathBuf, source: std::io::Error },
    #[error("there is no .ply file in {folder}")]
    Empty { folder: PathBuf },
    #[error("{path}: the name begins with no class; call it as in chair-1.ply")]
    NoClass { path: PathBuf },
    #[error(transparent)]
    BadMesh(#[from] MeshError),
    #[error("{path}: {reason}")]
    BadModel { path: PathBuf, reason: String },
}

impl Catalogue {
    /// Reads the meshes of a folder, called CLASS-NAME.ply. They have the frame of a piece of furniture: metres, x along the
    /// width, the back at +y, z up. They are kept until the program ends.
    pub fn open(folder: &Path) -> Result<Catalogue, CatalogueError> {
        let unreadable = |source| CatalogueError::Unreadable { folder: folder.to_owned(), source };
        let mut paths = vec![];
        for entry in std::fs::read_dir(folder).map_err(unreadable)? {
            let path = entry.map_err(unreadable)?.path();
            if path.extension().is_some_and(|extension| extension == "ply") {
                paths.push(path);
            }
        }
        paths.sort();
        let entries: Vec<Entry> = paths.iter().map(|path| read(path)).collect::<Result<_, _>>()?;
        if entries.is_empty() {
            Err(CatalogueError::Empty { folder: folder.to_owned() })
        } else {
            Ok(Catalogue { entries })
        }
    }

    /// Replaces pieces by models of their class, most of them or few.
    pub(super) fn dress(&self, pieces: &mut [Piece], rng: &mut Rng) {
        let most = rng.between(0.3, 1.0);
        for piece in pieces {
            let like: Vec<&Entry> = self.entries.iter().filter(|entry| entry.is_like(piece)).collect();
            if !like.is_empty() && rng.chance(most) {
                like[rng.count(0, like.len() - 1)].replace(piece);
            }
        }
    }
}

fn read(path: &Path) -> Result<Entry, CatalogueError> {
    let stem = path.file_stem().map(|stem| stem.to_string_lossy()).unwrap_or_default();
    let name = stem.split('-').next().unwrap_or_default();
    let class = Class::ALL.iter().copied().find(|class| class.name() == name);
    let class = class.ok_or_else(|| CatalogueError::NoClass { path: path.to_owned() })?;
    let (model, size_m) = Model::of(&Mesh::open(path)?)
        .map_err(|error| CatalogueError::BadModel { path: path.to_owned(), reason: error.to_string() })?;
    Ok(Entry { class, size_m, model: Box::leak(Box::new(model)) })
}

impl Entry {
    fn is_like(&self, piece: &Piece) -> bool {
        self.class == piece.class
            && self.size_m.iter().zip(&piece.size).all(|(a, b)| (a / b).max(b / a) <= STRETCH)
    }

    /// Puts the model in the place of all solids of the piece's class. What stands on a level top stays there.
    fn replace(&self, piece: &mut Piece) {
        let own = || piece.solids.iter().filter(|solid| solid.class == self.class);
        let Some(first) = own().next().copied() else { return };
        let bottom = own().map(Solid::bottom_m).fold(f64::INFINITY, f64::min).max(0.0);
        let top = own().map(Solid::top_m).fold(0.0, f64::max);
        let is_level =
            matches!(self.class, Class::Table | Class::Desk | Class::Cabinet | Class::WashingMachine);
        piece
            .solids
            .retain(|solid| is_level && solid.class != self.class && solid.bottom_m() >= top - ON_TOP_M);
        let [width, depth, _] = piece.size;
        let block = Solid::block(self.class, [0.0, 0.0, bottom], [width, depth, top - bottom], first.finish);
        piece.solids.push(Solid { shape: Shape::Mesh(self.model), ..block });
    }
}

#[cfg(test)]
mod tests {
    use super::super::finish::{Finish, WHITE};
    use super::super::rng::Rng;
    use super::*;
    use viola_geometry::Point3;

    /// A table top of 1 x 0.5 m, 0.7 m above a single triangle on the floor.
    fn table() -> Entry {
        let points = [
            [-0.5, -0.25, 0.7],
            [0.5, -0.25, 0.7],
            [0.5, 0.25, 0.7],
            [-0.5, 0.25, 0.7],
            [-0.1, 0.0, 0.0],
            [0.1, 0.0, 0.0],
            [0.0, 0.1, 0.0],
        ];
        let triangles = vec![[0, 1, 2], [0, 2, 3], [4, 5, 6]];
        let mesh = Mesh { vertices_m: points.map(Point3::from).to_vec(), triangles, labels: vec![] };
        let (model, size_m) = Model::of(&mesh).unwrap();
        Entry { class: Class::Table, size_m, model: Box::leak(Box::new(model)) }
    }

    /// A block with a box on its top and one beneath it.
    fn piece(class: Class, size: [f64; 3]) -> Piece {
        let finish = Finish::plain(WHITE);
        let mut piece = Piece::new(class, size);
        piece.block([0.0; 3], size, finish);
        for bottom in [0.0, size[2]] {
            piece.solids.push(Solid::block(Class::Box, [0.0, 0.0, bottom], [0.1; 3], finish));
        }
        piece
    }

    #[test]
    fn models_take_the_place_of_pieces_like_them() {
        let catalogue = Catalogue { entries: vec![table()] };
        for (class, size, is_replaced) in [
            (Class::Table, [1.2, 0.6, 0.75], true),
            // Too long, and of another class.
            (Class::Table, [1.5, 0.6, 0.75], false),
            (Class::Desk, [1.2, 0.6, 0.75], false),
        ] {
            // Each home replaces another fraction of its pieces.
            let mut pieces = vec![piece(class, size); 40];
            catalogue.dress(&mut pieces, &mut Rng::new(1));
            let is_model = |solid: &Solid| matches!(solid.shape, Shape::Mesh(_));
            let replaced: Vec<&Piece> =
                pieces.iter().filter(|piece| piece.solids.iter().any(is_model)).collect();
            assert_eq!(!replaced.is_empty(), is_replaced, "{class:?} {size:?}");
            for piece in replaced {
                let [on_top, model] = &piece.solids[..] else { panic!("{:?}", piece.solids) };
                assert_eq!((on_top.class, on_top.bottom_m()), (Class::Box, size[2]));
                assert!((model.half * 2.0 - viola_geometry::Vector3::from(size)).norm() < 1e-9);
                assert!(model.bottom_m().abs() < 1e-9);
            }
        }
    }
}
