//! A simulated line on a pseudo-terminal, for any client that opens serial ports. Linux.

use super::line::{Line, SharedLine};
use super::trace::Trace;
use crate::base::{Clock, Time};
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fs::inotify;
use rustix::fs::{Mode, OFlags};
use rustix::io::Errno;
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{self, OptionalActions, QueueSelector};
use std::ffi::OsStr;
use std::io;
use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
use std::os::unix::ffi::OsStrExt;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

/// Bytes are handed to the client when this much time of them has gathered, or the reply ends.
///
/// A full-speed USB adapter gathers as long.
const BATCH: Duration = Duration::from_millis(1);
/// A pause on the line longer than this ends a reply.
const REPLY_GAP: Duration = Duration::from_micros(150);
/// The kernel wakes us this much before a byte is due; the rest is spun away.
const WAKE_EARLY: Duration = Duration::from_micros(90);
/// How often the servos are moved on when nothing else happens.
const IDLE_LOOK: Duration = Duration::from_secs(1);

/// Why the server ended or could not begin.
#[derive(Debug, thiserror::Error)]
pub enum PtyError {
    /// The system refuses a pseudo-terminal.
    #[error("cannot {action}: {reason}")]
    System {
        /// What was tried.
        action: &'static str,
        /// What the system said.
        reason: io::Error,
    },
    /// The link cannot be made.
    #[error("cannot make the link {link}: {reason}")]
    Link {
        /// Path of the link.
        link: PathBuf,
        /// What the system said, or what is in the way.
        reason: io::Error,
    },
}

fn system(action: &'static str) -> impl Fn(Errno) -> PtyError {
    move |errno| PtyError::System {
        action,
        reason: errno.into(),
    }
}

/// Serves one line to clients, one after another.
pub struct PtyServer {
    line: SharedLine,
    clock: Arc<dyn Clock>,
    /// Where the terminal is linked now, and at first.
    link: PathBuf,
    first_link: PathBuf,
    baud: u32,
    terminal: Option<Terminal>,
    trace: Option<Trace>,
    /// When the servos are moved on if nobody asks.
    idle_at: Time,
}

/// Both ends of a pseudo-terminal, and who opens and closes the clients' end.
struct Terminal {
    master: OwnedFd,
    /// Held open, so that the line does not hang up between two clients.
    slave: OwnedFd,
    path: PathBuf,
    openings: OwnedFd,
    clients: i64,
}

impl PtyServer {
    /// Opens a pseudo-terminal set to `baud_bps` and links it at `link`.
    ///
    /// An old symbolic link there is replaced, anything else is left alone and is an error.
    /// The link goes when the server is dropped.
    pub fn open(
        line: SharedLine,
        clock: Arc<dyn Clock>,
        link: &Path,
        baud_bps: u32,
    ) -> Result<Self, PtyError> {
        let mut server = Self {
            line,
            clock,
            link: link.to_owned(),
            first_link: link.to_owned(),
            baud: baud_bps,
            terminal: None,
            trace: None,
            idle_at: Time::ZERO,
        };
        server.plug()?;
        Ok(server)
    }

    /// Writes down from now on what the servos do.
    pub fn trace_to(&mut self, trace: Trace) {
        self.trace = Some(trace);
    }

    /// Serves until `stop` becomes readable (a pipe or socket that somebody writes to or closes).
    pub fn serve(&mut self, stop: BorrowedFd) -> Result<(), PtyError> {
        // The default slack of 50 us would be most of the jitter. Without it all still works.
        let _only_jitter = rustix::thread::set_current_timer_slack(std::num::NonZeroU64::new(1));
        let mut incoming = [0; 4096];
        let mut outgoing = [0; 4096];
        loop {
            let now = self.clock.now();
            self.follow_adapter(now)?;
            self.move_on(now)?;
            self.deliver(now, &mut outgoing)?;
            let wait = self.until_next(now);
            let mut fds = watched(stop);
            if let Some(terminal) = &self.terminal {
                fds[1] = Some(terminal.master.as_fd());
                fds[2] = Some(terminal.openings.as_fd());
            }
            let ready = wait_for(&fds, wait)?;
            if ready[0] {
                return Ok(());
            }
            if ready[2] {
                self.count_clients()?;
            }
            if ready[1] {
                self.take_in(&mut incoming)?;
            }
        }
    }

    /// Plugs the adapter out and in again as the faults say.
    fn follow_adapter(&mut self, now: Time) -> Result<(), PtyError> {
        let unplugged = self.line.lock().is_unplugged(now);
        if unplugged && self.terminal.is_some() {
            self.line.lock().clear();
            self.unlink();
            self.terminal = None;
        } else if !unplugged && self.terminal.is_none() {
            self.plug()?;
        }
        Ok(())
    }

    /// Moves the servos on when nobody has asked for a while, and writes the trace.
    fn move_on(&mut self, now: Time) -> Result<(), PtyError> {
        let mut line = self.line.lock();
        if let Some(trace) = &mut self.trace {
            let written = trace.follow(&mut line, now);
            return written.map_err(|reason| PtyError::System {
                action: "write the trace",
                reason,
            });
        }
        if now >= self.idle_at {
            line.advance(now);
            self.idle_at = now + IDLE_LOOK;
        }
        Ok(())
    }

    /// How long to sleep: until bytes are due, a fault changes or the servos are to be moved on.
    fn until_next(&self, now: Time) -> Duration {
        let line = self.line.lock();
        let due = self.trace.as_ref().map_or(self.idle_at, Trace::due);
        let change = line.next_fault_change(now).unwrap_or(due).min(due);
        let wake = match Batch::next(&line) {
            Some(batch) => batch.wake().min(change),
            None => change,
        };
        wake.saturating_since(now)
    }

    /// Writes what has arrived to the client, spinning away the last microseconds of a reply.
    fn deliver(&mut self, now: Time, buf: &mut [u8]) -> Result<(), PtyError> {
        let Some(terminal) = &self.terminal else {
            return Ok(());
        };
        let mut line = self.line.lock();
        let Some(batch) = Batch::next(&line).filter(|batch| batch.wake() <= now) else {
            return Ok(());
        };
        while self.clock.now() < batch.due {
            std::hint::spin_loop();
        }
        let count = line.receive(self.clock.now(), buf);
        drop(line);
        let mut rest = &buf[..count];
        while !rest.is_empty() {
            match rustix::io::write(&terminal.master, rest) {
                Ok(written) => rest = &rest[written..],
                Err(Errno::INTR) => {}
                // A client that does not read loses bytes, as with a real adapter.
                Err(Errno::AGAIN) => break,
                Err(errno) => return Err(system("write to the pseudo-terminal")(errno)),
            }
        }
        Ok(())
    }

    /// Reads what the client sent and puts it on the line.
    fn take_in(&mut self, buf: &mut [u8]) -> Result<(), PtyError> {
        let Some(terminal) = &self.terminal else {
            return Ok(());
        };
        let count = match rustix::io::read(&terminal.master, &mut *buf) {
            Ok(count) => count,
            Err(Errno::INTR | Errno::AGAIN | Errno::IO) => return Ok(()),
            Err(errno) => return Err(system("read from the pseudo-terminal")(errno)),
        };
        // The master sees the settings of the client's end, its rate among them.
        let baud = termios::tcgetattr(&terminal.master)
            .map(|settings| settings.output_speed())
            .unwrap_or(self.baud);
        let now = self.clock.now();
        self.line.lock().send(now, baud, &buf[..count]);
        Ok(())
    }

    /// Follows the clients' coming and going; what the last one left unread must not greet the next.
    fn count_clients(&mut self) -> Result<(), PtyError> {
        let Some(terminal) = &mut self.terminal else {
            return Ok(());
        };
        let before = terminal.clients;
        let mut space = [std::mem::MaybeUninit::uninit(); 1024];
        let mut events = inotify::Reader::new(&terminal.openings, &mut space);
        loop {
            match events.next() {
                Ok(event) => {
                    let opened = event.events().contains(inotify::ReadFlags::OPEN);
                    terminal.clients += if opened { 1 } else { -1 };
                }
                Err(Errno::AGAIN) => break,
                Err(Errno::INTR) => {}
                Err(errno) => return Err(system("watch the pseudo-terminal")(errno)),
            }
        }
        if terminal.clients <= 0 && before > 0 {
            terminal.clients = 0;
            // A client that was killed leaves its exclusive lock behind. Neither call can fail on a
            // terminal that we hold open.
            let _held_open = termios::ioctl_tiocnxcl(&terminal.slave);
            let _held_open = termios::tcflush(&terminal.slave, QueueSelector::IFlush);
            self.line.lock().clear();
        }
        Ok(())
    }

    fn plug(&mut self) -> Result<(), PtyError> {
        let name = self.line.lock().adapter_name(self.clock.now());
        self.link = named(&self.first_link, name);
        let terminal = Terminal::open(self.baud)?;
        self.make_link(&terminal.path)
            .map_err(|reason| PtyError::Link {
                link: self.link.clone(),
                reason,
            })?;
        self.terminal = Some(terminal);
        Ok(())
    }

    fn make_link(&self, target: &Path) -> io::Result<()> {
        match std::fs::symlink_metadata(&self.link) {
            Ok(found) if !found.is_symlink() => {
                return Err(io::Error::new(
                    io::ErrorKind::AlreadyExists,
                    "there is something that is no symbolic link; give another path or remove it",
                ));
            }
            Ok(_) => std::fs::remove_file(&self.link)?,
            Err(_) => {}
        }
        std::os::unix::fs::symlink(target, &self.link)
    }

    /// Removes the link if it still is ours.
    fn unlink(&self) {
        let ours = self.terminal.as_ref().map(|t| t.path.as_path());
        if std::fs::read_link(&self.link).ok().as_deref() == ours {
            // At worst a dead link stays, which the next simulator replaces.
            let _stays = std::fs::remove_file(&self.link);
        }
    }
}

impl Drop for PtyServer {
    fn drop(&mut self) {
        if self.terminal.is_some() {
            self.unlink();
        }
    }
}

impl Terminal {
    fn open(baud: u32) -> Result<Self, PtyError> {
        let flags = OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC;
        let master = openpt(flags).map_err(system("open a pseudo-terminal"))?;
        let prepare = system("set up the pseudo-terminal");
        grantpt(&master).map_err(&prepare)?;
        unlockpt(&master).map_err(&prepare)?;
        let name = ptsname(&master, Vec::new()).map_err(&prepare)?;
        let path = PathBuf::from(OsStr::from_bytes(name.to_bytes()));
        let slave = rustix::fs::open(
            &path,
            OFlags::RDWR | OFlags::NOCTTY | OFlags::CLOEXEC,
            Mode::empty(),
        )
        .map_err(&prepare)?;
        let mut settings = termios::tcgetattr(&slave).map_err(&prepare)?;
        settings.make_raw();
        settings.set_speed(baud).map_err(&prepare)?;
        termios::tcsetattr(&slave, OptionalActions::Now, &settings).map_err(&prepare)?;
        let status = rustix::fs::fcntl_getfl(&master).map_err(&prepare)?;
        rustix::fs::fcntl_setfl(&master, status | OFlags::NONBLOCK).map_err(&prepare)?;
        let openings =
            inotify::init(inotify::CreateFlags::CLOEXEC | inotify::CreateFlags::NONBLOCK)
                .map_err(&prepare)?;
        let watched = inotify::WatchFlags::OPEN
            | inotify::WatchFlags::CLOSE_WRITE
            | inotify::WatchFlags::CLOSE_NOWRITE;
        inotify::add_watch(&openings, &path, watched).map_err(&prepare)?;
        Ok(Self {
            master,
            slave,
            path,
            openings,
            clients: 0,
        })
    }
}

/// The link of an adapter that came back under another name: `PATH.1`; 0 is its first name.
fn named(first: &Path, name: u32) -> PathBuf {
    if name == 0 {
        return first.to_owned();
    }
    let mut path = first.as_os_str().to_owned();
    path.push(format!(".{name}"));
    path.into()
}

/// The bytes that go to the client together next.
struct Batch {
    due: Time,
    /// It ends a reply, for which the client waits.
    ends_reply: bool,
}

impl Batch {
    fn next(line: &Line) -> Option<Self> {
        let limit = line.arrival(0)? + BATCH;
        let (mut due, mut index) = (line.arrival(0)?, 1);
        while let Some(at) = line.arrival(index) {
            if at > due + REPLY_GAP {
                break;
            }
            if at > limit {
                return Some(Self {
                    due,
                    ends_reply: false,
                });
            }
            due = at;
            index += 1;
        }
        Some(Self {
            due,
            ends_reply: true,
        })
    }

    /// When to wake up for it: early for the end of a reply, to meet it exactly.
    fn wake(&self) -> Time {
        match self.ends_reply {
            true => self.due - WAKE_EARLY,
            false => self.due,
        }
    }
}

fn watched(stop: BorrowedFd<'_>) -> [Option<BorrowedFd<'_>>; 3] {
    [Some(stop), None, None]
}

/// Waits until one of `fds` can be read or has ended, at most `wait`; which ones.
fn wait_for(fds: &[Option<BorrowedFd>; 3], wait: Duration) -> Result<[bool; 3], PtyError> {
    let Some(first) = fds[0] else {
        return Ok([false; 3]);
    };
    let mut polled = fds.map(|fd| PollFd::from_borrowed_fd(fd.unwrap_or(first), PollFlags::IN));
    let timeout = Timespec {
        tv_sec: wait.as_secs() as i64,
        tv_nsec: i64::from(wait.subsec_nanos()),
    };
    match poll(&mut polled, Some(&timeout)) {
        Ok(_) => {}
        Err(Errno::INTR) => return Ok([false; 3]),
        Err(errno) => return Err(system("wait for the client")(errno)),
    }
    let mut ready = [false; 3];
    for ((ready, fd), polled) in ready.iter_mut().zip(fds).zip(&polled) {
        *ready = fd.is_some() && !polled.revents().is_empty();
    }
    Ok(ready)
}
