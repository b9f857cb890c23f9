#![no_main]

#[path = "../inputs.rs"]
#[allow(dead_code)] // Each target uses one function.
mod inputs;

libfuzzer_sys::fuzz_target!(|input: &[u8]| {
    let _ = inputs::jpeg(input);
});
