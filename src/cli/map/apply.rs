//! `handwave map apply`: a map run over a recording, one row of joint positions per sample.

use super::shelf::{limits, robot};
use crate::cli::{ExitStatus, Failure, poses, warn};
use crate::config::Files;
use crate::config::map::load_map;
use crate::gesture::PoseFeatures;
use crate::motion::mapping::MapFile;
use clap::Args;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::PathBuf;

#[derive(Args, Debug)]
pub(super) struct ApplyArgs {
    /// The map file
    #[arg(long)]
    map: PathBuf,
    /// The pose stream (.jsonl or .csv)
    #[arg(long)]
    poses: PathBuf,
    /// Where to write joint positions (CSV)
    #[arg(long)]
    out: PathBuf,
    /// Robot whose joint limits hold too, and whose joint order is written
    #[arg(long)]
    urdf: Option<PathBuf>,
}

pub(super) fn apply(args: &ApplyArgs) -> Result<ExitStatus, Failure> {
    let model = robot(args.urdf.as_deref())?;
    let (files, name) = Files::of(&args.map);
    let joints = match &model {
        Some(model) => model.joint_names(),
        None => {
            let text = files.read(&name).map_err(Failure::input)?;
            let file = MapFile::from_toml(&text);
            let file = file.map_err(|e| Failure::input(format!("{}: {e}", files.name(&name))))?;
            file.joints
        }
    };
    let (lower, upper) = limits(model.as_ref(), joints.len());
    let mut parts = load_map(&files, &name, &joints, &lower, &upper).map_err(Failure::input)?;
    let (recording, _) = poses::read(&args.poses)?;
    let mut features = PoseFeatures::new(&parts.spec, &recording.header)
        .map_err(|e| Failure::input(format!("{}: {e}", args.poses.display())))?;
    let failed = |e: std::io::Error| {
        Failure::input(format!(
            "{}: cannot be written: {e}; check the folder and its permissions",
            args.out.display()
        ))
    };
    let mut pose = vec![0.0; joints.len()];
    let mut refused = 0;
    let mut write = || -> std::io::Result<()> {
        let mut out = BufWriter::new(File::create(&args.out)?);
        writeln!(out, "t,{}", joints.join(","))?;
        for sample in &recording.samples {
            if features.push(sample).is_err() {
                refused += 1;
                continue;
            }
            parts
                .map
                .apply(features.feature().unwrap_or_default(), &mut pose);
            write!(out, "{}", sample.t)?;
            for q in &pose {
                write!(out, ",{q:.6}")?;
            }
            out.write_all(b"\n")?;
        }
        out.flush()
    };
    write().map_err(failed)?;
    if refused > 0 {
        warn(format_args!(
            "{}: {refused} samples without a row: too few points seen",
            args.poses.display()
        ));
    }
    Ok(ExitStatus::Done)
}
