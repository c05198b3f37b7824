//! A list of the tests that cannot run here.

use std::fs::OpenOptions;
use std::io::Write;

/// The file to which `tests/run` has skips written; it prints them at the end.
const LIST: &str = "VIOLA_TEST_SKIPS";

/// Notes that something is not tested, and what would switch it on.
pub fn skipped(what: &str, switch: &str) {
    let line = format!("{what}: {switch}\n");
    eprint!("SKIPPED {line}");
    if let Some(list) = std::env::var_os(LIST) {
        let mut list = OpenOptions::new().create(true).append(true).open(list).expect("the list of skips");
        list.write_all(line.as_bytes()).expect("the list of skips");
    }
}
