//! The `--targets` file: one row of joint targets per control cycle.

use crate::live::CycleRecord;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

/// Writes targets as CSV. The first failure is kept and reported at the end, since a full disk must
/// not stop a robot in mid-step.
pub struct TargetsFile {
    path: PathBuf,
    out: BufWriter<File>,
    failure: Option<std::io::Error>,
}

impl TargetsFile {
    /// Creates the file and writes its header.
    pub fn create(path: &Path, joints: &[String]) -> std::io::Result<Self> {
        let mut out = BufWriter::new(File::create(path)?);
        writeln!(out, "t,{}", joints.join(","))?;
        Ok(Self {
            path: path.into(),
            out,
            failure: None,
        })
    }

    /// Appends the row of one cycle.
    pub fn row(&mut self, record: &CycleRecord) {
        if self.failure.is_some() {
            return;
        }
        let mut write = || -> std::io::Result<()> {
            write!(self.out, "{:.6}", record.t_s)?;
            for target in &record.targets {
                // Nine decimals: rounding stays invisible even in second differences.
                write!(self.out, ",{target:.9}")?;
            }
            self.out.write_all(b"\n")
        };
        self.failure = write().err();
    }

    /// Flushes; says what went wrong while writing, if anything did.
    pub fn finish(mut self) -> Result<(), String> {
        let flushed = self.out.flush().err();
        match self.failure.or(flushed) {
            Some(e) => Err(format!("{}: cannot be written: {e}", self.path.display())),
            None => Ok(()),
        }
    }
}
