//! A tablespace of PostgreSQL on a small file system.

use crate::postgres::{Schema, try_execute};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use tempfile::TempDir;
use uuid::Uuid;

const SIZE_MIB: u32 = 16;

/// A schema whose tables have little disk space.
pub struct Tablespace {
    schema: Schema,
    name: String,
    mount: Mount,
}

/// A mounted folder that the user of the database owns.
struct Mount {
    folder: TempDir,
}

fn run(command: &mut Command) -> bool {
    command.stderr(Stdio::null()).status().is_ok_and(|status| status.success())
}

impl Mount {
    fn new() -> Option<Mount> {
        let folder = TempDir::new().ok()?;
        run(Command::new("chmod").arg("755").arg(folder.path())).then_some(())?;
        let mount = Mount { folder };
        let path = mount.path();
        std::fs::create_dir(&path).ok()?;
        let size = format!("size={SIZE_MIB}m,mode=0700");
        let mounted = run(Command::new("mount").args(["-t", "tmpfs", "-o", &size, "tmpfs"]).arg(&path));
        (mounted && run(Command::new("chown").arg("postgres").arg(&path))).then_some(mount)
    }

    fn path(&self) -> PathBuf {
        self.folder.path().join("space")
    }
}

impl Drop for Mount {
    fn drop(&mut self) {
        // A failed test keeps its tablespace: without the folder the database stops at its next checkpoint.
        if std::thread::panicking() {
            self.folder.disable_cleanup(true);
            return;
        }
        let path: &Path = &self.path();
        run(Command::new("umount").arg("--lazy").arg(path));
    }
}

impl Tablespace {
    /// Creates a tablespace; skips with `None` if the tests lack the privileges.
    pub async fn new() -> Option<Tablespace> {
        let mut schema = Schema::new().await?;
        let name = format!("viola_test_{}", Uuid::now_v7().simple());
        let url = schema.url();
        let mount = Mount::new();
        if let Some(mount) = mount {
            let made = format!("CREATE TABLESPACE {name} LOCATION '{}'", mount.path().display());
            if try_execute(&url, made).await.is_ok() {
                schema.set_tablespace(name.clone());
                return Some(Tablespace { schema, name, mount });
            }
        }
        eprintln!("not tested on a small tablespace: only root may mount one beside the database");
        schema.remove().await;
        None
    }

    pub fn schema(&self) -> &Schema {
        &self.schema
    }

    /// Fills the file system.
    pub async fn fill(&self) {
        let (url, schema) = (self.schema.url(), self.schema.name());
        let table = format!("CREATE TABLE {schema}.ballast (bytes TEXT) TABLESPACE {}", self.name);
        try_execute(&url, table).await.unwrap();
        try_execute(&url, format!("ALTER TABLE {schema}.ballast ALTER bytes SET STORAGE PLAIN"))
            .await
            .unwrap();
        for rows in [4096, 1, 1] {
            let fill = format!(
                "INSERT INTO {schema}.ballast SELECT repeat('x', 7000) FROM generate_series(1, {rows})"
            );
            // The space of a refused statement stays taken.
            let refused = try_execute(&url, fill).await.unwrap_err();
            let code =
                refused.as_database_error().and_then(|error| error.code().map(|code| code.into_owned()));
            assert_eq!(code.as_deref(), Some("53100"), "{refused}");
        }
    }

    pub async fn free(&self) {
        try_execute(&self.schema.url(), format!("DROP TABLE {}.ballast", self.schema.name())).await.unwrap();
    }

    pub async fn remove(self) {
        let Tablespace { schema, name, mount } = self;
        let url = schema.url();
        schema.remove().await;
        // Without the tablespace as the default.
        let url = url.replace(&format!("%20-cdefault_tablespace%3D{name}"), "");
        try_execute(&url, format!("DROP TABLESPACE {name}")).await.unwrap();
        drop(mount);
    }
}
