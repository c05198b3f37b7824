//! Videos in HEVC, decoded.
#![no_main]

use viola_fuzz::video::Codec;

libfuzzer_sys::fuzz_target!(init: viola_fuzz::allow_panics(), |bytes: &[u8]| {
    viola_fuzz::check_video(bytes, Some(Codec::Hevc));
});
