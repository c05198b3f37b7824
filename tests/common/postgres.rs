//! A place of its own for every test in the PostgreSQL database that `VIOLA_TEST_POSTGRES` names.

use sqlx::{AssertSqlSafe, Connection, PgConnection};
use uuid::Uuid;

const DATABASE: &str = "VIOLA_TEST_POSTGRES";
/// What the names of schemas begin with, where the process that began the tests removes them.
const PREFIX: &str = "VIOLA_TEST_SCHEMAS";

/// A schema that nobody else uses.
pub struct Schema {
    url: String,
    name: String,
}

impl Schema {
    /// None where no database is named; that is said, so that nobody takes the test for done.
    pub async fn new() -> Option<Schema> {
        let Ok(url) = std::env::var(DATABASE) else {
            eprintln!("not tested on PostgreSQL: {DATABASE} names no database");
            return None;
        };
        let prefix = std::env::var(PREFIX).unwrap_or_else(|_| "viola_test".to_owned());
        let schema = Schema { url, name: format!("{prefix}_{}", Uuid::now_v7().simple()) };
        execute(&schema.url, format!("CREATE SCHEMA {}", schema.name)).await;
        Some(schema)
    }

    /// The database with this schema as the only one.
    pub fn url(&self) -> String {
        let separator = if self.url.contains('?') { '&' } else { '?' };
        format!("{}{separator}options=-csearch_path%3D{}", self.url, self.name)
    }

    pub async fn remove(self) {
        execute(&self.url, format!("DROP SCHEMA {} CASCADE", self.name)).await;
    }

    /// Ends all connections of the service, whoever has them.
    #[allow(dead_code, reason = "for the test of disasters")]
    pub async fn cut_connections(&self) {
        let cut = "SELECT pg_terminate_backend(pid) FROM pg_stat_activity
            WHERE application_name = 'viola' AND datname = current_database() AND pid <> pg_backend_pid()";
        execute(&self.url, cut.to_owned()).await;
    }
}

/// Many schemas that are removed together, by the process that has others make them.
#[allow(dead_code, reason = "unit tests have no such processes")]
pub struct Schemas {
    prefix: String,
}

#[allow(dead_code, reason = "unit tests have no such processes")]
impl Schemas {
    /// None where no database is named.
    pub fn new() -> Option<Schemas> {
        std::env::var_os(DATABASE)?;
        Some(Schemas { prefix: format!("viola_{}", Uuid::now_v7().simple()) })
    }

    /// To be set for the processes that make them.
    pub fn variable(&self) -> (&'static str, &str) {
        (PREFIX, &self.prefix)
    }

    pub async fn remove(self) {
        let url = std::env::var(DATABASE).expect("it was there");
        let mut connection = PgConnection::connect(&url).await.expect("the test's database answers");
        let names =
            sqlx::query_scalar("SELECT nspname::text FROM pg_namespace WHERE starts_with(nspname, $1)");
        let names: Vec<String> = names.bind(&self.prefix).fetch_all(&mut connection).await.expect("a list");
        for name in names {
            execute(&url, format!("DROP SCHEMA {name} CASCADE")).await;
        }
    }
}

async fn execute(url: &str, statement: String) {
    let mut connection = PgConnection::connect(url).await.expect("the test's database answers");
    sqlx::query(AssertSqlSafe(statement)).execute(&mut connection).await.expect("its owner may do so");
}
