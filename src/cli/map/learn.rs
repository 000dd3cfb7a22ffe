//! `handwave map learn`: from pairs to a map file, with a report.

use super::shelf::{Shelf, SourceArgs, TargetArgs, limits, robot};
use crate::cli::{ExitStatus, Failure, say};
use crate::config::map::{Lesson, MapParts, build_map, teach};
use crate::motion::mapping::file::VolumeSource;
use crate::motion::mapping::{MOST_AXES, MapFile, NOISE_VARIANCE, learn_volume};
use clap::Args;
use std::path::PathBuf;

#[derive(Args, Debug)]
pub(super) struct LearnArgs {
    #[command(flatten)]
    source: SourceArgs,
    /// Robot whose joints are mapped and whose limits hold (default: the joints of the first clip, no limits)
    #[arg(long)]
    urdf: Option<PathBuf>,
    #[command(flatten)]
    targets: TargetArgs,
    /// Where to write the map
    #[arg(long)]
    out: PathBuf,
    /// sigma^2: more smooths the map, less meets the pairs closer
    #[arg(long, value_name = "VARIANCE", default_value_t = NOISE_VARIANCE, allow_negative_numbers = true)]
    noise: f64,
    /// Most principal axes of the target
    #[arg(long, value_name = "D", default_value_t = MOST_AXES)]
    components: usize,
    /// Turn of the root per turn of the performer, for a body that can turn
    #[arg(
        long,
        value_name = "R",
        default_value_t = 0.0,
        allow_negative_numbers = true
    )]
    yaw_ratio: f64,
    /// Print the report as one JSON object
    #[arg(long)]
    json: bool,
}

pub(super) fn learn(args: &LearnArgs) -> Result<ExitStatus, Failure> {
    let model = robot(args.urdf.as_deref())?;
    let source = args.source.read()?;
    let mut shelf = Shelf::of(model.as_ref());
    let wishes = args.targets.read(&mut shelf)?;
    let mut lessons = Vec::new();
    for wish in &wishes {
        let name = format!("{} s = {}", wish.t_s, wish.target.text);
        let feature = source
            .at(wish.t_s)
            .map_err(|e| Failure::input(format!("pair {name}: {e}")))?;
        lessons.push(Lesson {
            t_s: source.times_s[feature],
            pose: shelf.pose(&wish.target),
            name,
        });
    }
    let (volume, root) = learn_volume(&shelf.clips, args.components).map_err(Failure::input)?;
    let mut file = teach(&source.recording, &source.spec, source.spread_m, &lessons);
    file.recording = args
        .source
        .poses
        .file_name()
        .map(|n| n.to_string_lossy().into_owned())
        .unwrap_or_default();
    file.noise_variance = args.noise;
    file.components = args.components;
    file.yaw_ratio = args.yaw_ratio;
    file.joints.clone_from(&shelf.joints);
    file.volume = VolumeSource::Volume(volume, root.weights);
    // What is reported is what a reader of the file will get, rounding included.
    let text = file.to_toml();
    let name = args.out.display().to_string();
    let file = MapFile::from_toml(&text).map_err(|e| Failure::input(format!("{name}: {e}")))?;
    let (lower, upper) = limits(model.as_ref(), shelf.joints.len());
    let mut parts = build_map(&name, &file, &[], &lower, &upper).map_err(Failure::input)?;
    std::fs::write(&args.out, text).map_err(|e| {
        Failure::input(format!(
            "{name}: cannot be written: {e}; check the folder and its permissions"
        ))
    })?;
    report(args.json, &name, &file, &mut parts)?;
    Ok(ExitStatus::Done)
}

/// Variance kept, and how close each pair is met.
fn report(json: bool, name: &str, file: &MapFile, parts: &mut MapParts) -> Result<(), Failure> {
    let volume = parts.map.volume();
    let (axes, kept) = (volume.dimensions(), volume.kept);
    let mut rows = Vec::new();
    let mut pose = vec![0.0; file.joints.len()];
    for pair in &file.pairs {
        let feature = crate::config::map::feature_of(&parts.spec, pair).map_err(Failure::input)?;
        parts.map.apply(&feature, &mut pose);
        let (q, _) = parts.map.uncertainty(&feature);
        let errors = || pose.iter().zip(&pair.pose).map(|(a, b)| (a - b).abs());
        let rms = (errors().map(|e| e * e).sum::<f64>() / pose.len() as f64).sqrt();
        let (worst, joint) = errors().zip(&file.joints).fold(
            (0.0, ""),
            |most: (f64, &str), (e, joint)| {
                if e > most.0 { (e, joint) } else { most }
            },
        );
        rows.push((pair.name.clone(), rms, worst, joint.to_owned(), q));
    }
    if json {
        let pairs: Vec<_> = rows
            .iter()
            .map(|(pair, rms, worst, joint, q)| {
                serde_json::json!({
                    "pair": pair, "residual_rms_rad": rms, "residual_worst_rad": worst,
                    "worst_joint": joint, "q": q,
                })
            })
            .collect();
        let object = serde_json::json!({
            "map": name, "joints": file.joints, "axes": axes, "variance_kept": kept,
            "spread_m": file.spread_m, "pairs": pairs,
        });
        say(format_args!("{object}"));
        return Ok(());
    }
    say(format_args!(
        "{name}: {} pairs, {} joints, {axes} axes hold {:.2} % of the target's variance, source spread {:.3} m",
        rows.len(),
        file.joints.len(),
        100.0 * kept,
        file.spread_m
    ));
    say(format_args!(
        "{:<36} {:>14} {:>16}  joint",
        "pair", "residual [rad]", "worst [rad]"
    ));
    for (pair, rms, worst, joint, _) in &rows {
        say(format_args!(
            "{pair:<36} {rms:>14.4} {worst:>16.4}  {joint}"
        ));
    }
    Ok(())
}
