//! Processes of an earlier version that run beside those of a later one.

use super::*;
use crate::database::query;
use std::collections::VecDeque;

on_every_back_end!(
    a_home_of_an_earlier_process_is_found,
    homes_of_earlier_processes_are_found_after_a_start,
    a_later_process_adds_a_column,
);

/// Returns the ids of the homes with a text in their id or name.
async fn found(storage: &Storage, text: &str) -> Vec<String> {
    let filter = HomeFilter { text: Some(text.to_owned()), ..HomeFilter::default() };
    let page = Page { limit: 9, after: None };
    let homes = storage.homes(&Tenant::default(), &filter, &page).await.unwrap();
    homes.iter().map(|home| home.id.to_string()).collect()
}

/// Leaves the homes as a process does that does not know the text for searches.
async fn forget_searches(storage: &Storage) {
    storage.database.execute(query("UPDATE homes SET search = ''")).await.unwrap();
}

async fn a_home_of_an_earlier_process_is_found(storage: Storage) {
    let put = async || storage.put_home(&home("h"), Some("\u{d6}l Street"), |_| true, at(0)).await.unwrap();
    put().await;
    forget_searches(&storage).await;
    assert_eq!(found(&storage, "\u{f6}l").await, Vec::<String>::new());
    put().await;
    assert_eq!(found(&storage, "\u{f6}l").await, ["h"]);
}

async fn homes_of_earlier_processes_are_found_after_a_start(storage: Storage) {
    for (id, name) in [("Oak-1", Some("\u{d6}l Street")), ("Elm-2", None)] {
        storage.put_home(&home(id), name, |_| true, at(0)).await.unwrap();
    }
    forget_searches(&storage).await;
    storage.fill_searches().await.unwrap();
    assert_eq!(found(&storage, "\u{f6}l STREET").await, ["Oak-1"]);
    assert_eq!(found(&storage, "elm").await, ["Elm-2"]);
}

/// Calls `work` once for each connection of the pool, which has no other free one meanwhile.
async fn with_each_connection(storage: &Storage, mut work: impl AsyncFnMut()) {
    let connections = storage.database.connections().max;
    let mut held = VecDeque::new();
    for _ in 0..connections {
        held.push_back(storage.database.reader().await.unwrap());
    }
    for _ in 0..connections {
        drop(held.pop_front());
        work().await;
        held.push_back(storage.database.reader().await.unwrap());
    }
}

/// PostgreSQL refuses a prepared statement whose result has another column since. Each connection may meet this once.
async fn a_later_process_adds_a_column(storage: Storage) {
    if !storage.database.is_shared() {
        return;
    }
    let id = home("h");
    storage.put_home(&id, None, |_| true, at(0)).await.unwrap();
    with_each_connection(&storage, async || _ = storage.home(&id).await.unwrap()).await;
    let add = query("ALTER TABLE homes ADD COLUMN of_later_version BIGINT");
    storage.database.execute(add).await.unwrap();
    let mut refused = 0;
    with_each_connection(&storage, async || {
        let read = storage.home(&id).await;
        assert!(read.as_ref().err().is_none_or(StorageError::is_transient), "{read:?}");
        refused += u64::from(read.is_err());
    })
    .await;
    assert_eq!(refused, storage.database.connections().max);
    with_each_connection(&storage, async || assert_eq!(storage.home(&id).await.unwrap().id, id)).await;
    // The same in a transaction.
    let mut time = 0;
    with_each_connection(&storage, async || {
        time += 1;
        storage.put_home(&id, Some(&time.to_string()), |_| true, at(1)).await.unwrap();
    })
    .await;
}

/// A release is rolled back so.
#[tokio::test]
async fn an_earlier_program_starts_on_the_tables_of_a_later_one() {
    let folder = tempfile::tempdir().unwrap();
    let storage = in_folder(folder.path()).await;
    storage.put_home(&home("h"), None, |_| true, at(0)).await.unwrap();
    let later = "INSERT INTO _sqlx_migrations (version, description, success, checksum, execution_time)
        SELECT MAX(version) + 1, 'later', success, x'00', execution_time FROM _sqlx_migrations";
    storage.database.execute(query(later)).await.unwrap();
    storage.close().await;
    drop(storage);
    let storage = in_folder(folder.path()).await;
    assert_eq!(storage.home(&home("h")).await.unwrap().id, home("h"));
    storage.close().await;
}
