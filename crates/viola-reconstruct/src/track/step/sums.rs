//! Normal equations and counts of a step.

use super::state::Matrix8;

#[derive(Debug, Clone)]
pub(super) struct Sums {
    /// Upper triangle of the 6x6 part, row by row; then gain and offset with the pose; then with each other.
    pub squares: [f64; 36],
    pub gradient: [f64; 8],
    pub seen: f64,
    pub agree: f64,
    pub grey: [f64; 2],
    pub depth: [f64; 2],
}

impl Sums {
    pub const ZERO: Sums = Sums {
        squares: [0.0; 36],
        gradient: [0.0; 8],
        seen: 0.0,
        agree: 0.0,
        grey: [0.0; 2],
        depth: [0.0; 2],
    };

    pub fn add(&mut self, other: &Sums) {
        self.squares.iter_mut().zip(other.squares).for_each(|(a, b)| *a += b);
        self.gradient.iter_mut().zip(other.gradient).for_each(|(a, b)| *a += b);
        self.seen += other.seen;
        self.agree += other.agree;
        for k in 0..2 {
            self.grey[k] += other.grey[k];
            self.depth[k] += other.depth[k];
        }
    }

    pub fn matrix(&self) -> Matrix8 {
        let mut matrix = Matrix8::zeros();
        let mut next = self.squares.iter();
        let mut set = |row: usize, column: usize| {
            let value = *next.next().unwrap_or(&0.0);
            matrix[(row, column)] = value;
            matrix[(column, row)] = value;
        };
        for row in 0..6 {
            for column in row..6 {
                set(row, column);
            }
        }
        for (row, column) in (0..6).map(|i| (i, 6)).chain((0..6).map(|i| (i, 7))) {
            set(row, column);
        }
        set(6, 6);
        set(6, 7);
        set(7, 7);
        matrix
    }
}
