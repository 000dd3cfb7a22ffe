//! The MCAP file: what a replay needs, and beside it the same in words for people.

use super::channel::Channel;
use crate::base::Time;
use crate::bus::tap::{Event, Events, trace};
use crate::live::recording::{pose, tap};
use crate::pose::{PoseFormat, PoseHeader, PoseWriter};
use mcap::records::{MessageHeader, Metadata};
use mcap::{Attachment, WriteOptions, Writer};
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, BufWriter};
use std::path::Path;

/// Version of what a replay reads; another one is refused.
pub const FORMAT: u64 = 1;
/// Topics of the logs begin so.
pub(super) const LOG_TOPIC: &str = "/replay/";
/// Prefix of files brought along.
pub(super) const FILES: &str = "files/";
/// A chunk is closed after so much recorded time or so many bytes: what a kill loses at most.
const CHUNK_NS: i64 = 500_000_000;
const CHUNK_BYTES: u64 = 1 << 20;
/// Decimals of a metre in `/poses`, as in pose files.
const DECIMALS: usize = 4;

/// What a recording is of.
#[derive(Clone, Debug)]
pub struct About {
    /// Options of the run and names, as JSON; see [`super::read`].
    pub run: serde_json::Value,
    /// The files of the character by name; the configuration's name stands in `run`.
    pub files: BTreeMap<String, Vec<u8>>,
    /// What the poses consist of.
    pub header: PoseHeader,
    /// Time zero of the bus clock since 1970, nanoseconds; 0 in virtual time.
    pub epoch_ns: i64,
    /// Names of the logs.
    pub logs: Vec<String>,
    /// The JSON channels that are written.
    pub channels: Vec<Channel>,
}

/// A piece of a log.
#[derive(Clone, Debug)]
pub(super) struct Piece {
    /// Which log.
    pub log: usize,
    /// Time of the entry before.
    pub base: Time,
    /// Time of its last entry.
    pub end: Time,
    /// Entries.
    pub bytes: Vec<u8>,
}

/// A file being written.
pub(super) struct McapFile {
    writer: Writer<BufWriter<File>>,
    /// The same file, to have the system put it on the disk.
    disk: File,
    about: About,
    channel_ids: Vec<Option<u16>>,
    log_ids: Vec<u16>,
    poses: PoseWriter<io::Sink>,
    sequence: u32,
    start: Time,
    newest_ns: i64,
    flushed_ns: i64,
    failure: Option<String>,
}

fn other(error: mcap::McapError) -> io::Error {
    match error {
        mcap::McapError::Io(error) => error,
        other => io::Error::other(other.to_string()),
    }
}

/// The header line of a pose stream.
pub(super) fn header_line(header: &PoseHeader) -> io::Result<String> {
    let writer = PoseWriter::new(Vec::new(), header, PoseFormat::JsonLines, DECIMALS)?;
    let line = String::from_utf8(writer.finish()?).map_err(io::Error::other)?;
    Ok(line.trim_end().to_owned())
}

impl McapFile {
    /// Creates the file; `whole` says that it begins where the run began.
    pub fn create(path: &Path, about: &About, whole: bool) -> io::Result<Self> {
        let file = File::create(path)?;
        let disk = file.try_clone()?;
        let mut writer = WriteOptions::new()
            .compression(None)
            .profile("handwave")
            .library(concat!("handwave ", env!("CARGO_PKG_VERSION")))
            .chunk_size(Some(CHUNK_BYTES))
            .disable_seeking(true)
            .create(BufWriter::new(file))
            .map_err(other)?;
        let header = header_line(&about.header)?;
        let pairs = [
            ("format", FORMAT.to_string()),
            ("version", env!("CARGO_PKG_VERSION").to_owned()),
            ("whole", whole.to_string()),
            ("epoch_ns", about.epoch_ns.to_string()),
            ("run", about.run.to_string()),
            ("poses", header.clone()),
        ];
        let metadata = pairs.map(|(name, value)| (name.to_owned(), value));
        writer
            .write_metadata(&Metadata {
                name: "handwave".into(),
                metadata: metadata.into_iter().collect(),
            })
            .map_err(other)?;
        for (name, bytes) in &about.files {
            writer
                .attach(&Attachment {
                    log_time: 0,
                    create_time: 0,
                    name: format!("{FILES}{name}"),
                    media_type: "application/octet-stream".into(),
                    data: Cow::Borrowed(bytes),
                })
                .map_err(other)?;
        }
        let about_poses = BTreeMap::from([("header".to_owned(), header)]);
        let nothing = BTreeMap::new();
        let mut channel_ids = Vec::new();
        for channel in Channel::ALL {
            if !about.channels.contains(&channel) {
                channel_ids.push(None);
                continue;
            }
            let (name, schema) = channel.schema();
            let schema = writer
                .add_schema(name, "jsonschema", schema.as_bytes())
                .map_err(other)?;
            let metadata = match channel {
                Channel::Poses => &about_poses,
                _ => &nothing,
            };
            let id = writer.add_channel(schema, channel.topic(), "json", metadata);
            channel_ids.push(Some(id.map_err(other)?));
        }
        let mut log_ids = Vec::new();
        for (index, name) in about.logs.iter().enumerate() {
            let metadata = BTreeMap::from([("log".to_owned(), name.clone())]);
            let topic = format!("{LOG_TOPIC}{index}");
            let id = writer.add_channel(0, &topic, "handwave-log", &metadata);
            log_ids.push(id.map_err(other)?);
        }
        Ok(Self {
            writer,
            disk,
            channel_ids,
            log_ids,
            poses: PoseWriter::new(io::sink(), &about.header, PoseFormat::JsonLines, DECIMALS)?,
            about: about.clone(),
            sequence: 0,
            start: Time::ZERO,
            newest_ns: 0,
            flushed_ns: 0,
            failure: None,
        })
    }

    fn put(&mut self, channel_id: u16, time: Time, data: &[u8]) {
        if self.failure.is_some() {
            return;
        }
        let at = self.about.epoch_ns.saturating_add(time.nanos());
        let log_time = u64::try_from(at).unwrap_or(0);
        self.newest_ns = self.newest_ns.max(time.nanos());
        self.sequence = self.sequence.wrapping_add(1);
        let header = MessageHeader {
            channel_id,
            sequence: self.sequence,
            log_time,
            publish_time: log_time,
        };
        let written = self.writer.write_to_known_channel(&header, data);
        self.failure = written.err().map(|e| e.to_string());
    }

    /// A JSON message of the time `t_s` since cycle 0.
    pub fn message(&mut self, channel: Channel, t_s: f64, text: &str) {
        let time = Time::from_nanos(
            self.start
                .nanos()
                .saturating_add(Time::from_secs(t_s).nanos()),
        );
        self.message_at(channel, time, text);
    }

    /// Whether `t_s` since cycle 0 is not after `time`.
    pub fn is_past(&self, t_s: f64, time: Time) -> bool {
        t_s <= time.secs_since(self.start)
    }

    fn message_at(&mut self, channel: Channel, time: Time, text: &str) {
        if let Some(id) = self.channel_ids[channel as usize] {
            self.put(id, time, text.as_bytes());
        }
    }

    /// A piece of a log: as it is for the replay and, where `in_words`, its frames and poses as messages.
    pub fn piece(&mut self, piece: &Piece, in_words: bool) {
        let mut data = piece.base.nanos().to_le_bytes().to_vec();
        data.extend_from_slice(&piece.bytes);
        if let Some(id) = self.log_ids.get(piece.log) {
            self.put(*id, piece.end, &data);
        }
        for event in Events::new(&piece.bytes, piece.base) {
            match event {
                Event::Seen(tap::CYCLE_0, nanos) => self.start = Time::from_nanos(nanos as i64),
                _ if !in_words => {}
                Event::Write(time, bytes) => self.frame(piece.log, "tx", time, bytes),
                Event::Read(time, bytes) if !bytes.is_empty() => {
                    self.frame(piece.log, "rx", time, bytes);
                }
                Event::Pose(bytes) => {
                    if let Some(sample) = pose::read(bytes) {
                        let line = self.poses.line(&sample);
                        self.message(Channel::Poses, sample.t, &line);
                    }
                }
                _ => {}
            }
        }
    }

    fn frame(&mut self, log: usize, direction: &str, time: Time, bytes: &[u8]) {
        if self.channel_ids[Channel::Frames as usize].is_none() {
            return;
        }
        let bus = self.about.logs.get(log).map_or("", String::as_str);
        let text = serde_json::json!({
            "bus": bus, "dir": direction, "what": trace::words(bytes), "hex": trace::hex(bytes),
        });
        self.message_at(Channel::Frames, time, &text.to_string());
    }

    /// Closes the chunk when it has lasted long enough; true when it did.
    pub fn flush_if_due(&mut self) -> bool {
        let due = self.newest_ns - self.flushed_ns >= CHUNK_NS && self.failure.is_none();
        if due {
            self.flushed_ns = self.newest_ns;
            self.failure = self.writer.flush().err().map(|e| e.to_string());
        }
        due
    }

    /// Has the system put what is written on the disk, so that a power cut loses no more than a kill.
    pub fn sync(&self) {
        // A file system that cannot is no reason to stop recording.
        let _ = self.disk.sync_data();
    }

    /// Ends the file.
    ///
    /// # Errors
    /// The first thing that could not be written.
    pub fn finish(mut self) -> Result<(), String> {
        let finished = self.writer.finish().map_err(|e| e.to_string());
        match self.failure {
            Some(failure) => Err(failure),
            None => finished.map(|_| ()),
        }
    }
}
