//! A statement with its values, and the rows that it returns, on either database. Our tables have text,
//! integers and floating-point numbers only.

use super::super::StorageError;
use super::connection::{Connection, Executor};
use sqlx::postgres::{PgArguments, PgRow};
use sqlx::sqlite::{SqliteArguments, SqliteRow};
use sqlx::{Arguments, AssertSqlSafe, Decode, Postgres, Row as _, SqlSafeStr, SqlStr, Sqlite, Type};

/// A parameter of a statement.
pub enum Value {
    Text(Option<String>),
    Number(Option<i64>),
    Real(f64),
}

macro_rules! from {
    ($($type:ty => $value:ident, $convert:expr;)*) => {
        $(impl From<$type> for Value {
            fn from(value: $type) -> Value {
                Value::$value($convert(value))
            }
        })*
    };
}

from!(
    &str => Text, |value: &str| Some(value.to_owned());
    String => Text, Some;
    &String => Text, |value: &String| Some(value.clone());
    Option<&str> => Text, |value: Option<&str>| value.map(str::to_owned);
    Option<String> => Text, |value| value;
    &Option<String> => Text, Option::clone;
    i64 => Number, Some;
    Option<i64> => Number, |value| value;
    f64 => Real, |value| value;
);

/// A statement and its values, to be run once.
pub struct Query {
    sql: SqlStr,
    values: Vec<Value>,
}

pub fn query(sql: impl SqlSafeStr) -> Query {
    Query { sql: sql.into_sql_str(), values: Vec::new() }
}

/// Words of PostgreSQL in our statements, and those of SQLite in their place: it has one writer and no locks of rows, and another
/// function for the values of a JSON list.
const FOR_SQLITE: [(&str, &str); 5] = [
    (" FOR UPDATE", ""),
    (" FOR NO KEY UPDATE", ""),
    (" SKIP LOCKED", ""),
    ("jsonb_array_elements_text(", "json_each("),
    (" AS JSONB)", " AS TEXT)"),
];

/// Returns a statement in the words of SQLite.
fn for_sqlite(sql: SqlStr) -> SqlStr {
    if !FOR_SQLITE.iter().any(|(postgres, _)| sql.as_str().contains(postgres)) {
        return sql;
    }
    let of_postgres = sql.as_str().to_owned();
    let replaced =
        FOR_SQLITE.iter().fold(of_postgres, |sql, (postgres, sqlite)| sql.replace(postgres, sqlite));
    AssertSqlSafe(replaced).into_sql_str()
}

/// The values of a list that is bound as JSON, for `IN`.
macro_rules! listed {
    ($json:literal) => {
        concat!("(SELECT value FROM jsonb_array_elements_text(CAST(", $json, " AS JSONB)))")
    };
}
pub(crate) use listed;

/// Work for which the transactions of a tenant take turns.
#[derive(Clone, Copy)]
pub enum Turn {
    Quota,
    Webhooks,
}

/// Lets the transactions of a tenant take turns from now on. Those of SQLite do anyway.
pub async fn take_turns(connection: &mut Connection, turn: Turn, tenant: &str) -> Result<(), sqlx::Error> {
    if connection.is_shared() {
        let lock = query("SELECT pg_advisory_xact_lock(hashtextextended($1, $2))");
        lock.bind(tenant).bind(turn as i64).execute(connection).await?;
    }
    Ok(())
}

/// A row of a result.
pub enum Row {
    Sqlite(SqliteRow),
    Postgres(PgRow),
}

impl From<SqliteRow> for Row {
    fn from(row: SqliteRow) -> Row {
        Row::Sqlite(row)
    }
}

impl From<PgRow> for Row {
    fn from(row: PgRow) -> Row {
        Row::Postgres(row)
    }
}

/// Converts the values to arguments of a database.
macro_rules! arguments {
    ($type:ty, $values:expr) => {{
        let mut arguments = <$type>::default();
        for value in $values {
            let added = match value {
                Value::Text(text) => arguments.add(text),
                Value::Number(number) => arguments.add(number),
                Value::Real(real) => arguments.add(real),
            };
            added.map_err(sqlx::Error::Encode)?;
        }
        arguments
    }};
}

/// Runs a query on either database by a method of the driver, and converts the result.
macro_rules! run {
    ($query:ident.$method:ident($connection:ident) => $convert:expr) => {{
        let ran = match $connection.executor()? {
            Executor::Sqlite(sqlite) => {
                let arguments = arguments!(SqliteArguments, $query.values);
                let query = sqlx::query_with::<Sqlite, _>(for_sqlite($query.sql), arguments);
                query.$method(sqlite).await.map($convert)
            }
            Executor::Postgres(postgres) => {
                let arguments = arguments!(PgArguments, $query.values);
                let query = sqlx::query_with::<Postgres, _>($query.sql, arguments);
                query.$method(postgres).await.map($convert)
            }
        };
        $connection.ended(ran).await
    }};
}

impl Query {
    pub fn bind(mut self, value: impl Into<Value>) -> Query {
        self.values.push(value.into());
        self
    }

    pub async fn fetch_all(self, connection: &mut Connection) -> Result<Vec<Row>, sqlx::Error> {
        run!(self.fetch_all(connection) => |rows| rows.into_iter().map(Row::from).collect())
    }

    pub async fn fetch_optional(self, connection: &mut Connection) -> Result<Option<Row>, sqlx::Error> {
        run!(self.fetch_optional(connection) => |row| row.map(Row::from))
    }

    pub async fn fetch_one(self, connection: &mut Connection) -> Result<Row, sqlx::Error> {
        self.fetch_optional(connection).await?.ok_or(sqlx::Error::RowNotFound)
    }

    /// Runs the statement and returns the number of changed rows.
    pub async fn execute(self, connection: &mut Connection) -> Result<u64, sqlx::Error> {
        let rows = run!(self.execute(connection) => |done| done.rows_affected())?;
        connection.changed(rows);
        Ok(rows)
    }
}

impl Row {
    pub fn get<T>(&self, column: &'static str) -> Result<T, StorageError>
    where
        T: for<'r> Decode<'r, Sqlite> + Type<Sqlite> + for<'r> Decode<'r, Postgres> + Type<Postgres>,
    {
        Ok(match self {
            Row::Sqlite(row) => row.try_get(column)?,
            Row::Postgres(row) => row.try_get(column)?,
        })
    }
}
