//! A schema for every test in the PostgreSQL database that `VIOLA_TEST_POSTGRES` names.

use crate::skipped;
use sqlx::{AssertSqlSafe, Connection, PgConnection};
use uuid::Uuid;

const DATABASE: &str = "VIOLA_TEST_POSTGRES";
/// Variable with the prefix of schemas' names, if the process that started the tests removes them.
const PREFIX: &str = "VIOLA_TEST_SCHEMAS";

/// Tables that grow with data of clients and workers.
const GROWING: [&str; 10] = [
    "homes",
    "lidar_maps",
    "clips",
    "jobs",
    "changes",
    "uploads",
    "upload_pieces",
    "home_maps",
    "home_map_files",
    "webhook_deliveries",
];

/// A schema for one test.
pub struct Schema {
    url: String,
    name: String,
    /// Tablespace of its tables, if it is not the database's default.
    tablespace: Option<String>,
}

impl Schema {
    /// Creates a schema; skips with `None` if no database is named.
    pub async fn new() -> Option<Schema> {
        let Ok(url) = std::env::var(DATABASE) else {
            skipped("PostgreSQL", "set VIOLA_TEST_POSTGRES to the address of a database");
            return None;
        };
        let prefix = std::env::var(PREFIX).unwrap_or_else(|_| "viola_test".to_owned());
        let name = format!("{prefix}_{}", Uuid::now_v7().simple());
        let schema = Schema { url, name, tablespace: None };
        execute(&schema.url, format!("CREATE SCHEMA {}", schema.name)).await;
        Some(schema)
    }

    /// Returns the URL of the database with only this schema.
    pub fn url(&self) -> String {
        let separator = if self.url.contains('?') { '&' } else { '?' };
        let tablespace = self.tablespace.iter().map(|name| format!("%20-cdefault_tablespace%3D{name}"));
        let tablespace: String = tablespace.collect();
        // The database's own death is not tested, so nothing waits for its disk.
        let settings = "%20-csynchronous_commit%3Doff";
        let Schema { url, name, .. } = self;
        format!(
            "{url}{separator}application_name={name}&options=-csearch_path%3D{name}{tablespace}{settings}"
        )
    }

    pub fn name(&self) -> &str {
        &self.name
    }

    /// Makes the service create its tables in a tablespace.
    pub fn set_tablespace(&mut self, name: String) {
        self.tablespace = Some(name);
    }

    /// Prepares [`Schema::fill_disk`] after the service has created its tables.
    pub async fn prepare_full_disk(&self) {
        let name = &self.name;
        execute(&self.url, format!("CREATE TABLE {name}.disk_full (since TIMESTAMPTZ)")).await;
        let refuse = format!(
            "CREATE FUNCTION {name}.refuse_rows() RETURNS trigger LANGUAGE plpgsql AS $$
            BEGIN
                IF EXISTS (SELECT 1 FROM {name}.disk_full) THEN
                    RAISE EXCEPTION 'could not extend file: No space left on device' USING ERRCODE = 'disk_full';
                END IF;
                RETURN NULL;
            END $$"
        );
        execute(&self.url, refuse).await;
        for table in GROWING {
            // One lock at a time, which prevents deadlocks.
            let trigger = format!(
                "CREATE TRIGGER disk_full BEFORE INSERT OR UPDATE ON {name}.{table}
                FOR EACH STATEMENT EXECUTE FUNCTION {name}.refuse_rows()"
            );
            execute(&self.url, trigger).await;
        }
    }

    /// Refuses rows from now on, as a database with a full disk does.
    pub async fn fill_disk(&self) {
        execute(&self.url, format!("INSERT INTO {}.disk_full VALUES (now())", self.name)).await;
    }

    pub async fn free_disk(&self) {
        execute(&self.url, format!("DELETE FROM {}.disk_full", self.name)).await;
    }

    pub async fn remove(self) {
        execute(&self.url, format!("DROP SCHEMA {} CASCADE", self.name)).await;
    }

    /// Ends all connections with this schema, of all processes.
    pub async fn cut_connections(&self) {
        // PostgreSQL cuts names to 63 bytes.
        let cut = format!(
            "SELECT pg_terminate_backend(pid) FROM pg_stat_activity
            WHERE application_name = left('{}', 63) AND datname = current_database() AND pid <> pg_backend_pid()",
            self.name
        );
        execute(&self.url, cut).await;
    }
}

/// Many schemas that child processes create and this process removes together.
pub struct Schemas {
    prefix: String,
}

impl Schemas {
    /// Returns `None` if no database is named.
    pub fn new() -> Option<Schemas> {
        std::env::var_os(DATABASE)?;
        Some(Schemas { prefix: format!("viola_{}", Uuid::now_v7().simple()) })
    }

    /// Returns the environment variable for the processes that create them.
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
    try_execute(url, statement).await.expect("its owner may do so");
}

/// Runs a statement as the user of the tests.
pub async fn try_execute(url: &str, statement: String) -> Result<(), sqlx::Error> {
    let mut connection = PgConnection::connect(url).await.expect("the test's database answers");
    sqlx::raw_sql(AssertSqlSafe(statement)).execute(&mut connection).await?;
    Ok(())
}
