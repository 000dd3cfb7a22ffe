//! Runs the `handwave` program: arguments in, exit code and texts out, never longer than a deadline.

use std::io::{BufRead, BufReader, Read};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// No run of the program may last longer.
pub const AT_MOST: Duration = Duration::from_secs(300);

/// A program that has ended.
#[derive(Debug)]
pub struct Ended {
    /// Exit code; `None` when a signal killed it.
    pub code: Option<i32>,
    pub out: String,
    pub err: String,
}

impl Ended {
    /// The one JSON object on standard output.
    pub fn json(&self) -> serde_json::Value {
        serde_json::from_str(&self.out)
            .unwrap_or_else(|e| panic!("{e} in {:?}; stderr: {}", self.out, self.err))
    }

    /// Fails unless the program ended with `code`; shows all it said.
    #[track_caller]
    pub fn expect(self, code: i32) -> Self {
        assert_eq!(self.code, Some(code), "{self:#?}");
        assert!(!self.err.contains("panicked"), "{self:#?}");
        self
    }
}

/// A program that runs; killed when dropped.
pub struct Running {
    child: Child,
    out: Option<JoinHandle<String>>,
    err: Option<JoinHandle<String>>,
}

impl Running {
    pub fn start(args: &[&str]) -> Self {
        Self::start_in(Path::new("."), args)
    }

    pub fn start_in(folder: &Path, args: &[&str]) -> Self {
        let mut running = Self::spawn(folder, args);
        let out = running.child.stdout.take().expect("piped");
        running.out = Some(drain(out));
        running
    }

    /// Starts the program and waits for its first line of output.
    pub fn start_and_hear(args: &[&str]) -> (Self, String) {
        let mut running = Self::spawn(Path::new("."), args);
        let mut out = BufReader::new(running.child.stdout.take().expect("piped"));
        let mut line = String::new();
        out.read_line(&mut line).expect("readable output");
        running.out = Some(drain(out));
        (running, line)
    }

    fn spawn(folder: &Path, args: &[&str]) -> Self {
        let mut child = Command::new(env!("CARGO_BIN_EXE_handwave"))
            .args(args)
            .current_dir(folder)
            // Runs that fail on purpose must not leave recordings of it about.
            .env("HANDWAVE_NO_DUMP", "1")
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("the program starts");
        let err = child.stderr.take().map(drain);
        Self {
            child,
            out: None,
            err,
        }
    }

    pub fn interrupt(&self) {
        self.signal(libc::SIGINT);
    }

    pub fn signal(&self, signal: i32) {
        let pid = i32::try_from(self.child.id()).expect("a process id");
        // SAFETY: sends a signal to a child of this process that was not waited for yet.
        #[allow(unsafe_code)]
        let sent = unsafe { libc::kill(pid, signal) };
        assert_eq!(sent, 0, "the signal was not sent");
    }

    /// kill -9.
    pub fn kill(&mut self) {
        self.child.kill().expect("a running child");
        self.child.wait().expect("an ended child");
    }

    /// Whether it has ended already.
    pub fn has_ended(&mut self) -> bool {
        self.child.try_wait().expect("a child").is_some()
    }

    /// Waits for the end, `at_most` this long.
    #[track_caller]
    pub fn wait(mut self, at_most: Duration) -> Ended {
        let deadline = Instant::now() + at_most;
        let status = loop {
            if let Some(status) = self.child.try_wait().expect("a child") {
                break status;
            }
            if Instant::now() > deadline {
                self.kill();
                let said = self.said();
                panic!("still running after {at_most:?}; it said {said:?}");
            }
            std::thread::park_timeout(Duration::from_millis(2));
        };
        let (out, err) = self.said();
        Ended {
            code: status.code(),
            out,
            err,
        }
    }

    fn said(&mut self) -> (String, String) {
        let text = |thread: Option<JoinHandle<String>>| {
            thread.map_or(String::new(), |t| t.join().expect("a reader"))
        };
        (text(self.out.take()), text(self.err.take()))
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn drain(mut from: impl Read + Send + 'static) -> JoinHandle<String> {
    std::thread::spawn(move || {
        let mut text = String::new();
        from.read_to_string(&mut text).expect("text");
        text
    })
}

/// Runs the program to its end.
#[track_caller]
pub fn handwave(args: &[&str]) -> Ended {
    Running::start(args).wait(AT_MOST)
}

/// Asks again and again until `answer` gives something; fails after `at_most`.
#[track_caller]
pub fn wait_for<T>(what: &str, at_most: Duration, mut answer: impl FnMut() -> Option<T>) -> T {
    let deadline = Instant::now() + at_most;
    loop {
        if let Some(found) = answer() {
            return found;
        }
        assert!(Instant::now() < deadline, "waited {at_most:?} for {what}");
        std::thread::park_timeout(Duration::from_millis(5));
    }
}

/// Fails unless the program refused with `code` and said all of `parts`, without starting a run.
#[track_caller]
pub fn refused(ended: Ended, code: i32, parts: &[&str]) {
    let ended = ended.expect(code);
    for part in parts {
        assert!(ended.err.contains(part), "no {part:?} in: {}", ended.err);
    }
    assert!(
        ended.err.len() < 1500,
        "a message this long is not read: {}",
        ended.err
    );
}

/// `handwave run` in virtual time.
#[track_caller]
pub fn run_virtual(args: &[&str]) -> Ended {
    let all = [&["run", "--headless", "--speed", "max"], args].concat();
    handwave(&all)
}
