//! The identity of a clip: its content.

use crate::api::content_sha256;
use crate::cli::sum;
use anyhow::{Context, Result, bail};
use sha2::{Digest, Sha256};
use std::fs::{self, File};
use std::path::Path;
use uuid::{Builder, Uuid};
use viola_formats::container::{self, Container, Folder, Region};

/// The content of a clip.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct Content {
    /// SHA-256 of the bytes of its file, or of the names and bytes of the files in its folder.
    bytes: [u8; 32],
    /// SHA-256 of the recording in an archive or a folder; all archives of the same files have the same.
    files: Option<String>,
}

impl Content {
    /// Reads all bytes of a clip.
    pub fn of(path: &Path) -> Result<Content> {
        let unreadable = || format!("cannot read {}", path.display());
        let metadata = fs::metadata(path).with_context(unreadable)?;
        let mut hash = Sha256::new();
        if metadata.is_dir() {
            let folder = Folder::open(path).with_context(unreadable)?;
            for name in folder.names() {
                let file = folder.region(name, u64::MAX).with_context(unreadable)?;
                // With the lengths, no two folders give the same bytes.
                hash.update((name.len() as u64).to_le_bytes());
                hash.update(name);
                hash.update(file.bytes.to_le_bytes());
                sum::add(&mut hash, file.reader()).with_context(unreadable)?;
            }
        } else if metadata.is_file() {
            let file = File::open(path).and_then(Region::whole).with_context(unreadable)?;
            sum::add(&mut hash, file.reader()).with_context(unreadable)?;
        } else {
            // Opening a pipe would block until there is a writer.
            bail!("{} is neither a file nor a folder", path.display());
        }
        // A file that is no clip is refused when it is opened.
        let files = container::open(path).and_then(|container| content_sha256(container.as_ref()));
        Ok(Content { bytes: hash.finalize().into(), files: files.ok().flatten() })
    }

    /// Returns the SHA-256 in lower-case hexadecimal.
    pub fn sha256(&self) -> String {
        sum::hexadecimal(&self.bytes)
    }

    /// Returns the hash of the recording: equal for a clip that is packed twice.
    pub fn recording(&self) -> String {
        self.files.clone().unwrap_or_else(|| self.sha256())
    }

    /// Returns the clip's id: a UUID of version 8 (RFC 9562) of the first bits of the sum.
    pub fn id(&self) -> Uuid {
        let mut bytes = [0; 16];
        bytes.copy_from_slice(&self.bytes[..16]);
        Builder::from_custom_bytes(bytes).into_uuid()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn folder(files: &[(&str, &str)]) -> Content {
        let folder = tempfile::tempdir().unwrap();
        for (name, text) in files {
            let path = folder.path().join(name);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, text).unwrap();
        }
        Content::of(folder.path()).unwrap()
    }

    #[test]
    fn a_file_is_its_bytes() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.zip");
        fs::write(&path, "abc").unwrap();
        let content = Content::of(&path).unwrap();
        // FIPS 180-4, the first example of SHA-256.
        let sum = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
        assert_eq!(content.sha256(), sum);
        assert_eq!(content.id().to_string(), "ba7816bf-8f01-8fea-8141-40de5dae2223");
        assert!(Content::of(&folder.path().join("missing")).is_err());
    }

    #[test]
    fn a_folder_is_the_names_and_bytes_of_its_files() {
        let files = folder(&[("color/0.jpg", "a"), ("pose/0.txt", "bc")]);
        assert_eq!(files, folder(&[("pose/0.txt", "bc"), ("color/0.jpg", "a")]));
        for others in [
            &[("color/0.jpg", "ab"), ("pose/0.txt", "c")][..],
            &[("color/0.jpg", "a"), ("pose/1.txt", "bc")],
            &[("color/0.jpg", "a")],
            &[],
        ] {
            assert_ne!(files, folder(others), "{others:?}");
        }
    }
}
