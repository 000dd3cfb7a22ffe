//! Other programs' recordings as pose streams: which kind a file is, and what its importer is told.

use super::bvh::{self, BvhFile, BvhOptions, LengthUnit};
use super::table::TableOptions;
use super::{
    LineFault, PoseError, PoseFormat, PoseReader, Recording, aframe, leap, live_link, table,
};
use crate::base::suggest::hint;
use std::path::Path;

/// A kind of recording.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
pub enum ImportKind {
    /// BVH motion capture ([`bvh`]).
    Bvh,
    /// Leap Motion, LeapJS playback, decompressed JSON ([`leap`]).
    Leap,
    /// Live Link Face, CSV with 52 blendshapes ([`live_link`]).
    LiveLinkFace,
    /// A-Frame motion capture, JSON ([`aframe`]).
    AFrame,
    /// Points without a header ([`table`]).
    Table,
    /// A pose stream already (.jsonl, .csv).
    Poses,
}

impl ImportKind {
    /// All kinds with their names.
    pub const NAMED: [(&'static str, ImportKind); 6] = [
        ("bvh", ImportKind::Bvh),
        ("leap", ImportKind::Leap),
        ("live-link-face", ImportKind::LiveLinkFace),
        ("a-frame", ImportKind::AFrame),
        ("table", ImportKind::Table),
        ("poses", ImportKind::Poses),
    ];

    /// The kind of that name.
    ///
    /// # Errors
    /// No such kind: a suggestion and all names.
    pub fn from_name(name: &str) -> Result<Self, String> {
        let names = || Self::NAMED.iter().map(|(name, _)| *name);
        let found = Self::NAMED.iter().find(|(known, _)| *known == name);
        found.map(|(_, kind)| *kind).ok_or_else(|| {
            let all: Vec<&str> = names().collect();
            format!(
                "no kind {name:?}{} Allowed: {}",
                hint(name, names()),
                all.join(", ")
            )
        })
    }

    /// Its name.
    pub fn name(self) -> &'static str {
        let named = Self::NAMED.iter().find(|(_, kind)| *kind == self);
        named.map_or("", |(name, _)| name)
    }

    /// What the content of a file looks like.
    pub fn detect(text: &str) -> Option<Self> {
        let start = text.trim_start_matches('\u{feff}').trim_start();
        let begins = |word: &str| {
            start
                .get(..word.len())
                .is_some_and(|head| head.eq_ignore_ascii_case(word))
        };
        let first = start.lines().next().unwrap_or_default();
        Some(if begins("HIERARCHY") {
            Self::Bvh
        } else if live_link::is_live_link(text) {
            Self::LiveLinkFace
        } else if super::json::looks_like_header(first) || super::csv::parse_header(first).is_ok() {
            Self::Poses
        } else if leap::is_leap(text) {
            Self::Leap
        } else if start.starts_with('{') && aframe::is_aframe(text) {
            Self::AFrame
        } else if table::is_table(text) {
            Self::Table
        } else {
            return None;
        })
    }
}

/// How to read a recording; what does not belong to its kind is refused.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ImportOptions {
    /// The kind; detected from the content when not given.
    pub kind: Option<ImportKind>,
    /// Leap: with the joints of the fingers.
    pub joints: bool,
    /// BVH: with the End Sites.
    pub ends: bool,
    /// Live Link Face: with the angles of head and eyes.
    pub rotations: bool,
    /// BVH (else guessed) and tables (else metres): the unit of length.
    pub unit: Option<LengthUnit>,
    /// Tables: frames per second.
    pub rate_hz: Option<f64>,
    /// Tables: names of the points.
    pub names: Vec<String>,
}

impl ImportOptions {
    /// The flag of an option that is given and does not belong to `kind`, and the kinds it belongs to.
    fn misplaced(&self, kind: ImportKind) -> Option<(&'static str, &'static str)> {
        use ImportKind::{Bvh, Leap, LiveLinkFace, Table};
        let all: [(bool, &str, &[ImportKind], &str); 6] = [
            (self.joints, "--joints", &[Leap], "leap"),
            (self.ends, "--ends", &[Bvh], "bvh"),
            (
                self.rotations,
                "--rotations",
                &[LiveLinkFace],
                "live-link-face",
            ),
            (
                self.unit.is_some(),
                "--unit",
                &[Bvh, Table],
                "bvh and table",
            ),
            (self.rate_hz.is_some(), "--rate", &[Table], "table"),
            (!self.names.is_empty(), "--names", &[Table], "table"),
        ];
        (all.into_iter())
            .find(|(given, _, kinds, _)| *given && !kinds.contains(&kind))
            .map(|(_, flag, _, belongs)| (flag, belongs))
    }
}

/// A recording that was brought in.
#[derive(Clone, Debug, PartialEq)]
pub struct Imported {
    /// The poses.
    pub recording: Recording,
    /// What kind it was.
    pub kind: ImportKind,
    /// What had to be assumed and may be wrong.
    pub assumption: Option<String>,
}

/// Reads a recording of any known kind.
///
/// # Errors
/// Unreadable file, no known kind, an option of another kind, a fault in it (with its line where it
/// has lines), a table without a rate.
pub fn import(path: &Path, options: &ImportOptions) -> Result<Imported, PoseError> {
    let file = path.display().to_string();
    let read = |source| PoseError::Read {
        file: file.clone(),
        source,
    };
    let wrong = |what: String| PoseError::Import {
        file: file.clone(),
        what,
    };
    let bytes = std::fs::read(path).map_err(read)?;
    let text = String::from_utf8_lossy(&bytes);
    let kind = options.kind.or_else(|| ImportKind::detect(&text));
    let kind = kind.ok_or_else(|| {
        let names: Vec<&str> = ImportKind::NAMED.iter().map(|(name, _)| *name).collect();
        wrong(format!(
            "no recording of a known kind; known: {} (`handwave poses import --help` tells what each looks like)",
            names.join(", ")
        ))
    })?;
    if let Some((flag, belongs)) = options.misplaced(kind) {
        return Err(wrong(format!(
            "{flag} belongs to recordings of kind {belongs}; this one is read as {}",
            kind.name()
        )));
    }
    let at = |fault: LineFault| fault.in_file(&file);
    let mut assumption = None;
    let recording = match kind {
        ImportKind::Bvh => {
            let options = BvhOptions {
                unit: options.unit,
                ends: options.ends,
            };
            let (recording, guess) = bvh::to_recording(BvhFile::parse(&text).map_err(at)?, options);
            assumption = guess.map(|guess| guess.to_string());
            recording
        }
        ImportKind::Leap => leap::parse(&text, options.joints).map_err(wrong)?,
        ImportKind::LiveLinkFace => live_link::parse(&text, options.rotations).map_err(at)?,
        ImportKind::AFrame => aframe::parse(&text).map_err(wrong)?,
        ImportKind::Table => {
            let rate_hz = options.rate_hz.ok_or_else(|| {
                wrong("a table has no times: tell its frames per second with --rate HZ".into())
            })?;
            if !(1e-2..=1e4).contains(&rate_hz) {
                return Err(wrong(format!("rate {rate_hz}: allowed: 0.01 to 10000 Hz")));
            }
            let options = TableOptions {
                rate_hz,
                names: options.names.clone(),
                unit: options.unit.unwrap_or_default(),
            };
            table::parse(&text, &options).map_err(at)?
        }
        ImportKind::Poses => {
            let format = if super::json::looks_like_header(&text) {
                PoseFormat::JsonLines
            } else {
                PoseFormat::Csv
            };
            Recording::read_all(PoseReader::new(&bytes[..], format, &file)?)?.0
        }
    };
    Ok(Imported {
        recording,
        kind,
        assumption,
    })
}
