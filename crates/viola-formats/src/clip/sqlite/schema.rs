//! The names of a table's columns, from the statement that created it.

use super::super::ClipError;
use super::{MAX_SQL_BYTES, Row, Table};

/// Maximum number of columns that are kept of a table; the tables that are read have less than thirty.
const MAX_COLUMNS: usize = 200;
/// First words of a table's constraints, which stand after its columns.
const CONSTRAINTS: [&str; 5] = ["PRIMARY", "UNIQUE", "CHECK", "FOREIGN", "CONSTRAINT"];

/// Returns the table of a row of the list of tables; `None` if it has no place in the file.
pub(super) fn table(row: &Row) -> Result<Option<Table>, ClipError> {
    let name = row.text(1, MAX_SQL_BYTES)?;
    let root = row.integer(3)?.and_then(|root| u32::try_from(root).ok());
    let (Some(name), Some(root), Some(sql)) = (name, root, row.text(4, MAX_SQL_BYTES)?) else {
        return Ok(None);
    };
    Ok(Some(Table { name, columns: columns(&sql), root }))
}

/// Returns the names of the columns of a `CREATE TABLE` statement.
fn columns(sql: &str) -> Vec<String> {
    let plain = without_comments(sql);
    let list = plain.split_once('(').and_then(|(_, rest)| rest.rsplit_once(')')).map_or("", |(list, _)| list);
    let mut depth = 0;
    let mut parts = vec![String::new()];
    for c in list.chars() {
        match c {
            '(' => depth += 1,
            ')' => depth -= 1,
            ',' if depth == 0 => parts.push(String::new()),
            _ => {}
        }
        if let Some(part) = parts.last_mut().filter(|_| c != ',' || depth != 0) {
            part.push(c);
        }
    }
    let names = parts.iter().filter_map(|part| part.split_whitespace().next());
    let is_column = |name: &&str| !CONSTRAINTS.iter().any(|word| name.eq_ignore_ascii_case(word));
    let quotes = |c| matches!(c, '"' | '\'' | '`' | '[' | ']');
    let names = names.take_while(is_column).take(MAX_COLUMNS);
    names.map(|name| name.trim_matches(quotes).to_string()).collect()
}

/// Removes `--` and `/* */` comments, which SQLite keeps in the statement.
fn without_comments(sql: &str) -> String {
    let mut plain = String::new();
    let mut rest = sql;
    let comment = |text: &str| text.as_bytes().windows(2).position(|two| matches!(two, b"--" | b"/*"));
    while let Some(at) = comment(rest) {
        plain.push_str(&rest[..at]);
        let comment = &rest[at..];
        let end = if comment.starts_with("--") { "\n" } else { "*/" };
        rest = comment.split_once(end).map_or("", |(_, behind)| behind);
        plain.push(' ');
    }
    plain + rest
}

#[cfg(test)]
mod tests {
    use super::{MAX_COLUMNS, columns};
    use std::time::{Duration, Instant};

    #[test]
    fn columns_are_told_from_comments_and_constraints() {
        let sql = "CREATE TABLE Node (\n\tid INTEGER NOT NULL, -- one, or (two\n\t\"pose\" BLOB, /* 3x4, float */\n\t\
                   price DECIMAL(10, 2) DEFAULT (1),\n\tPRIMARY KEY (id), FOREIGN KEY (id) REFERENCES B(a, b)\n)";
        assert_eq!(columns(sql), ["id", "pose", "price"]);
        assert_eq!(columns("CREATE TABLE a(b -- c\n, d INTEGER DEFAULT (1-2/3) /* e"), ["b", "d"]);
        assert!(columns("CREATE TABLE broken").is_empty());
    }

    #[test]
    fn hostile_statements_cost_little_time_and_memory() {
        let start = Instant::now();
        let comments = format!("CREATE TABLE a(b {})", "--\n".repeat(20_000));
        assert!((0..60).all(|_| columns(&comments) == ["b"]));
        assert!(start.elapsed() < Duration::from_secs(5), "{:?}", start.elapsed());
        assert_eq!(columns(&format!("CREATE TABLE a({})", "b,".repeat(30_000))).len(), MAX_COLUMNS);
    }
}
