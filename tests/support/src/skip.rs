//! A list of skipped tests.

use std::fs::OpenOptions;
use std::io::Write;

/// Variable with the file of skipped tests, which `tests/run` prints at the end.
const LIST: &str = "VIOLA_TEST_SKIPS";

/// Records a skipped test and how to enable it.
pub fn skipped(what: &str, switch: &str) {
    let line = format!("{what}: {switch}\n");
    eprint!("SKIPPED {line}");
    if let Some(list) = std::env::var_os(LIST) {
        let mut list = OpenOptions::new().create(true).append(true).open(list).expect("the list of skips");
        list.write_all(line.as_bytes()).expect("the list of skips");
    }
}
