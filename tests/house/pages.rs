//! The pages: links that lead somewhere, short lines, sentences that name their noun, and figures that were measured.

use super::{check, root};
use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

const MOST_LETTERS_OF_A_LINE: usize = 160;
/// A sentence that begins with one of these is a relative clause, unless it is a question.
const RELATIVES: &[&str] = &[
    "What",
    "Whatever",
    "Where",
    "Wherever",
    "Whether",
    "Which",
    "Whichever",
    "Who",
    "Whoever",
    "Whose",
    "How",
];

/// Folders without pages of ours.
const FOREIGN: &[&str] = &["target", "node_modules"];

/// Returns the paths of all pages from the root.
fn pages() -> Vec<PathBuf> {
    let (mut found, mut folders) = (Vec::new(), vec![root().to_owned()]);
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).unwrap() {
            let entry = entry.unwrap();
            let (path, name) = (entry.path(), entry.file_name().into_string().unwrap());
            // A link may lead out of the working tree.
            let is_folder = entry.file_type().unwrap().is_dir();
            if is_folder && !name.starts_with('.') && !FOREIGN.contains(&name.as_str()) {
                folders.push(path);
            } else if name.ends_with(".md") {
                found.push(path.strip_prefix(root()).unwrap().to_owned());
            }
        }
    }
    found.sort();
    found
}

fn read(page: &Path) -> String {
    fs::read_to_string(root().join(page)).unwrap()
}

/// Returns the lines outside of code blocks, with their numbers.
fn prose(text: &str) -> Vec<(usize, &str)> {
    let mut is_code = false;
    let lines = text.lines().enumerate().map(|(index, line)| (index + 1, line));
    let outside = lines.filter(|(_, line)| {
        let is_fence = line.trim_start().starts_with("```");
        is_code ^= is_fence;
        !is_fence && !is_code && !line.starts_with("    ")
    });
    outside.collect()
}

/// Returns the anchors of a page's headings, as GitHub makes them.
fn anchors(text: &str) -> BTreeSet<String> {
    let headings = prose(text).into_iter().filter(|(_, line)| line.starts_with('#'));
    let slug = |heading: &str| -> String {
        let kept = heading.trim_start_matches('#').trim().to_lowercase();
        let kept = kept.chars().filter(|c| c.is_alphanumeric() || " -_".contains(*c));
        kept.map(|c| if c == ' ' { '-' } else { c }).collect()
    };
    headings.map(|(_, line)| slug(line)).collect()
}

/// Returns the targets of a text's links and pictures.
fn links(text: &str) -> Vec<&str> {
    let after = text.split("](").skip(1);
    after.filter_map(|rest| rest.split_once(')')).map(|(target, _)| target).collect()
}

#[test]
fn links_of_the_pages_lead_somewhere() {
    let mut broken = Vec::new();
    for page in pages() {
        let text = read(&page);
        let prose: Vec<&str> = prose(&text).into_iter().map(|(_, line)| line).collect();
        let joined = prose.join("\n");
        for link in links(&joined).into_iter().filter(|link| !link.contains("://")) {
            let (file, anchor) = link.split_once('#').unwrap_or((link, ""));
            let target = if file.is_empty() {
                page.clone()
            } else {
                page.parent().unwrap_or(Path::new("")).join(file)
            };
            let path = root().join(&target);
            let has_anchor = anchor.is_empty()
                || path.is_file() && anchors(&fs::read_to_string(&path).unwrap()).contains(anchor);
            if !path.exists() || !has_anchor {
                broken.push(format!("{}: {link} leads nowhere", page.display()));
            }
        }
    }
    check(broken);
}

#[test]
fn lines_of_the_pages_are_short() {
    let mut broken = Vec::new();
    for page in pages() {
        for (index, line) in read(&page).lines().enumerate() {
            let letters = line.chars().count();
            if letters > MOST_LETTERS_OF_A_LINE {
                broken.push(format!("{}:{}: {letters} letters", page.display(), index + 1));
            }
        }
    }
    check(broken);
}

/// Returns the sentences of a text that begin with a relative clause. A sentence ends before lines of lists and cells of tables.
fn relative_clauses(text: &str) -> Vec<String> {
    let mut found = Vec::new();
    let mut sentence = String::new();
    let mut end = |sentence: &mut String| {
        let begin = sentence.trim_start_matches([' ', '-', '*', '#', '>', '(', '"']).trim_end();
        let word = begin.split([' ', ',', '\'']).next().unwrap_or_default();
        if RELATIVES.contains(&word) && !begin.ends_with('?') {
            found.push(begin.to_owned());
        }
        sentence.clear();
    };
    for line in text.lines() {
        if line.trim().is_empty() || line.trim_start().starts_with(['-', '*', '#', '|']) {
            end(&mut sentence);
        }
        for word in line.split_inclusive(' ') {
            if word.starts_with('|') {
                end(&mut sentence);
                continue;
            }
            sentence += word;
            if word.trim_end().ends_with(['.', '!', '?', ':']) {
                end(&mut sentence);
            }
        }
        sentence.push(' ');
    }
    end(&mut sentence);
    found
}

#[test]
fn relative_clauses_are_found_and_questions_are_not() {
    let told = relative_clauses(
        "A page. What was lost is\nhere. Where is it?\n\n| Who sees it | Whose? |\n- How much it is",
    );
    assert_eq!(told, ["What was lost is here.", "Who sees it", "How much it is"]);
}

#[test]
fn no_sentence_of_the_pages_begins_with_a_relative_clause() {
    let mut broken = Vec::new();
    for page in pages() {
        let text = read(&page);
        let lines = prose(&text).into_iter().map(|(_, line)| line);
        // Headings are no sentences.
        let prose: Vec<&str> = lines.map(|line| if line.starts_with('#') { "" } else { line }).collect();
        let found = relative_clauses(&prose.join("\n"));
        broken.extend(found.into_iter().map(|sentence| format!("{}: {sentence}", page.display())));
    }
    check(broken);
}

/// Collects the summaries and descriptions of a part of the API's document.
fn told(part: &serde_json::Value, into: &mut Vec<String>) {
    match part {
        serde_json::Value::Object(members) => {
            for (name, member) in members {
                match member.as_str() {
                    Some(text) if ["summary", "description", "title"].contains(&name.as_str()) => {
                        into.push(text.to_owned());
                    }
                    _ => told(member, into),
                }
            }
        }
        serde_json::Value::Array(items) => items.iter().for_each(|item| told(item, into)),
        _ => {}
    }
}

#[test]
fn no_sentence_of_the_api_begins_with_a_relative_clause() {
    let document: serde_json::Value = serde_json::from_str(&read(Path::new("openapi/viola.json"))).unwrap();
    let mut texts = Vec::new();
    told(&document, &mut texts);
    assert!(texts.len() > 300, "{}", texts.len());
    check(texts.iter().flat_map(|text| relative_clauses(text)).collect());
}

/// Returns the help of a command and those of the commands below it.
fn help(command: &[String]) -> Vec<String> {
    let mut program = Command::new(env!("CARGO_BIN_EXE_viola"));
    let output = program.args(command).arg("--help").output().unwrap();
    let text = String::from_utf8(output.stdout).unwrap();
    let below = text.split("Commands:\n").nth(1).unwrap_or_default();
    let names = below.lines().take_while(|line| !line.is_empty()).filter(|line| line.starts_with("  "));
    let names = names.filter_map(|line| line.split_whitespace().next()).filter(|name| *name != "help");
    let mut all: Vec<String> = Vec::new();
    for name in names.filter(|name| name.starts_with(char::is_alphabetic)) {
        let inner: Vec<String> = command.iter().cloned().chain([name.to_owned()]).collect();
        all.extend(help(&inner));
    }
    all.push(text);
    all
}

#[test]
fn no_sentence_of_the_help_begins_with_a_relative_clause() {
    let texts = help(&[]);
    assert!(texts.len() > 20, "{}", texts.len());
    let mut broken = Vec::new();
    for text in texts {
        // The explanation of an option begins on a line or in a column of its own.
        let begun = text.replace("   ", "\n\n");
        broken.extend(relative_clauses(&begun));
    }
    check(broken);
}

#[test]
fn the_figures_of_the_pages_are_the_measured_ones() {
    let script = root().join("benches/figures");
    let Ok(output) = Command::new("python3").arg(script).arg("check").output() else {
        viola_testing::skipped("figures of the pages", "install python3");
        return;
    };
    let told = [output.stdout, output.stderr].map(|bytes| String::from_utf8_lossy(&bytes).into_owned());
    assert!(output.status.success(), "{}", told.concat());
}
