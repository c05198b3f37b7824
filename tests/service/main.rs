//! The binary as an operator runs it: real processes, signals, disks and clients.

mod apartment_http;
#[cfg(target_os = "linux")]
mod bounds;
mod demo;
mod disk_full;
mod faults;
mod kill;
mod networks;
mod python;
mod schemathesis;
mod serving;
mod silent;
mod typescript;
