//! A decoding process, and the thread that reads its output.

use super::VideoError;
use super::limits::Limits;
use super::protocol::{self, Message, NumberList};
use super::sandbox;
use super::status::was_asked_to_stop;
use super::track::Track;
use crate::container::Region;
use image::RgbImage;
use std::io::{self, BufReader, Read};
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::time::Duration;

/// Number of frames that are read ahead.
const AHEAD: usize = 2;
/// Systems take at most 128 KiB in one argument.
const NUMBERS_PER_ARGUMENT: usize = 8000;

/// Forwards a message; returns false if there is no receiver any more.
pub type Say<'a> = &'a mut dyn FnMut(Result<Message, VideoError>) -> bool;

/// A child process; dropping it kills the process.
pub struct Child {
    process: std::process::Child,
    heard: Receiver<Result<Message, VideoError>>,
    silence: Duration,
    /// Maximum number of further messages other than frames: a child cannot keep its parent waiting forever.
    patience: usize,
}

impl Child {
    /// Starts `command` with the region's file as standard input; `listen` reads its standard output on a
    /// thread of its own, until the end or until there is no receiver.
    pub fn start(
        mut command: Command,
        region: &Region,
        limits: &Limits,
        samples: usize,
        listen: impl FnOnce(&mut dyn Read, Say) + Send + 'static,
    ) -> Result<Child, VideoError> {
        let file = region.file.try_clone().map_err(VideoError::ChildStart)?;
        command.stdin(file).stdout(Stdio::piped()).stderr(Stdio::null()).env_clear();
        limits.impose(&mut command, samples);
        sandbox::impose(&mut command);
        let mut process = command.spawn().map_err(VideoError::ChildStart)?;
        let (say, heard) = sync_channel(AHEAD);
        if let Some(stdout) = process.stdout.take() {
            let listen = move || listen_to(BufReader::new(stdout), &say, listen);
            let listener = std::thread::Builder::new().spawn(listen);
            if let Err(error) = listener {
                let _ = process.kill().and_then(|()| process.wait());
                return Err(VideoError::ChildStart(error));
            }
        }
        // One message per sample, and up to three per group of pictures, which has at least one sample.
        let patience = 4 * samples + 16;
        Ok(Child { process, heard, silence: limits.silence, patience })
    }

    /// Starts `viola decode-video`.
    pub fn viola(
        program: &Path,
        region: &Region,
        track: &Track,
        wanted: &[usize],
        limits: &Limits,
    ) -> Result<Child, VideoError> {
        let mut command = Command::new(program);
        command.arg("decode-video");
        command.args(["--offset", &region.offset.to_string(), "--bytes", &region.bytes.to_string()]);
        for part in wanted.chunks(NUMBERS_PER_ARGUMENT) {
            command.args(["--frames", &NumberList(part.to_vec()).to_string()]);
        }
        let (width, height) = (track.format.width, track.format.height);
        Child::start(command, region, limits, track.samples.len(), move |mut from, say| {
            if let Err(error) = protocol::read_greeting(&mut from) {
                say(Err(error));
                return;
            }
            loop {
                let message = protocol::read_message(&mut from, width, height);
                let last = !matches!(message, Ok(Message::Working | Message::Frame(..)));
                if !say(message) || last {
                    return;
                }
            }
        })
    }

    /// Returns the next frame, or `None` at the end.
    pub fn next(&mut self) -> Result<Option<(usize, RgbImage)>, VideoError> {
        loop {
            match self.heard.recv_timeout(self.silence) {
                Ok(Ok(Message::Frame(number, rgb))) => return Ok(Some((number, rgb))),
                Ok(Ok(Message::Working)) => {
                    let less = self.patience.checked_sub(1);
                    self.patience =
                        less.ok_or(VideoError::ChildLied { what: "more samples than there are" })?;
                }
                Ok(Ok(Message::Done)) => return Ok(None),
                Ok(Ok(Message::Refused(message))) => return Err(VideoError::ChildRefused { message }),
                // The pipe ends when the process does.
                Ok(Err(VideoError::Unreadable(error))) if error.kind() == io::ErrorKind::UnexpectedEof => {
                    return Err(self.ended());
                }
                Ok(Err(error)) => return Err(error),
                Err(RecvTimeoutError::Timeout) => {
                    return Err(VideoError::ChildSilent { seconds: self.silence.as_secs_f64() });
                }
                Err(RecvTimeoutError::Disconnected) => return Err(self.ended()),
            }
        }
    }

    /// Returns how the process ended; one that closed its pipe but still runs is killed first.
    fn ended(&mut self) -> VideoError {
        let status = match self.process.try_wait() {
            Ok(Some(status)) => Ok(status),
            // It may be exiting: the pipe closes a moment before the process ends.
            _ => self.process.kill().and_then(|()| self.process.wait()),
        };
        match status {
            Ok(status) if was_asked_to_stop(status) => {
                VideoError::ChildStopped { status: status.to_string() }
            }
            Ok(status) => VideoError::ChildEnded { status: status.to_string() },
            Err(error) => VideoError::ChildEnded { status: error.to_string() },
        }
    }
}

impl Drop for Child {
    fn drop(&mut self) {
        // The errors are ignored: the process may have ended by itself.
        let _ = self.process.kill();
        let _ = self.process.wait();
        // The reading thread ends with the pipe, or without a receiver. It is not joined, because a process
        // of the child's own may hold the pipe open.
    }
}

fn listen_to(
    mut from: impl Read,
    say: &SyncSender<Result<Message, VideoError>>,
    listen: impl FnOnce(&mut dyn Read, Say),
) {
    listen(&mut from, &mut |message| say.send(message).is_ok());
}
