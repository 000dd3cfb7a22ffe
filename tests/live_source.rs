//! Live pose sources: datagrams and pipes drive a run as they arrive, whatever else arrives with them.

mod support;

use handwave::live::feed::SenderClock;
use handwave::pose::{PoseFormat, PoseReader, PoseSample};
use std::io::{BufRead, BufReader, Read, Write};
use std::net::UdpSocket;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use support::program::{handwave, refused};

fn at(times: &[f64]) -> Vec<PoseSample> {
    let sample = |t: &f64| PoseSample {
        t: *t,
        ..PoseSample::default()
    };
    times.iter().map(sample).collect()
}

#[test]
fn a_senders_clock_is_found_through_jitter_drift_and_restarts() {
    // A sender at 60 Hz whose clock runs 200 ppm slow; every sample is 2 to 42 ms under way.
    let mut clock = SenderClock::default();
    let mut state: u64 = 1;
    let mut random = || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        (state >> 33) as f64 / (1u64 << 31) as f64
    };
    let (mut worst_ms, mut latest) = (0.0_f64, 0.0_f64);
    let mut arrivals: Vec<(f64, f64)> = (0..60_000)
        .map(|k| {
            let sent = f64::from(k) / 60.0;
            (sent + 0.002 + 0.04 * random(), sent)
        })
        .collect();
    arrivals.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut last_sent = -1.0;
    for (arrived, sent) in arrivals {
        // Overtaken ones are dropped by the reader before they come here.
        if sent <= last_sent {
            continue;
        }
        last_sent = sent;
        let stamp = 1e6 + sent * (1.0 - 200e-6);
        let now = (arrived * 200.0).ceil() / 200.0;
        let mut samples = at(&[stamp]);
        clock.map(now, &mut samples);
        let error_ms = 1e3 * (samples[0].t - (sent + 0.002));
        assert!(samples[0].t <= now, "a sample from the future");
        if sent > 2.0 {
            worst_ms = worst_ms.max(error_ms.abs());
        }
        latest = samples[0].t;
    }
    println!("worst error after two seconds: {worst_ms:.2} ms");
    assert!(worst_ms < 8.0, "{worst_ms} ms");
    // The sender starts again: its clock is at zero.
    let mut samples = at(&[0.5, 0.516, 0.533]);
    clock.map(latest + 0.3, &mut samples);
    assert!((samples[2].t - (latest + 0.3)).abs() < 1e-9, "{samples:?}");
    assert!(samples[0].t > latest, "time went on");
    // Within one batch as well.
    let mut samples = at(&[0.55, 0.1, 0.116]);
    clock.map(latest + 0.4, &mut samples);
    assert!((samples[2].t - (latest + 0.4)).abs() < 1e-9, "{samples:?}");
}

/// The times that a tolerant reader lets pass, or its error.
fn tolerated(lines: &[String]) -> (Vec<f64>, u64, Option<String>) {
    let header = r#"{"handwave":"poses","version":1,"points":["a"]}"#;
    let text = format!("{header}\n{}\n", lines.join("\n"));
    let input = std::io::Cursor::new(text.into_bytes());
    let mut reader = PoseReader::new(input, PoseFormat::JsonLines, "sender")
        .expect("a header")
        .tolerant();
    let (mut passed, mut error) = (Vec::new(), None);
    for sample in &mut reader {
        match sample {
            Ok(sample) => passed.push(sample.t),
            Err(e) => error = Some(e.to_string()),
        }
    }
    (passed, reader.counts().total(), error)
}

fn line(t: f64) -> String {
    format!("{{\"t\":{t},\"p\":[[0.1,0.2,0.3]]}}")
}

#[test]
fn a_live_reader_forgives_what_ends_a_file_but_not_a_stranger() {
    let good = |from: f64, count: u32| (0..count).map(move |k| line(from + f64::from(k) * 0.02));
    let junk = |count: usize| std::iter::repeat_n("{\"t\":0,".to_owned(), count);
    // Thirty bad ones in a row from a sender that was good for a second.
    let lines: Vec<String> = good(0.0, 60).chain(junk(30)).chain(good(2.0, 60)).collect();
    let (passed, dropped, error) = tolerated(&lines);
    assert_eq!((passed.len(), dropped, error), (120, 30, None));
    // Started again with its clock at zero: one sample.
    let lines: Vec<String> = good(500.0, 60).chain(good(0.0, 60)).collect();
    let (passed, dropped, error) = tolerated(&lines);
    assert_eq!((passed.len(), dropped, error), (119, 1, None));
    // Overtaken datagrams are late, not a new clock.
    let mut lines: Vec<String> = good(5.0, 100).collect();
    lines.swap(70, 73);
    let (passed, dropped, error) = tolerated(&lines);
    assert_eq!((passed.len(), dropped, error), (97, 3, None));
    // What never spoke the format is told so.
    for stranger in [
        junk(12).collect::<Vec<_>>(),
        (0..12).map(|k| line(f64::from(k) * 33_333.0)).collect(),
    ] {
        let (_, _, error) = tolerated(&stranger);
        assert!(
            error.is_some_and(|e| e.contains("10 bad samples in a row")),
            "{stranger:?}"
        );
    }
}

#[test]
fn what_cannot_be_a_live_source_is_refused() {
    let run = |more: &[&str]| handwave(&[&["run", "--headless"], more].concat());
    for source in ["udp://127.0.0.1:0", "-", "file:-"] {
        refused(
            run(&["--speed", "max", "--input", source]),
            2,
            &["--speed max", source, "live"],
        );
    }
    for source in ["udp://nowhere", "udp://", "udp://127.0.0.1:99999"] {
        refused(
            run(&["--input", source]),
            2,
            &[source, "udp://ADDRESS:PORT"],
        );
    }
    // An address of nobody on this machine (TEST-NET-1).
    refused(
        run(&["--input", "udp://192.0.2.1:7000"]),
        2,
        &["cannot listen"],
    );
    refused(
        run(&["--input", "upd://7000"]),
        2,
        &["unknown pose source", "udp://"],
    );
}

/// The program with a pipe to its input; killed when dropped.
struct Live {
    child: Child,
    err: BufReader<std::process::ChildStderr>,
}

impl Drop for Live {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

impl Live {
    fn start(args: &[&str]) -> Self {
        let mut child = Command::new(env!("CARGO_BIN_EXE_handwave"))
            .args(args)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("the program starts");
        let err = BufReader::new(child.stderr.take().expect("piped"));
        Self { child, err }
    }

    /// The address it listens on, from its first message.
    fn address(&mut self) -> String {
        let mut line = String::new();
        self.err.read_line(&mut line).expect("a message");
        let (_, address) = line
            .trim()
            .split_once("udp://")
            .unwrap_or_else(|| panic!("{line:?}"));
        address.to_owned()
    }

    /// Exit code and both outputs; the outputs end when the program does.
    fn end(mut self) -> (Option<i32>, String, String) {
        drop(self.child.stdin.take());
        let (mut out, mut err) = (String::new(), String::new());
        let mut stdout = self.child.stdout.take().expect("piped");
        stdout.read_to_string(&mut out).expect("text");
        self.err.read_to_string(&mut err).expect("text");
        (self.child.wait().expect("a child").code(), out, err)
    }
}

fn configs(part: &str) -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("configs")
        .join(part)
}

#[test]
fn ctrl_c_ends_the_wait_for_poses() {
    for source in ["udp://127.0.0.1:0", "-"] {
        let mut live = Live::start(&["run", "--headless", "--input", source]);
        if source == "-" {
            // Half a header: from here on it listens for signals and waits.
            let stdin = live.child.stdin.as_mut().expect("piped");
            let half = [b' '; 100_000];
            // Returns when most of it was read, which needs the signals to be in place.
            stdin.write_all(&half[..]).expect("read by the program");
        } else {
            live.address();
        }
        let pid = i32::try_from(live.child.id()).expect("a process id");
        // SAFETY: sends a signal to a child of this process that was not waited for yet.
        #[allow(unsafe_code)]
        let sent = unsafe { libc::kill(pid, libc::SIGINT) };
        assert_eq!(sent, 0);
        let stdin = live.child.stdin.take();
        let (code, _, err) = live.end();
        drop(stdin);
        assert_eq!(code, Some(130), "{source}: {err}");
    }
}

#[test]
fn datagrams_drive_a_run_with_junk_between_them_and_a_sender_that_starts_again() {
    let mut live = Live::start(&[
        "run",
        "--headless",
        "--json",
        "--input",
        "udp://127.0.0.1:0",
        "--duration",
        "9",
    ]);
    let address = live.address();
    let text =
        std::fs::read_to_string(configs("performances/drum_and_splay.jsonl")).expect("bundled");
    let done = AtomicBool::new(false);
    let (code, out, err) = std::thread::scope(|scope| {
        scope.spawn(|| {
            let socket = UdpSocket::bind("127.0.0.1:0").expect("a socket");
            let send = |bytes: &[u8]| {
                // Refused once the program has ended.
                let _ = socket.send_to(bytes, &address);
            };
            let mut lines = text.lines();
            let header = lines.next().expect("a header");
            let samples: Vec<&str> = lines.collect();
            let time = |line: &str| -> f64 {
                let sample: serde_json::Value = serde_json::from_str(line).expect("a sample");
                sample["t"].as_f64().expect("a time")
            };
            // A sample before the header cannot be understood; the program waits on.
            send(samples[0].as_bytes());
            let (start, mut base) = (Instant::now(), 0.0);
            let mut next = 0;
            while !done.load(Ordering::Relaxed) && start.elapsed() < Duration::from_secs(60) {
                let elapsed = start.elapsed().as_secs_f64();
                if elapsed - base > 4.0 {
                    // The sender starts again, with its clock at zero.
                    (base, next) = (elapsed, 0);
                }
                if next % 30 == 0 {
                    send(header.as_bytes());
                }
                if next % 100 == 50 {
                    send(b"{\"t\": never}");
                    send(&vec![b'x'; 65_000]);
                }
                if let Some(line) = samples.get(next) {
                    send(line.as_bytes());
                    next += 1;
                    let due = base + samples.get(next).map_or(1e9, |line| time(line));
                    let wait = due - start.elapsed().as_secs_f64();
                    std::thread::park_timeout(Duration::from_secs_f64(wait.clamp(0.0, 0.1)));
                }
            }
        });
        let ended = live.end();
        done.store(true, Ordering::Relaxed);
        ended
    });
    assert_eq!(code, Some(0), "{err}");
    let summary: serde_json::Value = serde_json::from_str(&out).expect("one object");
    let count = |value: &serde_json::Value| value.as_u64().unwrap_or(0);
    println!("{summary}");
    let dropped = &summary["samples_dropped"];
    assert!(count(&summary["samples"]) > 300, "{summary}");
    assert!(
        (2..200).contains(&count(&dropped["malformed"])),
        "{dropped}"
    );
    assert!(count(&dropped["time_backwards"]) <= 20, "{dropped}");
    assert_eq!(count(&dropped["before_header"]), 1, "{dropped}");
    assert!(count(&summary["samples_refused"]) < 20, "{summary}");
    assert_eq!(summary["poses_lost_cycles"], 0, "{summary}");
}

#[test]
fn a_pipe_is_played_to_its_end_in_both_formats() {
    for name in [
        "performances/waiting.csv",
        "performances/drum_and_splay.jsonl",
    ] {
        let mut live = Live::start(&[
            "run",
            "--headless",
            "--json",
            "--input",
            "-",
            "--duration",
            "4",
        ]);
        let text = std::fs::read(configs(name)).expect("bundled");
        let mut stdin = live.child.stdin.take().expect("piped");
        std::thread::spawn(move || {
            // The program may end before it has read all.
            let _ = stdin.write_all(&text);
        });
        let (code, out, err) = live.end();
        assert_eq!(code, Some(0), "{name}: {err}");
        let summary: serde_json::Value = serde_json::from_str(&out).expect("one object");
        assert!(summary["samples"].as_u64() > Some(200), "{name}: {summary}");
        assert_eq!(summary["samples_dropped"], serde_json::json!({}), "{name}");
    }
}
