//! Any file as a container.
#![no_main]

use viola_fuzz::check_archive;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| check_archive(bytes));
