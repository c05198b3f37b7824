//! Opens a file in a process of its own, to find out whether the file ends its process, or whether earlier
//! processes ended for another reason.

use super::refusal::UploadRefusal;
use crate::api::content;
use crate::api::error::{Defence, Error, Problem};
use crate::jobs::{ChildParams, PANICKED};
use serde::{Deserialize, Serialize};
use std::path::Path;
use std::time::Duration;
use viola_formats::clip::{Clip, ClipInfo};
use viola_formats::container::Scratch;
use viola_formats::video::{Tools, was_asked_to_stop};
use viola_storage::Arrived;

/// Timeout for opening a file.
const MAX_TIME: Duration = Duration::from_secs(120);

/// Output of the process: one line of JSON. A process without output died.
#[derive(Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Opened {
    Clip {
        info: Box<ClipInfo>,
        content_sha256: Option<String>,
    },
    Refused(Problem),
    /// A fault of the service or of the system.
    Failed(String),
}

/// Opens the clip at `path` and returns what its parent process reads.
pub fn opened_clip_json(path: &Path) -> String {
    // Beside the file, which lies in the data folder.
    let scratch = path.parent().map_or_else(Scratch::default, |folder| Scratch::new(folder, Vec::new()));
    let opened = Clip::open_in(path, &Tools::default(), &scratch)
        .and_then(|clip| Ok((clip.info().clone(), content::of_clip(&clip)?)));
    let opened = match opened.map_err(Error::from) {
        Ok((info, content_sha256)) => Opened::Clip { info: Box::new(info), content_sha256 },
        Err(error) if error.is_refusal() => Opened::Refused(error.problem()),
        Err(error) => Opened::Failed(error.to_string()),
    };
    serde_json::to_string(&opened).expect("our own records have text keys and cannot fail to serialise")
}

/// Opens a file in a process that is started by `params`; returns it with its summary and the SHA-256 of its content.
pub(super) async fn open(
    params: &ChildParams,
    file: Arrived,
) -> Result<(Arrived, ClipInfo, Option<String>), Error> {
    let failed = |cause: String| Error::Opener(cause);
    let output = params.output(file.path().as_os_str(), MAX_TIME).await;
    let Some(output) = output.map_err(|error| failed(error.to_string()))? else {
        return Err(Defence::TookTooLong { limit: MAX_TIME }.into());
    };
    match serde_json::from_slice(&output.stdout) {
        Ok(Opened::Clip { info, content_sha256 }) => Ok((file, *info, content_sha256)),
        Ok(Opened::Refused(problem)) => Err(Error::Told(problem)),
        Ok(Opened::Failed(cause)) => Err(failed(cause)),
        // It panicked, or a signal ended it: it aborted, or took too much memory.
        Err(_)
            if matches!(output.status.code(), None | Some(PANICKED)) && !was_asked_to_stop(output.status) =>
        {
            Err(UploadRefusal::Unreadable.into())
        }
        Err(error) => Err(failed(format!("{}: {error}", output.status))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use viola_storage::{Storage, StorageParams};

    /// Opens a file by a shell script that plays the child.
    async fn open_by(script: &str) -> Result<ClipInfo, Error> {
        let folder = tempfile::tempdir().unwrap();
        let storage = Storage::open(&StorageParams::in_folder(folder.path())).await.unwrap();
        let file = storage.incoming().unwrap().finish().await.unwrap();
        let arguments = ["-c", script].map(Into::into).to_vec();
        let params = ChildParams { program: "/bin/sh".into(), arguments, environment: Vec::new() };
        let opened = open(&params, file).await;
        storage.close().await;
        opened.map(|(_, info, _)| info)
    }

    #[tokio::test]
    async fn a_file_that_ends_its_process_is_refused_and_a_fault_of_ours_is_not() {
        for by_file in ["kill -9 $$", "exit 101"] {
            let refused = open_by(by_file).await.unwrap_err();
            assert_eq!(refused.problem().kind, "urn:viola:problem:upload-unreadable", "{by_file}");
        }
        for ours in ["exit 3", "kill -15 $$", "echo '{\"failed\":\"no descriptors\"}'", "echo {"] {
            assert!(!open_by(ours).await.unwrap_err().is_refusal(), "{ours}");
        }
    }

    #[tokio::test]
    async fn the_parent_reads_what_the_child_writes() {
        let folder = tempfile::tempdir().unwrap();
        let text = folder.path().join("text");
        std::fs::write(&text, "no clip").unwrap();
        let told = opened_clip_json(&text);
        let refused = open_by(&format!("printf '%s' '{}'", told.replace('\'', "'\\''"))).await.unwrap_err();
        assert_eq!(refused.problem(), Error::from(Clip::open(&text).err().unwrap()).problem());
        let missing = opened_clip_json(&folder.path().join("missing"));
        assert!(missing.contains("failed"), "{missing}");
    }
}
