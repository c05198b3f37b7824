//! Conversion between columns and values: times are milliseconds, ids and documents are text.

use super::database::Row;
use super::{HomeId, StorageError, Tenant};
use jiff::Timestamp;
use serde::Serialize;
use serde::de::{DeserializeOwned, IntoDeserializer};
use uuid::Uuid;

impl Row {
    pub fn text(&self, column: &'static str) -> Result<String, StorageError> {
        self.get(column)
    }

    pub fn maybe_text(&self, column: &'static str) -> Result<Option<String>, StorageError> {
        self.get(column)
    }

    pub fn number(&self, column: &'static str) -> Result<i64, StorageError> {
        self.get(column)
    }

    pub fn maybe_number(&self, column: &'static str) -> Result<Option<i64>, StorageError> {
        self.get(column)
    }

    pub fn real(&self, column: &'static str) -> Result<f64, StorageError> {
        self.get(column)
    }

    pub fn count<T: TryFrom<i64>>(&self, column: &'static str) -> Result<T, StorageError> {
        to_count(column, self.number(column)?)
    }

    pub fn maybe_count<T: TryFrom<i64>>(&self, column: &'static str) -> Result<Option<T>, StorageError> {
        self.maybe_number(column)?.map(|number| to_count(column, number)).transpose()
    }

    pub fn id(&self, column: &'static str) -> Result<Uuid, StorageError> {
        parse_id(column, &self.text(column)?)
    }

    pub fn maybe_id(&self, column: &'static str) -> Result<Option<Uuid>, StorageError> {
        self.maybe_text(column)?.map(|text| parse_id(column, &text)).transpose()
    }

    pub fn home(&self, column: &'static str) -> Result<HomeId, StorageError> {
        parse_home(column, self.text(column)?)
    }

    pub fn maybe_home(&self, column: &'static str) -> Result<Option<HomeId>, StorageError> {
        self.maybe_text(column)?.map(|key| parse_home(column, key)).transpose()
    }

    pub fn tenant(&self, column: &'static str) -> Result<Tenant, StorageError> {
        Tenant::try_from(self.text(column)?).map_err(|error| unreadable(column, error))
    }

    pub fn time(&self, column: &'static str) -> Result<Timestamp, StorageError> {
        parse_time(column, self.number(column)?)
    }

    pub fn maybe_time(&self, column: &'static str) -> Result<Option<Timestamp>, StorageError> {
        self.maybe_number(column)?.map(|number| parse_time(column, number)).transpose()
    }

    pub fn json<T: DeserializeOwned>(&self, column: &'static str) -> Result<T, StorageError> {
        parse_json(column, self.text(column)?.as_bytes())
    }

    pub fn maybe_json<T: DeserializeOwned>(&self, column: &'static str) -> Result<Option<T>, StorageError> {
        self.maybe_text(column)?.map(|text| parse_json(column, text.as_bytes())).transpose()
    }

    /// Returns a value of an enumeration by its serde name.
    pub fn name<T: DeserializeOwned>(&self, column: &'static str) -> Result<T, StorageError> {
        parse_name(column, &self.text(column)?)
    }

    pub fn maybe_name<T: DeserializeOwned>(&self, column: &'static str) -> Result<Option<T>, StorageError> {
        self.maybe_text(column)?.map(|text| parse_name(column, &text)).transpose()
    }
}

/// Returns a time as it is stored, in milliseconds.
pub(super) fn stored(time: Timestamp) -> Timestamp {
    Timestamp::from_millisecond(time.as_millisecond()).unwrap_or(time)
}

/// Returns the text of a document column.
pub(super) fn to_json<T: Serialize>(value: &T) -> String {
    serde_json::to_string(value).expect("our own records have text keys and cannot fail to serialise")
}

fn to_count<T: TryFrom<i64>>(column: &'static str, number: i64) -> Result<T, StorageError> {
    T::try_from(number).map_err(|_| unreadable(column, format!("{number} is out of range")))
}

fn parse_id(column: &'static str, text: &str) -> Result<Uuid, StorageError> {
    Uuid::parse_str(text).map_err(|error| unreadable(column, error))
}

fn parse_home(column: &'static str, key: String) -> Result<HomeId, StorageError> {
    HomeId::from_key(key).map_err(|error| unreadable(column, error))
}

/// Returns the time of a column or of another source that has a name.
pub(super) fn parse_time(column: &'static str, milliseconds: i64) -> Result<Timestamp, StorageError> {
    Timestamp::from_millisecond(milliseconds).map_err(|error| unreadable(column, error))
}

/// Returns the document of a column or of a file.
pub(super) fn parse_json<T: DeserializeOwned>(column: &'static str, json: &[u8]) -> Result<T, StorageError> {
    serde_json::from_slice(json).map_err(|error| unreadable(column, error))
}

fn parse_name<T: DeserializeOwned>(column: &'static str, text: &str) -> Result<T, StorageError> {
    T::deserialize(IntoDeserializer::<serde::de::value::Error>::into_deserializer(text))
        .map_err(|error| unreadable(column, error))
}

fn unreadable(column: &'static str, detail: impl ToString) -> StorageError {
    StorageError::Column { column, detail: detail.to_string() }
}
