//! Nobody reads any more, as behind `| head`: the program ends as it would have, without a panic.

use std::path::Path;
use std::process::{Command, Stdio};

/// The end of a pipe whose other end is closed.
fn closed_pipe() -> Stdio {
    let (reader, writer) = std::io::pipe().expect("a pipe");
    drop(reader);
    writer.into()
}

fn handwave(args: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_handwave"));
    command
        .args(args)
        .current_dir(Path::new(env!("CARGO_MANIFEST_DIR")));
    command
}

#[test]
fn closed_standard_output_is_no_failure() {
    let clip = "configs/clips/trot_long.json";
    let poses = "configs/performances/splay.csv";
    let commands: [&[&str]; 6] = [
        &["clip", "info", clip],
        &["clip", "info", clip, "--json"],
        &["poses", "info", poses],
        &["poses", "info", poses, "--json"],
        &["sim", "dynamixel", "--list-faults"],
        &["run", "--duration", "1.5"],
    ];
    for args in commands {
        let output = handwave(args)
            .stdout(closed_pipe())
            .output()
            .expect("the program was built");
        let message = String::from_utf8_lossy(&output.stderr);
        assert!(!message.contains("panicked"), "{args:?}: {message}");
        assert_eq!(output.status.code(), Some(0), "{args:?}: {message}");
    }
}

#[test]
fn closed_standard_error_leaves_the_exit_code() {
    let status = handwave(&["clip", "info", "no-such-clip.json"])
        .stderr(closed_pipe())
        .status()
        .expect("the program was built");
    assert_eq!(status.code(), Some(2));
}
