//! The paper's protocol on any data with ground truth: clips, methods, one table.
//!
//! A [`Suite`] provides clips with their truth: excerpts of a recorded scene ([`SceneClips`]), clips of
//! simulated homes ([`HomeClips`]), or clips drawn inside a map ([`DrawnClips`]). [`Run`] aligns the same
//! clips with every [`Method`], [`tabulate`] makes the table, and [`plot`] draws.

mod calibration;
mod cells;
mod draw;
mod drawn;
mod error;
mod failure;
mod fit;
pub mod home;
mod homes;
mod journal;
pub mod labels;
mod memory;
mod method;
mod oracle;
pub mod plot;
mod record;
mod run;
mod scene;
mod section;
mod success;
mod suite;
mod survey;
mod table;
pub mod track;
mod weights;

pub use crate::mesh::{Mesh, MeshError};
pub use calibration::{Bin, Calibration};
pub use draw::{excerpts, random_excerpts};
pub use drawn::{DrawnClips, DrawnParams};
pub use error::{DrawnError, JournalError, RunError, SceneError};
pub use fit::fit;
pub use homes::{HomeClips, HomesParams};
pub use journal::Journal;
pub use memory::peak_memory_bytes;
pub use method::{Method, MethodKind, NoMethod};
pub use oracle::Oracle;
pub use record::{ClipResult, Listed, Placement};
pub use run::Run;
pub use scene::{Scene, SceneClips};
pub use section::Section;
pub use success::{SUCCESS_DEG, SUCCESS_M};
pub use suite::{Case, Sample, Suite, Unit};
pub use survey::{Survey, SurveyError, SurveyParams};
pub use table::{TableRow, clips_csv, markdown, tabulate};
pub use weights::{LearnedLoss, learned_loss};
