//! A ROS 2 bag as MCAP, without the leading magic bytes.
#![no_main]

use viola_fuzz::check_file;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| check_file(&[b"\x89MCAP0\r\n", bytes].concat()));
