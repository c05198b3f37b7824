//! SHA-256 sums of files and of weights in the program.

use anyhow::{Context, Result, bail};
use sha2::{Digest, Sha256};
use std::fs::File;
use std::io::{self, Read};
use std::path::Path;
use viola_network::Weights;

/// Bytes read at a time.
const BUFFER_BYTES: usize = 1 << 16;

/// Adds all that is read to a sum.
pub(super) fn add(hash: &mut Sha256, mut read: impl Read) -> io::Result<()> {
    let mut buffer = vec![0; BUFFER_BYTES];
    loop {
        match read.read(&mut buffer) {
            Ok(0) => return Ok(()),
            Ok(bytes) => hash.update(&buffer[..bytes]),
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
}

/// Returns the sum in hexadecimal.
pub(super) fn of_file(path: &Path) -> Result<String> {
    let mut hash = Sha256::new();
    let read = File::open(path).and_then(|file| add(&mut hash, file));
    read.with_context(|| format!("cannot read {}", path.display()))?;
    Ok(hexadecimal(&hash.finalize()))
}

/// Returns the sums of all files in a folder and its folders, with their paths, in the order of the paths.
pub(super) fn of_folder(folder: &Path) -> Result<String> {
    let unreadable = || format!("cannot read {}", folder.display());
    let entries = std::fs::read_dir(folder).with_context(unreadable)?;
    let mut paths = entries
        .map(|entry| Ok(entry?.path()))
        .collect::<std::io::Result<Vec<_>>>()
        .with_context(unreadable)?;
    paths.sort();
    let mut sums = String::new();
    for path in paths {
        let sum = if path.is_dir() { of_folder(&path)? } else { of_file(&path)? };
        sums += &format!("{}: {sum}\n", path.display());
    }
    Ok(sums)
}

/// Returns the sum of bytes in hexadecimal.
pub(super) fn of_bytes(bytes: &[u8]) -> String {
    hexadecimal(&Sha256::digest(bytes))
}

/// Returns the sum of a network's weights in hexadecimal.
pub(super) fn of_weights(weights: &Weights) -> Result<String> {
    match weights {
        Weights::File(path) => of_file(path),
        Weights::BuiltIn { bytes, .. } => Ok(of_bytes(bytes)),
    }
}

pub(super) fn hexadecimal(sum: &[u8]) -> String {
    sum.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Returns an error if a sum is not `wanted`.
pub(super) fn expect(sum: &str, wanted: &str, what: &str) -> Result<()> {
    if !sum.eq_ignore_ascii_case(wanted) {
        bail!("{what} is not that of models.toml: its SHA-256 is {sum}, not {wanted}; nothing is installed");
    }
    Ok(())
}
