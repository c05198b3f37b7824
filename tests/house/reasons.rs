//! The codes of reasons: docs/api.md lists each one that the sources make, and no other. The viewer has advice for those
//! that leave a clip without a certain place.

use super::{check, root};
use crate::sources::{Source, sources};
use std::collections::BTreeSet;
use std::fs;

/// Files that keep codes in another place than the call of `Reason::new`, and the text before a code in them.
const KEPT: [(&str, &str); 3] = [
    ("crates/viola-reconstruct/src/track/lost.rs", "=> "),
    ("crates/viola-storage/src/leases/retry.rs", "=> "),
    ("src/jobs/attempt_error.rs", "code: "),
];

/// Expressions that give the code of a reason, by file: those of [`KEPT`], and those of the readers, which the table of
/// errors names.
const GIVEN: [(&str, &str); 4] = [
    ("crates/viola-reconstruct/src/track/clip.rs", "why.code()"),
    ("crates/viola-storage/src/leases/retry.rs", "self.code()"),
    ("src/jobs/attempt_error.rs", "&code"),
    ("src/jobs/align_clip.rs", "code"),
];

/// Returns whether a file's reasons reach a client.
fn is_shown(source: &Source) -> bool {
    let is_test = |part: &String| part == "tests" || part == "conformance";
    source.krate != "viola-lab" && !source.module.iter().any(is_test)
}

/// Returns the code in quotes at the beginning of a text.
fn quoted(text: &str) -> Option<&str> {
    let (code, _) = text.strip_prefix('"')?.split_once('"')?;
    let is_code = !code.is_empty() && code.bytes().all(|byte| byte.is_ascii_lowercase() || byte == b'_');
    is_code.then_some(code)
}

/// Returns the codes of a file, and its expressions whose code is unknown.
fn codes(source: &Source) -> (Vec<String>, Vec<String>) {
    let lines: Vec<&str> = source.code().map(|(_, line)| line).collect();
    let code = lines.join(" ").split_whitespace().collect::<Vec<_>>().join(" ");
    let after = |mark: &str| -> Vec<&str> {
        code.match_indices(mark).map(|(at, mark)| code[at + mark.len()..].trim_start()).collect()
    };
    let (mut found, mut unknown) = (Vec::new(), Vec::new());
    for text in after("Reason::new(") {
        let argument = text.split(", ").next().unwrap_or_default();
        let constants = after(&format!("const {argument}: &str = "));
        match quoted(text).or_else(|| constants.first().and_then(|text| quoted(text))) {
            Some(code) => found.push(code.to_owned()),
            None => unknown.push(argument.to_owned()),
        }
    }
    let kept = KEPT.iter().filter(|(file, _)| source.path.ends_with(file));
    found.extend(kept.flat_map(|(_, mark)| after(mark)).filter_map(quoted).map(str::to_owned));
    (found, unknown)
}

/// Returns the codes of the table of reasons, each with the states of a clip that has it.
fn rows() -> Vec<(String, String)> {
    let page = fs::read_to_string(root().join("docs/api.md")).unwrap();
    let section = page.split("\n## Reasons\n").nth(1).unwrap_or_default();
    let section = section.split("\n## ").next().unwrap_or_default();
    let rows = section.lines().filter(|line| line.starts_with("| `"));
    let cells = rows.filter_map(|line| line.trim_start_matches("| ").split_once(" | "));
    let codes = |(codes, rest): (&str, &str)| -> Vec<(String, String)> {
        let states = rest.split(" | ").next().unwrap_or_default();
        let codes = codes.split('`').skip(1).step_by(2);
        codes.map(|code| (code.to_owned(), states.to_owned())).collect()
    };
    cells.flat_map(codes).collect()
}

/// Returns the codes of the table of reasons.
fn listed() -> BTreeSet<String> {
    rows().into_iter().map(|(code, _)| code).collect()
}

/// States of a clip without a certain place.
const UNPLACED: [&str; 3] = ["uploaded", "ambiguous", "failed"];
/// The code whose advice has no row: `isForeign` looks for it.
const OF_ANOTHER_HOME: &str = "not_this_home";

#[test]
fn the_viewer_has_advice_for_each_reason_of_a_clip_without_a_certain_place() {
    let advice = fs::read_to_string(root().join("web/src/clip/advice.ts")).unwrap();
    let rows = rows();
    assert!(rows.len() > 40, "{}", rows.len());
    let needed = rows.into_iter().filter(|(code, states)| {
        let is_unplaced = UNPLACED.iter().any(|state| states.contains(&format!("`{state}`")));
        is_unplaced && code != OF_ANOTHER_HOME
    });
    let absent = needed.filter(|(code, _)| !advice.contains(&format!("\n  {code}: ")));
    check(absent.map(|(code, _)| format!("web/src/clip/advice.ts has no advice for {code}")).collect());
}

#[test]
fn the_page_of_the_api_lists_the_codes_of_all_reasons() {
    let (mut made, mut broken) = (BTreeSet::new(), Vec::new());
    for source in sources().iter().filter(|source| is_shown(source)) {
        let (found, unknown) = codes(source);
        made.extend(found);
        let is_given = |argument: &String| {
            GIVEN.iter().any(|(file, given)| source.path.ends_with(file) && given == argument)
        };
        let unknown = unknown.into_iter().filter(|argument| !is_given(argument));
        broken.extend(
            unknown.map(|argument| format!("{}: the code {argument} is unknown", source.path.display())),
        );
    }
    let listed = listed();
    broken
        .extend(made.difference(&listed).map(|code| format!("docs/api.md does not list the reason {code}")));
    broken.extend(
        listed.difference(&made).map(|code| format!("docs/api.md lists {code}, which nothing makes")),
    );
    check(broken);
}

#[test]
fn codes_are_found_in_literals_and_constants() {
    let source = |text: &str| Source {
        krate: "viola".to_owned(),
        module: vec!["jobs".to_owned(), "attempt_error".to_owned()],
        path: root().join("src/jobs/attempt_error.rs"),
        text: text.to_owned(),
    };
    let table: [(&str, &[&str], &[&str]); 5] = [
        ("Reason::new(\"no_floor\", detail)", &["no_floor"], &[]),
        ("Reason::new(\n    \"no_floor\",\n    detail)", &["no_floor"], &[]),
        ("const WAITS: &str = \"waits\";\nReason::new(WAITS, detail)", &["waits"], &[]),
        ("Broken { code: \"worker_died\".to_owned(), cause }", &["worker_died"], &[]),
        ("Reason::new(other(), detail)", &[], &["other()"]),
    ];
    for (text, found, unknown) in table {
        let expected = (found.iter().map(|code| (*code).to_owned()).collect::<Vec<_>>(), unknown);
        let (codes, others) = codes(&source(text));
        assert_eq!(
            (codes, others.iter().map(String::as_str).collect::<Vec<_>>().as_slice()),
            expected,
            "{text}"
        );
    }
}
