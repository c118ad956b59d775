#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| bowwave_fuzz::targets::link::run(bytes));
