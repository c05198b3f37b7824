//! Blobs beside a database that does not know them: lost, empty, or of another place.

use super::*;
use tempfile::TempDir;

/// A place for blobs, and a database that can be replaced by an empty one.
struct Bench {
    folder: TempDir,
    server: Option<S3Server>,
    schemas: Vec<Schema>,
}

impl Bench {
    fn params(&self) -> StorageParams {
        let postgres = self.schemas.last();
        StorageParams {
            data: self.folder.path().to_owned(),
            postgres: postgres.map(|schema| PostgresParams { url: schema.url(), connections: 4 }),
            s3: self.server.as_ref().map(bucket),
            ..StorageParams::default()
        }
    }

    async fn open(&self) -> Result<Storage, StorageError> {
        Storage::open(&self.params()).await
    }

    async fn with(&self, work: impl AsyncFnOnce(&Storage)) {
        let storage = self.open().await.unwrap();
        work(&storage).await;
        storage.close().await;
    }

    /// Returns the files of the database, without those of blobs.
    fn database_files(&self) -> Vec<std::path::PathBuf> {
        let names = ["viola.sqlite", "viola.sqlite-wal", "viola.sqlite-shm"];
        let files = names.map(|name| self.folder.path().join(name));
        files.into_iter().filter(|file| file.exists()).collect()
    }

    /// Takes the database away; it comes back with [`Bench::restore`].
    async fn lose(&mut self) {
        for file in self.database_files() {
            let kept =
                file.with_extension(file.extension().unwrap().to_string_lossy().replace("sqlite", "kept"));
            std::fs::rename(file, kept).unwrap();
        }
        if !self.schemas.is_empty() {
            self.schemas.push(Schema::new().await.unwrap());
        }
    }

    async fn restore(&mut self) {
        for file in self.database_files() {
            std::fs::remove_file(file).unwrap();
        }
        for extension in ["", "-wal", "-shm"] {
            let file = |kind| self.folder.path().join(format!("viola.{kind}{extension}"));
            if file("kept").exists() {
                std::fs::rename(file("kept"), file("sqlite")).unwrap();
            }
        }
        if self.schemas.len() > 1 {
            self.schemas.pop().unwrap().remove().await;
        }
    }

    async fn remove(self) {
        for schema in self.schemas {
            schema.remove().await;
        }
    }

    /// Returns the file with the store's id.
    fn id_file(&self) -> std::path::PathBuf {
        match &self.server {
            Some(server) => server.path_of("viola-store-id"),
            None => self.folder.path().join("blobs/viola-store-id"),
        }
    }
}

/// Writes a recording that no row names.
async fn orphan(storage: &Storage) {
    storage.blobs.put(&format!("clips/{}/file", Uuid::now_v7()), b"orphan".to_vec()).await.unwrap();
}

macro_rules! on_every_pair {
    ($($case:ident),* $(,)?) => {
        $(mod $case {
            use super::*;

            async fn run(on_postgres: bool, on_s3: bool) {
                let mut schemas = Vec::new();
                if on_postgres {
                    let Some(schema) = Schema::new().await else { return };
                    schemas.push(schema);
                }
                let server = on_s3.then(S3Server::start);
                let folder = tempfile::tempdir().unwrap();
                super::$case(Bench { folder, server, schemas }).await;
            }

            #[tokio::test]
            async fn sqlite_and_local_files() {
                run(false, false).await;
            }

            #[tokio::test]
            async fn sqlite_and_s3() {
                run(false, true).await;
            }

            #[tokio::test]
            async fn postgres_and_local_files() {
                run(true, false).await;
            }

            #[tokio::test]
            async fn postgres_and_s3() {
                run(true, true).await;
            }
        })*
    };
}
on_every_pair!(
    a_lost_database_is_refused,
    a_sweep_removes_a_small_part,
    a_place_that_lived_is_no_lost_one,
    a_store_with_another_id_is_refused_and_keeps_its_files,
    a_store_of_before_ids_gets_one,
    an_empty_store_of_another_database_is_refused,
);

async fn a_lost_database_is_refused(mut bench: Bench) {
    let mut kept = Vec::new();
    let mut clip = None;
    bench
        .with(async |storage| {
            clip = Some(one_job(storage).await);
            kept = storage.blobs_that_exist().await;
        })
        .await;
    bench.lose().await;
    let mut lost = Uuid::nil();
    for _ in 0..2 {
        let refused = bench.open().await.err();
        let Some(StorageError::LostDatabase { blobs: 3, store }) = refused else { panic!("{refused:?}") };
        lost = store;
    }
    let administered = Storage::administer(&bench.params()).await.unwrap();
    for limit in [SweepLimit::Leftovers, SweepLimit::Everything] {
        let refused = administered.sweep(Timestamp::MAX, limit).await;
        assert!(matches!(refused, Err(StorageError::LostDatabase { blobs: 3, .. })), "{refused:?}");
    }
    assert_eq!(administered.blobs_that_exist().await, kept);
    administered.close().await;
    drop(administered);

    bench.restore().await;
    let (id, clip) = clip.unwrap();
    bench
        .with(async |storage| {
            assert_eq!(storage.clip(&id, clip.id).await.unwrap(), clip);
            assert_eq!(storage.blobs_that_exist().await, kept);
        })
        .await;
    // An operator can start with an empty service explicitly, after the refusal to start.
    bench.lose().await;
    assert!(matches!(bench.open().await.err(), Some(StorageError::LostDatabase { .. })));
    let administered = Storage::administer(&bench.params()).await.unwrap();
    let refused = administered.take_over_store(Uuid::now_v7()).await;
    assert!(matches!(refused, Err(StorageError::NotThisStore { .. })), "{refused:?}");
    administered.take_over_store(lost).await.unwrap();
    assert_eq!(administered.sweep(Timestamp::MAX, SweepLimit::Everything).await.unwrap(), 3);
    administered.close().await;
    drop(administered);
    bench.with(async |storage| assert!(storage.blobs_that_exist().await.is_empty())).await;
    bench.remove().await;
}

async fn a_sweep_removes_a_small_part(bench: Bench) {
    bench
        .with(async |storage| {
            one_job(storage).await;
            for _ in 0..16 {
                orphan(storage).await;
            }
            assert_eq!(storage.blobs_that_exist().await.len(), 19);
            assert_eq!(storage.sweep(Timestamp::MAX, SweepLimit::Leftovers).await.unwrap(), 16);
            assert_eq!(storage.blobs_that_exist().await.len(), 3);
            for _ in 0..17 {
                orphan(storage).await;
            }
        })
        .await;
    // As with an old copy of the database: a start succeeds and removes nothing.
    bench
        .with(async |storage| {
            let refused = storage.sweep(Timestamp::MAX, SweepLimit::Leftovers).await;
            assert!(matches!(refused, Err(StorageError::TooMuchToSweep { sent: 17, .. })), "{refused:?}");
            assert_eq!(storage.blobs_that_exist().await.len(), 20);
            assert_eq!(storage.sweep(Timestamp::MAX, SweepLimit::Everything).await.unwrap(), 17);
            assert_eq!(storage.blobs_that_exist().await.len(), 3);
        })
        .await;
    bench.remove().await;
}

/// Deletions and an interrupted first upload are no reason to refuse.
async fn a_place_that_lived_is_no_lost_one(bench: Bench) {
    bench
        .with(async |storage| {
            storage.put_home(&home("h"), None, |_| true, at(0)).await.unwrap();
            orphan(storage).await;
        })
        .await;
    bench.with(async |storage| storage.delete_home(&home("h"), |_| true, at(1)).await.unwrap()).await;
    bench.with(async |_| {}).await;
    bench.remove().await;
}

/// Returns a description of a refusal to start and to sweep.
async fn refused(bench: &Bench) -> StorageError {
    let started = bench.open().await.err().expect("a refusal");
    let administered = Storage::administer(&bench.params()).await.unwrap();
    let kept = administered.blobs_that_exist().await;
    for limit in [SweepLimit::Leftovers, SweepLimit::Everything] {
        let swept = administered.sweep(Timestamp::MAX, limit).await;
        assert_eq!(swept.err().map(|error| error.to_string()), Some(started.to_string()));
    }
    assert_eq!(administered.blobs_that_exist().await, kept);
    administered.close().await;
    started
}

async fn a_store_with_another_id_is_refused_and_keeps_its_files(bench: Bench) {
    bench
        .with(async |storage| {
            one_job(storage).await;
            orphan(storage).await;
        })
        .await;
    let (file, other) = (bench.id_file(), Uuid::now_v7());
    let own = std::fs::read_to_string(&file).unwrap();
    std::fs::write(&file, other.to_string()).unwrap();
    let told = refused(&bench).await;
    assert!(matches!(told, StorageError::OtherStore { own: Some(_), found, .. } if found == other), "{told}");
    assert!(told.to_string().contains(own.trim()), "{told}");
    let administered = Storage::administer(&bench.params()).await.unwrap();
    let taken = administered.take_over_store(other).await;
    assert!(matches!(taken, Err(StorageError::OtherStore { .. })), "{taken:?}");
    administered.close().await;
    drop(administered);
    std::fs::remove_file(&file).unwrap();
    let told = refused(&bench).await;
    assert!(matches!(told, StorageError::UnmarkedStore { .. }), "{told}");
    assert!(told.to_string().contains(own.trim()), "{told}");
    std::fs::write(&file, "nothing").unwrap();
    let told = refused(&bench).await;
    assert!(matches!(told, StorageError::DamagedStoreId { .. }), "{told}");
    std::fs::write(&file, &own).unwrap();
    bench.with(async |_| {}).await;
    bench.remove().await;
}

async fn a_store_of_before_ids_gets_one(bench: Bench) {
    bench.with(async |storage| drop(one_job(storage).await)).await;
    let file = bench.id_file();
    // An upgrade, one that was killed in between, and a copy of the database of before the upgrade.
    for has_file in [false, true] {
        bench
            .with(async |storage| execute(storage, "DELETE FROM store_identity WHERE id <> $1", "").await)
            .await;
        let before = std::fs::read_to_string(&file).unwrap();
        if !has_file {
            std::fs::remove_file(&file).unwrap();
        }
        let mut id = Uuid::nil();
        bench.with(async |storage| id = storage.check_store().await.unwrap()).await;
        let after = std::fs::read_to_string(&file).unwrap();
        assert_eq!((after.trim(), after == before), (id.to_string().as_str(), has_file));
    }
    // An upgrade with a wrong place, which is empty.
    bench
        .with(async |storage| {
            let keys = storage.blobs_that_exist().await;
            storage.blobs.remove_all(&keys).await.unwrap();
            execute(storage, "DELETE FROM store_identity WHERE id <> $1", "").await;
        })
        .await;
    std::fs::remove_file(&file).unwrap();
    let told = refused(&bench).await;
    assert!(matches!(told, StorageError::StoreWithoutFiles { .. }), "{told}");
    bench.remove().await;
}

async fn an_empty_store_of_another_database_is_refused(mut bench: Bench) {
    bench.with(async |_| {}).await;
    bench.lose().await;
    let told = refused(&bench).await;
    assert!(matches!(told, StorageError::OtherStore { own: None, .. }), "{told}");
    std::fs::remove_file(bench.id_file()).unwrap();
    bench.with(async |_| {}).await;
    bench.remove().await;
}

/// The listing of a bucket begins with the oldest keys.
#[tokio::test]
async fn a_store_that_begins_with_leftovers_is_no_lost_one() {
    let (folder, server) = (tempfile::tempdir().unwrap(), S3Server::start());
    let bench = Bench { folder, server: Some(server), schemas: Vec::new() };
    let mut clip = None;
    bench.with(async |storage| clip = Some(one_job(storage).await.1)).await;
    // Results that killed workers left of a clip that was removed since: more files than a sample has.
    for attempt in 0..1001_u128.div_ceil(result_file::ALL.len() as u128) {
        let result = format!("clips/{}/results/{}-1", Uuid::nil(), Uuid::from_u128(attempt));
        let result = bench.server.as_ref().unwrap().path_of(&result);
        std::fs::create_dir_all(&result).unwrap();
        result_file::ALL.iter().for_each(|name| std::fs::write(result.join(name), "left").unwrap());
    }
    let clip = clip.unwrap().id;
    bench.with(async |storage| assert!(storage.clip_recording(clip).await.unwrap().is_some())).await;
    bench.remove().await;
}

/// A start needs no store that answers. It is checked later.
#[tokio::test]
async fn a_wrong_store_that_was_silent_at_the_start_is_not_ready() {
    let Some(schema) = Schema::new().await else { return };
    let (folder, server) = (tempfile::tempdir().unwrap(), S3Server::start());
    let bench = Bench { folder, server: Some(server), schemas: vec![schema] };
    bench.with(async |storage| drop(one_job(storage).await)).await;
    let server = bench.server.as_ref().unwrap();
    std::fs::write(bench.id_file(), Uuid::now_v7().to_string()).unwrap();
    server.stop();
    bench
        .with(async |storage| {
            server.listen();
            let ready = storage.blobs_ready().await;
            assert!(matches!(ready, Err(StorageError::OtherStore { .. })), "{ready:?}");
            let claimed = storage.claim(LEASE, at(0)).await;
            assert!(matches!(claimed, Err(StorageError::OtherStore { .. })), "{claimed:?}");
            let deleted = storage.finish_deletions().await;
            assert!(matches!(deleted, Err(StorageError::OtherStore { .. })), "{deleted:?}");
        })
        .await;
    bench.remove().await;
}
