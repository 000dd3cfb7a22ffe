//! A whole pose stream in memory, for work that needs to look at it twice.

use super::{FaultCounts, PoseError, PoseFormat, PoseHeader, PoseReader, PoseSample, PoseWriter};
use std::fs::File;
use std::io::{BufRead, BufWriter};
use std::path::Path;

/// Header and all good samples of a stream; times strictly increase.
#[derive(Clone, Debug, PartialEq)]
pub struct Recording {
    /// Names and dimension.
    pub header: PoseHeader,
    /// Good samples in the order of time; never empty after [`Recording::read`].
    pub samples: Vec<PoseSample>,
}

impl Recording {
    /// Reads a `.jsonl`, `.csv` or `.bvh` file to its end; also returns what was dropped.
    ///
    /// # Errors
    /// Unreadable file, bad header, ten bad samples in a row, no sample at all.
    pub fn read(path: &Path) -> Result<(Self, FaultCounts), PoseError> {
        Self::read_all(PoseReader::open(path)?)
    }

    /// Reads what is left in `reader`; also returns what was dropped.
    ///
    /// # Errors
    /// Unreadable input, ten bad samples in a row, no sample at all.
    pub fn read_all<R: BufRead>(
        mut reader: PoseReader<R>,
    ) -> Result<(Self, FaultCounts), PoseError> {
        let mut samples = Vec::new();
        for sample in &mut reader {
            samples.push(sample?);
        }
        let header = reader.header().clone();
        for sample in &mut samples {
            sample.channels.resize(header.channels.len(), None);
        }
        let counts = *reader.counts();
        if samples.is_empty() {
            return Err(PoseError::Empty {
                file: reader.file().into(),
                dropped: counts.to_string(),
            });
        }
        Ok((Self { header, samples }, counts))
    }

    /// Writes the recording to a `.jsonl` or `.csv` file, 0.1 mm resolution.
    ///
    /// # Errors
    /// An ending that is neither, unwritable file.
    pub fn write(&self, path: &Path) -> Result<(), PoseError> {
        let failed = |source| PoseError::Write {
            file: path.display().to_string(),
            source,
        };
        let format = PoseFormat::of(path)
            .ok()
            .filter(|format| *format != PoseFormat::Bvh)
            .ok_or_else(|| PoseError::WriteFormat {
                file: path.display().to_string(),
            })?;
        let out = BufWriter::new(File::create(path).map_err(failed)?);
        let mut writer = PoseWriter::new(out, &self.header, format, 4).map_err(failed)?;
        for sample in &self.samples {
            writer.write(sample).map_err(failed)?;
        }
        writer.finish().map_err(failed)?;
        Ok(())
    }

    /// First and last time in seconds.
    pub fn span_s(&self) -> (f64, f64) {
        let time = |sample: Option<&PoseSample>| sample.map_or(0.0, |sample| sample.t);
        (time(self.samples.first()), time(self.samples.last()))
    }

    /// All places with the gaps filled: linearly between neighbours in time, held at the ends.
    ///
    /// One row per sample, one place per point.
    ///
    /// # Errors
    /// The name of a point that is never seen.
    pub fn filled(&self) -> Result<Vec<Vec<[f64; 3]>>, String> {
        let mut rows = vec![vec![[0.0; 3]; self.header.points.len()]; self.samples.len()];
        for (point, name) in self.header.points.iter().enumerate() {
            let mut last: Option<(usize, [f64; 3])> = None;
            for index in 0..self.samples.len() {
                let Some(place) = self.samples[index].points[point] else {
                    continue;
                };
                let (from, start) = last.unwrap_or((0, place));
                let t0 = self.samples[from].t;
                let span = self.samples[index].t - t0;
                for (row, sample) in rows[from..=index].iter_mut().zip(&self.samples[from..]) {
                    let u = if span > 0.0 {
                        (sample.t - t0) / span
                    } else {
                        1.0
                    };
                    for axis in 0..3 {
                        row[point][axis] = start[axis] + u * (place[axis] - start[axis]);
                    }
                }
                last = Some((index, place));
            }
            let Some((from, place)) = last else {
                return Err(name.clone());
            };
            for row in &mut rows[from..] {
                row[point] = place;
            }
        }
        Ok(rows)
    }
}
