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

/// Returns the archive with one more incompressible file, so that it has at least `size_bytes`.
pub fn zip_of_size(files: &Files, size_bytes: usize) -> Vec<u8> {
    let mut state = 1_u64;
    let noise = (0..size_bytes).map(|_| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        (state >> 56) as u8
    });
    let mut files = files.clone();
    files.push(("notes.bin".to_owned(), noise.collect()));
    zip(&files)
}

/// Returns the archive with one more file: `size_bytes` zeros, deflated as they are written.
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
