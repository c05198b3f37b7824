//! Hostile tar archives, bare and packed: each is refused by name, quickly, and in little memory.

use crate::archives::*;
use crate::memory::peak_bytes;
use crate::writers::*;
use std::io::{BufWriter, Write};
use std::path::Path;
use std::time::{Duration, Instant};
use tempfile::NamedTempFile;
use viola_formats::clip::Clip;
use viola_formats::container;

/// One entry with the fields that an attacker can choose (POSIX.1-2017, pax, "ustar Interchange Format").
#[derive(Clone)]
struct Entry {
    name: Vec<u8>,
    kind: u8,
    data: Vec<u8>,
    declared_bytes: u64,
    checksum_off_by: u32,
}

impl Entry {
    fn file(name: impl AsRef<[u8]>, data: &[u8]) -> Entry {
        let declared_bytes = data.len() as u64;
        Entry {
            name: name.as_ref().to_vec(),
            kind: b'0',
            data: data.to_vec(),
            declared_bytes,
            checksum_off_by: 0,
        }
    }

    fn of_kind(kind: u8, name: &str, data: &[u8]) -> Entry {
        Entry { kind, ..Entry::file(name, data) }
    }

    fn header(&self) -> [u8; 512] {
        let mut header = [0; 512];
        let name = &self.name[..self.name.len().min(100)];
        header[..name.len()].copy_from_slice(name);
        header[100..108].copy_from_slice(b"0000644\0");
        // Twelve octal digits and no end, as for a file of up to 64 GiB.
        header[124..136].copy_from_slice(format!("{:012o}", self.declared_bytes).as_bytes());
        header[148..156].fill(b' ');
        header[156] = self.kind;
        header[257..265].copy_from_slice(b"ustar\x0000");
        let sum: u32 = header.iter().map(|byte| u32::from(*byte)).sum();
        header[148..155].copy_from_slice(format!("{:06o}\0", sum + self.checksum_off_by).as_bytes());
        header
    }
}

fn raw_tar(entries: &[Entry]) -> Vec<u8> {
    let mut tar = Vec::new();
    for entry in entries {
        tar.extend(entry.header());
        tar.extend(&entry.data);
        tar.resize(tar.len().next_multiple_of(512), 0);
    }
    tar.resize(tar.len() + 1024, 0);
    tar
}

fn pax(key: &str, value: &str) -> Vec<u8> {
    let length = |digits: usize| digits + 3 + key.len() + value.len();
    let digits = (1..9).find(|digits| length(*digits).to_string().len() == *digits).unwrap();
    format!("{} {key}={value}\n", length(digits)).into_bytes()
}

fn good() -> Vec<Entry> {
    scannet("", &[0, 1]).iter().map(|(name, bytes)| Entry::file(name, bytes)).collect()
}

/// Returns a good recording with `more` before its last file.
fn with(more: &[Entry]) -> Vec<u8> {
    let mut entries = good();
    let last = entries.pop().unwrap();
    entries.extend(more.iter().cloned());
    entries.push(last);
    raw_tar(&entries)
}

fn check_path(path: &Path, code: &str) {
    let start = Instant::now();
    let (result, peak) = peak_bytes(|| Clip::open(path).map(drop));
    let error = result.err().unwrap_or_else(|| panic!("{code}: was not refused"));
    assert_eq!(error.code(), code, "{error}");
    assert!(peak < 16 << 20, "{code}: {peak} bytes at once");
    assert!(start.elapsed() < Duration::from_secs(10), "{code}: {:?}", start.elapsed());
}

fn check_bytes(bytes: &[u8], code: &str) {
    check_path(as_file(bytes).path(), code);
}

/// Checks that the tar archive is refused with `code` in little time and memory, bare and packed.
fn check(tar: &[u8], code: &str) {
    check_bytes(tar, code);
    check_bytes(&gzip(tar), code);
    check_bytes(&zstd(tar), code);
}

#[test]
fn what_is_made_by_hand_is_good_without_tricks() {
    let label = Entry::of_kind(b'V', "a volume", b"");
    let folder = Entry::of_kind(b'5', "color/", b"");
    let old_folder = Entry::of_kind(b'0', "depth/", b"");
    let comment = Entry::of_kind(b'g', "pax_global_header", &pax("comment", "0123abcd"));
    let contiguous = Entry::of_kind(b'7', "notes.txt", b"text");
    let old = Entry::of_kind(0, "more.txt", b"text");
    let latin = Entry::file(b"caf\xe9.txt", b"a name that is not UTF-8");
    let tar = with(&[label, folder, old_folder, comment, contiguous, old, latin]);
    for bytes in [gzip(&tar), zstd(&tar), tar] {
        let clip = Clip::open(as_file(&bytes).path()).unwrap();
        assert!(clip.load(1).is_ok());
    }
}

#[test]
fn names_that_lead_out_are_refused_however_they_are_written() {
    let long = "x".repeat(2000);
    for name in [
        "../outside.txt",
        "a/../../outside.txt",
        "..",
        "/etc/passwd",
        "C:/windows/system.ini",
        "..\\outside.txt",
        "\\\\server\\share\\file",
        "__MACOSX/../../outside.txt",
        &long,
    ] {
        let plain = Entry::file("innocent.txt", b"content");
        if name.len() <= 100 {
            check(&with(&[Entry::file(name, b"content")]), "path_escapes");
            check(&with(&[Entry::of_kind(b'5', name, b"")]), "path_escapes");
        }
        check(&with(&[Entry::of_kind(b'x', "pax", &pax("path", name)), plain.clone()]), "path_escapes");
        check(&with(&[Entry::of_kind(b'L', "././@LongLink", name.as_bytes()), plain]), "path_escapes");
    }
    // A name that is not UTF-8 is not read, but must still not escape.
    check(&with(&[Entry::file(b"../\xff", b"content")]), "path_escapes");
}

#[test]
fn what_is_no_plain_file_is_refused() {
    for kind in [b'1', b'2'] {
        check(&with(&[Entry::of_kind(kind, "depth/2.png", b"")]), "link");
        // A long target comes first.
        let target = Entry::of_kind(b'K', "././@LongLink", &[b'x'; 3000]);
        check(&with(&[target, Entry::of_kind(kind, "depth/2.png", b"")]), "link");
    }
    // Devices, a pipe, a part of a file, and unknown kinds.
    for kind in [b'3', b'4', b'6', b'M', b'D', b'Z'] {
        check(&with(&[Entry::of_kind(kind, "depth/2.png", b"")]), "tar_special_file");
    }
    check(&with(&[Entry::of_kind(b'S', "depth/2.png", b"")]), "tar_sparse");
    for key in ["GNU.sparse.major", "GNU.sparse.realsize", "GNU.sparse.map"] {
        let records = Entry::of_kind(b'x', "pax", &pax(key, "1000000000000"));
        check(&with(&[records, Entry::file("depth/2.png", b"1\n0\n")]), "tar_sparse");
    }
    check(&with(&[Entry::file("color/0.jpg", b"again")]), "duplicate_name");
    check(&with(&[Entry::file("./color//0.jpg", b"again")]), "duplicate_name");
    let hidden = Entry::file("a/.hidden", b"twice");
    check(&with(&[hidden.clone(), hidden]), "duplicate_name");
}

#[test]
fn lies_are_refused() {
    let file = |declared_bytes| Entry { declared_bytes, ..Entry::file("a.bin", b"little") };
    check(&with(&[file(1 << 20)]), "tar_truncated");
    check(&with(&[file((8 << 30) - 1)]), "tar_truncated");
    // A size in GNU's binary form, near the largest number.
    let mut tar = raw_tar(&[file(0)]);
    tar[124..136].copy_from_slice(b"\x80\0\0\0\xff\xff\xff\xff\xff\xff\xff\xff");
    let sum: u32 = tar[..512]
        .iter()
        .enumerate()
        .map(|(i, b)| if (148..156).contains(&i) { 32 } else { u32::from(*b) })
        .sum();
    tar[148..155].copy_from_slice(format!("{sum:06o}\0").as_bytes());
    check(&tar, "tar_truncated");
    let after = Entry::file("a.bin", b"little");
    for size in ["18446744073709551615", "18446744073709551000", "1000000000000"] {
        check(&with(&[Entry::of_kind(b'x', "pax", &pax("size", size)), after.clone()]), "tar_truncated");
    }

    check(&with(&[Entry { checksum_off_by: 1, ..after.clone() }]), "tar_damaged");
    check(&with(&[Entry::of_kind(b'5', "color/", b"content of a directory")]), "tar_damaged");
    for records in [
        &pax("size", "-1")[..],
        &pax("size", "1e3"),
        &pax("size", "99999999999999999999999"),
        b"0 path=a\n",
        b"999999 path=a\n",
        b"99999999999999999999999999 path=a\n",
        b"9 path=a\n9 ",
        b"9 path.a\n",
        b"8 path=a\n",
        b"path=a\n",
    ] {
        check(&with(&[Entry::of_kind(b'x', "pax", records), after.clone()]), "tar_damaged");
    }
    for (key, value) in [("path", "all/of/them"), ("size", "0"), ("GNU.sparse.major", "1")] {
        check(&with(&[Entry::of_kind(b'g', "pax", &pax(key, value))]), "tar_damaged");
    }
    // More extension headers than any program writes.
    check(&with(&[Entry::of_kind(b'x', "pax", &[b'x'; 2 << 20]), after.clone()]), "tar_damaged");
    check(&with(&vec![Entry::of_kind(b'x', "pax", &pax("mtime", "1")); 100]), "tar_damaged");
    // An extension header without a file.
    let announced = raw_tar(&[after, Entry::of_kind(b'L', "././@LongLink", b"name")]);
    check(&announced, "tar_damaged");
}

#[test]
fn half_a_million_entries_are_refused() {
    let mut file = BufWriter::new(NamedTempFile::new().unwrap());
    let header = Entry::of_kind(b'5', "folder/", b"").header();
    for _ in 0..400_001 {
        file.write_all(&header).unwrap();
    }
    file.write_all(&[0; 1024]).unwrap();
    check_path(file.into_inner().unwrap().path(), "too_many_entries");
}

#[test]
fn archives_that_were_cut_are_refused() {
    let tar = raw_tar(&good()[..4]);
    let end_mark = tar.len() - 1024;
    for cut in (0..end_mark).step_by(512).flat_map(|at| [at + 300, at + 511, at + 512]) {
        check_bytes(&tar[..cut], "tar_truncated");
        check_bytes(&gzip(&tar[..cut]), "tar_truncated");
        check_bytes(&zstd(&tar[..cut]), "tar_truncated");
    }
    for packed in
        [gzip(&tar), zstd(&tar), [gzip(&tar), gzip(b"more")].concat(), [zstd(&tar), zstd(b"more")].concat()]
    {
        for cut in (5..packed.len()).step_by(packed.len() / 200) {
            // A cut at the end of the first piece cannot be detected.
            if cut != gzip(&tar).len() && cut != zstd(&tar).len() {
                check_bytes(&packed[..cut], "packing_truncated");
            }
        }
        for cut in 1..9 {
            check_bytes(&packed[..packed.len() - cut], "packing_truncated");
        }
    }
    for head in [&b"\x1f\x8b\x08"[..], b"\x28\xb5\x2f\xfd", b"\x50\x2a\x4d\x18\xff\xff\xff\xff"] {
        check_bytes(head, "packing_truncated");
    }
}

#[test]
fn damaged_streams_are_refused() {
    let tar = raw_tar(&good());
    let mut checksum = gzip(&tar);
    let at = checksum.len() - 8;
    checksum[at] ^= 1;
    check_bytes(&checksum, "packing_damaged");
    let mut checksum = zstd(&tar);
    let at = checksum.len() - 1;
    checksum[at] ^= 1;
    check_bytes(&checksum, "packing_damaged");
    check_bytes(&[gzip(&tar), b"what is this".to_vec()].concat(), "packing_damaged");
    check_bytes(&[zstd(&tar), b"what is this".to_vec()].concat(), "packing_damaged");
    // A frame that needs a dictionary (RFC 8878, section 3.1.1.1.3): a window of 1 KiB, dictionary 7.
    check_bytes(b"\x28\xb5\x2f\xfd\x01\x00\x07\x01\x00\x00", "packing_damaged");
    // A block of a reserved type.
    check_bytes(b"\x28\xb5\x2f\xfd\x00\x00\x07\x00\x00", "packing_damaged");
}

/// Returns a Zstandard frame of `blocks` times 128 KiB of zeros, four bytes each (RFC 8878, section 3.1.1.2).
fn zstd_zeros(blocks: usize, window: u8) -> Vec<u8> {
    let mut frame = b"\x28\xb5\x2f\xfd\x00".to_vec();
    frame.push(window);
    let block = |is_last: u32| (((128 << 10) << 3) | 1 << 1 | is_last).to_le_bytes();
    for _ in 1..blocks {
        frame.extend(&block(0)[..3]);
        frame.push(0);
    }
    frame.extend(&block(1)[..3]);
    frame.push(0);
    frame
}

#[test]
fn bombs_are_refused() {
    // 4 GiB are declared, and 400 MiB of zeros follow: 400 KiB packed by gzip, which are allowed 20 MiB.
    let head = Entry { declared_bytes: 4 << 30, ..Entry::file("zeros.bin", b"") }.header();
    let member = gzip(&vec![0; 1 << 20]);
    let zeros = member.repeat(400);
    check_bytes(&[gzip(&head), zeros].concat(), "archive_bomb");
    // 128 KiB packed by zstd become 4 GiB and are allowed 16 MiB; 1 MiB become 32 GiB and are allowed 50 MiB.
    for blocks in [1 << 15, 1 << 18] {
        check_bytes(&[zstd(&head), zstd_zeros(blocks, 7 << 3)].concat(), "archive_bomb");
    }
    // The decoder allows a window of at most 64 MiB: 1 << (10 + exponent).
    check_bytes(&[zstd(&head), zstd_zeros(4, 17 << 3)].concat(), "zstd_window");
    check_bytes(&[zstd(&head), zstd_zeros(4, 31 << 3)].concat(), "zstd_window");
    check_bytes(&zstd_zeros(4, 17 << 3), "zstd_window");
    // Empty pieces.
    check_bytes(&[gzip(&head), gzip(b"").repeat(600_000)].concat(), "packing_pieces");
    check_bytes(&[zstd(&head), skipped(b"").repeat(600_000)].concat(), "packing_pieces");
    check_bytes(&skipped(b"").repeat(600_000), "packing_pieces");
    // No archive: only the first block is unpacked.
    check_bytes(&gzip(&vec![0; 1 << 20]).repeat(1000), "not_an_archive");
    check_bytes(&zstd_zeros(1 << 20, 7 << 3), "not_an_archive");
}

#[test]
fn archives_in_archives_are_not_opened() {
    let tar = raw_tar(&good());
    check_bytes(&gzip(&gzip(&tar)), "not_an_archive");
    check_bytes(&zstd(&gzip(&tar)), "not_an_archive");
    check_bytes(&gzip(&zip_bytes(&scannet("", &[0, 1]))), "not_an_archive");
    let nested = raw_tar(&[Entry::file("inner.tar.gz", &gzip(&tar))]);
    assert_eq!(container::open(as_file(&nested).path()).unwrap().names(), ["inner.tar.gz"]);
    check(&nested, "unknown_layout");
}
