//! The problems that operations answer with, for the OpenAPI document. [`openapi`](super::openapi) adds that they are problem
//! documents.

use std::collections::BTreeMap;
use utoipa::IntoResponses;
use utoipa::openapi::{RefOr, Response};

type Responses = BTreeMap<String, RefOr<Response>>;

fn responses(problems: &[(&str, &str)]) -> Responses {
    let response = |description: &str| RefOr::T(Response::new(description));
    problems.iter().map(|(status, description)| ((*status).to_owned(), response(description))).collect()
}

/// Declares problems that several operations have, by their status.
macro_rules! problems {
    ($($(#[$attribute:meta])* $name:ident: $problems:expr;)+) => {
        $($(#[$attribute])*
        pub(super) struct $name;

        impl IntoResponses for $name {
            fn responses() -> Responses {
                responses(&$problems)
            }
        })+
    };
}

/// Problems of keys and of too many requests.
const KEY_PROBLEMS: [(&str, &str); 3] = [
    (
        "401",
        "The service asks for a key, and none came or one that is not valid: `key-missing`, `key-invalid`, `session-ended`",
    ),
    (
        "403",
        "The key's role or home does not allow it: `forbidden`. Or a service without keys was called by another name or by a page of another site, or such a page used the session of a browser: `foreign-host`, `foreign-origin`",
    ),
    (
        "429",
        "The tenant sends too many requests, or the address too many keys that are not valid; `Retry-After` says how long to wait: `too-many-requests`, `too-many-failed-keys`",
    ),
];

/// Problems of every operation.
const COMMON_PROBLEMS: [(&str, &str); 4] = [
    (
        "400",
        "A part of the path, a query parameter or a header is not valid: `invalid-path`, `invalid-query`, `invalid-header`; or the body is not whole, not JSON, or not the one of its digest: `body-incomplete`, `malformed-json`, `digest-mismatch`",
    ),
    (
        "404",
        "The resource of the path does not exist: `home-not-found`, `clip-not-found`, `lidar-map-not-found`, `map-not-found`, `object-not-found`, `room-not-found`, `job-not-found`, `result-not-found`, `upload-not-found`, `webhook-not-found`, `delivery-not-found`",
    ),
    ("500", "The service failed: `internal-error`. The log has the cause under the answer's `x-request-id`"),
    (
        "503",
        "The database or the store of files does not answer now, or too many files are being read or made: `unavailable`, `readers-busy`, `makers-busy`. `Retry-After` says when to try again",
    ),
];

problems! {
    /// Problems of operations that need a key, and nothing else of the request.
    KeyProblems: KEY_PROBLEMS;
    /// Problems of every operation.
    CommonProblems: [&COMMON_PROBLEMS[..], &KEY_PROBLEMS].concat();
    /// Problems of operations on a revision of a map.
    MapProblems: [("410", "The revision is not kept any more: `map-revision-removed`")];
    /// Problems of the export of a home.
    ExportProblems: [(
        "503",
        "As many exports as may run at once run already: `too-many-exports`; or the database or the store of files does not answer now: `unavailable`. `Retry-After` says when to try again",
    )];
    /// Problems of operations that take a JSON body.
    JsonProblems: [
        ("408", "The body did not arrive in time: `body-stalled`"),
        ("413", "`body-too-large`"),
        ("415", "The body is not declared as JSON, or is encoded: `unsupported-media-type`"),
        (
            "422",
            "The body is JSON, but not with the expected members: `invalid-body`; `field` names the member where one is at fault",
        ),
        ("507", "`storage-full`"),
    ];
    /// Problems of operations that take a file.
    FileProblems: [
        ("408", "The body did not arrive in time: `body-stalled`"),
        (
            "413",
            "The body is larger than the service's limit, or unpacks to more: `body-too-large`, `unpacks-too-large`",
        ),
        (
            "415",
            "A form, an encoded body, or a file of a kind that no reader knows: `unsupported-media-type`, `unknown-...`",
        ),
        (
            "422",
            "The file cannot be used; the type is the reader's own: `body-empty`, `zip-truncated`, ... Or reading it takes too long: `took-too-long`. Or its `Idempotency-Key` came with another file: `idempotency-key-reused`",
        ),
        ("507", "The service or the tenant has no room left: `storage-full`, `tenant-full`"),
    ];
    /// A condition of a change that the clip does not meet.
    ChangedClip: [("412", "The clip was changed since it was read: `changed-meanwhile`")];
    /// Problems of corrections.
    CorrectionProblems: [
        ("409", "`too-many-corrections`: at most 500 a home"),
        ("412", "It was changed since it was read: `changed-meanwhile`"),
    ];
    /// Problems of operations that take the file of a LiDAR map.
    LidarMapProblems: [
        ("409", "The home has LiDAR maps of 8 other levels: `too-many-levels`"),
        ("412", "The LiDAR map was changed since it was read: `changed-meanwhile`"),
    ];
}

/// Problems of operations that take bytes of an upload in parts: those of all operations and files, and its own.
pub(super) struct UploadProblems;

impl IntoResponses for UploadProblems {
    fn responses() -> Responses {
        let mut all = CommonProblems::responses();
        all.extend(FileProblems::responses());
        for (status, own) in [
            ("400", "Or `Upload-Checksum` has another algorithm: `unknown-checksum-algorithm`"),
            ("403", "Or a final upload takes no bytes: `upload-final`"),
            ("413", "Or the file came in too many pieces: `too-many-pieces`"),
            (
                "422",
                "Or a process that opened the file died: `upload-unreadable`. Or the file does not have the `sha256` of its metadata: `checksum-mismatch`",
            ),
            (
                "429",
                "Or too many uploads of the home or of the tenant are unfinished, without `Retry-After`: `too-many-uploads`",
            ),
            (
                "503",
                "Or the service is stopping, or the body of a PATCH pauses for too long; the received bytes are kept: `stopping`, `body-stalled`",
            ),
        ] {
            if let Some(RefOr::T(response)) = all.get_mut(status) {
                response.description = format!("{}. {own}", response.description);
            }
        }
        all
    }
}
