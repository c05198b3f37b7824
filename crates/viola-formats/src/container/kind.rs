//! Detection of a file's kind by its first bytes.

/// Kinds of containers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    Zip,
    Tar,
    Packed(Packing),
    /// Any other file.
    Other,
}

/// Compression of a whole archive.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Packing {
    Gzip,
    Zstd,
}

impl Packing {
    pub fn name(self) -> &'static str {
        match self {
            Packing::Gzip => "gzip",
            Packing::Zstd => "zstd",
        }
    }
}

impl Kind {
    /// Number of first bytes that are examined: one block of a tar archive.
    pub const HEAD_BYTES: usize = 512;

    pub fn of(head: &[u8]) -> Kind {
        // A first entry, or the end record of a zip without entries (APPNOTE 4.3.7 and 4.3.16).
        if head.starts_with(b"PK\x03\x04") || head.starts_with(b"PK\x05\x06") {
            return Kind::Zip;
        }
        // RFC 1952, section 2.3: the only method is deflate.
        if head.starts_with(&[0x1f, 0x8b, 8]) {
            return Kind::Packed(Packing::Gzip);
        }
        // RFC 8878, section 3.1.1; a skippable frame (3.1.2) may come first, as pzstd writes it.
        if let Some(magic) = head.first_chunk().map(|bytes| u32::from_le_bytes(*bytes))
            && (magic == 0xfd2f_b528 || magic & 0xffff_fff0 == 0x184d_2a50)
        {
            return Kind::Packed(Packing::Zstd);
        }
        // POSIX.1-1988 and later have a zero after it, GNU tar a space. Older archives have no magic number.
        if head.get(257..262) == Some(b"ustar") { Kind::Tar } else { Kind::Other }
    }
}
