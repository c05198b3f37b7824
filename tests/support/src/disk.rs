//! Disks that can be filled and freed while a server runs on them.

use crate::skipped;
use std::fs::File;
use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

/// A place for a server's data that can become full.
pub trait Disk: Send + Sync {
    /// Returns the data folder, as the server sees it.
    fn data(&self) -> &Path;
    /// Returns the data folder, as the test sees it.
    fn seen(&self) -> PathBuf;
    /// Returns a command that runs a program on the disk. It becomes the program, with the same process id.
    fn command(&self, program: &str) -> Command;
    /// Leaves no free byte to the server with this process id. Blocks.
    fn fill(&self, server: u32);
    /// Frees the disk; does nothing if it is not full.
    fn free(&self, server: u32);
}

/// A small file system in a mount namespace, which a process of its own holds. It outlives killed servers and
/// ends with the test.
pub struct SmallDisk {
    holder: Child,
    data: PathBuf,
}

impl SmallDisk {
    /// Mounts over a folder; skips with `None` if the system does not allow this to an ordinary user.
    /// `/readyz` asks for 256 MiB.
    pub fn mount(folder: &Path, size_mib: u64) -> Option<SmallDisk> {
        let disk = SmallDisk::try_mount(folder, size_mib);
        if disk.is_none() {
            skipped("a small file system", "let an ordinary user mount (`unshare`, user namespaces)");
        }
        disk
    }

    fn try_mount(folder: &Path, size_mib: u64) -> Option<SmallDisk> {
        let script = format!(
            "mount -t tmpfs -o size={size_mib}m tmpfs '{}' && echo mounted && exec cat",
            folder.display()
        );
        let mut command = Command::new("unshare");
        command.args(["--user", "--map-root-user", "--mount", "sh", "-c", &script]);
        let held = command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::null()).spawn();
        let mut disk = SmallDisk { holder: held.ok()?, data: folder.join("data") };
        let mut line = String::new();
        BufReader::new(disk.holder.stdout.take()?).read_line(&mut line).ok()?;
        (line.trim() == "mounted").then_some(disk)
    }

    /// Refuses all writes from now on; no file may be open for writing.
    pub fn make_read_only(&self) {
        let mut command = self.command("mount");
        let folder = self.data.parent().expect("it is below the mount");
        let status = command.args(["-o", "remount,ro"]).arg(folder).status().unwrap();
        assert!(status.success(), "{status}");
    }

    fn ballast(&self) -> PathBuf {
        self.seen().parent().expect("it is below the mount").join("ballast")
    }
}

impl Disk for SmallDisk {
    fn data(&self) -> &Path {
        &self.data
    }

    fn seen(&self) -> PathBuf {
        let inside = self.data.strip_prefix("/").expect("it is absolute");
        Path::new("/proc").join(self.holder.id().to_string()).join("root").join(inside)
    }

    fn command(&self, program: &str) -> Command {
        let mut command = Command::new("nsenter");
        let holder = self.holder.id().to_string();
        command.args(["--target", &holder, "--user", "--mount", "--preserve-credentials", program]);
        command
    }

    fn fill(&self, _: u32) {
        let mut ballast = File::create(self.ballast()).unwrap();
        let mut size = 1 << 20;
        while size > 0 {
            let written = ballast.write_all(&vec![1; size]);
            if let Err(error) = written {
                assert_eq!(error.kind(), std::io::ErrorKind::StorageFull);
                size /= 2;
            }
        }
    }

    fn free(&self, _: u32) {
        match std::fs::remove_file(self.ballast()) {
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => {}
            removed => removed.unwrap(),
        }
    }
}

impl Drop for SmallDisk {
    fn drop(&mut self) {
        let _ = self.holder.kill();
        let _ = self.holder.wait();
    }
}

/// A folder whose server may not write to any file while the disk is "full": writes fail with `EFBIG`, which
/// SQLite reports as an I/O error. It needs no privilege.
pub struct LimitedDisk {
    data: PathBuf,
}

impl LimitedDisk {
    /// Skips with `None` if limits of a running process cannot be changed.
    pub fn new(folder: &Path) -> Option<LimitedDisk> {
        let known = Command::new("prlimit").arg("--version").stdout(Stdio::null()).status();
        if !known.is_ok_and(|status| status.success()) {
            skipped("a limit on the size of files", "install prlimit");
            return None;
        }
        Some(LimitedDisk { data: folder.join("data") })
    }
}

/// Sets the largest size of a file that a process may write.
fn limit(process: u32, bytes: &str) {
    let arguments = [format!("--pid={process}"), format!("--fsize={bytes}:unlimited")];
    assert!(Command::new("prlimit").args(arguments).status().unwrap().success());
}

impl Disk for LimitedDisk {
    fn data(&self) -> &Path {
        &self.data
    }

    fn seen(&self) -> PathBuf {
        self.data.clone()
    }

    fn command(&self, program: &str) -> Command {
        let mut command = Command::new("sh");
        // Otherwise the signal ends the process.
        command.args(["-c", "trap '' XFSZ; exec \"$@\"", "sh", program]);
        command
    }

    fn fill(&self, server: u32) {
        limit(server, "0");
    }

    fn free(&self, server: u32) {
        limit(server, "unlimited");
    }
}
