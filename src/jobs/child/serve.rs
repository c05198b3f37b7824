//! The child's side of the protocol.

use super::memory;
use super::protocol::{Message, write_result};
use crate::jobs::align_clip::{JobParams, LevelFile, align_clip};
use crate::jobs::attempt_error::{AttemptError, MethodResult};
use crate::jobs::priority::give_way;
use std::any::Any;
use std::ffi::OsString;
use std::io::{self, Write};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use viola_formats::container::Scratch;
use viola_geometry::LevelName;
use viola_geometry::progress::{EarlyPose, Progress, Stage};

/// Step of the progress that is reported within a stage.
const STEP: f64 = 0.01;

/// Paths of a child's input and output.
#[derive(Debug)]
pub struct ChildOrder {
    pub clip: PathBuf,
    /// True if the unit of the clip is unknown.
    pub unknown_scale: bool,
    /// The levels of the home. Their LiDAR maps lie in `into`.
    pub levels: Vec<LevelName>,
    /// The folder for the answer.
    pub into: PathBuf,
    /// Limit of memory, in addition to what the process has when the work begins.
    pub memory_bytes: u64,
}

impl ChildOrder {
    /// Returns the child's command-line arguments.
    pub(super) fn arguments(&self) -> Vec<OsString> {
        let path = |name: &str, path: &PathBuf| [name.into(), path.clone().into_os_string()];
        let level = |level: &LevelName| ["--level".into(), level.as_str().into()];
        let levels = self.levels.iter().flat_map(level);
        let memory = ["--memory-bytes".into(), self.memory_bytes.to_string().into()];
        let scale = self.unknown_scale.then(|| "--unknown-scale".into());
        let paths = path("--clip", &self.clip).into_iter().chain(path("--into", &self.into));
        paths.chain(memory).chain(levels).chain(scale).collect()
    }

    /// Returns the path of a level's LiDAR map.
    pub(super) fn map_of(&self, level: LevelName) -> PathBuf {
        self.into.join(format!("lidar-map-{level}"))
    }
}

/// Runs the method, writes its answer into the order's folder, and reports to `out`. Fails if nobody reads
/// `out`.
pub fn serve_child(
    order: &ChildOrder,
    params: impl FnOnce() -> Result<JobParams, String>,
    out: impl Write + Send,
) -> io::Result<()> {
    give_way();
    let writer = MessageWriter { out: Mutex::new(Out { out, last: 0.0 }), is_cut: AtomicBool::new(false) };
    let ended = catch_unwind(AssertUnwindSafe(|| run(order, params, &writer)));
    let ended = ended.unwrap_or_else(|panic| Err(AttemptError::internal(text_of(panic.as_ref()))));
    let written =
        ended.and_then(|finished| write_result(&order.into, &finished).map_err(AttemptError::system));
    let mut out = writer.out();
    out.send(&match written {
        Ok(()) => Message::Finished,
        Err(error) => Message::Failed(error),
    })
}

fn run<W: Write + Send>(
    order: &ChildOrder,
    params: impl FnOnce() -> Result<JobParams, String>,
    writer: &MessageWriter<W>,
) -> MethodResult {
    let mut params = params().map_err(AttemptError::system)?;
    params.unknown_scale = order.unknown_scale;
    params.scratch = Scratch::new(&order.into, Vec::new());
    // The networks of `params` are loaded, and all threads have begun, each with memory for itself: the limit is
    // for the clip alone.
    rayon::broadcast(|_| ());
    memory::limit(order.memory_bytes).map_err(AttemptError::system)?;
    let read = |level: &LevelName| -> io::Result<LevelFile> {
        Ok(LevelFile { level: *level, bytes: std::fs::read(order.map_of(*level))?.into() })
    };
    let files: io::Result<Vec<LevelFile>> = order.levels.iter().map(read).collect();
    Ok(align_clip(&order.clip, &files.map_err(AttemptError::system)?, &params, writer)?)
}

fn text_of(panic: &(dyn Any + Send)) -> &str {
    let text = panic.downcast_ref::<&str>().copied();
    text.or_else(|| panic.downcast_ref::<String>().map(String::as_str)).unwrap_or("the method panicked")
}

/// A [`Progress`] that writes messages. It is cancelled if no process reads them.
struct MessageWriter<W> {
    out: Mutex<Out<W>>,
    is_cut: AtomicBool,
}

struct Out<W> {
    out: W,
    /// Last reported fraction.
    last: f64,
}

impl<W: Write> Out<W> {
    fn send(&mut self, message: &Message) -> io::Result<()> {
        let mut line = serde_json::to_vec(message)?;
        line.push(b'\n');
        self.out.write_all(&line)?;
        self.out.flush()
    }
}

impl<W: Write + Send> MessageWriter<W> {
    fn out(&self) -> MutexGuard<'_, Out<W>> {
        self.out.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn report(&self, out: &mut Out<W>, message: &Message) {
        if out.send(message).is_err() {
            self.is_cut.store(true, Ordering::Relaxed);
        }
    }
}

impl<W: Write + Send> Progress for MessageWriter<W> {
    fn enter(&self, stage: Stage) {
        let mut out = self.out();
        out.last = 0.0;
        self.report(&mut out, &Message::Enter(stage));
    }

    fn advance(&self, fraction: f64) {
        let mut out = self.out();
        let fraction = fraction.clamp(0.0, 1.0);
        if fraction >= out.last + STEP {
            out.last = fraction;
            self.report(&mut out, &Message::Advance(fraction));
        }
    }

    fn cancelled(&self) -> bool {
        self.is_cut.load(Ordering::Relaxed)
    }

    fn wants_early_pose(&self) -> bool {
        true
    }

    fn early_pose(&self, pose: EarlyPose) {
        self.report(&mut self.out(), &Message::EarlyPose(pose));
    }
}
