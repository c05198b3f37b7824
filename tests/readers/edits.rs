//! Changes to the files of a good recording.

use crate::writers::Files;
use serde_json::Value;

/// Returns the content of a file that must exist.
pub fn content<'a>(files: &'a mut Files, name: &str) -> &'a mut Vec<u8> {
    let file = files.iter_mut().find(|(own, _)| own == name);
    &mut file.unwrap_or_else(|| panic!("there is no {name}")).1
}

/// Sets the content of a file, which may be a new one.
pub fn set(files: &mut Files, name: &str, bytes: impl Into<Vec<u8>>) {
    files.retain(|(own, _)| own != name);
    files.push((name.to_string(), bytes.into()));
}

/// Removes the files for which `is_gone` holds, at least one.
pub fn remove(files: &mut Files, is_gone: impl Fn(&str) -> bool) {
    let before = files.len();
    files.retain(|(name, _)| !is_gone(name));
    assert!(files.len() < before, "nothing was taken away");
}

pub fn rename(files: &mut Files, from: &str, to: &str) {
    let bytes = std::mem::take(content(files, from));
    files.retain(|(name, _)| name != from);
    set(files, to, bytes);
}

/// Keeps the fraction `part` of a file, from its start.
pub fn cut(files: &mut Files, name: &str, part: f64) {
    let bytes = content(files, name);
    bytes.truncate((bytes.len() as f64 * part) as usize);
}

pub fn edit_json(files: &mut Files, name: &str, edit: impl FnOnce(&mut Value)) {
    let bytes = content(files, name);
    let mut value: Value = serde_json::from_slice(bytes).unwrap();
    edit(&mut value);
    *bytes = serde_json::to_vec(&value).unwrap();
}

/// Removes a member from a JSON file.
pub fn drop_member(files: &mut Files, name: &str, member: &str) {
    edit_json(files, name, |value| {
        value.as_object_mut().unwrap().remove(member).unwrap_or_else(|| panic!("no {member}"));
    });
}

/// Replaces a member's value in a JSON file by raw text, which need not be JSON.
pub fn set_raw(files: &mut Files, name: &str, member: &str, raw: &str) {
    edit_json(files, name, |value| value[member] = Value::from("the place"));
    let bytes = content(files, name);
    let text = String::from_utf8(bytes.clone()).unwrap().replace("\"the place\"", raw);
    *bytes = text.into_bytes();
}

/// Changes the lines of a text file.
pub fn edit_lines(files: &mut Files, name: &str, edit: impl Fn(usize, &str) -> Option<String>) {
    let bytes = content(files, name);
    let text = String::from_utf8(bytes.clone()).unwrap();
    let lines = text.lines().enumerate().filter_map(|(number, line)| edit(number, line));
    *bytes = lines.map(|line| line + "\n").collect::<String>().into_bytes();
}

/// Replaces one word of one line, separated by blanks, counted from 0.
pub fn set_word(files: &mut Files, name: &str, line: usize, word: usize, new: &str) {
    edit_lines(files, name, |number, text| {
        let mut words: Vec<&str> = text.split_whitespace().collect();
        if number == line {
            words[word] = new;
        }
        Some(words.join(" "))
    });
}
