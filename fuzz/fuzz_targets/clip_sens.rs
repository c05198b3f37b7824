//! ScanNet's `.sens` without the leading version.
#![no_main]

use viola_fuzz::check_file;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| check_file(&[&4u32.to_le_bytes(), bytes].concat()));
