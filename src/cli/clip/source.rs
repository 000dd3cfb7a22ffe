//! Which motion file, and what it does not tell: options that import and export share.

use crate::cli::{Failure, warn};
use crate::motion::import::{Axis, ImportOptions, open};
use crate::motion::take::Take;
use crate::pose::bvh::LengthUnit;
use clap::Args;
use std::path::{Path, PathBuf};

/// Files larger than this take a moment, bytes.
const LARGE: u64 = 16 << 20;

/// What a file does not tell, or tells wrongly.
#[derive(Args, Debug)]
pub(super) struct SourceArgs {
    /// Which axis of the file points up: y, z, x, or one with a minus (default: that of the format).
    #[arg(long, allow_hyphen_values = true, value_name = "AXIS")]
    up: Option<Axis>,
    /// Which axis the body at rest faces, or auto: by left and right joints, else by travel.
    #[arg(
        long,
        allow_hyphen_values = true,
        value_name = "AXIS|auto",
        default_value = "auto"
    )]
    forward: String,
    /// Unit of length: m, cm, mm, in, ft, or its length in metres (default: that of the format).
    #[arg(long)]
    unit: Option<LengthUnit>,
    /// Frames per second: of an AMC file (default 120); at which a glTF is sampled (default 60).
    #[arg(long, value_name = "HZ")]
    fps: Option<f64>,
    /// Which animation of a glTF; the same as FILE#NAME.
    #[arg(long, value_name = "NAME")]
    animation: Option<String>,
    /// Where the bones are: the .asf of an .amc, any motion of the same skeleton for a .csv.
    #[arg(long, value_name = "FILE")]
    skeleton: Option<PathBuf>,
    /// Joints of a quadruped robot's JSON, by leg: front right, front left, rear right, rear left.
    #[arg(long, value_delimiter = ',', value_name = "A,B,...")]
    joints: Option<Vec<String>>,
    /// Where the motion comes from: author, recording, licence.
    #[arg(long, value_name = "TEXT", default_value = "")]
    origin: String,
}

impl SourceArgs {
    /// The one motion of `file`; assumptions go to standard error.
    pub fn read(&self, file: &Path) -> Result<Take, Failure> {
        let forward = match self.forward.as_str() {
            "auto" => None,
            axis => Some(
                axis.parse()
                    .map_err(|e| Failure::input(format!("--forward: {e}, auto")))?,
            ),
        };
        let options = ImportOptions {
            up: self.up,
            forward,
            unit: self.unit,
            rate_hz: self.fps,
            animation: self.animation.clone(),
            skeleton: self.skeleton.clone(),
            joints: self.joints.clone(),
            origin: self.origin.clone(),
        };
        if let Ok(data) = std::fs::metadata(file)
            && data.len() > LARGE
        {
            let megabytes = data.len() >> 20;
            warn(format_args!("reading {} ({megabytes} MB)", file.display()));
        }
        let mut imported = open(file, &options).map_err(Failure::input)?;
        for warning in &imported.warnings {
            warn(format_args!("{}: {warning}", file.display()));
        }
        if imported.takes.len() != 1 {
            let names: Vec<&str> = imported.takes.iter().map(|t| t.name.as_str()).collect();
            return Err(Failure::input(format!(
                "{}: {} animations ({}); choose one: {}#{}",
                file.display(),
                names.len(),
                names.join(", "),
                file.display(),
                names.first().unwrap_or(&"NAME")
            )));
        }
        // Just checked to be one.
        Ok(imported.takes.remove(0))
    }
}
