//! The programs that decode video: this one, and ffmpeg if it is installed.

use std::env;
use std::io;
use std::path::{Path, PathBuf};
use viola_formats::video::Tools;

/// Returns the programs that are found.
pub(super) fn video_tools() -> Tools {
    Tools { viola: own_program().ok(), ffmpeg: in_path("ffmpeg"), ..Tools::default() }
}

/// Returns the path of the running program; on Linux it stays valid when another version replaces the file.
pub(super) fn own_program() -> io::Result<PathBuf> {
    let running = Path::new("/proc/self/exe");
    if running.exists() { Ok(running.to_owned()) } else { env::current_exe() }
}

fn in_path(program: &str) -> Option<PathBuf> {
    let folders = env::var_os("PATH")?;
    env::split_paths(&folders).map(|folder| folder.join(program)).find(|path| path.is_file())
}
