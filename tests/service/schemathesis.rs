//! Requests that the API's document allows, and such that it does not, made by Schemathesis: no answer is a fault of
//! ours, none has a status or a body that the document does not have, and what the document refuses is refused.
//!
//! `VIOLA_SCHEMATHESIS` is the path of the program (`pip install schemathesis`); without it the test says so and passes.

use std::process::Command;

const LEAST_CASES: u32 = 5000;

#[test]
fn the_service_keeps_to_its_document() {
    let Some(program) = std::env::var_os("VIOLA_SCHEMATHESIS") else {
        viola_testing::skipped("Schemathesis", "set VIOLA_SCHEMATHESIS to the path of the program");
        return;
    };
    let run = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/schemathesis/run");
    let output = Command::new(run).arg(env!("CARGO_BIN_EXE_viola")).arg(program).output().unwrap();
    let (said, erred) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert!(output.status.success(), "{said}\n{erred}");
    let cases = said.lines().find_map(|line| line.trim().split_once(" generated"));
    let cases: u32 = cases.and_then(|(count, _)| count.parse().ok()).unwrap_or(0);
    println!("{cases} cases");
    assert!(cases >= LEAST_CASES, "{cases} cases\n{said}");
}
