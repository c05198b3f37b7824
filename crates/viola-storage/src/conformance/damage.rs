//! Files that lost bytes since they were stored.

use super::home_maps::{merge, two_aligned};
use super::*;

on_every_back_end!(a_shorter_file_of_a_map_is_not_sent);

async fn a_shorter_file_of_a_map_is_not_sent(storage: Storage) {
    let (home, _) = two_aligned(&storage).await;
    merge(&storage, b"a tile", 10).await;
    let file = async || {
        let mut files = storage.home_map_files(&home, 1, LevelName::MAIN, map_file::TILE).await.unwrap();
        files.pop().expect("the tile is there")
    };
    let tile = file().await;
    assert_eq!(bytes_of(storage.read_map_file(&tile).await.unwrap()).await, b"a tile");
    for shorter in [&b"a t"[..], b""] {
        storage.blobs.put(tile.key(), shorter.to_vec()).await.unwrap();
        let error = storage.read_map_file(&tile).await.err();
        let is_told = matches!(&error, Some(StorageError::DamagedFile { key, .. }) if key == tile.key());
        assert!(is_told, "{shorter:?}: {error:?}");
    }
    // Files of earlier versions have no size.
    execute(&storage, "UPDATE home_map_files SET size_bytes = 0 WHERE blob_key = $1", tile.key()).await;
    assert_eq!(bytes_of(storage.read_map_file(&file().await).await.unwrap()).await, b"");
}
