//! `handwave gesture define --input` as users call it: hands-free, by a pedal, over the network, refused.

mod support;

use handwave::gesture::{GestureKind, GestureSet};
use std::io::{BufRead, BufReader, Read};
use std::net::UdpSocket;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;
use support::folder::Folder;
use support::program::{Ended, handwave, refused};

fn define(folder: &Folder, input: &str, name: &str, more: &[&str]) -> Ended {
    let into = folder.text("taught.toml");
    let first = [
        "gesture", "define", "--input", input, "--name", name, "--into", &into,
    ];
    handwave(&[&first[..], more].concat())
}

fn performance(name: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("configs/performances")
        .join(name);
    path.to_str().expect("a plain path").to_owned()
}

fn source(name: &str) -> String {
    format!("file:{}", performance(name))
}

#[test]
fn what_cannot_be_taught_is_refused_and_nothing_is_written() {
    let folder = Folder::empty();
    let drum = source("waiting.csv");
    let fast = ["--speed", "max"];
    for (input, more, parts) in [
        ("udp://127.0.0.1:0", &fast[..], &["--speed max", "live"][..]),
        (&drum, &fast, &["nobody can mark", "--start-after"]),
        (
            &drum,
            &["--speed", "max", "--start-after", "99"],
            &["0 to 60 seconds"],
        ),
        (
            &drum,
            &["--speed", "max", "--mark-channel", "pedal"],
            &["--mark-channel pedal", "channels"],
        ),
        (&drum, &["--poses", "x.csv"], &["cannot be used with"]),
        (
            &drum,
            &["--speed", "max", "--start-after", "2.9"],
            &["needed"],
        ),
        (
            &drum,
            &["--speed", "max", "--start-after", "0", "--longest", "0"],
            &["--longest 0"],
        ),
    ] {
        refused(define(&folder, input, "x", more), 2, parts);
    }
    let still: String = (0..300)
        .map(|k| format!("{:.2},0.1,0.2,0.3,0.4,0.5,0.6\n", f64::from(k) * 0.02))
        .collect();
    let text = format!("t,a.x,a.y,a.z,b.x,b.y,b.z\n{still}");
    let still = format!("file:{}", folder.write("still.csv", &text));
    let args = ["--speed", "max", "--start-after", "1"];
    refused(define(&folder, &still, "x", &args), 2, &["nothing moved"]);
    let jump = "t,a.x,a.y,a.z\n0.0,0.0,0.0,0.0\n0.1,,,\n";
    let unseen = format!("file:{}", folder.write("unseen.csv", jump));
    refused(define(&folder, &unseen, "x", &args), 2, &["nothing moved"]);
    assert!(
        !folder.path("taught.toml").exists(),
        "a refused lesson wrote a file"
    );
}

#[test]
fn hands_free_a_recording_teaches_both_kinds_with_the_same_bytes_every_time() {
    let folder = Folder::empty();
    let teach = || {
        let drum = ["--speed", "max", "--start-after", "0.5", "--json"];
        let report = define(&folder, &source("waiting.csv"), "drum", &drum)
            .expect(0)
            .json();
        let splay = [
            "--speed",
            "max",
            "--start-after",
            "0.5",
            "--kind",
            "non-cyclic",
        ];
        let words = define(&folder, &source("splay.csv"), "splay", &splay).expect(0);
        (report, words.out, folder.read("taught.toml"))
    };
    let (report, words, text) = teach();
    println!("{report}\n{words}");
    assert_eq!(report["works"], true, "{report}");
    assert!(report["periodicity"].as_f64() > Some(0.8), "{report}");
    assert!(
        words.contains("by playing") && words.contains("added `splay`"),
        "{words}"
    );
    let set = GestureSet::from_toml(&text, "taught.toml").expect("a gesture file");
    let hand = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/gestures/hand.toml");
    let marked = GestureSet::load(&hand).expect("bundled");
    let error = set.gestures[0].duration_s / marked.gestures[0].duration_s - 1.0;
    println!(
        "drum: {:.4} s, {:+.2} % of the marked one",
        set.gestures[0].duration_s,
        100.0 * error
    );
    assert!(error.abs() < 0.02, "{error}");
    assert_eq!(set.gestures[1].kind, GestureKind::NonCyclic);
    std::fs::remove_file(folder.path("taught.toml")).expect("written");
    assert_eq!(teach().2, text, "another result the second time");
}

/// The drumming hand with a pedal that is pressed for 50 ms at each of `presses`.
fn with_pedal(folder: &Folder, presses: &[f64]) -> String {
    let waiting = std::fs::read_to_string(performance("waiting.csv")).expect("bundled");
    let mut lines = waiting.lines();
    let mut text = format!("{},ch.pedal\n", lines.next().expect("a header"));
    for line in lines {
        let t: f64 = line
            .split(',')
            .next()
            .expect("a time")
            .parse()
            .expect("a number");
        let pressed = presses.iter().any(|at| (*at..at + 0.05).contains(&t));
        text += &format!("{line},{}\n", f64::from(u8::from(pressed)));
    }
    format!("file:{}", folder.write("pedal.csv", &text))
}

/// A hand that circles once a second for `seconds`, with a pedal as above.
fn circling(folder: &Folder, seconds: f64, presses: &[f64]) -> String {
    let mut text =
        "t,hip.x,hip.y,hip.z,head.x,head.y,head.z,hand.x,hand.y,hand.z,ch.pedal\n".to_owned();
    for k in 0..(50.0 * seconds) as u32 {
        let t = f64::from(k) / 50.0;
        let (sin, cos) = (std::f64::consts::TAU * t).sin_cos();
        let (x, y) = (0.3 + 0.2 * cos, 1.2 + 0.2 * sin);
        let pressed = presses.iter().any(|at| (*at..at + 0.05).contains(&t));
        let pedal = u8::from(pressed);
        text += &format!("{t:.2},0,0.9,0,0,1.6,0.05,{x:.5},{y:.5},0.2,{pedal}\n");
    }
    format!("file:{}", folder.write("circling.csv", &text))
}

#[test]
fn a_pedal_in_the_stream_marks_start_and_end() {
    let folder = Folder::empty();
    let input = with_pedal(&folder, &[0.5, 1.585]);
    let args = ["--speed", "max", "--mark-channel", "pedal"];
    define(&folder, &input, "drum", &args).expect(0);
    let set = GestureSet::load(&folder.path("taught.toml")).expect("a gesture file");
    let duration_s = set.gestures[0].duration_s;
    println!("between two presses: {duration_s:.3} s");
    assert!((duration_s - 1.085).abs() < 0.03, "{duration_s} s");
}

#[test]
fn a_gesture_that_reads_nothing_of_itself_is_not_written_without_force() {
    let folder = Folder::empty();
    // Two exactly equal periods marked as one: no linear map makes one turn of them.
    let input = circling(&folder, 4.0, &[1.0, 3.0]);
    let args = ["--speed", "max", "--mark-channel", "pedal"];
    let ended = define(&folder, &input, "drum", &args);
    println!("{}", ended.out);
    refused(ended, 2, &["not written", "--force"]);
    assert!(!folder.path("taught.toml").exists(), "written all the same");
    let forced = [&args[..], &["--force"]].concat();
    let ended = define(&folder, &input, "drum", &forced).expect(0);
    assert!(ended.out.contains("cannot work"), "{}", ended.out);
    assert!(folder.path("taught.toml").exists());
}

#[test]
fn a_twin_is_told_which_gesture_it_is_like() {
    let folder = Folder::empty();
    let args = ["--speed", "max", "--start-after", "0.5", "--force"];
    define(&folder, &source("waiting.csv"), "drum", &args).expect(0);
    let twin = define(&folder, &source("waiting.csv"), "twin", &args).expect(0);
    println!("{}", twin.out);
    assert!(
        twin.out.contains("`drum`") && twin.out.contains("more than two edges apart"),
        "{}",
        twin.out
    );
}

#[test]
fn keys_of_a_terminal_begin_and_keep_a_gesture() {
    use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
    let folder = Folder::empty();
    let keyboard = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY).expect("a pseudo-terminal");
    grantpt(&keyboard).expect("granted");
    unlockpt(&keyboard).expect("unlocked");
    let name = ptsname(&keyboard, Vec::new()).expect("its name");
    let terminal = std::fs::OpenOptions::new()
        .read(true)
        .write(true)
        .open(name.to_str().expect("plain"))
        .expect("the terminal");
    let mut child = Command::new(env!("CARGO_BIN_EXE_handwave"))
        .args([
            "gesture",
            "define",
            "--input",
            &circling(&folder, 60.0, &[]),
        ])
        .args(["--name", "circle"])
        .args(["--into", &folder.text("taught.toml")])
        .stdin(terminal)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the program starts");
    let press = |key: &[u8]| rustix::io::write(&keyboard, key).expect("a key");
    let mut err = BufReader::new(child.stderr.take().expect("piped"));
    let mut said = String::new();
    for (until, key) in [("space begins", &b" "[..]), ("keeps it", b"\x1b[6~")] {
        while !said.contains(until) {
            let before = said.len();
            err.read_line(&mut said).expect("text");
            assert!(said.len() > before, "no {until:?} in {said}");
        }
        press(key);
    }
    err.read_to_string(&mut said).expect("text");
    assert_eq!(child.wait().expect("a child").code(), Some(0), "{said}");
    let set = GestureSet::load(&folder.path("taught.toml")).expect("a gesture file");
    let duration_s = set.gestures[0].duration_s;
    assert!((duration_s - 1.0).abs() < 0.02, "{duration_s} s");
}

#[test]
fn a_gesture_is_taught_over_the_network_hands_free() {
    let folder = Folder::empty();
    let into = folder.text("taught.toml");
    let mut child = Command::new(env!("CARGO_BIN_EXE_handwave"))
        .args([
            "gesture",
            "define",
            "--input",
            "udp://127.0.0.1:0",
            "--name",
            "drum",
        ])
        .args(["--start-after", "0.3", "--into", &into])
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the program starts");
    let mut err = BufReader::new(child.stderr.take().expect("piped"));
    let mut line = String::new();
    err.read_line(&mut line).expect("a message");
    let address = line
        .trim()
        .rsplit("udp://")
        .next()
        .expect("an address")
        .to_owned();
    let socket = UdpSocket::bind("127.0.0.1:0").expect("a socket");
    let performance =
        std::fs::read_to_string(performance("drum_and_splay.jsonl")).expect("bundled");
    let lines: Vec<&str> = performance.lines().collect();
    let start = std::time::Instant::now();
    // The performance from 10 s on, where the hand drums, at most 20 s of it; paced as a tracker does.
    let time = |line: &str| -> f64 {
        let sample: serde_json::Value = serde_json::from_str(line).expect("a sample");
        sample["t"].as_f64().expect("a time")
    };
    for (k, line) in lines[1..]
        .iter()
        .filter(|l| (10.0..30.0).contains(&time(l)))
        .enumerate()
    {
        if k % 20 == 0 {
            let _ = socket.send_to(lines[0].as_bytes(), &address);
        }
        let _ = socket.send_to(line.as_bytes(), &address);
        if child.try_wait().expect("a child").is_some() {
            break;
        }
        let wait = time(line) - 10.0 - start.elapsed().as_secs_f64();
        std::thread::park_timeout(Duration::from_secs_f64(wait.clamp(0.0, 0.1)));
    }
    let taken = start.elapsed();
    // Whatever became of it, it does not wait for ever.
    let _ = child.kill();
    let status = child.wait().expect("a child");
    let mut said = String::new();
    err.read_to_string(&mut said).expect("text");
    assert_eq!(status.code(), Some(0), "after {taken:?}: {said}");
    let set = GestureSet::load(&folder.path("taught.toml")).expect("a gesture file");
    println!("taught in {taken:.1?}: {:.3} s", set.gestures[0].duration_s);
}
