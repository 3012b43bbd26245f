//! An application with the built-in pilots only: `skein` itself, for the tests of this crate, which has no other way to it.

fn main() -> std::process::ExitCode {
    skein::App::new().main()
}
