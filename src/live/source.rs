//! Pose sources by name: what `--input` and `input.source` say, opened for reading.

use super::arrival::{DatagramInput, Hangup, PipeInput};
use super::stop::StopSwitch;
use crate::base::print::warn;
use crate::config::Files;
use crate::pose::{FaultCounts, PoseError, PoseFormat, PoseReader, PoseSample};
use std::fs::File;
use std::io::{BufRead, BufReader, Cursor};
use std::net::{Ipv4Addr, SocketAddr, UdpSocket};
use std::path::{Path, PathBuf};

/// A reader of any source.
pub type SourceReader = PoseReader<Box<dyn BufRead + Send>>;

/// Why a source cannot be opened.
#[derive(Debug, thiserror::Error)]
pub enum SourceError {
    /// Not a source.
    #[error(
        "unknown pose source {found:?}. Allowed: file:PATH with a .jsonl, .csv or .bvh recording, udp://[ADDRESS:]PORT, - (standard input)"
    )]
    Unknown {
        /// As written.
        found: String,
    },
    /// A source that is known and not built in.
    #[error(
        "pose source {found:?}: {kind} is not supported by this build; use file:PATH, udp://[ADDRESS:]PORT or - (standard input)"
    )]
    NotYet {
        /// As written.
        found: String,
        /// Its kind.
        kind: String,
    },
    /// A network address that is none.
    #[error(
        "pose source {found:?}: not an address. Allowed: udp://PORT (this machine only), udp://ADDRESS:PORT; udp://0.0.0.0:PORT hears the whole network"
    )]
    Address {
        /// As written.
        found: String,
    },
    /// The address cannot be listened on.
    #[error(
        "pose source {found:?}: cannot listen: {source}; choose a free port above 1023 and an address of this machine"
    )]
    Listen {
        /// As written.
        found: String,
        /// The system's reason.
        source: std::io::Error,
    },
    /// A live source where only a recording will do.
    #[error("pose source {found:?} is live; here it takes a recording, file:PATH")]
    Live {
        /// As written.
        found: String,
    },
    /// The operator stopped the wait for poses.
    #[error("interrupted before poses came")]
    Interrupted,
    /// A built-in file that is not there.
    #[error("{0}")]
    Config(#[from] crate::config::ConfigError),
    /// Nothing in it.
    #[error("no good sample in the pose stream; nothing to play")]
    Empty,
    /// The stream cannot be read.
    #[error("{0}")]
    Pose(#[from] PoseError),
}

/// Kinds of sources that other builds have.
const OTHER_KINDS: [&str; 6] = ["ws", "osc", "zenoh", "camera", "gamepad", "mcap"];

/// A source that was opened: its header is read.
pub struct Source {
    /// Gives the samples.
    pub reader: SourceReader,
    /// How a live source is ended; `None` for recordings.
    pub live: Option<Hangup>,
}

impl std::fmt::Debug for Source {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Source")
            .field("header", self.reader.header())
            .field("live", &self.live)
            .finish()
    }
}

/// Whether `source` gives poses as they happen: its samples are due on arrival.
pub fn is_live(source: &str) -> bool {
    matches!(source, "-" | "file:-") || source.starts_with("udp:")
}

/// Opens any source; a relative path is taken from `files`. Waits for the header of a live one, until
/// `stop` is pressed.
///
/// # Errors
/// Unknown source, address that cannot be listened on, unreadable file, bad header, interruption.
pub fn open_any(source: &str, files: &Files, stop: &StopSwitch) -> Result<Source, SourceError> {
    if !is_live(source) {
        return Ok(Source {
            reader: open(source, files)?,
            live: None,
        });
    }
    let hangup = Hangup::new(stop);
    let reader = match source.strip_prefix("udp:") {
        Some(address) => listen(source, address, &hangup),
        None => read_pipe(&hangup),
    };
    match reader {
        // A wait that was broken off looks like an empty stream.
        Err(_) if hangup.is_over() => Err(SourceError::Interrupted),
        reader => Ok(Source {
            reader: reader?.tolerant(),
            live: Some(hangup),
        }),
    }
}

/// The address that follows `udp:`.
fn address_of(text: &str) -> Option<SocketAddr> {
    let text = text.strip_prefix("//").unwrap_or(text);
    let text = text.trim_end_matches('/');
    if let Ok(port) = text.trim_start_matches(':').parse::<u16>() {
        return Some((Ipv4Addr::LOCALHOST, port).into());
    }
    if let Some(port) = text.strip_prefix("localhost:") {
        return Some((Ipv4Addr::LOCALHOST, port.parse().ok()?).into());
    }
    text.parse().ok()
}

fn listen(source: &str, address: &str, hangup: &Hangup) -> Result<SourceReader, SourceError> {
    let address = address_of(address).ok_or_else(|| SourceError::Address {
        found: source.into(),
    })?;
    let listening = UdpSocket::bind(address).and_then(|socket| {
        let name = format!("udp://{}", socket.local_addr()?);
        Ok((DatagramInput::new(socket, hangup.clone())?, name))
    });
    let (input, name) = listening.map_err(|error| SourceError::Listen {
        found: source.into(),
        source: error,
    })?;
    warn(format_args!("waiting for poses on {name}"));
    let input: Box<dyn BufRead + Send> = Box::new(input);
    Ok(PoseReader::new(input, PoseFormat::JsonLines, &name)?)
}

fn read_pipe(hangup: &Hangup) -> Result<SourceReader, SourceError> {
    let name = "standard input";
    let failed = |source| PoseError::Read {
        file: name.into(),
        source,
    };
    // A descriptor of our own: the buffer of the standard one would hide what was read ahead from `poll`.
    let pipe = rustix::io::dup(rustix::stdio::stdin()).map_err(|e| failed(e.into()))?;
    let mut input = BufReader::new(PipeInput::new(File::from(pipe), hangup.clone()));
    let format = match input.fill_buf().map_err(failed)?.first() {
        Some(b'{') => PoseFormat::JsonLines,
        _ => PoseFormat::Csv,
    };
    let input: Box<dyn BufRead + Send> = Box::new(input);
    Ok(PoseReader::new(input, format, name)?)
}

/// Opens a recording; a relative path is taken from `files` (the configuration's folder).
///
/// # Errors
/// Unknown or live source, unreadable file, bad header.
pub fn open(source: &str, files: &Files) -> Result<SourceReader, SourceError> {
    if is_live(source) {
        return Err(SourceError::Live {
            found: source.into(),
        });
    }
    let (kind, rest) = source.split_once(':').unwrap_or((source, ""));
    if kind != "file" {
        return Err(if OTHER_KINDS.contains(&kind) {
            SourceError::NotYet {
                found: source.into(),
                kind: kind.into(),
            }
        } else {
            SourceError::Unknown {
                found: source.into(),
            }
        });
    }
    match files.place() {
        Files::Folder(folder) => open_file(&folder.join(rest)),
        Files::Embedded | Files::Kept(_) => {
            let name = files.name(rest);
            let format = PoseFormat::of(Path::new(rest))?;
            let text = files.read(rest)?;
            let input: Box<dyn BufRead + Send> = Box::new(Cursor::new(text.into_bytes()));
            Ok(PoseReader::new(input, format, &name)?)
        }
    }
}

fn open_file(path: &Path) -> Result<SourceReader, SourceError> {
    let name = path.display().to_string();
    let format = PoseFormat::of(path)?;
    let file = File::open(path).map_err(|source| PoseError::Read {
        file: name.clone(),
        source,
    })?;
    let input: Box<dyn BufRead + Send> = Box::new(BufReader::new(file));
    Ok(PoseReader::new(input, format, &name)?)
}

/// Reads the first good sample, so that a stream without one is found out before anything moves.
pub fn first_sample(reader: &mut SourceReader) -> Result<PoseSample, SourceError> {
    let mut sample = PoseSample::default();
    if reader.read_into(&mut sample)? {
        Ok(sample)
    } else {
        Err(SourceError::Empty)
    }
}

impl Source {
    /// Reads the first good sample; of a live source it waits for one.
    ///
    /// # Errors
    /// As [`first_sample`]; a wait that was broken off.
    pub fn first_sample(&mut self) -> Result<PoseSample, SourceError> {
        let first = first_sample(&mut self.reader);
        match (&self.live, first) {
            (Some(live), Err(_)) if live.is_over() => Err(SourceError::Interrupted),
            (_, first) => first,
        }
    }

    /// Samples dropped so far.
    pub fn counts(&self) -> FaultCounts {
        *self.reader.counts()
    }
}

/// The place that a path on the command line is relative to.
pub fn working_folder() -> Files {
    Files::Folder(PathBuf::new())
}
