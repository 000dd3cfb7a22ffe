//! A real serial port (or pseudo-terminal) with deadlines finer than a millisecond.

use super::address::BusAddress;
use super::port::{Port, PortError};
use crate::base::{Clock, Time};
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use serialport::{ClearBuffer, ErrorKind, SerialPort as _, TTYPort};
use std::fs;
use std::io::{self, Read, Write};
use std::os::fd::{AsRawFd, BorrowedFd};
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

/// How long one write may take before the port counts as gone: far beyond any frame's time.
const WRITE_TIMEOUT: Duration = Duration::from_millis(500);

/// An open serial port.
pub struct SerialPort {
    tty: TTYPort,
    name: String,
    baud: u32,
    clock: Arc<dyn Clock>,
    latency_timer: Option<Duration>,
}

impl SerialPort {
    /// Opens `path` for this process alone at `baud` bits per second, 8N1, raw.
    ///
    /// `clock` is the time of the deadlines; it must run in real time.
    pub fn open(path: &str, baud: u32, clock: Arc<dyn Clock>) -> Result<Self, PortError> {
        let tty = serialport::new(path, baud)
            .timeout(WRITE_TIMEOUT)
            .open_native()
            .map_err(|error| open_error(path, baud, &error))?;
        let mut port = SerialPort {
            tty,
            name: path.into(),
            baud,
            clock,
            latency_timer: lower_latency_timer(path),
        };
        // Direction control of some adapters hangs on RTS; pseudo-terminals have no such lines.
        let _ = port.tty.write_request_to_send(false);
        port.discard_input()?;
        Ok(port)
    }

    /// How long a USB adapter keeps received bytes back before it sends them on, where it has such a timer.
    ///
    /// Opening the port tries to set it to 1 ms, which takes the right to write its file in `/sys`.
    pub fn latency_timer(&self) -> Option<Duration> {
        self.latency_timer
    }

    fn gone(&self, reason: impl ToString) -> PortError {
        PortError::Gone {
            port: self.name.clone(),
            reason: reason.to_string(),
        }
    }

    /// Waits for input until `deadline`; false when it passed. At least one look is taken.
    fn wait_readable(&self, deadline: Time) -> Result<bool, PortError> {
        // The descriptor is that of `self.tty`, which stays open at least as long as `self` is borrowed.
        #[allow(unsafe_code)] // `TTYPort` gives its descriptor only as a number.
        let fd = unsafe { BorrowedFd::borrow_raw(self.tty.as_raw_fd()) };
        loop {
            let left = deadline.saturating_since(self.clock.now());
            let timeout = Timespec {
                tv_sec: i64::try_from(left.as_secs()).unwrap_or(i64::MAX),
                tv_nsec: left.subsec_nanos().into(),
            };
            let mut fds = [PollFd::new(&fd, PollFlags::IN)];
            match poll(&mut fds, Some(&timeout)) {
                Ok(0) => return Ok(false),
                Ok(_) if fds[0].revents().contains(PollFlags::IN) => return Ok(true),
                // Hang-up or error without anything left to read.
                Ok(_) => return Err(self.gone("the other end hung up")),
                Err(rustix::io::Errno::INTR) => {}
                Err(error) => return Err(self.gone(error)),
            }
        }
    }
}

impl Port for SerialPort {
    fn name(&self) -> &str {
        &self.name
    }

    fn baud(&self) -> u32 {
        self.baud
    }

    fn set_baud(&mut self, baud: u32) -> Result<(), PortError> {
        self.tty
            .set_baud_rate(baud)
            .map_err(|error| PortError::Baud {
                port: self.name.clone(),
                baud,
                reason: error.to_string(),
            })?;
        self.baud = baud;
        Ok(())
    }

    fn now(&self) -> Time {
        self.clock.now()
    }

    fn write_all(&mut self, bytes: &[u8]) -> Result<(), PortError> {
        self.tty
            .write_all(bytes)
            .map_err(|error| self.gone(format!("writing failed ({error})")))
    }

    fn read(&mut self, buf: &mut [u8], want: usize, deadline: Time) -> Result<usize, PortError> {
        let want = want.min(buf.len());
        let mut filled = 0;
        while filled < want && self.wait_readable(deadline)? {
            match self.tty.read(&mut buf[filled..]) {
                Ok(0) => return Err(self.gone("end of file")),
                Ok(count) => filled += count,
                Err(error) if is_passing(&error) => {}
                Err(error) => return Err(self.gone(error)),
            }
        }
        Ok(filled)
    }

    fn discard_input(&mut self) -> Result<(), PortError> {
        self.tty
            .clear(ClearBuffer::Input)
            .map_err(|error| self.gone(error))
    }

    fn latency_timer(&self) -> Option<Duration> {
        self.latency_timer
    }
}

/// Sets the latency timer of an FTDI-class adapter to 1 ms if allowed, and says what it is then.
fn lower_latency_timer(path: &str) -> Option<Duration> {
    // The device may be named by a link, such as one in /dev/serial/by-id.
    let device = fs::canonicalize(path).ok()?;
    let timer = Path::new("/sys/class/tty")
        .join(device.file_name()?)
        .join("device/latency_timer");
    let read = || fs::read_to_string(&timer).ok()?.trim().parse().ok();
    let millis: u64 = read()?;
    if millis > 1 && fs::write(&timer, "1").is_ok() {
        return read().map(Duration::from_millis);
    }
    Some(Duration::from_millis(millis))
}

fn is_passing(error: &io::Error) -> bool {
    matches!(
        error.kind(),
        io::ErrorKind::Interrupted | io::ErrorKind::WouldBlock | io::ErrorKind::TimedOut
    )
}

/// Says what stands in the way and what to do about it.
fn open_error(path: &str, baud: u32, error: &serialport::Error) -> PortError {
    let list = BusAddress::Dynamixel {
        path: path.into(),
        baud,
        backend: Default::default(),
    };
    let (reason, advice) = match error.kind {
        ErrorKind::Io(io::ErrorKind::NotFound) => (
            "no such file".into(),
            "Is the adapter plugged in? `ls /dev/ttyUSB* /dev/ttyACM* /dev/serial/by-id/*` lists \
             the serial ports; a simulated chain is made by `handwave sim dynamixel`"
                .into(),
        ),
        ErrorKind::Io(io::ErrorKind::PermissionDenied) => (
            "permission denied".into(),
            "Add yourself to the group that owns the port, on most systems \
             `sudo usermod -aG dialout $USER`, then log in again"
                .into(),
        ),
        ErrorKind::NoDevice | ErrorKind::Io(io::ErrorKind::WouldBlock) => (
            format!("busy or gone ({error})"),
            format!("Another program has it open: `fuser {path}` names it. Close it and try again"),
        ),
        _ => (
            error.to_string(),
            format!("Is it a serial port? `handwave bus scan {list}` expects one"),
        ),
    };
    PortError::Open {
        port: path.into(),
        reason,
        advice,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Instant;

    struct WallClock(Instant);

    impl Clock for WallClock {
        fn now(&self) -> Time {
            Time::ZERO + self.0.elapsed()
        }
        fn sleep_until(&self, time: Time) {
            std::thread::sleep(time.saturating_since(self.now()));
        }
    }

    fn pair() -> (TTYPort, SerialPort) {
        let (master, slave) = TTYPort::pair().expect("a pseudo-terminal pair");
        let name = slave.name().expect("the slave has a name");
        // The pair holds its slave exclusively.
        drop(slave);
        let clock = Arc::new(WallClock(Instant::now()));
        let port = SerialPort::open(&name, 1_000_000, clock).expect("the slave opens");
        (master, port)
    }

    #[test]
    fn bytes_pass_and_silence_ends_at_the_deadline() {
        let (mut master, mut port) = pair();
        port.write_all(&[1, 2, 3]).expect("writing");
        let mut buf = [0; 8];
        master
            .read_exact(&mut buf[..3])
            .expect("the other end reads");
        assert_eq!(buf[..3], [1, 2, 3]);

        master
            .write_all(&[0xFF, 0x11, 0x13, 0x04, 0x0D])
            .expect("the other end writes");
        let soon = port.now() + Duration::from_secs(2);
        assert_eq!(port.read(&mut buf, 5, soon).expect("reading"), 5);
        assert_eq!(
            buf[..5],
            [0xFF, 0x11, 0x13, 0x04, 0x0D],
            "control bytes pass unchanged"
        );

        let deadline = port.now() + Duration::from_micros(700);
        assert_eq!(
            port.read(&mut buf, 1, deadline)
                .expect("silence is no error"),
            0
        );
        assert!(
            port.now() >= deadline,
            "gave up {:?} before the deadline",
            deadline.saturating_since(port.now())
        );
    }

    #[test]
    fn a_vanished_other_end_is_told_at_once() {
        let (master, mut port) = pair();
        drop(master);
        let started = Instant::now();
        let late = port.now() + Duration::from_secs(5);
        let error = port
            .read(&mut [0; 8], 1, late)
            .expect_err("nobody is there");
        assert!(matches!(error, PortError::Gone { .. }), "{error}");
        let waited = started.elapsed();
        assert!(waited < Duration::from_secs(1), "told after {waited:?}");
    }

    #[test]
    fn a_port_that_does_not_open_says_what_to_do() {
        let clock = Arc::new(WallClock(Instant::now()));
        let Err(error) = SerialPort::open("/dev/no-such-port", 1_000_000, clock.clone()) else {
            panic!("a port that is not there opened");
        };
        assert!(
            error
                .to_string()
                .contains("no such file. Is the adapter plugged in?"),
            "{error}"
        );
        let (_master, port) = pair();
        let Err(error) = SerialPort::open(port.name(), 1_000_000, clock) else {
            panic!("a port opened twice");
        };
        assert!(
            error.to_string().contains("Another program has it open"),
            "{error}"
        );
    }
}
