//! Live pose input: datagrams and pipes as lines for a pose reader, interruptible at any time.

use super::stop::{StopRequest, StopSwitch};
use crate::base::print::warn;
use crate::pose::{MAX_LINE_BYTES, json};
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use std::io::{self, BufRead, Read};
use std::net::UdpSocket;
use std::os::fd::AsFd;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Duration;

/// A wait for input is looked up from this often, so that a run can end.
const LOOK_UP: Duration = Duration::from_millis(50);
/// After this many samples without a header the user is told.
const TELL_AFTER: u64 = 30;

/// Ends a live input from outside: its reader then sees the end of the input within 50 ms.
#[derive(Clone, Debug, Default)]
pub struct Hangup {
    closed: Arc<AtomicBool>,
    stop: StopSwitch,
    headless: Arc<AtomicU64>,
}

impl Hangup {
    /// A hang-up that also happens when `stop` is pressed.
    pub fn new(stop: &StopSwitch) -> Self {
        Self {
            stop: stop.clone(),
            ..Self::default()
        }
    }

    /// Ends the input.
    pub fn close(&self) {
        self.closed.store(true, Ordering::Relaxed);
    }

    /// Whether the input is to end.
    pub fn is_over(&self) -> bool {
        self.closed.load(Ordering::Relaxed) || self.stop.request() != StopRequest::None
    }

    /// Datagrams that came before the first header and so could not be understood.
    pub fn before_header(&self) -> u64 {
        self.headless.load(Ordering::Relaxed)
    }
}

/// A UDP socket as lines: one or more JSON objects a datagram, each on a line.
///
/// Datagrams before the first header are dropped and counted: a receiver may come late, when the sender
/// repeats its header. Memory is bounded by one datagram.
#[derive(Debug)]
pub struct DatagramInput {
    socket: UdpSocket,
    hangup: Hangup,
    bytes: Vec<u8>,
    at: usize,
    end: usize,
    header_seen: bool,
}

impl DatagramInput {
    /// Lines of the datagrams that `socket` receives.
    ///
    /// # Errors
    /// Those of setting the socket's timeout.
    pub fn new(socket: UdpSocket, hangup: Hangup) -> io::Result<Self> {
        socket.set_read_timeout(Some(LOOK_UP))?;
        Ok(Self {
            socket,
            hangup,
            // One more byte than a good line has, which tells an oversized one, and its line end.
            bytes: vec![0; MAX_LINE_BYTES + 2],
            at: 0,
            end: 0,
            header_seen: false,
        })
    }

    /// Takes the next datagram that is worth reading; false when the input is over.
    fn receive(&mut self) -> io::Result<bool> {
        loop {
            if self.hangup.is_over() {
                return Ok(false);
            }
            let room = self.bytes.len() - 1;
            let count = match self.socket.recv(&mut self.bytes[..room]) {
                Ok(count) => count,
                Err(error) if is_passing(error.kind()) => continue,
                Err(error) => return Err(error),
            };
            if count == 0 {
                continue;
            }
            if !self.header_seen {
                self.header_seen = std::str::from_utf8(&self.bytes[..count])
                    .is_ok_and(|text| text.lines().next().is_some_and(json::looks_like_header));
                if !self.header_seen {
                    let before = self.hangup.headless.fetch_add(1, Ordering::Relaxed);
                    if before + 1 == TELL_AFTER {
                        warn(format_args!(
                            "{TELL_AFTER} datagrams came without a header; the sender must send {{\"handwave\":\"poses\",...}} first, and better every second, since datagrams get lost"
                        ));
                    }
                    continue;
                }
            }
            self.at = 0;
            self.end = count;
            if self.bytes[count - 1] != b'\n' {
                self.bytes[count] = b'\n';
                self.end += 1;
            }
            return Ok(true);
        }
    }
}

/// Errors after which a socket goes on.
fn is_passing(kind: io::ErrorKind) -> bool {
    matches!(
        kind,
        io::ErrorKind::WouldBlock
            | io::ErrorKind::TimedOut
            | io::ErrorKind::Interrupted
            | io::ErrorKind::ConnectionRefused
            | io::ErrorKind::ConnectionReset
    )
}

impl Read for DatagramInput {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        let count = self.fill_buf()?.read(out)?;
        self.consume(count);
        Ok(count)
    }
}

impl BufRead for DatagramInput {
    fn fill_buf(&mut self) -> io::Result<&[u8]> {
        if self.at == self.end && !self.receive()? {
            return Ok(&[]);
        }
        Ok(&self.bytes[self.at..self.end])
    }

    fn consume(&mut self, count: usize) {
        self.at = (self.at + count).min(self.end);
    }
}

/// A pipe (standard input) that gives up waiting when it is hung up.
#[derive(Debug)]
pub struct PipeInput<P> {
    pipe: P,
    hangup: Hangup,
}

impl<P: Read + AsFd> PipeInput<P> {
    /// Reads `pipe` until its end or the hang-up.
    pub fn new(pipe: P, hangup: Hangup) -> Self {
        Self { pipe, hangup }
    }
}

impl<P: Read + AsFd> Read for PipeInput<P> {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        while !self.hangup.is_over() {
            if is_readable(self.pipe.as_fd(), LOOK_UP)? {
                return self.pipe.read(out);
            }
        }
        Ok(0)
    }
}

/// Whether something (or the end) can be read from `fd` within `wait`.
pub(crate) fn is_readable(fd: impl AsFd, wait: Duration) -> io::Result<bool> {
    let timeout = Timespec {
        tv_sec: i64::try_from(wait.as_secs()).unwrap_or(i64::MAX),
        tv_nsec: wait.subsec_nanos().into(),
    };
    let mut fds = [PollFd::new(&fd, PollFlags::IN)];
    match poll(&mut fds, Some(&timeout)) {
        Ok(count) => Ok(count > 0),
        Err(rustix::io::Errno::INTR) => Ok(false),
        Err(error) => Err(error.into()),
    }
}
