//! A BVH file as a pose stream: joints as points, metres, seconds from 0.
//!
//! A root that stays at the origin while the hips below it travel is no point: it is not part of the
//! body, and a fit of the body to itself would be held back by it.

use super::{BvhFile, JointPlace, LengthUnit, MAX_BYTES, UnitGuess};
use crate::pose::{LineFault, PoseHeader, PoseSample, Recording};
use std::io::{BufRead, Read};

/// What may differ when a BVH file becomes poses.
#[derive(Copy, Clone, Debug, Default, PartialEq)]
pub struct BvhOptions {
    /// Unit of length; guessed from the skeleton when not given ([`UnitGuess`]).
    pub unit: Option<LengthUnit>,
    /// End Sites are points too.
    pub ends: bool,
}

/// Frames of a BVH file, one after another, as samples.
#[derive(Clone, Debug)]
pub struct BvhStream {
    file: BvhFile,
    unit: LengthUnit,
    guess: Option<UnitGuess>,
    /// Joints that are points.
    columns: Vec<usize>,
    places: Vec<JointPlace>,
    next: usize,
}

impl BvhStream {
    pub(in crate::pose) fn new(file: BvhFile, options: BvhOptions) -> Self {
        let guess = options.unit.is_none().then(|| UnitGuess::of(&file));
        let unit = options.unit.or(guess.map(|guess| guess.unit));
        Self {
            unit: unit.unwrap_or_default(),
            guess,
            columns: (0..file.joints.len())
                .filter(|index| options.ends || !file.joints[*index].is_end)
                .filter(|index| !file.is_origin(*index))
                .collect(),
            places: Vec::with_capacity(file.joints.len()),
            file,
            next: 0,
        }
    }

    /// Reads all of `input`; the outer error is the input's, the inner one the file's.
    pub(in crate::pose) fn read(input: impl BufRead) -> std::io::Result<Result<Self, LineFault>> {
        let mut bytes = Vec::new();
        input.take(MAX_BYTES + 1).read_to_end(&mut bytes)?;
        if bytes.len() as u64 > MAX_BYTES {
            return Ok(Err(LineFault {
                line: 1,
                found: format!("over {MAX_BYTES} bytes"),
                allowed: "shorter files; cut it in parts".into(),
            }));
        }
        // Names may be in any encoding; a name of unreadable signs is still a name.
        let text = String::from_utf8_lossy(&bytes);
        Ok(BvhFile::parse(&text).map(|file| Self::new(file, BvhOptions::default())))
    }

    pub(in crate::pose) fn header(&self) -> PoseHeader {
        let name = |index: &usize| self.file.joints[*index].name.clone();
        PoseHeader {
            points: self.columns.iter().map(name).collect(),
            dim: 3,
            channels: Vec::new(),
        }
    }

    /// The guess at the unit, where one had to be made.
    pub(in crate::pose) fn guess(&self) -> Option<UnitGuess> {
        self.guess
    }

    /// Line of the next frame, as far as no blank lines lie between frames.
    pub(in crate::pose) fn line(&self) -> u64 {
        self.file.first_frame_line + self.next as u64
    }

    /// Writes the next frame to `sample` (re-using its memory); false at the end.
    pub(in crate::pose) fn read_into(&mut self, sample: &mut PoseSample) -> bool {
        if self.next >= self.file.frames() {
            return false;
        }
        self.file.places(self.next, &mut self.places);
        sample.t = self.next as f64 * self.file.frame_time_s;
        sample.points.clear();
        for column in &self.columns {
            let place = self.places[*column].position * self.unit.metres;
            sample.points.push(Some(place.into()));
        }
        sample.confidence.clear();
        sample.channels.clear();
        self.next += 1;
        true
    }
}

/// All frames of `file` as a recording, and the guess at the unit where none was given.
pub fn to_recording(file: BvhFile, options: BvhOptions) -> (Recording, Option<UnitGuess>) {
    let mut stream = BvhStream::new(file, options);
    let mut samples = Vec::with_capacity(stream.file.frames());
    let mut sample = PoseSample::default();
    while stream.read_into(&mut sample) {
        samples.push(sample.clone());
    }
    let header = stream.header();
    (Recording { header, samples }, stream.guess)
}
