//! Fair use of the service: limits for each tenant and each address, so that none of them slows the others down.

mod arrivals;
mod failed_keys;
mod limits;
mod makers;
mod places;
mod readers;
mod turns;

pub use failed_keys::FailedKeyParams;
pub use limits::LimitParams;
pub use readers::ReaderParams;

pub(super) use arrivals::{Arrival, Arrivals};
pub(super) use failed_keys::FailedKeys;
pub(super) use limits::Limits;
pub(super) use makers::{MakerPlaces, Makers};
pub(super) use places::{FairPlace, FairPlaces};
pub(super) use readers::Readers;
pub(super) use turns::{Turn, Turns};
