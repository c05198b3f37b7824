//! Maps of Viomi and 3irobotix after inflation.
#![no_main]

use viola_fuzz::{check, zlib};

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| check(&zlib(bytes)));
