//! The `skein` binary: the application with the built-in pilots alone.

fn main() -> std::process::ExitCode {
    skein::App::new().main()
}
