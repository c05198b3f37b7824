//! Containers: a folder and every archive of the same files return the same bytes, whole and in part.

use crate::writers::*;
use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use flate2::Compression;
use flate2::write::GzEncoder;
use ruzstd::encoding::{CompressionLevel, compress_to_vec};
use std::io::{BufReader, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use tempfile::TempDir;
use viola_formats::container::{self, Budget, Container, ContainerError, Scratch};

/// Formats of tar's headers for names of more than 100 bytes.
#[derive(Clone, Copy, PartialEq)]
pub enum Names {
    Gnu,
    Pax,
}

pub fn tar_bytes(files: &[(String, Vec<u8>)], names: Names) -> Vec<u8> {
    let mut tar = tar::Builder::new(Vec::new());
    for (name, bytes) in files {
        let mut header = if names == Names::Gnu { tar::Header::new_gnu() } else { tar::Header::new_ustar() };
        header.set_size(bytes.len() as u64);
        header.set_mode(0o644);
        if names == Names::Gnu {
            tar.append_data(&mut header, name, bytes.as_slice()).unwrap();
            continue;
        }
        // A value may have line ends and zeros, as macOS writes them.
        let records: [(&str, &[u8]); 3] =
            [("path", name.as_bytes()), ("mtime", b"1700000000.25"), ("SCHILY.xattr.note", b"\n\0=9 a\n")];
        tar.append_pax_extensions(records).unwrap();
        header.set_path("somewhere/else").unwrap();
        header.set_cksum();
        tar.append(&header, bytes.as_slice()).unwrap();
    }
    tar.into_inner().unwrap()
}

pub fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::fast());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

pub fn zstd(bytes: &[u8]) -> Vec<u8> {
    compress_to_vec(bytes, CompressionLevel::Fastest)
}

/// Returns a skippable frame of Zstandard (RFC 8878, section 3.1.2).
pub fn skipped(bytes: &[u8]) -> Vec<u8> {
    [&0x184d_2a53u32.to_le_bytes()[..], &(bytes.len() as u32).to_le_bytes(), bytes].concat()
}

fn stored_zip(files: &[(String, Vec<u8>)]) -> Vec<u8> {
    let mut zip = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
    let options = zip::write::SimpleFileOptions::default().compression_method(zip::CompressionMethod::Stored);
    for (name, bytes) in files {
        zip.start_file(name.as_str(), options).unwrap();
        zip.write_all(bytes).unwrap();
    }
    zip.finish().unwrap().into_inner()
}

/// Returns the files in every kind of archive, with its name.
pub fn archives(files: &[(String, Vec<u8>)]) -> Vec<(&'static str, Vec<u8>)> {
    let (gnu, pax) = (tar_bytes(files, Names::Gnu), tar_bytes(files, Names::Pax));
    let (head, tail) = pax.split_at(pax.len() / 3);
    vec![
        ("zip", zip_bytes(files)),
        ("zip, stored", stored_zip(files)),
        ("tar.gz", gzip(&gnu)),
        ("tar.gz of two members", [gzip(head), gzip(tail)].concat()),
        ("tar.zst", zstd(&gnu)),
        ("tar.zst of several frames", [skipped(b"pieces"), zstd(head), skipped(b""), zstd(tail)].concat()),
        ("tar", gnu),
        ("tar, pax", pax),
    ]
}

/// Writes the files to a folder and to every archive, whose names do not show their kind.
pub fn everywhere(files: &[(String, Vec<u8>)]) -> (TempDir, Vec<(&'static str, PathBuf)>) {
    let root = TempDir::new().unwrap();
    let mut places = vec![("folder", root.path().join("folder"))];
    std::fs::create_dir(&places[0].1).unwrap();
    for (name, bytes) in files {
        write(&places[0].1.join(name), bytes);
    }
    for (index, (what, bytes)) in archives(files).into_iter().enumerate() {
        let path = root.path().join(format!("0193b0c2-{index:04}"));
        write(&path, &bytes);
        places.push((what, path));
    }
    (root, places)
}

fn open(path: &Path) -> Box<dyn Container> {
    container::open(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// Checks that every file reads as it was written, whole and in parts, by several threads at once.
fn check(what: &str, container: &dyn Container, files: &[(String, Vec<u8>)]) {
    let mut sorted: Vec<_> = files.iter().collect();
    sorted.sort();
    assert!(
        container.names().iter().eq(sorted.iter().map(|(name, _)| name)),
        "{what}: {:?}",
        container.names()
    );
    std::thread::scope(|scope| {
        for _ in 0..3 {
            scope.spawn(|| {
                for (name, bytes) in &sorted {
                    check_file(what, container, name, bytes);
                }
            });
        }
    });
    let missing = container.region("no such file", 10).unwrap_err();
    assert_eq!(missing.code(), "missing_file", "{what}");
}

fn check_file(what: &str, container: &dyn Container, name: &str, bytes: &[u8]) {
    let len = bytes.len() as u64;
    assert!(container.read(name, len).unwrap() == bytes, "{what}: {name}");
    let region = container.region(name, len).unwrap();
    assert_eq!(region.bytes, len, "{what}: {name}");
    std::thread::scope(|scope| {
        for part in 0..3 {
            let region = &region;
            scope.spawn(move || {
                for at in (0..=bytes.len()).step_by(bytes.len() / 7 + 1).skip(part) {
                    let mut buffer = vec![0; (bytes.len() - at).min(50)];
                    region.read_exact_at(at as u64, &mut buffer).unwrap();
                    assert_eq!(buffer, &bytes[at..at + buffer.len()], "{what}: {name} at {at}");
                }
            });
        }
    });
    // No byte beyond the region can be read.
    assert_eq!(region.read_at(len, &mut [0; 9]).unwrap(), 0);
    assert_eq!(region.read_at(u64::MAX, &mut [0; 9]).unwrap(), 0);
    assert!(region.read_exact_at(len.saturating_sub(3), &mut [0; 9]).is_err());
    assert!(region.part(1, len).is_err() && region.part(u64::MAX, 2).is_err());
    let mut reader = BufReader::new(region.reader());
    assert_eq!(reader.seek(SeekFrom::End(-(len.min(5) as i64))).unwrap(), len - len.min(5));
    let mut tail = Vec::new();
    reader.read_to_end(&mut tail).unwrap();
    assert_eq!(tail, &bytes[bytes.len() - bytes.len().min(5)..], "{what}: {name}");
    assert!(reader.seek(SeekFrom::Start(0)).and_then(|_| reader.seek(SeekFrom::Current(-1))).is_err());
    if len > 0 {
        for error in [container.read(name, len - 1).err(), container.region(name, len - 1).err()] {
            assert_eq!(error.unwrap().code(), "file_too_large", "{what}: {name}");
        }
    }
}

fn mixed_files() -> Vec<(String, Vec<u8>)> {
    let long = format!("{}/{}.bin", "folder/".repeat(20), "n".repeat(150));
    vec![
        ("empty".into(), Vec::new()),
        ("zeros".into(), vec![0; 100_000]),
        ("a/block".into(), (0..512).map(|i| i as u8).collect()),
        ("a/odd".into(), (0..70_001u32).map(|i| (i.wrapping_mul(i) >> 7) as u8).collect()),
        (long.replace("//", "/"), b"far down".to_vec()),
        ("a/größe 日本.txt".into(), b"a name in UTF-8".to_vec()),
    ]
}

#[test]
fn every_container_gives_the_same_bytes() {
    let files = mixed_files();
    let (_root, places) = everywhere(&files);
    for (what, path) in &places {
        // Folders are read eight levels deep.
        let files: Vec<_> = files
            .iter()
            .filter(|(name, _)| *what != "folder" || name.matches('/').count() < 8)
            .cloned()
            .collect();
        check(what, open(path).as_ref(), &files);
    }
    let bytes = container::Zip::from_bytes(stored_zip(&files)).unwrap();
    check("zip in memory", &bytes, &files);
}

#[test]
fn what_is_hidden_is_left_out() {
    let mut files = mixed_files();
    for name in [".DS_Store", "a/._block", "__MACOSX/a/._block", ".git/config"] {
        files.push((name.into(), b"hidden".to_vec()));
    }
    for (what, bytes) in archives(&files) {
        check(what, open(as_file(&bytes).path()).as_ref(), &mixed_files());
    }
}

/// `clip/b.txt`, `clip/color/0.txt`, and a file whose name is 120 times `n`, packed by GNU tar 1.34.
#[test]
fn archives_of_other_programs_are_read() {
    let made = [
        // tar --format=gnu, zstd 1.5.4 -19
        (
            "zstd",
            "KLUv/WQAJ7UFAKIGFheAqwNAavWU57/ngkoddzrZJaaApScwZEd8b7xa490IkXKzZUpM4BEfBiqp9O4G0q53LeP3lHx/\
             QoHC5TuLlK1+7VzPZ6ZBEZLCZBplpK51rzK/VbUkTgQhoLAqoLltzfBMJEd2/kP1gC+AqI8NYDXIih8GJJVvACg6yTrK\
             lGVUB2ZIBzQNn9oxqrPTJ/iHAQdFUz3EgCcHaKv2qARG5c5DLM0B26NLLejTT0VOBgZ2p2cDKmN8mQ==",
        ),
        // tar --format=pax, zstd --format=gzip
        (
            "gzip",
            "H4sIAAAAAAACA+2ZTW6DMBBGveYUPgGMPf4pi+y77BVogppILkSEqhy/gCqVElURUmziMm8DwguEzPs+RqTZS9E9l8Wh\
             bC7Z3p3O7P5Aj1FqPPbMjwBW/ZwP18UA4x0LwMelLZr+9mybIPCiPb2XO2FzLXKDqNIcZW4BrU361f3VqnwaV03CiOgZ\
             lM8832NUXOu//Z+fCxCoGNcx+T9/uJj2f1IBr2nbtavnv+xfAMr/R81/oPz/X/nvQ/ol/oO5/v6TjENM/kea/5914w5k\
             8rb9n46AtaubB+h/K6n/qf+JIP6P0vubApfPf0JqSfNf4P2ftADc9YNwef4jKEv5T/lPBPQffE2By+c/KZSh+S8Ex9K5\
             mkym+e+7+SsP3PIfwf72HxEMzX9BEJjzc9Eed+OLUK3E0DwJ/Ypcy3/Pu3u7//XMf6U0Uv+HwNXVG9lDEASxPb4A0/id\
             ogAoAAA=",
        ),
    ];
    let files: Vec<_> = [
        ("b.txt".into(), "world\n"),
        ("color/0.txt".into(), "hello\n"),
        (format!("{}.txt", "n".repeat(120)), "long\n"),
    ]
    .into_iter()
    .map(|(name, text): (String, _)| (format!("clip/{name}"), text.as_bytes().to_vec()))
    .collect();
    for (what, text) in made {
        let bytes = BASE64_STANDARD.decode(text).unwrap();
        check(what, open(as_file(&bytes).path()).as_ref(), &files);
    }
}

#[test]
fn a_file_by_itself_is_a_container_of_one() {
    let bytes = b"what this is, its reader will say".to_vec();
    let folder = TempDir::new().unwrap();
    for (own, name) in [
        ("0193b0c2-uuid", "0193b0c2-uuid"),
        ("scan.sens", "scan.sens"),
        (".hidden", "hidden"),
        ("...", "file"),
        ("C:evil\\..\\name", "C_evil_.._name"),
        ("line\nend", "line_end"),
    ] {
        let path = folder.path().join(own);
        write(&path, &bytes);
        check(own, open(&path).as_ref(), &[(name.to_owned(), bytes.clone())]);
    }
}

#[cfg(unix)]
#[test]
fn pipes_and_missing_files_are_not_waited_for() {
    use std::os::unix::net::UnixListener;
    let folder = TempDir::new().unwrap();
    let socket = folder.path().join("socket");
    let _listener = UnixListener::bind(&socket).unwrap();
    for path in [socket, folder.path().join("missing"), "/dev/null".into()] {
        assert_eq!(container::open(&path).err().unwrap().code(), "unreadable", "{}", path.display());
    }
}

#[test]
fn archives_are_unpacked_in_their_folder_and_within_budgets() {
    let folder = TempDir::new().unwrap();
    let files = vec![("a.txt".to_owned(), b"a".to_vec()), ("filler.bin".to_owned(), vec![7; 300_000])];
    let path = folder.path().join("clip.tar.gz");
    std::fs::write(&path, gzip(&tar_bytes(&files, Names::Gnu))).unwrap();
    let missing = Scratch::new(&folder.path().join("none"), Vec::new());
    assert!(matches!(container::open_in(&path, &missing), Err(ContainerError::CannotUnpack { .. })));
    let budget = Arc::new(Budget::new(500_000));
    let scratch = Scratch::new(folder.path(), vec![budget.clone()]);
    let first = container::open_in(&path, &scratch).unwrap();
    assert!(budget.used_bytes() > 300_000);
    assert_eq!(first.read("a.txt", 10).unwrap(), b"a");
    // A second one must wait for the first, and one that is too large by itself is refused.
    assert!(matches!(container::open_in(&path, &scratch), Err(ContainerError::CannotUnpack { .. })));
    let region = first.region("filler.bin", 1 << 20).unwrap();
    drop(first);
    assert!(budget.used_bytes() > 300_000, "a part of the file is still open");
    drop(region);
    assert_eq!(budget.used_bytes(), 0);
    container::open_in(&path, &scratch).unwrap();
    let small = Scratch::new(folder.path(), vec![Arc::new(Budget::new(100_000))]);
    let refused = container::open_in(&path, &small).err().unwrap();
    assert!(matches!(refused, ContainerError::UnpacksTooLarge { max_bytes: 100_000 }));
    // A compressed entry of a zip that is read as a file.
    let path = folder.path().join("clip.zip");
    std::fs::write(&path, zip_bytes(&files)).unwrap();
    let zip = container::open_in(&path, &small).unwrap();
    assert!(matches!(zip.region("filler.bin", 1 << 20), Err(ContainerError::UnpacksTooLarge { .. })));
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 2, "nothing unpacked has a name");
}
