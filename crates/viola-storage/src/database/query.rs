//! A statement with its values, and the rows that it returns, on either database. Our tables have text,
//! integers and floating-point numbers only.

use super::super::StorageError;
use super::connection::{Connection, Executor};
use sqlx::postgres::{PgArguments, PgRow};
use sqlx::sqlite::{SqliteArguments, SqliteRow};
use sqlx::{Arguments, Decode, Postgres, Row as _, SqlSafeStr, SqlStr, Sqlite, Type};

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

/// A row of a result.
pub enum Row {
    Sqlite(SqliteRow),
    Postgres(PgRow),
}

/// Converts the values to arguments of either database.
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

impl Query {
    pub fn bind(mut self, value: impl Into<Value>) -> Query {
        self.values.push(value.into());
        self
    }

    pub async fn fetch_all(self, connection: &mut Connection) -> Result<Vec<Row>, sqlx::Error> {
        let fetched = match connection.executor()? {
            Executor::Sqlite(connection) => {
                let query = sqlx::query_with::<Sqlite, _>(self.sql, arguments!(SqliteArguments, self.values));
                let rows = query.fetch_all(connection).await;
                rows.map(|rows| rows.into_iter().map(Row::Sqlite).collect())
            }
            Executor::Postgres(connection) => {
                let query = sqlx::query_with::<Postgres, _>(self.sql, arguments!(PgArguments, self.values));
                let rows = query.fetch_all(connection).await;
                rows.map(|rows| rows.into_iter().map(Row::Postgres).collect())
            }
        };
        connection.ended(fetched).await
    }

    pub async fn fetch_optional(self, connection: &mut Connection) -> Result<Option<Row>, sqlx::Error> {
        let fetched = match connection.executor()? {
            Executor::Sqlite(connection) => {
                let query = sqlx::query_with::<Sqlite, _>(self.sql, arguments!(SqliteArguments, self.values));
                query.fetch_optional(connection).await.map(|row| row.map(Row::Sqlite))
            }
            Executor::Postgres(connection) => {
                let query = sqlx::query_with::<Postgres, _>(self.sql, arguments!(PgArguments, self.values));
                query.fetch_optional(connection).await.map(|row| row.map(Row::Postgres))
            }
        };
        connection.ended(fetched).await
    }

    pub async fn fetch_one(self, connection: &mut Connection) -> Result<Row, sqlx::Error> {
        self.fetch_optional(connection).await?.ok_or(sqlx::Error::RowNotFound)
    }

    /// Runs the statement and returns the number of changed rows.
    pub async fn execute(self, connection: &mut Connection) -> Result<u64, sqlx::Error> {
        let executed = match connection.executor()? {
            Executor::Sqlite(connection) => {
                let query = sqlx::query_with::<Sqlite, _>(self.sql, arguments!(SqliteArguments, self.values));
                query.execute(connection).await.map(|done| done.rows_affected())
            }
            Executor::Postgres(connection) => {
                let query = sqlx::query_with::<Postgres, _>(self.sql, arguments!(PgArguments, self.values));
                query.execute(connection).await.map(|done| done.rows_affected())
            }
        };
        let rows = connection.ended(executed).await?;
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
