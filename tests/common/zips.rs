//! Zip archives, good and bad.

use std::io::{Cursor, Write};
use zip::write::SimpleFileOptions;

/// Names and contents.
pub type Files = Vec<(String, Vec<u8>)>;

pub fn zip(files: &Files) -> Vec<u8> {
    let mut archive = zip::ZipWriter::new(Cursor::new(Vec::new()));
    for (name, bytes) in files {
        archive.start_file(name.as_str(), SimpleFileOptions::default()).unwrap();
        archive.write_all(bytes).unwrap();
    }
    archive.finish().unwrap().into_inner()
}

/// The archive with one more file: `size_bytes` zeros, deflated as they are written.
pub fn zip_with_zeros(files: &Files, name: &str, size_bytes: u64) -> Vec<u8> {
    let mut archive = zip::ZipWriter::new(Cursor::new(Vec::new()));
    let options = SimpleFileOptions::default().compression_level(Some(1)).large_file(true);
    for (name, bytes) in files {
        archive.start_file(name.as_str(), options).unwrap();
        archive.write_all(bytes).unwrap();
    }
    archive.start_file(name, options).unwrap();
    let zeros = vec![0; 1 << 20];
    for _ in 0..size_bytes / zeros.len() as u64 {
        archive.write_all(&zeros).unwrap();
    }
    archive.finish().unwrap().into_inner()
}
