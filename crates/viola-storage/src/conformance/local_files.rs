//! Tests of a data folder on a disk alone.

use super::*;
use std::path::Path;

async fn open(folder: &Path) -> Storage {
    in_folder(folder).await
}

#[tokio::test]
async fn a_folder_has_one_server_at_a_time() {
    let folder = tempfile::tempdir().unwrap();
    let storage = open(folder.path()).await;
    assert!(matches!(
        Storage::open(&StorageParams::in_folder(folder.path())).await,
        Err(StorageError::InUse { .. })
    ));
    storage.close().await;
    drop(storage);
    open(folder.path()).await;
}

/// Otherwise a misspelt folder would be an empty service.
#[tokio::test]
async fn a_folder_without_a_service_is_not_administered() {
    let folder = tempfile::tempdir().unwrap();
    let params = StorageParams::in_folder(&folder.path().join("typo"));
    let refused = Storage::administer(&params).await.err();
    assert!(
        matches!(&refused, Some(StorageError::NoService { path }) if *path == params.data),
        "{refused:?}"
    );
    assert!(!params.data.exists());
    Storage::administer_or_create(&params).await.unwrap().close().await;
    Storage::administer(&params).await.unwrap().close().await;
}

#[tokio::test]
async fn everything_is_there_after_a_restart_and_leftovers_are_not() {
    let folder = tempfile::tempdir().unwrap();
    let storage = open(folder.path()).await;
    let (id, clip) = one_job(&storage).await;
    let kept = storage.blobs_that_exist().await;
    assert_eq!(kept.len(), 3);
    // An interrupted upload, a clip whose row was never committed, and an interrupted write of a blob.
    let mut cut_off = storage.incoming().unwrap();
    cut_off.write(b"half a cl").await.unwrap();
    std::mem::forget(cut_off);
    let orphan = folder.path().join("blobs/clips/01a1f766-7a97-7747-9dbb-391e0eeccb64");
    std::fs::create_dir_all(&orphan).unwrap();
    std::fs::write(orphan.join("file"), b"orphan").unwrap();
    std::fs::write(orphan.join("file#1"), b"orphan").unwrap();
    assert_eq!(storage.blobs_that_exist().await.len(), 6);
    drop(storage);

    let storage = open(folder.path()).await;
    assert_eq!(storage.clip(&id, clip.id).await.unwrap(), clip);
    assert_eq!(storage.blobs_that_exist().await, kept);
}

/// Many processes may share a folder of incoming files.
#[tokio::test]
async fn arriving_files_of_a_killed_process_go_at_a_start_without_another_process() {
    for is_on_s3 in [false, true] {
        let Some(schema) = Schema::new().await else { return };
        let (folder, server) = (tempfile::tempdir().unwrap(), is_on_s3.then(S3Server::start));
        let open = async || on(&schema, folder.path(), server.as_ref().map(bucket)).await;
        let incoming = folder.path().join(if is_on_s3 { "incoming" } else { "blobs/incoming" });
        let left = || std::fs::read_dir(&incoming).unwrap().count();
        let killed = open().await;
        let mut cut_off = killed.incoming().unwrap();
        cut_off.write(b"half a cl").await.unwrap();
        std::mem::forget(cut_off);
        std::fs::write(killed.work_folder().unwrap().keep().join("clip"), b"of a job").unwrap();
        let other = open().await;
        drop(killed);
        let third = open().await;
        assert_eq!(left(), 2, "they may be those of a process that runs");
        drop((other, third));
        let alone = open().await;
        assert_eq!(left(), 0);
        alone.close().await;
        drop(alone);
        schema.remove().await;
    }
}

#[tokio::test]
async fn an_upload_dropped_half_way_leaves_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let storage = open(folder.path()).await;
    let mut incoming = storage.incoming().unwrap();
    incoming.write(b"half").await.unwrap();
    drop(incoming);
    drop(arrived(&storage, b"whole, but refused").await);
    assert_eq!(storage.blobs_that_exist().await, Vec::<String>::new());
}

#[tokio::test]
async fn a_data_folder_is_for_its_owner_alone() {
    use std::os::unix::fs::PermissionsExt;
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path().join("data");
    open(&data).await;
    assert_eq!(std::fs::metadata(&data).unwrap().permissions().mode() & 0o777, 0o700);
}

#[test]
fn only_harmless_home_ids_pass() {
    for good in ["a", "A.b_c-9", "...", &"x".repeat(64)] {
        assert!(good.parse::<HomeId>().is_ok(), "{good}");
    }
    for bad in ["", ".", "..", "a/b", "a b", "\u{e9}", "a\0", "a\n", "%2e", &"x".repeat(65)] {
        assert!(bad.parse::<HomeId>().is_err(), "{bad:?}");
    }
}

/// A disk of its own for the blobs has such a folder, which the service may not read unless it is the administrator's.
#[tokio::test]
async fn the_folder_of_a_disks_own_checks_is_left_alone() {
    use std::os::unix::fs::PermissionsExt;
    let folder = tempfile::tempdir().unwrap();
    let storage = open(folder.path()).await;
    let of_disk = folder.path().join("blobs/lost+found");
    std::fs::create_dir(&of_disk).unwrap();
    std::fs::write(of_disk.join("file"), "found").unwrap();
    std::fs::set_permissions(&of_disk, std::fs::Permissions::from_mode(0o000)).unwrap();
    let swept = storage.sweep(Timestamp::MAX, SweepLimit::Everything).await;
    storage.close().await;
    drop(storage);
    let opened = Storage::open(&StorageParams::in_folder(folder.path())).await;
    // So that the test can remove it.
    std::fs::set_permissions(&of_disk, std::fs::Permissions::from_mode(0o700)).unwrap();
    assert!(matches!(swept, Ok(0)), "{swept:?}");
    opened.unwrap().close().await;
    assert!(of_disk.join("file").exists());
}

#[tokio::test]
async fn a_link_to_a_folder_of_another_disk_is_left_alone() {
    let folder = tempfile::tempdir().unwrap();
    let storage = open(folder.path()).await;
    let (id, _) = one_job(&storage).await;
    let (moved, elsewhere) = (folder.path().join("blobs/lidar-maps"), folder.path().join("elsewhere"));
    std::fs::rename(&moved, &elsewhere).unwrap();
    std::os::unix::fs::symlink(&elsewhere, &moved).unwrap();
    for limit in [SweepLimit::Leftovers, SweepLimit::Everything] {
        assert_eq!(storage.sweep(Timestamp::MAX, limit).await.unwrap(), 0);
    }
    let map = storage.lidar_map(&id, LevelName::MAIN).await.unwrap();
    assert_eq!(storage.lidar_map_file(map.id()).await.unwrap(), "map");
    storage.close().await;
}
