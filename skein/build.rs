//! How the binary is linked.

use std::env;

/// Links the program at a fixed address. With a position-independent executable, every drone process relocates its own copy of
/// the address tables. That costs a quarter of a MiB per process, start-up time, and cold memory in every tick. At a fixed
/// address all processes share these pages.
fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    let target = |key: &str| env::var(format!("CARGO_CFG_TARGET_{key}"));
    if target("OS").as_deref() == Ok("linux") && target("ENV").as_deref() == Ok("gnu") {
        println!("cargo::rustc-link-arg-bins=-no-pie");
    }
}
