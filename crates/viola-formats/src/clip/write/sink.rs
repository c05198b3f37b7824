//! Destinations of written files.

use super::WriteError;
use std::io::{self, Seek, Write};
use std::path::{Path, PathBuf};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

/// Takes files one by one.
pub trait Sink {
    fn put(&mut self, name: &str, bytes: &[u8]) -> Result<(), WriteError>;
}

/// A folder; subfolders in names are created.
pub struct FolderSink {
    root: PathBuf,
}

impl FolderSink {
    pub fn new(root: &Path) -> FolderSink {
        FolderSink { root: root.to_path_buf() }
    }
}

impl Sink for FolderSink {
    fn put(&mut self, name: &str, bytes: &[u8]) -> Result<(), WriteError> {
        let path = self.root.join(name);
        let written =
            path.parent().map_or(Ok(()), std::fs::create_dir_all).and_then(|()| std::fs::write(&path, bytes));
        written.map_err(|source| WriteError::Write { name: name.to_string(), source })
    }
}

/// A zip archive; pictures are stored, text is compressed.
pub struct ZipSink<W: Write + Seek> {
    zip: ZipWriter<W>,
}

impl<W: Write + Seek> ZipSink<W> {
    pub fn new(to: W) -> ZipSink<W> {
        ZipSink { zip: ZipWriter::new(to) }
    }

    /// Writes the archive's directory.
    pub fn finish(self) -> io::Result<W> {
        Ok(self.zip.finish()?)
    }
}

impl<W: Write + Seek> Sink for ZipSink<W> {
    fn put(&mut self, name: &str, bytes: &[u8]) -> Result<(), WriteError> {
        let is_packed = [".png", ".jpg", ".mp4"].iter().any(|ending| name.ends_with(ending));
        let method = if is_packed { CompressionMethod::Stored } else { CompressionMethod::Deflated };
        let options = SimpleFileOptions::default().compression_method(method);
        let written = self.zip.start_file(name, options).map_err(io::Error::from);
        written
            .and_then(|()| self.zip.write_all(bytes))
            .map_err(|source| WriteError::Write { name: name.to_string(), source })
    }
}
