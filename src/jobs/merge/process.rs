//! The work of a merge in a process of its own: one that needs too much memory, or dies, takes nothing else with it.

use super::SurfaceLabels;
use super::error::MergeError;
use super::wire::{self, AnswerHead, Failure, RevisionHead, Told};
use super::work::{Answer, Files, Link, Made, Order, Request, make};
use crate::jobs::child::{ChildParams, Leash, NO_MEMORY, Pipes, last_words, limit_memory};
use crate::jobs::priority::give_way;
use serde::de::DeserializeOwned;
use std::alloc::{Layout, handle_alloc_error};
use std::ffi::OsString;
use std::fs::File;
use std::io::{self, BufReader, BufWriter, Read, Write};
use std::process::{ExitStatus, Stdio};
use viola_formats::video::was_asked_to_stop;
use viola_geometry::progress::Silent;

/// Starts the process and answers it until it has ended. It is killed with `leash`, and ends with this thread. Its standard
/// error goes to `said`.
pub(super) fn tend(
    params: &ChildParams,
    order: &Order,
    limit_bytes: u64,
    said: File,
    link: &mut dyn Link,
    leash: &Leash,
) -> Result<Option<Made>, MergeError> {
    let mut command = params.command();
    command.args(arguments(limit_bytes)).stdin(Stdio::piped());
    command.stderr(said.try_clone().map_err(MergeError::NotStarted)?);
    let started = leash.start(&mut command).map_err(MergeError::NotStarted)?;
    let Some(Pipes { stdin: Some(stdin), stdout }) = started else { return Err(MergeError::Cancelled) };
    let ended = converse(order, limit_bytes, BufReader::new(stdout), BufWriter::new(stdin), link);
    let (status, is_killed) = leash.end().map_err(MergeError::NotStarted)?;
    // A stop of the service may ask all of its processes to stop.
    ended.unwrap_or_else(|error| match is_killed || was_asked_to_stop(status) {
        true => Err(MergeError::Cancelled),
        false => Err(without_a_word(status, &error, &last_words(Ok(said)), limit_bytes)),
    })
}

fn arguments(limit_bytes: u64) -> [OsString; 2] {
    ["--memory-bytes".into(), limit_bytes.to_string().into()]
}

/// Gives the process its order and answers what it asks for. Fails if the process ends, or sends what it should not.
fn converse(
    order: &Order,
    limit_bytes: u64,
    mut from_work: impl Read,
    mut to_work: impl Write,
    link: &mut dyn Link,
) -> io::Result<Result<Option<Made>, MergeError>> {
    wire::write(&mut to_work, order, &Files::new())?;
    loop {
        // No message is larger than the memory of its process.
        let (told, files) = wire::read(&mut from_work, limit_bytes)?;
        match told {
            Told::Request(request) => match link.ask(request) {
                Ok(answer) => {
                    let (head, files) = AnswerHead::split(answer);
                    wire::write(&mut to_work, &head, &files)?;
                }
                Err(error) => return Ok(Err(error)),
            },
            Told::Made(None) => return Ok(Ok(None)),
            Told::Made(Some(head)) => {
                return Ok(head.join(files).map(Some).ok_or_else(|| MergeError::Died(MIXED_UP.to_owned())));
            }
            Told::Failed(failure) => return Ok(Err(failure.into())),
        }
    }
}

const MIXED_UP: &str = "its files are not those of its message";

/// Returns the error of a process that ended without a last message.
fn without_a_word(status: ExitStatus, error: &io::Error, said: &str, limit_bytes: u64) -> MergeError {
    if status.code().is_none() && said.contains(NO_MEMORY) {
        return MergeError::TooLarge { limit_bytes };
    }
    MergeError::Died(format!("{status}, {error}: {said}"))
}

/// Does the work of a merge whose order, and all that it asks for, comes from `input`; `surface` loads its network, without which
/// the merge fails. Fails if nobody reads `out`.
pub fn serve_merge(
    memory_bytes: u64,
    surface: impl FnOnce() -> Result<SurfaceLabels, String>,
    input: impl Read,
    out: impl Write,
) -> io::Result<()> {
    give_way();
    let surface = surface();
    // The network is loaded, and all threads have begun, each with memory for itself: the limit is for the map alone.
    rayon::broadcast(|_| ());
    limit_memory(memory_bytes)?;
    serve(surface, ProcessLink { input: BufReader::new(input), out: BufWriter::new(out) })
}

fn serve(
    surface: Result<SurfaceLabels, String>,
    mut link: ProcessLink<impl Read, impl Write>,
) -> io::Result<()> {
    let (order, _) = read(&mut link.input)?;
    let surface = surface.map_err(MergeError::NoNetwork);
    let made = surface.and_then(|surface| make(order, &mut link, surface.as_deref(), &Silent));
    let (told, files) = match made {
        Ok(Some(made)) => {
            let (head, files) = RevisionHead::split(made);
            (Told::Made(Some(Box::new(head))), files)
        }
        Ok(None) => (Told::Made(None), Files::new()),
        Err(error) => (Told::Failed(Failure::from(&error)), Files::new()),
    };
    wire::write(&mut link.out, &told, &files)
}

/// Reads a message of the worker. If there is no memory for it, the process ends as after any other such allocation.
fn read<T: DeserializeOwned>(input: &mut impl Read) -> io::Result<(T, Files)> {
    let message = wire::read(input, u64::MAX);
    if message.as_ref().is_err_and(|error| error.kind() == io::ErrorKind::OutOfMemory) {
        handle_alloc_error(Layout::new::<T>());
    }
    message
}

/// The link of a process. An error means that its worker is gone.
struct ProcessLink<R: Read, W: Write> {
    input: BufReader<R>,
    out: BufWriter<W>,
}

impl<R: Read, W: Write> Link for ProcessLink<R, W> {
    fn ask(&mut self, request: Request) -> Result<Answer, MergeError> {
        let answered = wire::write(&mut self.out, &Told::Request(request), &Files::new())
            .and_then(|()| read::<AnswerHead>(&mut self.input));
        let (head, files) = answered.map_err(|_| MergeError::Abandoned)?;
        head.join(files).ok_or(MergeError::Abandoned)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use viola_home::Manifest;

    #[test]
    fn a_network_that_is_gone_fails_the_merge() {
        let (mut order, mut out): (Vec<u8>, Vec<u8>) = Default::default();
        let nothing = Order { last: Manifest::default(), members: Vec::new() };
        wire::write(&mut order, &nothing, &Files::new()).unwrap();
        let link = ProcessLink { input: BufReader::new(order.as_slice()), out: BufWriter::new(&mut out) };
        serve(Err("no such file".to_owned()), link).unwrap();
        let (told, _) = wire::read(&mut out.as_slice(), 1 << 20).unwrap();
        let Told::Failed(failure) = told else { panic!("{told:?}") };
        let cause = MergeError::from(failure).to_string();
        assert_eq!(cause, "the surface network cannot be used any more: no such file");
    }
}
