//! Requests of Schemathesis that the API's document allows or forbids: no answer is a server error, every
//! status and body is in the document, and forbidden requests are refused.
//!
//! `VIOLA_SCHEMATHESIS` is the path of the program (`pip install schemathesis`); else the test is skipped.

use std::process::Command;
use viola_testing::process::succeed;

const LEAST_CASES: u32 = 5000;

#[test]
fn the_service_keeps_to_its_document() {
    let Some(program) = std::env::var_os("VIOLA_SCHEMATHESIS") else {
        viola_testing::skipped("Schemathesis", "set VIOLA_SCHEMATHESIS to the path of the program");
        return;
    };
    let run = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/schemathesis/run");
    let said = succeed(Command::new(run).arg(env!("CARGO_BIN_EXE_viola")).arg(program));
    let cases = said.lines().find_map(|line| line.trim().split_once(" generated"));
    let cases: u32 = cases.and_then(|(count, _)| count.parse().ok()).unwrap_or(0);
    println!("{cases} cases");
    assert!(cases >= LEAST_CASES, "{cases} cases\n{said}");
}
