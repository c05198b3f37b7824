//! Points in cubic cells, to find those near a place.

use rustc_hash::FxHashMap;
use viola_geometry::Point3;

/// Items by the cells of their points.
pub(super) struct Cells<T> {
    side_m: f64,
    items: FxHashMap<[i32; 3], Vec<T>>,
}

impl<T> Cells<T> {
    pub fn new(side_m: f64, items: impl IntoIterator<Item = (Point3, T)>) -> Cells<T> {
        let mut cells = Cells { side_m, items: FxHashMap::default() };
        for (point, item) in items {
            let cell = cells.cell(&point);
            cells.items.entry(cell).or_default().push(item);
        }
        cells
    }

    fn cell(&self, point: &Point3) -> [i32; 3] {
        [point.x, point.y, point.z].map(|c| (c / self.side_m).floor() as i32)
    }

    /// Returns the items in the cell of a place and in the adjacent ones.
    pub fn around(&self, at: &Point3) -> impl Iterator<Item = &T> {
        let [x, y, z] = self.cell(at);
        let keys = (0..27).map(move |i| [x + i % 3 - 1, y + i / 3 % 3 - 1, z + i / 9 - 1]);
        keys.filter_map(|key| self.items.get(&key)).flatten()
    }
}
