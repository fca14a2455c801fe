//! The program `shader-server`.

use std::process::ExitCode;

fn main() -> ExitCode {
    shader_server::main_from_args(std::env::args_os())
}
