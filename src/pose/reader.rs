//! A pose stream read one sample at a time, from a file or anything that yields lines.

use super::bvh::BvhStream;
use super::json::{self, JsonHeader};
use super::{FaultCounts, LONGEST_STEP_S, MAX_LINE_BYTES, PoseError, PoseHeader, PoseSample};
use super::{SampleFault, Validator, csv};
use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;

/// How the samples are written.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
pub enum PoseFormat {
    /// One JSON object a line ([`json`]).
    JsonLines,
    /// A table with a header row ([`csv`]).
    Csv,
    /// BVH motion capture ([`super::bvh`]): joints are points. Read, not written.
    Bvh,
}

impl PoseFormat {
    /// The format a file name ends in.
    ///
    /// # Errors
    /// Neither `.jsonl` nor `.csv` nor `.bvh`.
    pub fn of(path: &Path) -> Result<Self, PoseError> {
        match path.extension().and_then(|ending| ending.to_str()) {
            Some("jsonl") => Ok(Self::JsonLines),
            Some("csv") => Ok(Self::Csv),
            Some("bvh") => Ok(Self::Bvh),
            _ => Err(PoseError::Format {
                file: path.display().to_string(),
            }),
        }
    }
}

/// Reads a pose stream: the header at once, then one good sample per call.
///
/// Bad samples are dropped and counted ([`PoseReader::counts`]); ten in a row are an error that
/// names the first, and so are stamps that are plainly not in seconds ([`Validator`]). As an iterator it ends after the first error.
#[derive(Debug)]
pub struct PoseReader<R> {
    input: R,
    file: String,
    format: PoseFormat,
    stream: JsonHeader,
    /// What a BVH file holds; such a file is read as a whole.
    bvh: Option<BvhStream>,
    validator: Validator,
    line: u64,
    bytes: Vec<u8>,
    done: bool,
    tolerant: bool,
    /// Time of a sample far in the past, which the next one may confirm as a sender's new start.
    restart_t: Option<f64>,
}

/// A tolerant reader goes on after bad samples once this many were good: the sender knows the format.
const PROVEN_BY: u64 = 50;
/// A sample this much earlier than the last one, in seconds, is no late datagram but another clock.
const RESTART_S: f64 = 1.0;

impl PoseReader<BufReader<File>> {
    /// Opens a `.jsonl`, `.csv` or `.bvh` file and reads its header.
    ///
    /// # Errors
    /// Unknown ending, unreadable file, bad header.
    pub fn open(path: &Path) -> Result<Self, PoseError> {
        let file = path.display().to_string();
        let format = PoseFormat::of(path)?;
        match File::open(path) {
            Ok(input) => Self::new(BufReader::new(input), format, &file),
            Err(source) => Err(PoseError::Read { file, source }),
        }
    }
}

impl<R: BufRead> PoseReader<R> {
    /// Reads the header from `input`; `file` is the name used in messages.
    ///
    /// # Errors
    /// Unreadable input, bad header; for BVH, any fault in the file.
    pub fn new(input: R, format: PoseFormat, file: &str) -> Result<Self, PoseError> {
        let mut reader = Self {
            input,
            file: file.into(),
            format,
            stream: JsonHeader {
                header: PoseHeader {
                    points: Vec::new(),
                    dim: 3,
                    channels: Vec::new(),
                },
                metres_per_unit: 1.0,
            },
            bvh: None,
            validator: Validator::new(0),
            line: 0,
            bytes: Vec::new(),
            done: false,
            tolerant: false,
            restart_t: None,
        };
        if format == PoseFormat::Bvh {
            reader.read_bvh()?;
            return Ok(reader);
        }
        let header = |reader: &Self, fault: json::HeaderFault| PoseError::Header {
            file: reader.file.clone(),
            line: reader.line.max(1),
            found: fault.found,
            allowed: fault.allowed,
        };
        let missing = |found: &str| {
            json::HeaderFault {
            found: found.into(),
            allowed: "a header line of a pose stream; other recordings come in with `handwave poses import`".into(),
        }
        };
        let line = match reader.next_line()? {
            None => return Err(header(&reader, missing("an empty file"))),
            Some(Err(_)) => {
                return Err(header(&reader, missing("a line over 64 KiB or not UTF-8")));
            }
            Some(Ok(line)) => line,
        };
        let parsed = match format {
            PoseFormat::JsonLines => json::parse_header(&line),
            PoseFormat::Csv | PoseFormat::Bvh => {
                csv::parse_header(&line).map(|header| JsonHeader {
                    header,
                    metres_per_unit: 1.0,
                })
            }
        };
        reader.stream = parsed.map_err(|fault| header(&reader, fault))?;
        reader.validator = Validator::new(reader.stream.header.points.len());
        Ok(reader)
    }

    /// The same reader for a live source, which is not to end because a sender stumbles: once 50 samples were
    /// good, bad ones are counted without end, and a sender that starts again with another clock is followed
    /// (at the cost of one sample).
    #[must_use]
    pub fn tolerant(mut self) -> Self {
        self.tolerant = true;
        self
    }

    fn read_bvh(&mut self) -> Result<(), PoseError> {
        let read = BvhStream::read(&mut self.input).map_err(|source| PoseError::Read {
            file: self.file.clone(),
            source,
        })?;
        let stream = read.map_err(|fault| fault.in_file(&self.file))?;
        self.stream.header = stream.header();
        self.validator = Validator::new(self.stream.header.points.len());
        self.bvh = Some(stream);
        Ok(())
    }

    /// What had to be assumed about the input and may be wrong, for the user: a guessed unit.
    pub fn assumption(&self) -> Option<String> {
        let guess = self.bvh.as_ref()?.guess()?;
        Some(format!("{}: {guess}", self.file))
    }

    /// Names and dimension. Channels that only turn up in samples are appended while reading.
    pub fn header(&self) -> &PoseHeader {
        &self.stream.header
    }

    /// The input's name in messages.
    pub fn file(&self) -> &str {
        &self.file
    }

    /// Samples dropped so far, by reason.
    pub fn counts(&self) -> &FaultCounts {
        self.validator.counts()
    }

    /// The number of the last line read, from 1.
    pub fn line(&self) -> u64 {
        self.line
    }

    /// Reads the next good sample into `sample`; false at the end of the input.
    ///
    /// # Errors
    /// Unreadable input, ten bad samples in a row.
    pub fn read_into(&mut self, sample: &mut PoseSample) -> Result<bool, PoseError> {
        loop {
            let parsed = if let Some(bvh) = &mut self.bvh {
                self.line = bvh.line();
                if !bvh.read_into(sample) {
                    return Ok(false);
                }
                Ok(true)
            } else {
                let Some(line) = self.next_line()? else {
                    return Ok(false);
                };
                line.and_then(|line| self.parse(&line, sample))
            };
            let outcome = match parsed {
                Ok(false) => continue,
                Ok(true) => self.validator.check(sample).map(|()| sample.t),
                Err(fault) => Err(fault),
            };
            let outcome = if self.tolerant {
                self.forgive(outcome, sample)
            } else {
                outcome
            };
            match self.validator.note(self.line, outcome) {
                Ok(true) => return Ok(true),
                Ok(false) => {}
                Err(_) if self.tolerant && self.validator.accepted() >= PROVEN_BY => {
                    self.validator.begin_anew();
                }
                Err(first) => {
                    return Err(PoseError::TooManyBad {
                        file: self.file.clone(),
                        line: first.line,
                        fault: first.fault,
                    });
                }
            }
        }
    }

    /// Lets a sample pass that begins a new clock, when the one before did so already.
    fn forgive(
        &mut self,
        outcome: Result<f64, SampleFault>,
        sample: &PoseSample,
    ) -> Result<f64, SampleFault> {
        let Err(SampleFault::TimeBackwards { t, last }) = outcome else {
            if outcome.is_ok() {
                self.restart_t = None;
            }
            return outcome;
        };
        let before = self.restart_t;
        if last - t > RESTART_S {
            self.restart_t = Some(t);
            if before.is_some_and(|before| t > before && t - before <= LONGEST_STEP_S) {
                self.restart_t = None;
                self.validator.begin_anew();
                return self.validator.check(sample).map(|()| t);
            }
        }
        outcome
    }

    /// Parses a line; false where it is no sample and no fault (the header said again).
    fn parse(&mut self, line: &str, sample: &mut PoseSample) -> Result<bool, SampleFault> {
        match self.format {
            PoseFormat::Csv | PoseFormat::Bvh => {
                csv::parse_sample(line, &self.stream.header, sample)?;
            }
            PoseFormat::JsonLines => {
                if json::looks_like_header(line) {
                    // Senders repeat their header; another one would change the meaning of points.
                    return match json::parse_header(line) {
                        Ok(again) if again.header.points == self.stream.header.points => Ok(false),
                        _ => Err(SampleFault::Malformed {
                            detail: "another header in the middle of the stream".into(),
                        }),
                    };
                }
                json::parse_sample(line, &mut self.stream, sample)?;
            }
        }
        Ok(true)
    }

    /// The next non-empty line; inner errors are faults of that line alone.
    fn next_line(&mut self) -> Result<Option<Result<String, SampleFault>>, PoseError> {
        loop {
            self.bytes.clear();
            let limit = MAX_LINE_BYTES as u64 + 2;
            let read = (&mut self.input)
                .take(limit)
                .read_until(b'\n', &mut self.bytes)
                .map_err(|source| PoseError::Read {
                    file: self.file.clone(),
                    source,
                })?;
            if read == 0 {
                return Ok(None);
            }
            self.line += 1;
            let ended = self.bytes.last() == Some(&b'\n');
            while matches!(self.bytes.last(), Some(b'\n' | b'\r')) {
                self.bytes.pop();
            }
            if self.bytes.len() > MAX_LINE_BYTES {
                if !ended {
                    self.skip_line()?;
                }
                return Ok(Some(Err(SampleFault::LineTooLong)));
            }
            match std::str::from_utf8(&self.bytes) {
                Ok(line) if line.trim().is_empty() => {}
                Ok(line) => return Ok(Some(Ok(line.to_owned()))),
                Err(_) => {
                    return Ok(Some(Err(SampleFault::Malformed {
                        detail: "not UTF-8 text".into(),
                    })));
                }
            }
        }
    }

    /// Throws away the rest of an over-long line without keeping it in memory.
    fn skip_line(&mut self) -> Result<(), PoseError> {
        self.input
            .skip_until(b'\n')
            .map(|_| ())
            .map_err(|source| PoseError::Read {
                file: self.file.clone(),
                source,
            })
    }
}

impl<R: BufRead> Iterator for PoseReader<R> {
    type Item = Result<PoseSample, PoseError>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.done {
            return None;
        }
        let mut sample = PoseSample::default();
        match self.read_into(&mut sample) {
            Ok(true) => Some(Ok(sample)),
            Ok(false) => {
                self.done = true;
                None
            }
            Err(error) => {
                self.done = true;
                Some(Err(error))
            }
        }
    }
}
