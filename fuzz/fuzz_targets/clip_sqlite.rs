//! RTAB-Map's database or a ROS 2 bag of SQLite, without the leading magic bytes.
#![no_main]

use viola_fuzz::check_file;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| check_file(&[b"SQLite format 3\0", bytes].concat()));
