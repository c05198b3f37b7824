//! Transactions that the database rolls back by itself, and commits without effect.

use super::faults::cut_off;
use super::*;
use crate::database::query;

on_every_back_end!(
    a_transaction_in_which_a_statement_failed_commits_nothing,
    a_write_that_works_is_told,
    a_database_that_is_read_only_may_be_writable_later,
);

async fn insert(transaction: &mut database::Transaction, id: &str) -> std::result::Result<u64, sqlx::Error> {
    query("INSERT INTO homes (id, tenant, created_at, updated_at) VALUES ($1, '', 0, 0)")
        .bind(id)
        .execute(transaction)
        .await
}

/// Also if the caller ignores the failure.
async fn a_transaction_in_which_a_statement_failed_commits_nothing(storage: Storage) {
    let mut transaction = storage.database.begin().await.unwrap();
    insert(&mut transaction, "/one").await.unwrap();
    insert(&mut transaction, "/one").await.unwrap_err();
    insert(&mut transaction, "/two").await.unwrap_err();
    transaction.commit().await.unwrap_err();
    for id in ["one", "two"] {
        assert!(matches!(storage.home(&home(id)).await, Err(StorageError::NoSuchHome)), "{id}");
    }
    storage.put_home(&home("one"), None, |_| true, at(0)).await.unwrap();
    storage.home(&home("one")).await.unwrap();
}

async fn a_write_that_works_is_told(storage: Storage) {
    for _ in 0..3 {
        storage.check_writes().await.unwrap();
    }
}

/// PostgreSQL may be a standby after a failover; a file may lack the right to be written.
async fn a_database_that_is_read_only_may_be_writable_later(storage: Storage) {
    let mut transaction = storage.database.begin().await.unwrap();
    let is_shared = transaction.is_shared();
    let read_only = if is_shared { "SET TRANSACTION READ ONLY" } else { "PRAGMA query_only = 1" };
    query(read_only).execute(&mut transaction).await.unwrap();
    let refused = StorageError::from(insert(&mut transaction, "/one").await.unwrap_err());
    assert!(refused.is_transient() && !refused.is_full(), "{refused}");
    drop(transaction);
    storage.put_home(&home("one"), None, |_| true, at(0)).await.unwrap();
}

/// Returns the names of all homes, as a new process sees them.
async fn fresh(folder: &Path) -> Vec<String> {
    let storage = Storage::administer(&StorageParams::in_folder(folder)).await.unwrap();
    let page = Page { limit: 1000, after: None };
    let homes = storage.homes(&Tenant::default(), &HomeFilter::default(), &page).await.unwrap();
    storage.close().await;
    homes.iter().map(|home| home.id.to_string()).collect()
}

/// Rolls a transaction back in good order.
async fn undo(storage: &Storage) {
    let mut transaction = storage.database.begin().await.unwrap();
    insert(&mut transaction, "/undone").await.unwrap();
}

#[tokio::test]
async fn a_database_that_is_full_loses_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let storage = in_folder(folder.path()).await;
    let mut acknowledged = Vec::new();
    for round in 0..3 {
        // Until this connection is closed the database accepts no further page.
        sqlx::query("PRAGMA max_page_count = 1").execute(storage.database.writer()).await.unwrap();
        let refused = loop {
            let id = format!("full-{round}-{}", acknowledged.len());
            match storage.put_home(&home(&id), Some(&"x".repeat(2000)), |_| true, at(0)).await {
                Ok(_) => acknowledged.push(id),
                Err(error) => break error,
            }
        };
        assert!(refused.is_full(), "{refused}");
        let told = storage.check_writes().await.unwrap_err();
        assert!(told.is_full(), "{told}");
        for number in 0..40 {
            undo(&storage).await;
            let id = format!("freed-{round}-{number}");
            storage.put_home(&home(&id), Some(&"x".repeat(2000)), |_| true, at(0)).await.unwrap();
            acknowledged.push(id);
        }
        let mut here = fresh(folder.path()).await;
        here.sort();
        acknowledged.sort();
        assert_eq!(here, acknowledged);
    }
}

#[tokio::test]
async fn a_write_that_is_cut_off_anywhere_harms_no_later_one() {
    let folder = tempfile::tempdir().unwrap();
    let storage = in_folder(folder.path()).await;
    for waits in 0..12 {
        let cut = format!("cut-{waits}");
        drop(cut_off(storage.put_home(&home(&cut), None, |_| true, at(0)), waits).await);
        undo(&storage).await;
        let whole = format!("whole-{waits}");
        storage.put_home(&home(&whole), None, |_| true, at(0)).await.unwrap();
        let here = fresh(folder.path()).await;
        assert!(here.contains(&whole), "cut off after {waits} waits");
        let seen = storage.home(&home(&cut)).await.is_ok();
        assert_eq!(here.contains(&cut), seen, "what is seen is committed");
    }
}

#[tokio::test]
async fn a_database_that_another_process_holds_is_busy_and_not_broken() {
    let folder = tempfile::tempdir().unwrap();
    let storage = in_folder(folder.path()).await;
    let options = sqlx::sqlite::SqliteConnectOptions::new().filename(folder.path().join("viola.sqlite"));
    let mut other = sqlx::ConnectOptions::connect(&options).await.unwrap();
    sqlx::query("BEGIN IMMEDIATE").execute(&mut other).await.unwrap();
    sqlx::query("PRAGMA busy_timeout = 10").execute(storage.database.writer()).await.unwrap();
    let busy = storage.put_home(&home("h"), None, |_| true, at(0)).await.unwrap_err();
    assert!(busy.is_transient() && !busy.is_full(), "{busy}");
    sqlx::query("ROLLBACK").execute(&mut other).await.unwrap();
    storage.put_home(&home("h"), None, |_| true, at(0)).await.unwrap();
}
