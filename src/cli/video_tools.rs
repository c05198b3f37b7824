//! The programs that decode video: this one, and ffmpeg if it is installed.

use std::env;
use std::path::PathBuf;
use viola_formats::video::Tools;

/// Returns the programs that are found.
pub(super) fn video_tools() -> Tools {
    Tools { viola: env::current_exe().ok(), ffmpeg: in_path("ffmpeg"), ..Tools::default() }
}

fn in_path(program: &str) -> Option<PathBuf> {
    let folders = env::var_os("PATH")?;
    env::split_paths(&folders).map(|folder| folder.join(program)).find(|path| path.is_file())
}
