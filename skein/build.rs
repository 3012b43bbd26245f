//! How the binary is linked.

use std::env;

/// At a fixed address. Every drone is a process, and tables of addresses that have to be fitted to where each process
/// happens to lie cost each of them a quarter of a MiB of its own, time to start, and cold memory in every tick; a fixed
/// one they all share.
fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    let target = |key: &str| env::var(format!("CARGO_CFG_TARGET_{key}"));
    if target("OS").as_deref() == Ok("linux") && target("ENV").as_deref() == Ok("gnu") {
        println!("cargo::rustc-link-arg-bins=-no-pie");
    }
}
