//! Hostile zip archives: each is refused by name, quickly, and in little memory.

use crate::memory::peak_bytes;
use crate::writers::*;
use std::io::{Seek, SeekFrom, Write};
use std::time::{Duration, Instant};
use viola_formats::clip::Clip;

/// One entry with every field that an attacker can choose (PKWARE APPNOTE 4.3.7 and 4.3.12).
#[derive(Clone)]
struct Entry {
    name: String,
    method: u16,
    flags: u16,
    data: Vec<u8>,
    declared_bytes: u64,
    unix_mode: u32,
}

impl Entry {
    fn stored(name: &str, data: &[u8]) -> Entry {
        let (name, data) = (name.to_string(), data.to_vec());
        Entry { name, method: 0, flags: 0, declared_bytes: data.len() as u64, data, unix_mode: 0o100_644 }
    }

    /// Returns a deflate stream of `bytes` zeros: the head of a block with one-bit codes for "258 times the
    /// last byte", then such codes, 1032 zeros a byte. It has no end, which no reader should reach.
    fn zeros(name: &str, bytes: u64, declared_bytes: u64) -> Entry {
        const HEAD: [u8; 14] = [0xec, 0xc1, 1, 1, 0, 0, 0, 0x80, 0x90, 0xfe, 0xaf, 0xee, 8, 0x0a];
        let mut data = HEAD.to_vec();
        data.resize(HEAD.len() + (bytes / 1032) as usize, 0);
        Entry { method: 8, declared_bytes, data, ..Entry::stored(name, b"") }
    }
}

fn raw_zip(entries: &[Entry]) -> Vec<u8> {
    let (mut zip, mut directory) = (Vec::new(), Vec::new());
    for entry in entries {
        let offset = zip.len() as u32;
        let is_long = entry.declared_bytes >= u64::from(u32::MAX);
        let declared = if is_long { u32::MAX } else { entry.declared_bytes as u32 };
        let mut common = Vec::new();
        for value in [45, entry.flags, entry.method, 0, 0x21] {
            common.extend(value.to_le_bytes());
        }
        // No reader reaches the checksum of the packed entries.
        let checksum = if entry.method == 0 { crc32(&entry.data) } else { 0 };
        for value in [checksum, entry.data.len() as u32, declared] {
            common.extend(value.to_le_bytes());
        }
        common.extend((entry.name.len() as u16).to_le_bytes());
        zip.extend(b"PK\x03\x04");
        zip.extend(&common);
        zip.extend([0, 0]);
        zip.extend(entry.name.as_bytes());
        zip.extend(&entry.data);
        directory.extend(b"PK\x01\x02");
        directory.extend((3u16 << 8 | 45).to_le_bytes());
        directory.extend(&common);
        directory.extend((if is_long { 12u16 } else { 0 }).to_le_bytes());
        directory.extend([0; 6]);
        directory.extend((entry.unix_mode << 16).to_le_bytes());
        directory.extend(offset.to_le_bytes());
        directory.extend(entry.name.as_bytes());
        if is_long {
            directory.extend([1, 0, 8, 0]);
            directory.extend(entry.declared_bytes.to_le_bytes());
        }
    }
    let (start, count) = (zip.len() as u32, entries.len() as u16);
    zip.extend(&directory);
    zip.extend(b"PK\x05\x06\0\0\0\0");
    zip.extend(count.to_le_bytes());
    zip.extend(count.to_le_bytes());
    zip.extend((directory.len() as u32).to_le_bytes());
    zip.extend(start.to_le_bytes());
    zip.extend([0, 0]);
    zip
}

/// Checks that the archive is refused with `code` in little time and memory, for any declared sizes.
fn check(zip: &[u8], code: &str) {
    let file = as_file(zip);
    let start = Instant::now();
    let (result, peak) = peak_bytes(|| Clip::open(file.path()).map(drop));
    let error = result.err().unwrap_or_else(|| panic!("{code}: was not refused"));
    assert_eq!(error.code(), code, "{error}");
    assert!(peak < 16 << 20, "{code}: {peak} bytes at once");
    assert!(start.elapsed() < Duration::from_secs(5), "{code}: {:?}", start.elapsed());
}

fn good() -> Vec<Entry> {
    scannet("", &[0, 1]).iter().map(|(name, bytes)| Entry::stored(name, bytes)).collect()
}

fn with(entry: Entry) -> Vec<u8> {
    let mut entries = good();
    entries.retain(|e| e.name != entry.name);
    entries.push(entry);
    raw_zip(&entries)
}

#[test]
fn what_is_made_by_hand_is_good_without_tricks() {
    assert!(Clip::open(as_file(&raw_zip(&good())).path()).is_ok());
    // Archives that some programs for Windows make.
    let mut entries = good();
    for entry in &mut entries {
        entry.name = entry.name.replace('/', "\\");
    }
    assert!(Clip::open(as_file(&raw_zip(&entries)).path()).is_ok());
}

#[test]
fn archives_that_were_written_without_seeking_are_read() {
    let mut zip = zip::ZipWriter::new_stream(Vec::new());
    for (name, bytes) in scannet("", &[0, 1]) {
        zip.start_file(name, zip::write::SimpleFileOptions::default()).unwrap();
        zip.write_all(&bytes).unwrap();
    }
    let file = as_file(&zip.finish().unwrap().into_inner());
    assert!(Clip::open(file.path()).unwrap().load(1).is_ok());
}

#[test]
fn archives_with_more_entries_than_zip32_can_count_are_read() {
    let mut files = scannet("", &[0, 1]);
    files.extend((0..66_000).map(|n| (format!("other/{n}.txt"), Vec::new())));
    let file = as_zip(&files);
    assert!(Clip::open(file.path()).unwrap().load(1).is_ok());
}

/// Archive Utility of macOS counts the entries modulo 65 536.
#[test]
fn archives_that_count_modulo_65_536_are_read() {
    let others = |numbers: std::ops::Range<u32>| -> Vec<Entry> {
        numbers.map(|n| Entry::stored(&format!("other/{n}.txt"), b"")).collect()
    };
    for entries in [
        [good(), others(0..65_536)].concat(),
        [others(0..65_536), good()].concat(),
        [others(0..40_000), good(), others(40_000..131_072)].concat(),
        // The end counts none of them.
        [good(), others(good().len() as u32..65_536)].concat(),
        [others(good().len() as u32..131_072), good()].concat(),
    ] {
        let file = as_file(&raw_zip(&entries));
        let clip = Clip::open(file.path()).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(clip.frames().len(), 2);
        assert!(clip.load(1).is_ok());
    }
}

#[test]
fn archives_with_more_entries_than_they_count_are_refused() {
    let mut zip = raw_zip(&good());
    let (count, end) = (good().len(), zip.len() - 22);
    for at in [end + 8, end + 10] {
        zip[at] -= 1;
    }
    let file = as_file(&zip);
    let error = Clip::open(file.path()).map(drop).unwrap_err();
    assert_eq!(error.code(), "zip_damaged", "{error}");
    let words = format!("its directory has {count} entries, and its end counts {}", count - 1);
    assert!(error.to_string().contains(&words), "{error}");
}

/// Archive Utility of macOS keeps the last 32 bits of the directory's place.
#[test]
fn an_archive_of_4_gib_whose_directory_is_not_found_tells_the_way_out() {
    const MORE: u64 = 1 << 32;
    let zip = raw_zip(&good());
    let directory = zip.windows(4).position(|bytes| bytes == b"PK\x01\x02").unwrap();
    let mut file = as_file(&zip[..directory]);
    // A file with a hole takes no room.
    file.as_file_mut().set_len(directory as u64 + MORE).unwrap();
    file.seek(SeekFrom::End(0)).unwrap();
    file.write_all(&zip[directory..]).unwrap();
    let error = Clip::open(file.path()).map(drop).unwrap_err();
    assert_eq!(error.code(), "zip_damaged", "{error}");
    assert!(error.to_string().contains("pack the folder with `zip -r`"), "{error}");
}

#[test]
fn bombs_are_refused() {
    const GIB: u64 = 1 << 30;
    // Ten gigabytes that are declared, in files that are read or not.
    for name in ["intrinsic/intrinsic_color.txt", "color/0.jpg", "nobody/reads/this.bin"] {
        check(&with(Entry::zeros(name, 10 * GIB, 10 * GIB)), "zip_bomb");
        check(&with(Entry::zeros(name, 3 * GIB, 3 * GIB)), "zip_bomb");
    }
    // Ten gigabytes that are declared as 300 bytes.
    check(&with(Entry::zeros("intrinsic/intrinsic_color.txt", 10 * GIB, 300)), "zip_damaged");
    check(&with(Entry::zeros("pose/0.txt", 10 * GIB, 300)), "zip_damaged");
    // Ten gigabytes in small pieces.
    let mut pieces = good();
    pieces.extend((0..10_000).map(|n| Entry::zeros(&format!("color/{}.jpg", n + 2), 1 << 20, 1 << 20)));
    check(&raw_zip(&pieces), "zip_bomb");
}

#[test]
fn a_lying_picture_is_refused_when_it_is_loaded() {
    let mut files = scannet("", &[0, 1]);
    let zip = as_zip(&files);
    assert!(Clip::open(zip.path()).is_ok());
    // Rewrite the size that the directory declares for the last picture: less than it has.
    files.retain(|(name, _)| name != "color/1.jpg");
    files.push(("color/1.jpg".into(), color_jpeg(WIDTH, HEIGHT)));
    let mut bytes = zip_bytes(&files);
    let directory = bytes.windows(4).rposition(|w| w == b"PK\x01\x02").unwrap();
    bytes[directory + 24..directory + 28].copy_from_slice(&100u32.to_le_bytes());
    let zip = as_file(&bytes);
    let clip = Clip::open(zip.path()).unwrap();
    assert!(clip.load(0).is_ok());
    assert_eq!(clip.load(1).unwrap_err().code(), "zip_damaged");
}

#[test]
fn names_that_lead_out_are_refused_even_where_nobody_reads_them() {
    let long = "x".repeat(2000);
    for name in [
        "../outside.txt",
        "a/../../outside.txt",
        "a/../inside.txt",
        "..",
        "/etc/passwd",
        "C:/windows/system.ini",
        "c:relative",
        "..\\outside.txt",
        "a\\..\\..\\outside.txt",
        "\\\\server\\share\\file",
        "__MACOSX/../../outside.txt",
        "nul\0byte",
        &long,
    ] {
        check(&with(Entry::stored(name, b"content")), "path_escapes");
    }
}

#[test]
fn archives_with_other_tricks_are_refused() {
    check(&with(Entry { flags: 1, ..Entry::stored("color/0.jpg", b"secret") }), "zip_encrypted");
    check(&with(Entry { unix_mode: 0o120_777, ..Entry::stored("depth/0.png", b"/etc/passwd") }), "link");
    check(&with(Entry { method: 12, ..Entry::stored("color/0.jpg", b"BZh") }), "zip_method");
    check(&with(Entry { method: 99, ..Entry::stored("color/0.jpg", b"AES") }), "zip_method");
    for name in ["color\\0.jpg", "./color/0.jpg", "color//0.jpg"] {
        check(&with(Entry::stored(name, b"again")), "duplicate_name");
    }
    let mut twice = good();
    twice.push(twice[2].clone());
    check(&raw_zip(&twice), "duplicate_name");
}

#[test]
fn an_archive_that_claims_a_hundred_million_entries_is_refused() {
    let mut zip = raw_zip(&good());
    let start = zip.len() as u64 - 22;
    zip.truncate(start as usize);
    zip.extend(b"PK\x06\x06");
    zip.extend(44u64.to_le_bytes());
    zip.extend([45, 3, 45, 0, 0, 0, 0, 0, 0, 0, 0, 0]);
    zip.extend(100_000_000u64.to_le_bytes());
    zip.extend(100_000_000u64.to_le_bytes());
    zip.extend(4_600_000_000u64.to_le_bytes());
    zip.extend(0u64.to_le_bytes());
    zip.extend(b"PK\x06\x07\0\0\0\0");
    zip.extend(start.to_le_bytes());
    zip.extend(1u32.to_le_bytes());
    zip.extend(b"PK\x05\x06\0\0\0\0\xff\xff\xff\xff\xff\xff\xff\xff\xff\xff\xff\xff\0\0");
    check(&zip, "too_many_entries");
}
