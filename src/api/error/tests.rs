//! Failures of the service as problem documents.

use super::*;
use viola_formats::container::ContainerError;

async fn problem(response: Response) -> (u16, Problem) {
    let status = response.status().as_u16();
    let bytes = axum::body::to_bytes(response.into_body(), 10_000).await.unwrap();
    (status, serde_json::from_slice(&bytes).unwrap())
}

#[tokio::test]
async fn our_faults_are_told_without_their_cause() {
    let secret = || StorageError::Column { column: "secret", detail: "secret".to_owned() };
    let faults = [
        (Error::Storage(secret()).into_response(), 500),
        (Error::NotReady { what: "blobs", cause: Some(secret()) }.into_response(), 503),
        (panicked(Box::new("secret")), 500),
        (panicked(Box::new("secret".to_owned())), 500),
        (panicked(Box::new(7)), 500),
    ];
    for (response, status) in faults {
        let (answered, problem) = problem(response).await;
        assert_eq!((answered, problem.status), (status, status));
        assert!(!format!("{problem:?}").contains("secret"));
    }
}

#[tokio::test]
async fn a_clip_that_there_is_no_room_for_may_be_sent_again() {
    let source = std::io::Error::from(std::io::ErrorKind::StorageFull);
    let error = ClipError::Container(ContainerError::CannotUnpack { name: "clip.tar.gz".into(), source });
    let response = Error::Clip(error).into_response();
    assert!(response.headers().contains_key(header::RETRY_AFTER));
    let (status, problem) = problem(response).await;
    assert_eq!((status, problem.kind.as_str()), (503, "urn:viola:problem:unavailable"));
}

#[tokio::test]
async fn a_full_disk_is_told_apart() {
    let full = std::io::Error::from(std::io::ErrorKind::StorageFull);
    let error = StorageError::File { path: "upload".into(), source: full };
    let (status, problem) = problem(Error::Storage(error).into_response()).await;
    assert_eq!((status, problem.kind.as_str()), (507, "urn:viola:problem:storage-full"));
}
