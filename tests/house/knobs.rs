//! Fields of parameters that nothing sets.

use crate::sources::Source;

/// One field of a `...Params` struct.
struct Field {
    owner: String,
    name: String,
    /// The file that defines it.
    path: String,
}

/// Returns the fields that neither code nor a test sets, as `Owner::field in file`.
pub fn unset(sources: &[Source], tests: &[Source]) -> Vec<String> {
    let codes: Vec<String> = sources.iter().chain(tests).map(code_without_defaults).collect();
    let fields = sources.iter().flat_map(fields);
    let unset = fields.filter(|field| !codes.iter().any(|code| sets(code, field)));
    unset.map(|field| format!("{}::{} in {}", field.owner, field.name, field.path)).collect()
}

/// Returns the fields of a file, without those that are parameters of a part: these have fields of their own.
fn fields(source: &Source) -> Vec<Field> {
    let mut found = Vec::new();
    let mut owner = None;
    for (_, line) in source.code() {
        if let Some(rest) = line.split("struct ").nth(1) {
            let name: String = rest.chars().take_while(|c| c.is_alphanumeric()).collect();
            owner = (name.ends_with("Params") && line.ends_with('{')).then_some(name);
        } else if line == "}" {
            owner = None;
        } else if let Some(owner) = &owner
            && let Some((name, kind)) = line.trim().trim_start_matches("pub ").split_once(": ")
            && !kind.contains("Params")
        {
            let path = source.path.display().to_string();
            found.push(Field { owner: owner.clone(), name: name.to_owned(), path });
        }
    }
    found
}

/// Returns the code of a file without definitions of parameters and their defaults.
fn code_without_defaults(source: &Source) -> String {
    let mut kept = String::new();
    let mut is_inside = false;
    for line in source.text.lines() {
        let begins = (line.contains("struct ") || line.starts_with("impl Default for "))
            && line.contains("Params")
            && line.ends_with('{');
        is_inside = is_inside || begins;
        if !is_inside {
            kept.push_str(line.trim());
            kept.push(' ');
        }
        is_inside = is_inside && line != "}";
    }
    kept
}

/// Returns whether code assigns the field, borrows it mutably, or names it in a literal of its struct.
fn sets(code: &str, field: &Field) -> bool {
    let Field { owner, name, .. } = field;
    if ["=", "+=", "*="].iter().any(|sign| code.contains(&format!(".{name} {sign} "))) {
        return true;
    }
    if code.split("&mut ").skip(1).any(|rest| path_of(rest).ends_with(&format!(".{name}"))) {
        return true;
    }
    code.split(&format!("{owner} {{")).skip(1).any(|rest| {
        let literal = literal(rest);
        literal.split([',', '{']).any(|item| item.split(':').next().is_some_and(|head| head.trim() == name))
    })
}

/// Returns the path of fields at the beginning of a text.
fn path_of(text: &str) -> &str {
    let end = text.find(|c: char| !(c.is_alphanumeric() || "_.".contains(c)));
    text.get(..end.unwrap_or(text.len())).unwrap_or_default().trim_end_matches('.')
}

/// Returns the text before the brace that ends a literal.
fn literal(text: &str) -> &str {
    let mut depth = 1_u32;
    for (at, sign) in text.char_indices() {
        match sign {
            '{' => depth += 1,
            '}' => depth -= 1,
            _ => {}
        }
        if depth == 0 {
            return &text[..at];
        }
    }
    text
}
