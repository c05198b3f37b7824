//! The names of a table's columns, from the statement that created it.

use super::super::ClipError;
use super::{MAX_SQL_BYTES, Row, Table};

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
    names.take_while(is_column).map(|name| name.trim_matches(quotes).to_string()).collect()
}

/// Removes `--` and `/* */` comments, which SQLite keeps in the statement.
fn without_comments(sql: &str) -> String {
    let mut plain = String::new();
    let mut rest = sql;
    while let Some(at) = rest.find("--").into_iter().chain(rest.find("/*")).min() {
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
    use super::columns;

    #[test]
    fn columns_are_told_from_comments_and_constraints() {
        let sql = "CREATE TABLE Node (\n\tid INTEGER NOT NULL, -- one, or (two\n\t\"pose\" BLOB, /* 3x4, float */\n\t\
                   price DECIMAL(10, 2) DEFAULT (1),\n\tPRIMARY KEY (id), FOREIGN KEY (id) REFERENCES B(a, b)\n)";
        assert_eq!(columns(sql), ["id", "pose", "price"]);
        assert!(columns("CREATE TABLE broken").is_empty());
    }
}
