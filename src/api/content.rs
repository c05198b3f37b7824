//! The content of clips: an app that retries an upload may pack the same recording into another archive.

use sha2::{Digest, Sha256};
use viola_formats::clip::{Clip, ClipError};
use viola_formats::container::{Container, ContainerError};

/// Returns the SHA-256 of the names, lengths and checksums of a container's files, in lower-case hexadecimal. The order, the
/// times and the compression of the entries do not matter, nor does a folder around all files. `None` for one file by
/// itself: its own SHA-256 says the same.
pub fn content_sha256(container: &dyn Container) -> Result<Option<String>, ContainerError> {
    let Some(sums) = container.sums()? else { return Ok(None) };
    let names = container.names();
    let folder_bytes = common_folder_bytes(names);
    let mut hash = Sha256::new();
    for (name, sum) in names.iter().zip(sums) {
        let name = &name.as_bytes()[folder_bytes..];
        // With the lengths, no two lists give the same bytes.
        hash.update((name.len() as u64).to_le_bytes());
        hash.update(name);
        hash.update(sum.bytes.to_le_bytes());
        hash.update(sum.crc32.to_le_bytes());
    }
    Ok(Some(hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect()))
}

/// Returns [`content_sha256`] of an opened clip.
pub(super) fn of_clip(clip: &Clip) -> Result<Option<String>, ClipError> {
    let content = clip.container().map(content_sha256).transpose()?;
    Ok(content.flatten())
}

/// Returns the length of the path that all names begin with, with its last slash. The names are in byte order.
fn common_folder_bytes(names: &[String]) -> usize {
    let (Some(first), Some(last)) = (names.first(), names.last()) else { return 0 };
    let common = first.bytes().zip(last.bytes()).take_while(|(a, b)| a == b).count();
    first.as_bytes()[..common].iter().rposition(|byte| *byte == b'/').map_or(0, |slash| slash + 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::{Cursor, Write};
    use viola_formats::container::Zip;
    use zip::CompressionMethod::{self, Deflated, Stored};
    use zip::write::SimpleFileOptions;

    fn of_zip(files: &[(&str, &str)], method: CompressionMethod) -> String {
        let mut archive = zip::ZipWriter::new(Cursor::new(Vec::new()));
        for (name, text) in files {
            let options = SimpleFileOptions::default().compression_method(method);
            archive.start_file(*name, options).unwrap();
            archive.write_all(text.as_bytes()).unwrap();
        }
        let zip = Zip::from_bytes(archive.finish().unwrap().into_inner()).unwrap();
        content_sha256(&zip).unwrap().expect("it is an archive")
    }

    #[test]
    fn the_content_of_an_archive_does_not_depend_on_how_it_is_packed() {
        let files = [("rgb/0.jpg", "a"), ("rgb/1.jpg", "b"), ("poses.txt", "c")];
        let content = of_zip(&files, Deflated);
        let mut turned = files;
        turned.reverse();
        let beside = [("rgb/0.jpg", "a"), ("rgb/1.jpg", "b"), ("poses.txt", "c"), ("__MACOSX/._a", "d")];
        let in_folder = [("é/2/rgb/0.jpg", "a"), ("é/2/rgb/1.jpg", "b"), ("é/2/poses.txt", "c")];
        let folders = [&turned[..], &beside, &in_folder];
        for same in folders.iter().flat_map(|files| [Deflated, Stored].map(|method| of_zip(files, method))) {
            assert_eq!(same, content);
        }
        for others in [
            &[("rgb/0.jpg", "a"), ("rgb/1.jpg", "B"), ("poses.txt", "c")][..],
            &[("rgb/0.jpg", "b"), ("rgb/1.jpg", "a"), ("poses.txt", "c")],
            &[("rgb/0.jpg", "a"), ("rgb/2.jpg", "b"), ("poses.txt", "c")],
            &[("rgb/0.jpg", "a"), ("poses.txt", "c")],
            &[],
        ] {
            assert_ne!(of_zip(others, Stored), content, "{others:?}");
        }
    }

    #[test]
    fn a_folder_and_an_archive_have_the_same_content_and_a_file_by_itself_has_none() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("a.txt"), "a").unwrap();
        let content = |path: &std::path::Path| {
            content_sha256(viola_formats::container::open(path).unwrap().as_ref()).unwrap()
        };
        assert_eq!(content(folder.path()), Some(of_zip(&[("clip/a.txt", "a")], Deflated)));
        assert_eq!(content(&folder.path().join("a.txt")), None);
    }
}
