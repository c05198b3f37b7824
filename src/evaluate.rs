//! The paper's protocol: excerpts of a scene with known poses, aligned to its LiDAR map, in one table.

mod draw;
mod scene;
mod table;

pub use draw::excerpts;
pub use scene::{ClipResult, Method, Scene, SceneError, evaluate_clips};
pub use table::{TableRow, clips_csv, markdown, tabulate};
