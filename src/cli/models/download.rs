//! Download of a file by HTTPS; an interrupted download is resumed.

use crate::cli::progress;
use anyhow::{Context, Result, bail};
use indicatif::ProgressBar;
use reqwest::header::{CONTENT_RANGE, RANGE};
use reqwest::{Response, StatusCode};
use std::path::Path;
use std::time::Duration;
use tokio::fs::{File, OpenOptions};
use tokio::io::AsyncWriteExt;
use viola_network::MAX_MODEL_BYTES;

/// Time after which a server that sends nothing is given up.
const SILENCE: Duration = Duration::from_secs(60);

/// Downloads to `part`, which may already hold the beginning.
pub(super) fn to_file(url: &str, part: &Path) -> Result<()> {
    with_silence(url, part, SILENCE)
}

fn with_silence(url: &str, part: &Path, silence: Duration) -> Result<()> {
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()
        .context("cannot start the asynchronous runtime")?;
    runtime.block_on(fetch(url, part, silence)).with_context(|| format!("download of {url}"))
}

async fn fetch(url: &str, part: &Path, silence: Duration) -> Result<()> {
    let have = part.metadata().map_or(0, |metadata| metadata.len());
    viola_storage::tls::use_ring();
    // A redirect must not leave https.
    let client = reqwest::Client::builder().https_only(url.starts_with("https://"));
    let client = client.connect_timeout(silence).read_timeout(silence).build()?;
    let ask = client.get(url);
    let ask = if have > 0 { ask.header(RANGE, format!("bytes={have}-")) } else { ask };
    let answer = ask.send().await?;
    let (mut at, mut file) = match answer.status() {
        StatusCode::PARTIAL_CONTENT if begins_at(&answer) == Some(have) => {
            (have, OpenOptions::new().append(true).open(part).await.context("cannot write the file")?)
        }
        StatusCode::OK => (0, File::create(part).await.context("cannot write the file")?),
        // The part is complete, or it is of another file: the checksum decides.
        StatusCode::RANGE_NOT_SATISFIABLE if have > 0 => return Ok(()),
        status => bail!("the server answers {status}"),
    };
    let rest = answer.content_length().unwrap_or(0);
    let bar = progress::bar(at + rest, "{wide_bar} {bytes}/{total_bytes} {eta}");
    let done = write(answer, &mut file, &mut at, &bar).await;
    bar.finish_and_clear();
    // The bytes of a broken transfer are kept too, so that it can be resumed.
    file.flush().await.context("cannot write the file")?;
    file.sync_all().await.context("cannot write the file")?;
    done
}

async fn write(mut answer: Response, file: &mut File, at: &mut u64, bar: &ProgressBar) -> Result<()> {
    while let Some(bytes) = answer.chunk().await? {
        *at += bytes.len() as u64;
        if *at > MAX_MODEL_BYTES {
            bail!("the file is larger than any network that is loaded");
        }
        file.write_all(&bytes).await.context("cannot write the file")?;
        bar.set_position(*at);
    }
    Ok(())
}

/// Returns the first byte of a partial answer, such as 100 for `bytes 100-199/200`.
fn begins_at(answer: &Response) -> Option<u64> {
    let range = answer.headers().get(CONTENT_RANGE)?.to_str().ok()?;
    range.strip_prefix("bytes ")?.split('-').next()?.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::{to_file, with_silence};
    use crate::cli::models::test_server::{answer, serve};
    use std::net::TcpListener;
    use std::time::Duration;

    #[test]
    fn a_server_that_sends_nothing_is_given_up() {
        let folder = tempfile::tempdir().unwrap();
        // The system accepts the connection; nobody answers.
        let silent = TcpListener::bind("127.0.0.1:0").unwrap();
        let url = format!("http://{}/net.onnx", silent.local_addr().unwrap());
        let part = folder.path().join("net.part");
        let error = format!("{:#}", with_silence(&url, &part, Duration::from_millis(100)).unwrap_err());
        assert!(error.contains("timed out") && !part.exists(), "{error}");
    }

    #[test]
    fn a_broken_download_goes_on() {
        let folder = tempfile::tempdir().unwrap();
        let part = folder.path().join("net.part");
        let url = serve(vec![
            |_| answer("200 OK\r\ncontent-length: 10", "01234"),
            |request| {
                assert!(request.contains("range: bytes=5-"), "{request}");
                answer("206 Partial Content\r\ncontent-length: 5\r\ncontent-range: bytes 5-9/10", "56789")
            },
            |_| answer("416 Range Not Satisfiable\r\ncontent-length: 0", ""),
            // A server without range support sends the whole file again.
            |_| answer("200 OK\r\ncontent-length: 3", "abc"),
            |_| answer("404 Not Found\r\ncontent-length: 0", ""),
        ]);
        let content = || std::fs::read_to_string(&part).unwrap();
        assert!(to_file(&url, &part).is_err());
        assert_eq!(content(), "01234");
        to_file(&url, &part).unwrap();
        assert_eq!(content(), "0123456789");
        to_file(&url, &part).unwrap();
        assert_eq!(content(), "0123456789");
        to_file(&url, &part).unwrap();
        assert_eq!(content(), "abc");
        let error = format!("{:#}", to_file(&url, &part).unwrap_err());
        assert!(error.contains("404"), "{error}");
    }
}
