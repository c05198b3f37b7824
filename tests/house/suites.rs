//! The suites of `tests/run`: they contain the tests of all crates. The bars of the method: CONTRIBUTING.md lists them.

use super::{check, root};
use std::fs;

#[test]
fn every_test_of_the_crates_is_run() {
    let script = fs::read_to_string(root().join("tests/run")).unwrap();
    let words: Vec<&str> = script.split([' ', '\n', '"']).collect();
    let mut broken = Vec::new();
    for folder in fs::read_dir(root().join("crates")).unwrap() {
        let Ok(tests) = fs::read_dir(folder.unwrap().path().join("tests")) else { continue };
        for entry in tests {
            let path = entry.unwrap().path();
            let name = path.file_stem().unwrap().to_string_lossy();
            let is_test = path.extension().is_some_and(|end| end == "rs") || path.join("main.rs").is_file();
            if is_test && !words.windows(2).any(|pair| pair == ["--test", &*name]) {
                broken
                    .push(format!("{}: add `--test {name}` to the suite `lib` of tests/run", path.display()));
            }
        }
    }
    check(broken);
}

#[test]
fn every_bar_has_a_row_in_the_page() {
    let read = |path: &str| fs::read_to_string(root().join(path)).unwrap();
    let (page, bars) = (read("CONTRIBUTING.md"), read("tests/method/bars.rs"));
    let rows = page.split("`method bars::").skip(1).filter_map(|rest| rest.split('`').next());
    let rows: Vec<&str> = rows.collect();
    let tests = bars.split("#[test]\nfn ").skip(1).filter_map(|rest| rest.split('(').next());
    let absent = tests.filter(|test| !rows.iter().any(|row| test.starts_with(*row)));
    check(absent.map(|test| format!("CONTRIBUTING.md has no row for the bar {test}")).collect());
}
