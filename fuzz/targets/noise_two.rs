//! See `noise_two` in the library.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| handwave_fuzz::noise_two(bytes));
