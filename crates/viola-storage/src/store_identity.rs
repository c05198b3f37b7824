//! The identity of the store of files: an id that the database and the store both have. It tells a wrong data folder, bucket or
//! prefix, or a wrong database, from lost files.

use super::database::{Connection, Transaction, query};
use super::{Storage, StorageError, clips, lidar_maps};
use std::sync::atomic::Ordering;
use uuid::Uuid;

/// Maximum number of unnamed blobs that a start accepts if no blob is named.
const MAX_ALONE: usize = 100;

/// Number of clips and of LiDAR maps whose files are looked for in the store.
const NEWEST: i64 = 3;

impl Storage {
    /// Returns the id of the store. Refuses one that is not this database's: another one, or one without its files. The first
    /// check of a database and a store that have none gives both an id.
    pub async fn check_store(&self) -> Result<Uuid, StorageError> {
        let own = own_id(&mut self.database.reader().await?).await?;
        let id = match (own, self.blobs.store_id().await?) {
            (Some(own), Some(found)) => self.same(own, found)?,
            _ => self.settle_store().await?,
        };
        self.is_store_checked.store(true, Ordering::Relaxed);
        Ok(id)
    }

    /// Checks the store, unless it was found to be this database's before. A store that did not answer at the start is checked
    /// here, before jobs write to it and deletions count what it does not have as deleted.
    pub(super) async fn require_store(&self) -> Result<(), StorageError> {
        if !self.is_store_checked.load(Ordering::Relaxed) {
            self.check_store().await?;
        }
        Ok(())
    }

    /// Gives a new database the store with this id, whose files it does not name.
    pub async fn take_over_store(&self, id: Uuid) -> Result<(), StorageError> {
        let mut transaction = self.begin_identity().await?;
        let found = self.blobs.store_id().await?;
        if found != Some(id) {
            return Err(StorageError::NotThisStore { place: self.place(), asked: id });
        }
        if let Some(own) = own_id(&mut transaction).await? {
            return self.same(own, id).map(drop);
        }
        if names_files(&mut transaction).await? {
            return Err(StorageError::StoreWithoutFiles { place: self.place() });
        }
        insert(transaction, id).await
    }

    /// Refuses a database that knows none of the existing blobs: it is new, lost, or another one's.
    pub(super) async fn check_blobs_are_known(&self, store: Uuid) -> Result<(), StorageError> {
        let keys = self.blobs.sample().await?;
        let blobs = keys.len();
        if blobs == 0 || !self.named(keys).await?.is_empty() {
            return Ok(());
        }
        if (blobs <= MAX_ALONE && self.has_lived().await?) || self.has_newest_files().await? {
            return Ok(());
        }
        Err(StorageError::LostDatabase { blobs, store })
    }

    fn place(&self) -> String {
        self.blobs.place_name().to_owned()
    }

    fn same(&self, own: Uuid, found: Uuid) -> Result<Uuid, StorageError> {
        if own == found {
            return Ok(own);
        }
        Err(StorageError::OtherStore { place: self.place(), own: Some(own), found })
    }

    /// Gives the database and the store the id that at least one of them lacks, if they belong together.
    async fn settle_store(&self) -> Result<Uuid, StorageError> {
        let mut transaction = self.begin_identity().await?;
        // Another process may have settled it meanwhile.
        let (own, found) = (own_id(&mut transaction).await?, self.blobs.store_id().await?);
        let Some(own) = own else { return self.settle_database(transaction, found).await };
        if let Some(found) = found {
            return self.same(own, found);
        }
        if names_files(&mut transaction).await? {
            return Err(StorageError::UnmarkedStore { place: self.place(), own });
        }
        // A process was killed between the two, before the first file.
        self.blobs.put_store_id(own).await?;
        Ok(own)
    }

    /// Gives a database the id of the store, which it `found` or makes.
    async fn settle_database(
        &self,
        mut transaction: Transaction,
        found: Option<Uuid>,
    ) -> Result<Uuid, StorageError> {
        let id = found.unwrap_or_else(Uuid::now_v7);
        let keys = self.blobs.sample().await?;
        let blobs = keys.len();
        if blobs > 0 && (!self.named(keys).await?.is_empty() || self.has_newest_files().await?) {
            // Of a version without ids. A process that is killed after the first step repeats this.
            if found.is_none() {
                self.blobs.put_store_id(id).await?;
            }
            insert(transaction, id).await?;
            return Ok(id);
        }
        if names_files(&mut transaction).await? {
            return Err(StorageError::StoreWithoutFiles { place: self.place() });
        }
        if let Some(found) = found.filter(|_| blobs == 0) {
            return Err(StorageError::OtherStore { place: self.place(), own: None, found });
        }
        let is_new = blobs == 0 || (blobs <= MAX_ALONE && self.has_lived().await?);
        if found.is_none() && is_new {
            insert(transaction, id).await?;
            self.blobs.put_store_id(id).await?;
            return Ok(id);
        }
        // The refusal names the id, so that nobody deletes the files of another store by mistake.
        if found.is_none() {
            self.blobs.put_store_id(id).await?;
        }
        Err(StorageError::LostDatabase { blobs, store: id })
    }

    /// Returns whether the store has a file of the newest clips or LiDAR maps. A sample of the store alone does not tell: the
    /// listing of a bucket begins with the oldest keys, and all of these may be leftovers of clips that were removed since.
    async fn has_newest_files(&self) -> Result<bool, StorageError> {
        let mut keys = Vec::new();
        let newest = query("SELECT id FROM clips ORDER BY id DESC LIMIT $1").bind(NEWEST);
        for row in &newest.fetch_all(&mut self.database.reader().await?).await? {
            keys.push(clips::file_key(row.id("id")?));
        }
        let newest = query("SELECT id FROM lidar_maps WHERE removed_at IS NULL ORDER BY id DESC LIMIT $1");
        for row in &newest.bind(NEWEST).fetch_all(&mut self.database.reader().await?).await? {
            keys.push(lidar_maps::file_key(row.id("id")?));
        }
        for key in &keys {
            if self.blobs.read(key).await?.is_some() {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// Begins a transaction that may write the id; processes that start at once take turns.
    async fn begin_identity(&self) -> Result<Transaction, StorageError> {
        let mut transaction = self.database.begin().await?;
        if transaction.is_shared() {
            query("LOCK TABLE store_identity IN EXCLUSIVE MODE").execute(&mut transaction).await?;
        }
        Ok(transaction)
    }

    /// Returns whether the database has, or recently had, a home. Blobs come after their home.
    async fn has_lived(&self) -> Result<bool, StorageError> {
        let row = query(
            "SELECT (SELECT COUNT(*) FROM (SELECT 1 FROM homes LIMIT 1) AS h)
                + (SELECT COUNT(*) FROM (SELECT 1 FROM changes LIMIT 1) AS c)
                + (SELECT COUNT(*) FROM (SELECT 1 FROM doomed_blobs LIMIT 1) AS d) AS n",
        );
        Ok(row.fetch_one(&mut self.database.reader().await?).await?.number("n")? > 0)
    }
}

/// Returns the id of the database's store; `None` if it has none yet.
async fn own_id(connection: &mut Connection) -> Result<Option<Uuid>, StorageError> {
    let row = query("SELECT id FROM store_identity").fetch_optional(connection).await?;
    row.map(|row| row.id("id")).transpose()
}

async fn insert(mut transaction: Transaction, id: Uuid) -> Result<(), StorageError> {
    let insert = query("INSERT INTO store_identity (number, id) VALUES (1, $1)").bind(id.to_string());
    insert.execute(&mut transaction).await?;
    transaction.commit().await
}

/// Returns whether rows name files of the store.
async fn names_files(connection: &mut Connection) -> Result<bool, StorageError> {
    let row = query(
        "SELECT (SELECT COUNT(*) FROM (SELECT 1 FROM clips LIMIT 1) AS c)
            + (SELECT COUNT(*) FROM (SELECT 1 FROM lidar_maps WHERE removed_at IS NULL LIMIT 1) AS l)
            + (SELECT COUNT(*) FROM (SELECT 1 FROM home_map_files LIMIT 1) AS m)
            + (SELECT COUNT(*) FROM (SELECT 1 FROM upload_pieces LIMIT 1) AS u) AS n",
    );
    Ok(row.fetch_one(connection).await?.number("n")? > 0)
}
