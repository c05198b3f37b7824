//! A child process for the method, so that a clip that kills it, or needs too much memory, harms nothing else.

mod leash;
mod memory;
mod protocol;
mod serve;

pub(super) use leash::{KilledOnDrop, Leash, Pipes};
pub(super) use memory::limit as limit_memory;
pub use serve::{ChildOrder, serve_child};

use super::attempt_error::{AttemptError, MethodResult};
use super::limits::JobLimits;
use super::run::{Inputs, Working};
use super::shared_progress::SharedProgress;
use futures::FutureExt;
use protocol::Message;
use std::ffi::{OsStr, OsString};
use std::fs::{self, File};
use std::io::{self, BufRead, BufReader, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::process::{Command, ExitStatus, Output, Stdio};
use std::sync::Arc;
use std::time::Duration;
use tempfile::TempDir;
use tokio::sync::oneshot;
use viola_formats::video::was_asked_to_stop;
use viola_geometry::progress::Progress;

/// A longer message ends the child.
const MAX_MESSAGE_BYTES: u64 = 1 << 20;
/// Most bytes of the child's standard error that go to the log.
const MAX_SAID_BYTES: usize = 2000;
/// Bytes at the end of it that have the cause: with `RUST_BACKTRACE` a backtrace follows.
const MAX_END_BYTES: u64 = 1 << 18;
/// The line before a backtrace.
const BACKTRACE: &[u8] = b"stack backtrace:";
/// Words of a Rust program whose allocation the system refused, before it aborts.
pub(super) const NO_MEMORY: &str = "memory allocation of ";
/// Exit status of a Rust program that panicked.
pub const PANICKED: i32 = 101;

/// Command that starts another process of this program.
#[derive(Debug, Clone)]
pub struct ChildParams {
    pub program: PathBuf,
    /// Its arguments before those of the work.
    pub arguments: Vec<OsString>,
    /// Its whole environment.
    pub environment: Vec<(OsString, OsString)>,
}

impl ChildParams {
    /// Returns the command without the environment of this process.
    pub(super) fn command(&self) -> Command {
        let mut command = Command::new(&self.program);
        command.args(&self.arguments).env_clear().envs(self.environment.iter().cloned());
        command
    }

    /// Runs the command with one more argument and returns its output; none if it took longer than `max_time`.
    /// The process is killed if nobody waits for it any more.
    pub async fn output(&self, argument: &OsStr, max_time: Duration) -> io::Result<Option<Output>> {
        let mut command = tokio::process::Command::from(self.command());
        command.arg(argument).stdin(Stdio::null()).stderr(Stdio::null()).kill_on_drop(true);
        tokio::time::timeout(max_time, command.output()).await.ok().transpose()
    }
}

/// Runs the method in a child process, which is killed when `progress` is cancelled. Its files lie in `folder`.
///
/// The process ends with the thread that started it, so this thread is not taken from a pool.
pub(super) fn run_in_child(
    params: &ChildParams,
    inputs: Inputs,
    limits: JobLimits,
    folder: TempDir,
    progress: Arc<SharedProgress>,
) -> Working {
    let leash = Arc::new(Leash::default());
    let (sender, receiver) = oneshot::channel();
    let tend = {
        let (params, progress, leash) = (params.clone(), progress.clone(), leash.clone());
        move || {
            let ended = tend(&params, &inputs, limits, folder.path(), &progress, &leash);
            drop(folder);
            // The worker may have stopped waiting.
            let _ = sender.send(ended);
        }
    };
    let started = std::thread::Builder::new().name("job-child".to_owned()).spawn(tend);
    let ended = async move {
        started.map_err(AttemptError::system)?;
        let leash = KilledOnDrop(leash);
        let mut receiver = receiver;
        tokio::select! {
            ended = &mut receiver => ended.unwrap_or_else(|_| Err(AttemptError::internal("the child's thread panicked"))),
            () = progress.stop_asked() => {
                leash.0.kill();
                // The folder is removed before this returns.
                let _ = receiver.await;
                Err(AttemptError::Cancelled)
            }
        }
    };
    ended.boxed()
}

/// Starts the process and reads its messages until it has ended.
fn tend(
    params: &ChildParams,
    inputs: &Inputs,
    limits: JobLimits,
    folder: &Path,
    progress: &SharedProgress,
    leash: &Leash,
) -> MethodResult {
    let order = ChildOrder {
        clip: inputs.clip.to_path_buf(),
        unknown_scale: inputs.unknown_scale,
        levels: inputs.levels.iter().map(|file| file.level).collect(),
        into: folder.to_owned(),
        memory_bytes: limits.memory_bytes,
    };
    for file in &inputs.levels {
        fs::write(order.map_of(file.level), &file.bytes).map_err(AttemptError::system)?;
    }
    let said = folder.join("stderr");
    let mut command = params.command();
    command.args(order.arguments()).stdin(Stdio::null());
    command.stderr(File::create(&said).map_err(AttemptError::system)?);
    let Some(pipes) = leash.start(&mut command).map_err(AttemptError::system)? else {
        return Err(AttemptError::Cancelled);
    };
    let told = listen(pipes.stdout, progress);
    let (status, is_killed) = leash.end().map_err(AttemptError::system)?;
    match told {
        Some(ended) => ended.and_then(|()| protocol::read_result(folder)),
        None if is_killed => Err(AttemptError::Cancelled),
        None => Err(without_a_word(status, &last_words(File::open(&said)), limits)),
    }
}

/// Forwards the progress; returns the end that the last message tells, `None` if the process ended without one.
fn listen(stdout: impl Read, progress: &SharedProgress) -> Option<Result<(), AttemptError>> {
    let mut stdout = BufReader::new(stdout);
    loop {
        let mut line = Vec::new();
        let read = stdout.by_ref().take(MAX_MESSAGE_BYTES).read_until(b'\n', &mut line);
        // A process may die in the middle of a message.
        if read.is_err() || (line.last() != Some(&b'\n') && (line.len() as u64) < MAX_MESSAGE_BYTES) {
            return None;
        }
        match serde_json::from_slice(&line) {
            Ok(Message::Enter(stage)) => progress.enter(stage),
            Ok(Message::Advance(fraction)) => progress.advance(fraction),
            Ok(Message::EarlyPose(pose)) => progress.early_pose(pose),
            Ok(Message::Finished) => return Some(Ok(())),
            Ok(Message::Failed(error)) => return Some(Err(error)),
            Err(_) => return Some(Err(AttemptError::internal("the child sent an invalid message"))),
        }
    }
}

/// Returns the error of a process that ended without a last message.
fn without_a_word(status: ExitStatus, said: &str, limits: JobLimits) -> AttemptError {
    let cause = format!("the child ended with {status}: {said}");
    if was_asked_to_stop(status) {
        return AttemptError::system(cause);
    }
    match status.code() {
        None if said.contains(NO_MEMORY) => AttemptError::Refused(limits.too_large()),
        // By a signal: it aborted, or the system killed it, maybe for want of memory.
        None => AttemptError::died(cause),
        Some(PANICKED) => AttemptError::internal(cause),
        // It did not start its work.
        Some(_) => AttemptError::system(cause),
    }
}

/// Returns the end of a process's standard error; empty if it cannot be read. It has the cause and the first frames of a backtrace.
pub(super) fn last_words(said: io::Result<File>) -> String {
    let read = || -> io::Result<Vec<u8>> {
        let mut file = said?;
        let bytes = file.metadata()?.len();
        file.seek(SeekFrom::Start(bytes.saturating_sub(MAX_END_BYTES)))?;
        let mut tail = Vec::new();
        file.take(MAX_END_BYTES).read_to_end(&mut tail)?;
        Ok(tail)
    };
    let tail = read().unwrap_or_default();
    let backtrace = tail.windows(BACKTRACE.len()).rposition(|words| words == BACKTRACE);
    let end = backtrace.map_or(tail.len(), |at| tail.len().min(at + MAX_SAID_BYTES / 2));
    let said = &tail[end.saturating_sub(MAX_SAID_BYTES)..end];
    String::from_utf8_lossy(said).trim().replace(char::is_control, " ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_words_have_the_cause_of_the_end() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("stderr");
        let said = |text: String| {
            fs::write(&file, text).unwrap();
            last_words(File::open(&file))
        };
        let (before, frame) = ("a line of a log\n".repeat(20_000), "  17: a frame of a backtrace\n");
        assert_eq!(said(String::new()), "");
        assert_eq!(said("died\n".to_owned()), "died");
        let cause = format!("{NO_MEMORY}9 bytes failed");
        for frames in [0, 1, 5000] {
            let backtrace = format!("stack backtrace:\n{}note: that is all\n", frame.repeat(frames));
            for text in [format!("{before}{cause}\n"), format!("{before}{cause}\n{backtrace}")] {
                let words = said(text);
                assert!(words.contains(&cause) && words.len() <= MAX_SAID_BYTES, "{frames} frames: {words}");
            }
        }
        assert!(said(format!("{before}at the end")).ends_with("at the end"));
        fs::remove_file(&file).unwrap();
        assert_eq!(last_words(File::open(&file)), "");
    }
}
