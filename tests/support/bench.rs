//! A bench with servos in the making: a simulator with a hand at its servos, and commands that ask questions.

use super::folder::Folder;
use std::io::{BufRead, BufReader, Read, Write};
use std::process::{Child, ChildStderr, ChildStdin, Command, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::time::{Duration, Instant};

/// No question is waited for longer.
const AT_MOST: Duration = Duration::from_secs(60);

/// `handwave sim dynamixel`, and what is typed into it.
pub struct Bench {
    process: Child,
    hand: ChildStdin,
    murmur: BufReader<ChildStderr>,
    pub folder: Folder,
    /// For BUS, without a rate.
    pub bus: String,
}

impl Bench {
    /// Servos such as `1-4`, with more options such as `--factory`; `configs` are copied beside them.
    pub fn start(servos: &str, more: &[&str]) -> Self {
        let folder = Folder::of_configs();
        let link = folder.text("servos_line");
        let mut process = Command::new(env!("CARGO_BIN_EXE_handwave"))
            .args(["sim", "dynamixel", "--servos", servos, "--link", &link])
            .args(more)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("the simulator starts");
        let mut line = String::new();
        BufReader::new(process.stdout.take().expect("piped"))
            .read_line(&mut line)
            .expect("it says when it is ready");
        assert!(line.starts_with("ready "), "the simulator says {line:?}");
        Self {
            hand: process.stdin.take().expect("piped"),
            murmur: BufReader::new(process.stderr.take().expect("piped")),
            process,
            folder,
            bus: format!("dynamixel:{link}"),
        }
    }

    /// Does something with a servo, such as `plug 2` or `turn 11 -30`, and waits until it is done.
    #[track_caller]
    pub fn hand(&mut self, line: &str) {
        // Lines are obeyed in order, and one that is no command is complained of.
        writeln!(self.hand, "{line}\ndone?").expect("a running simulator");
        let mut heard = String::new();
        while !heard.contains("done?") {
            heard.clear();
            let count = self.murmur.read_line(&mut heard).expect("text");
            assert!(count > 0, "the simulator has ended");
        }
    }

    /// Plugs a servo in and waits until one answers at `id` and `baud`.
    #[track_caller]
    pub fn plug(&mut self, label: u8, id: u8, baud: u32) {
        self.hand(&format!("plug {label}"));
        let (id, bus) = (id.to_string(), format!("{}@{baud}", self.bus));
        let begin = Instant::now();
        while self.run(&["bus", "ping", &bus, &id]).code != Some(0) {
            assert!(begin.elapsed() < AT_MOST, "servo {label} does not come up");
        }
    }

    /// Runs a command to its end in the folder of the configurations, nobody at its keys.
    pub fn run(&self, args: &[&str]) -> Told {
        self.ask(args).end()
    }

    /// Starts a command that asks questions.
    pub fn ask(&self, args: &[&str]) -> Asking {
        let mut process = Command::new(env!("CARGO_BIN_EXE_handwave"))
            .args(args)
            .current_dir(self.folder.path("."))
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("the program starts");
        let (sender, said) = channel();
        let mut out = process.stdout.take().expect("piped");
        std::thread::spawn(move || {
            let mut chunk = [0; 4096];
            while let Ok(count) = out.read(&mut chunk) {
                if count == 0 || sender.send(chunk[..count].to_vec()).is_err() {
                    break;
                }
            }
        });
        Asking {
            answers: process.stdin.take(),
            process,
            said,
            text: String::new(),
            read: 0,
        }
    }

    /// A register of servo `id` at 1 Mbaud.
    #[track_caller]
    pub fn register(&self, id: u8, name: &str) -> i64 {
        self.register_at(&self.bus, id, name)
    }

    /// A register of servo `id` on `bus`. A machine that is busy otherwise may take more than one try.
    #[track_caller]
    pub fn register_at(&self, bus: &str, id: u8, name: &str) -> i64 {
        let id = id.to_string();
        let begin = Instant::now();
        loop {
            let told = self.run(&["bus", "read", bus, &id, name, "--json"]);
            if let Ok(row) = serde_json::from_str::<serde_json::Value>(&told.out) {
                return row["value"].as_i64().expect("a number");
            }
            assert!(begin.elapsed() < AT_MOST, "{name} of servo {id}: {told:?}");
        }
    }

    /// Present position of servo `id`, in pulses, once it is within `slack` of `pulse`.
    #[track_caller]
    pub fn wait_for_position(&self, id: u8, pulse: i64, slack: i64) {
        let begin = Instant::now();
        loop {
            let now = self.register(id, "present_position");
            if (now - pulse).abs() <= slack {
                return;
            }
            assert!(
                begin.elapsed() < AT_MOST,
                "servo {id} stays at {now}, not {pulse}"
            );
        }
    }
}

impl Drop for Bench {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

/// A command that has ended.
#[derive(Debug)]
pub struct Told {
    pub code: Option<i32>,
    pub out: String,
    pub err: String,
}

impl Told {
    /// Fails unless it ended with `code` and said all of `parts`.
    #[track_caller]
    pub fn expect(self, code: i32, parts: &[&str]) -> Self {
        assert_eq!(self.code, Some(code), "{self:#?}");
        assert!(!self.err.contains("panicked"), "{self:#?}");
        for part in parts {
            let said = self.out.contains(part) || self.err.contains(part);
            assert!(said, "no {part:?} in {self:#?}");
        }
        self
    }
}

/// A command that runs and asks.
pub struct Asking {
    pub process: Child,
    answers: Option<ChildStdin>,
    said: Receiver<Vec<u8>>,
    text: String,
    read: usize,
}

impl Asking {
    /// Waits until it has said `what`, after what was waited for before.
    #[track_caller]
    pub fn hear(&mut self, what: &str) {
        self.hear_one_of(&[what]);
    }

    /// Waits until it has said one of `all`; says which came first.
    #[track_caller]
    pub fn hear_one_of(&mut self, all: &[&str]) -> usize {
        let begin = Instant::now();
        let what = all.join("\" or \"");
        loop {
            let new = &self.text[self.read..];
            let seen = all
                .iter()
                .enumerate()
                .filter_map(|(i, what)| Some((new.find(what)?, i)));
            if let Some((at, which)) = seen.min() {
                self.read += at + all[which].len();
                return which;
            }
            let left = AT_MOST.saturating_sub(begin.elapsed());
            match self.said.recv_timeout(left) {
                Ok(bytes) => self.text.push_str(&String::from_utf8_lossy(&bytes)),
                Err(RecvTimeoutError::Timeout) => {
                    panic!("no {what:?} in {AT_MOST:?}: {}", self.text)
                }
                Err(RecvTimeoutError::Disconnected) => {
                    let mut err = String::new();
                    if let Some(mut pipe) = self.process.stderr.take() {
                        let _ = pipe.read_to_string(&mut err);
                    }
                    panic!("ended before {what:?}: {} {err}", self.text);
                }
            }
        }
    }

    /// Types a line.
    pub fn answer(&mut self, line: &str) {
        let keys = self.answers.as_mut().expect("not hung up");
        writeln!(keys, "{line}").expect("a running command");
    }

    /// Ctrl-C.
    pub fn interrupt(&self) {
        let pid = i32::try_from(self.process.id()).expect("a process id");
        // SAFETY: sends a signal to a child of this process that was not waited for yet.
        #[allow(unsafe_code)]
        let sent = unsafe { libc::kill(pid, libc::SIGINT) };
        assert_eq!(sent, 0, "the signal was not sent");
    }

    /// Hangs up the keys and waits for the end.
    #[track_caller]
    pub fn end(mut self) -> Told {
        drop(self.answers.take());
        self.finish()
    }

    /// Waits for the end, the keys still there.
    #[track_caller]
    pub fn finish(mut self) -> Told {
        let mut err = String::new();
        let mut pipe = self.process.stderr.take().expect("piped");
        // Standard output is drained by its own thread.
        pipe.read_to_string(&mut err).expect("text");
        while let Ok(bytes) = self.said.recv() {
            self.text.push_str(&String::from_utf8_lossy(&bytes));
        }
        let status = self.process.wait().expect("a child");
        Told {
            code: status.code(),
            out: std::mem::take(&mut self.text),
            err,
        }
    }
}

impl Drop for Asking {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

/// Answers the questions of a calibration of `joint` whose servo is mounted with `sign` against the configuration's.
#[track_caller]
pub fn teach(bench: &mut Bench, asking: &mut Asking, id: u8, sign: i32, ends: (i32, i32)) {
    let mut turn = |degrees: i32| bench.hand(&format!("turn {id} {}", sign * degrees));
    asking.hear("skips this joint): ");
    asking.answer("");
    asking.hear("Then Enter: ");
    turn(20);
    asking.answer("");
    if sign < 0 {
        asking.hear("the configuration says +1. To be sure");
        asking.hear("then Enter: ");
        turn(-20);
        asking.answer("");
        asking.hear("Then Enter: ");
        turn(20);
        asking.answer("");
    }
    asking.hear("press Enter (k");
    turn(ends.1 - 20);
    turn(ends.0 - ends.1);
    turn(-ends.0);
    asking.answer("");
    asking.hear("range is");
}
