use super::*;
use crate::conformance::bucket;
use viola_testing::s3_server::{ACCESS_KEY_ID, SECRET_ACCESS_KEY};

#[tokio::test]
async fn nothing_that_is_printed_shows_a_secret() {
    let bench = Bench::on_s3();
    let params = bucket(bench.server());
    let wrong = S3Params { access_key_id: "another".to_owned(), ..params.clone() };
    let blobs = Blobs::open(&BlobPlace::S3(wrong), bench.folder.path()).unwrap();
    let refused = blobs.put("key", vec![1]).await.unwrap_err();
    let with_password = S3Params {
        endpoint: Some(format!("https://user:{SECRET_ACCESS_KEY}@s3.example.com")),
        ..params.clone()
    };
    let unusable =
        Blobs::open(&BlobPlace::S3(with_password.clone()), bench.folder.path()).map(drop).unwrap_err();
    let printed = [
        format!("{params:?} {:#?}", BlobPlace::S3(params.clone())),
        format!("{with_password:?}"),
        format!("{refused} {refused:?}"),
        format!("{unusable} {unusable:?}"),
    ];
    for printed in printed {
        assert!(!printed.contains(SECRET_ACCESS_KEY) && !printed.contains(ACCESS_KEY_ID), "{printed}");
    }
    let store = format!("{} {:?}", bench.blobs.store, bench.blobs.store);
    assert!(!store.contains(SECRET_ACCESS_KEY), "{store}");
    assert!(format!("{params:?}").contains("viola-blobs"), "what is no secret is shown");
}

#[test]
fn unusable_params_are_refused_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let good = S3Params {
        bucket: "bucket".to_owned(),
        prefix: String::new(),
        endpoint: Some("https://s3.example.com/".to_owned()),
        region: "eu-central-1".to_owned(),
        access_key_id: "id".to_owned(),
        secret_access_key: "secret".to_owned(),
        allow_http: false,
        path_style: false,
    };
    let opens = |params: S3Params| Blobs::open(&BlobPlace::S3(params), folder.path()).map(drop);
    opens(good.clone()).unwrap();
    opens(S3Params { endpoint: None, ..good.clone() }).unwrap();
    let with_endpoint = |endpoint: &str| S3Params { endpoint: Some(endpoint.to_owned()), ..good.clone() };
    opens(S3Params { allow_http: true, ..with_endpoint("http://127.0.0.1:9000") }).unwrap_err();
    opens(S3Params { allow_http: true, path_style: true, ..with_endpoint("http://127.0.0.1:9000") }).unwrap();
    for (bad, why) in [
        (with_endpoint("http://s3.example.com"), "not encrypted"),
        (with_endpoint("s3.example.com"), "endpoint"),
        (with_endpoint("ftp://s3.example.com"), "https://"),
        (with_endpoint("https://user@s3.example.com"), "user name"),
        (S3Params { bucket: String::new(), ..good.clone() }, "bucket"),
        (S3Params { access_key_id: String::new(), ..good.clone() }, "access key id"),
        (S3Params { secret_access_key: String::new(), ..good.clone() }, "secret access key"),
        (S3Params { prefix: "a/../b".to_owned(), ..good.clone() }, "path"),
    ] {
        let error = opens(bad).unwrap_err().to_string();
        assert!(error.to_lowercase().contains(why), "{error}");
    }
}
