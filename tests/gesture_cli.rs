//! `handwave gesture` and `handwave poses` as users call them.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

fn configs(part: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("configs")
        .join(part)
}

fn handwave(args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_handwave"))
        .args(args)
        .output()
        .expect("the program was built")
}

fn refused(args: &[&str], expected: &str) {
    let output = handwave(args);
    let message = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{args:?}: {message}");
    assert!(message.contains(expected), "{args:?}: {message}");
}

#[test]
fn bad_input_ends_with_2_and_a_reason() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = |name: &str| folder.path().join(name).display().to_string();
    let waiting = configs("performances/waiting.csv").display().to_string();
    let hand = configs("gestures/hand.toml").display().to_string();
    let define = ["gesture", "define", "--name", "x", "--into"];
    let into = path("new.toml");
    let with = |more: &[&'static str]| {
        let mut args: Vec<String> = define.map(String::from).to_vec();
        args.extend([into.clone(), "--poses".into(), waiting.clone()]);
        args.extend(more.iter().map(ToString::to_string));
        args
    };
    for (more, expected) in [
        (&["--start", "99"][..], "lies outside the recording"),
        (&[][..], "a gesture needs marks"),
        (&["--rest", "1"][..], "--extreme"),
        (&["--start", "0.5", "--end", "0.51"][..], "a period of"),
    ] {
        let args = with(more);
        refused(
            &args.iter().map(String::as_str).collect::<Vec<_>>(),
            expected,
        );
    }
    assert!(
        !Path::new(&into).exists(),
        "a refused definition wrote a file"
    );
    let out = path("out.csv");
    let estimate = [
        "gesture",
        "estimate",
        "--gestures",
        &hand,
        "--out",
        &out,
        "--poses",
    ];
    let with = |more: &[&str]| {
        refused(
            &[&estimate[..], &more[..more.len() - 1]].concat(),
            more[more.len() - 1],
        )
    };
    with(&["nowhere.jsonl", "nowhere.jsonl: cannot be read"]);
    with(&["pose.fbx", ".jsonl, .csv or .bvh"]);
    with(&[&waiting, "--estimator", "gobor", "did you mean gabor?"]);
    std::fs::write(path("other.csv"), "t,a.x,a.y,a.z\n0,0,0,0\n").expect("writable");
    with(&[&path("other.csv"), "no point palm"]);
    std::fs::write(
        path("recipe.toml"),
        "handwave = \"recipe\"\nversion = 1\nsegment = []\n[sources]\na = \"other.csv\"\n",
    )
    .expect("writable");
    refused(
        &[
            "poses",
            "compose",
            &path("recipe.toml"),
            "--out",
            &path("x.csv"),
        ],
        "one sample only",
    );
    refused(
        &[
            "poses",
            "import",
            &waiting,
            "--kind",
            "leap",
            "--out",
            &path("x.csv"),
        ],
        "not a Leap Motion recording",
    );
}

#[test]
fn estimate_writes_a_row_per_gesture_and_sample() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let out = folder.path().join("out.csv");
    let waiting = configs("performances/waiting.csv");
    let hand = configs("gestures/hand.toml");
    let args = [
        "gesture",
        "estimate",
        "--gestures",
        &hand.display().to_string(),
        "--poses",
        &waiting.display().to_string(),
        "--out",
        &out.display().to_string(),
    ];
    let output = handwave(&args);
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    let text = std::fs::read_to_string(&out).expect("written");
    let mut lines = text.lines();
    assert_eq!(
        lines.next(),
        Some("t,gesture,amplitude,frequency_hz,phase_rad,quality")
    );
    let input = std::fs::read_to_string(&waiting).expect("bundled");
    let times: Vec<&str> = input
        .lines()
        .skip(1)
        .filter_map(|l| l.split(',').next())
        .collect();
    let rows: Vec<Vec<&str>> = lines.map(|line| line.split(',').collect()).collect();
    assert_eq!(rows.len(), 2 * times.len());
    for (row, t) in rows.iter().zip(times.iter().flat_map(|t| [t, t])) {
        assert_eq!(row[0], *t, "the time as in the input");
        assert_eq!(row.len(), 6);
    }
    for (command, expected) in [("list", "non-cyclic"), ("check", "splay")] {
        let output = handwave(&[
            "gesture",
            command,
            "--gestures",
            &hand.display().to_string(),
            "--json",
        ]);
        let text = String::from_utf8_lossy(&output.stdout);
        assert!(
            output.status.success() && text.contains(expected),
            "{command}: {text}"
        );
    }
}
