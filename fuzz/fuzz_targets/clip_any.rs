//! Any file as a clip.
#![no_main]

use viola_fuzz::check_file;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| check_file(bytes));
