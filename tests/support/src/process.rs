//! The real binary as a process that can be killed.

use crate::client::Client;
use crate::disk::Disk;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::LazyLock;

pub struct Process {
    child: Child,
    pub client: Client,
}

/// Returns the path of the binary, which Cargo builds beside the tests.
pub fn program() -> &'static str {
    static PROGRAM: LazyLock<String> = LazyLock::new(|| {
        let tests = std::env::current_exe().unwrap();
        let path = tests.parent().and_then(Path::parent).unwrap().join("viola");
        assert!(path.is_file(), "{} is not there: cargo build", path.display());
        path.into_os_string().into_string().unwrap()
    });
    &PROGRAM
}

pub fn viola() -> Command {
    prepared(Command::new(program()))
}

/// Prepares a command of the binary, without the environment variables that it reads: a shell may name the database and the
/// bucket of a service.
pub fn prepared(mut command: Command) -> Command {
    command.stdin(Stdio::null());
    for (name, _) in std::env::vars_os() {
        let text = name.to_string_lossy();
        let is_setting = text.starts_with("VIOLA_") || text.starts_with("OTEL_");
        if is_setting || ["RUST_LOG", "ORT_DYLIB_PATH"].contains(&&*text) {
            command.env_remove(&name);
        }
    }
    command
}

/// Runs a command that must succeed; returns its standard output.
pub fn succeed(command: &mut Command) -> String {
    let output = command.output().unwrap();
    let (said, erred) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert!(output.status.success(), "{command:?}: {said}\n{erred}");
    said.into_owned()
}

impl Process {
    /// Serves a data folder; returns once requests are accepted.
    pub fn serve(data: &Path, arguments: &[&str]) -> Process {
        Process::begin(viola(), data, arguments, Stdio::null())
    }

    /// Serves a data folder and writes its log to a file.
    pub fn serve_logged(data: &Path, log: &Path, arguments: &[&str]) -> Process {
        let log = std::fs::File::create(log).unwrap();
        Process::begin(viola(), data, arguments, log)
    }

    /// Serves a data folder with some variables of the environment set.
    pub fn serve_with(data: &Path, variables: &[(&str, &str)]) -> Process {
        let mut command = viola();
        command.envs(variables.iter().copied());
        Process::begin(command, data, &[], Stdio::null())
    }

    /// Serves a folder of a disk.
    pub fn serve_on(disk: &dyn Disk, arguments: &[&str]) -> Process {
        Process::begin(prepared(disk.command(program())), disk.data(), arguments, Stdio::null())
    }

    fn begin(mut command: Command, data: &Path, arguments: &[&str], log: impl Into<Stdio>) -> Process {
        command.args(["serve", "--listen", "127.0.0.1:0", "--data"]).arg(data).args(arguments);
        let mut child = command.stdout(Stdio::piped()).stderr(log).spawn().unwrap();
        let mut line = String::new();
        BufReader::new(child.stdout.take().unwrap()).read_line(&mut line).unwrap();
        let base = line.trim().strip_prefix("listening on ").unwrap_or_else(|| panic!("{line:?}"));
        Process { client: Client::new(base.to_owned()), child }
    }

    /// Returns the process id.
    pub fn id(&self) -> u32 {
        self.child.id()
    }

    /// Kills the process as `kill -9` does.
    pub fn kill(mut self) {
        self.child.kill().unwrap();
        self.child.wait().unwrap();
    }

    /// Asks the process to stop with a signal's name, and waits for its end.
    pub fn stop(mut self, signal: &str) -> ExitStatus {
        let id = self.child.id().to_string();
        assert!(Command::new("kill").args(["-s", signal, &id]).status().unwrap().success());
        self.child.wait().unwrap()
    }

    /// Returns the peak memory of the process, if the system reports it.
    pub fn peak_mib(&self) -> Option<u64> {
        let status = std::fs::read_to_string(format!("/proc/{}/status", self.child.id())).ok()?;
        let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
        Some(line.trim().trim_end_matches("kB").trim().parse::<u64>().ok()? / 1024)
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        // A failed test leaves no server behind; an ended process needs no kill.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
