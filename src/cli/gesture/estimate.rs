//! `handwave gesture estimate`: an estimator run over a recording, one row per gesture and sample.

use super::load;
use crate::base::suggest;
use crate::cli::{ExitStatus, Failure, poses, warn};
use crate::gesture::{
    EstimatorKind, FrontEnd, FrontEndOptions, GestureSet, PerformerScale, TrackingCounts,
};
use crate::pose::Recording;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

pub(super) fn estimate(
    gestures: &Path,
    poses: &Path,
    out: &Path,
    estimator: &str,
    scale: PerformerScale,
) -> Result<ExitStatus, Failure> {
    let kind = EstimatorKind::from_name(estimator).ok_or_else(|| {
        let names = EstimatorKind::NAMES;
        let hint = suggest::nearest(estimator, names)
            .map_or_else(String::new, |name| format!("; did you mean {name}?"));
        Failure::input(format!(
            "--estimator {estimator}: allowed: {}{hint}",
            names.join(", ")
        ))
    })?;
    let set = load(gestures)?;
    let (recording, _) = poses::read(poses)?;
    let options = FrontEndOptions {
        estimator: kind,
        scale,
        ..FrontEndOptions::default()
    };
    let mut front = FrontEnd::new(&set, &recording.header, options)
        .map_err(|error| Failure::input(format!("{}: {error}", poses.display())))?;
    let failed = |error: std::io::Error| {
        Failure::input(format!(
            "{}: cannot be written: {error}; check the folder and its permissions",
            out.display()
        ))
    };
    let mut file = BufWriter::new(File::create(out).map_err(failed)?);
    let refused = write_estimates(&mut file, &set, &recording, &mut front).map_err(failed)?;
    if refused > 0 {
        warn(format_args!(
            "{}: {refused} samples without estimate: too few points seen",
            poses.display()
        ));
    }
    let mended = front.tracking();
    if mended != TrackingCounts::default() {
        warn(format_args!("{}: {mended}", poses.display()));
    }
    match front.performer_scale() {
        None => warn(format_args!(
            "{}: no still second with all points seen, so no scale was measured; declare it with --scale NUMBER",
            poses.display()
        )),
        Some(measured) if scale == PerformerScale::Rest => warn(format_args!(
            "{}: performer's scale {measured:.3}",
            poses.display()
        )),
        Some(_) => {}
    }
    Ok(ExitStatus::Done)
}

/// Writes one row per gesture and sample; returns how many samples the front end refused.
fn write_estimates(
    file: &mut impl Write,
    set: &GestureSet,
    recording: &Recording,
    front: &mut FrontEnd,
) -> std::io::Result<u64> {
    writeln!(file, "t,gesture,amplitude,frequency_hz,phase_rad,quality")?;
    let mut refused = 0;
    for sample in &recording.samples {
        // A sample with too few points changes nothing: what the puppet would go on with is the
        // last estimate carried to this instant.
        let coasting = front.push(sample).is_err();
        refused += u64::from(coasting);
        for (index, gesture) in set.gestures.iter().enumerate() {
            let estimate = front.predict(index, sample.t);
            // Rounded up, an angle just under a full turn would print as one.
            let phase = (estimate.phase_rad * 1e6).floor() * 1e-6;
            writeln!(
                file,
                "{},{},{:.6},{:.6},{:.6},{:.4}",
                sample.t,
                gesture.name,
                estimate.amplitude,
                estimate.frequency_hz,
                phase,
                estimate.quality
            )?;
        }
    }
    file.flush()?;
    Ok(refused)
}
