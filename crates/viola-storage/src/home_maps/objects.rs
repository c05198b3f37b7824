//! The objects of all homes, as their current maps have them.

use crate::columns::to_json;
use crate::database::{Row, Transaction, query};
use crate::{HomeId, Page, Storage, StorageError, Tenant};
use jiff::Timestamp;
use serde::{Deserialize, Serialize};
use uuid::Uuid;
use viola_geometry::taxonomy::Class;
use viola_geometry::{LevelName, Pose2};
use viola_home::{
    Corrected, MovedObject, Object, ObjectField, PlacedClip, RecordedObject, RobotObject, UprightBox,
};

/// An object in a home: an upright box in the LiDAR map's frame, and its properties.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MapObject {
    /// Stays the same in the next revisions while the object is in the same place.
    pub id: String,
    /// The level in whose LiDAR map it is.
    #[serde(default)]
    pub level: LevelName,
    pub class: Class,
    /// In 0..1: from the class's fraction of the votes, the fit of its size and the number of cells.
    pub confidence: f64,
    pub centre_m: [f64; 3],
    /// Length, width and height, along its own x, y and z. The length is at least the width.
    pub size_m: [f64; 3],
    /// Yaw of its own x axis, in [0, pi).
    pub yaw_rad: f64,
    /// Id of the room that it is in.
    pub room: Option<String>,
    /// Number of map points.
    pub points: usize,
    /// The clips that saw a substantial part of it.
    pub clips: Vec<Uuid>,
    /// Recording time of the newest of those clips, if known.
    pub last_seen: Option<Timestamp>,
    /// Name that a person gave it.
    #[serde(default)]
    pub name: Option<String>,
    /// Properties that a person corrected.
    #[serde(default)]
    pub corrected: Vec<ObjectField>,
}

impl MapObject {
    pub fn bounds(&self) -> UprightBox {
        UprightBox { centre_m: self.centre_m, size_m: self.size_m, yaw_rad: self.yaw_rad }
    }

    /// Returns the object for a recording.
    pub fn recorded(&self) -> RecordedObject<'_> {
        RecordedObject {
            id: &self.id,
            name: self.name.as_deref(),
            class: self.class,
            confidence: self.confidence,
            bounds: self.bounds(),
        }
    }

    /// Returns the object for a comparison with those of another frame.
    pub fn in_frame(&self, other_from_own: &Pose2) -> MovedObject<'_> {
        let is_put = self.corrected.contains(&ObjectField::CentreM);
        let bounds = self.bounds().moved(other_from_own);
        MovedObject { id: &self.id, class: self.class, bounds, is_put, is_found: true }
    }

    /// Returns the object for files of robots.
    pub fn for_robot(&self) -> RobotObject {
        RobotObject {
            id: self.id.clone(),
            name: self.name.clone(),
            class: self.class,
            confidence: self.confidence,
            bounds: self.bounds(),
            room: self.room.clone(),
        }
    }

    /// Adds what a person corrected; the values are applied already.
    pub fn mark(&mut self, corrected: &Corrected<ObjectField>) {
        self.name.clone_from(&corrected.name);
        self.corrected.clone_from(&corrected.fields);
    }

    /// Replaces the numbers of clips by the ids of a map's clips.
    pub fn new(level: LevelName, object: Object, clips: &[PlacedClip]) -> MapObject {
        let seen_by = object.clips.iter().filter_map(|number| clips.get(usize::from(*number)));
        let last_ms = seen_by.clone().filter_map(|clip| clip.recorded_at_ms).max();
        MapObject {
            id: object.id,
            level,
            class: object.class,
            confidence: object.confidence,
            centre_m: object.centre_m,
            size_m: object.size_m,
            yaw_rad: object.yaw_rad,
            room: object.room,
            points: object.points,
            clips: seen_by.map(|clip| clip.clip).collect(),
            last_seen: last_ms.and_then(|ms| Timestamp::from_millisecond(ms).ok()),
            name: None,
            corrected: Vec::new(),
        }
    }
}

/// An object and its home.
#[derive(Debug, Clone, PartialEq)]
pub struct HomeObject {
    pub home: HomeId,
    pub object: MapObject,
}

/// Filter of objects; all by default.
#[derive(Debug, Clone, Default)]
pub struct ObjectFilter {
    pub class: Option<String>,
    pub home: Option<HomeId>,
}

/// Selects objects after the cursor: $1 is the tenant, $2 and $3 are the cursor, $4 is the limit.
macro_rules! select_objects {
    ($condition:literal) => {
        concat!(
            "SELECT home_id, object_id, document FROM home_objects WHERE tenant = $1 AND ",
            $condition,
            " ORDER BY home_id, object_id LIMIT $4"
        )
    };
}

/// Returns the statement of a filter; a class comes before a home in its values. Each has a text of its own, since a
/// condition that may be absent uses no index.
pub(crate) fn statement(filter: &ObjectFilter) -> &'static str {
    match (&filter.class, &filter.home) {
        (None, None) => select_objects!("(home_id, object_id) > ($2, $3)"),
        (Some(_), None) => select_objects!("class = $5 AND (home_id, object_id) > ($2, $3)"),
        // Without `|| ''` SQLite begins at the cursor's home, and reads all homes after it.
        (None, Some(_)) => select_objects!("home_id = $5 AND (home_id || '', object_id) > ($2, $3)"),
        (Some(_), Some(_)) => {
            select_objects!("class = $5 AND home_id = $6 AND (home_id || '', object_id) > ($2, $3)")
        }
    }
}

impl Storage {
    /// Returns a page of objects by home and id. The cursor is both with a space, which no home's id has.
    pub async fn objects(
        &self,
        tenant: &Tenant,
        filter: &ObjectFilter,
        page: &Page<String>,
    ) -> Result<Vec<HomeObject>, StorageError> {
        let after = page.after.as_deref().and_then(|after| after.split_once(' '));
        let after = after.and_then(|(home, id)| Some((tenant.home(&home.parse().ok()?), id)));
        let (home, id) = after.as_ref().map_or(("", ""), |(home, id)| (home.key(), *id));
        let mut select =
            query(statement(filter)).bind(tenant.name()).bind(home).bind(id).bind(i64::from(page.limit));
        if let Some(class) = &filter.class {
            select = select.bind(class);
        }
        if let Some(home) = &filter.home {
            select = select.bind(home.key());
        }
        let rows = select.fetch_all(&mut self.database.reader().await?).await?;
        let object = |row: &Row| Ok(HomeObject { home: row.home("home_id")?, object: row.json("document")? });
        rows.iter().map(object).collect()
    }
}

/// Replaces the objects of a home by those of a new revision.
pub(super) async fn replace(
    transaction: &mut Transaction,
    home: &HomeId,
    objects: &[MapObject],
) -> Result<(), StorageError> {
    query("DELETE FROM home_objects WHERE home_id = $1").bind(home.key()).execute(transaction).await?;
    for object in objects {
        query(
            "INSERT INTO home_objects (home_id, object_id, class, document, tenant) VALUES ($1, $2, $3, $4, $5)",
        )
            .bind(home.key())
            .bind(&object.id)
            .bind(object.class.name())
            .bind(to_json(object))
            .bind(home.tenant())
            .execute(transaction)
            .await?;
    }
    Ok(())
}
