//! `handwave clip info`: what a motion is, as a table, JSON or a plot.

#[cfg(feature = "plot")]
mod plots;

use super::source::SourceArgs;
use crate::base::print::{say, warn};
use crate::cli::disk;
use crate::cli::{ExitStatus, Failure};
use crate::motion::analysis::cut::{self, CutOptions, Seam};
use crate::motion::analysis::mirror::{self, Mirror, Symmetry};
use crate::motion::analysis::{Analysis, BodyModel, FootContact, analyse};
use crate::motion::clip::ClipFile;
use crate::motion::take::{Take, TakeBody};
use crate::robot::RobotModel;
use clap::Args;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// Arguments of `handwave clip info`.
#[derive(Args, Debug)]
pub struct InfoArgs {
    /// The motion: a clip, or any format that `clip import` reads; FILE#NAME selects one animation
    file: PathBuf,
    /// Robot of a motion in joint space: its feet, limits and mirror image
    #[arg(long)]
    urdf: Option<PathBuf>,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
    /// Draw contacts, foot heights, joints and speed as SVG
    #[arg(long, value_name = "OUT.svg")]
    plot: Option<PathBuf>,
    #[command(flatten)]
    source: SourceArgs,
}

/// Examples for the help.
pub const EXAMPLES: &str = "Examples:
  handwave clip info walk.bvh
  handwave clip info Fox.glb#Walk --unit cm --plot walk.svg
  handwave clip info trot0.txt --urdf a1.urdf --json

Feet stand where they are low and slow. Touch-down is a fraction of the cycle; in the
bar each block is 1/32 of the cycle on the ground. Slide is the way of a foot over the
ground while it stands, ground the height of the foot's joint then. Jerk is that of the
whole cycle over that of a sine (1: smoothest). Mirror images and a robot's feet need
its URDF.";

/// One take with all that was found out about it.
struct Findings {
    take: Take,
    body: BodyModel,
    found: Analysis,
    mirror: Option<Mirror>,
    symmetry: Vec<Symmetry>,
    seam: Option<Seam>,
    clip: Option<ClipFile>,
    warnings: Vec<String>,
}

/// Runs `handwave clip info ...`.
pub fn run(args: &InfoArgs) -> Result<ExitStatus, Failure> {
    let model = args.urdf.as_deref().map(disk::read_model).transpose()?;
    let take = args.source.read(&args.file)?;
    // A clip of our own says more than its take: kind, limbs, root.
    let clip = std::fs::read_to_string(&args.file)
        .ok()
        .and_then(|text| ClipFile::from_json(&text).ok());
    let findings = look(take, clip, model.as_ref())
        .map_err(|e| Failure::input(format!("{}: {e}", args.file.display())))?;
    if args.json {
        say(format_args!("{}", to_json(&findings)));
    } else {
        print(&findings);
    }
    if let Some(out) = &args.plot {
        draw(out, &findings)?;
    }
    Ok(ExitStatus::Done)
}

#[cfg(feature = "plot")]
fn draw(out: &Path, findings: &Findings) -> Result<(), Failure> {
    let text = plots::figure(findings)
        .svg()
        .map_err(|e| Failure::input(e.to_string()))?;
    disk::write(out, text)?;
    warn(format_args!("wrote {}", out.display()));
    Ok(())
}

/// This build draws none.
#[cfg(not(feature = "plot"))]
fn draw(_: &Path, _: &Findings) -> Result<(), Failure> {
    warn(format_args!("no plot: this build lacks the feature `plot`"));
    Ok(())
}

fn look(
    take: Take,
    clip: Option<ClipFile>,
    model: Option<&RobotModel>,
) -> Result<Findings, crate::motion::analysis::AnalysisError> {
    let body = BodyModel::of(&take, model)?;
    let found = analyse(&take, &body)?;
    let mut warnings: Vec<String> = body.note.iter().cloned().collect();
    let mirror = Mirror::of(&take, &body).ok();
    let symmetry = match (&mirror, &found.cycle) {
        (Some(mirror), Some(cycle)) => mirror::symmetry(&take, &body, mirror, cycle),
        _ => Vec::new(),
    };
    let any_seam = CutOptions {
        most_seam: f64::INFINITY,
        ..CutOptions::default()
    };
    let seam = (found.cycle.as_ref())
        .and_then(|c| cut::cycle(&take, &body, c, &found.feet, &any_seam).ok())
        .map(|cut| cut.seam);
    if let Some(seam) = seam
        && seam.share > CutOptions::default().most_seam
    {
        warnings.push(format!(
            "the ends of the cycle are {:.0} mm apart, {:.0} % of the motion: too far to be closed",
            1e3 * seam.distance_m,
            100.0 * seam.share
        ));
    }
    if let Some(model) = model {
        for (j, (name, limit)) in model.joint_names().iter().zip(model.limits()).enumerate() {
            let (low, high) = range(&take, j);
            if low < limit.lower - 1e-6 || high > limit.upper + 1e-6 {
                warnings.push(format!(
                    "joint {name} goes from {low:.3} to {high:.3} rad; its limits are {:.3} to {:.3}",
                    limit.lower, limit.upper
                ));
            }
            let speed = found.smoothness.get(j).map_or(0.0, |s| s.speed);
            if speed > limit.velocity {
                warnings.push(format!(
                    "joint {name} moves at {speed:.1} rad/s; its limit is {:.1}",
                    limit.velocity
                ));
            }
        }
    }
    if let Some(feet) = body.feet()
        && let Some(reach) = (0..feet.count()).map(|f| feet.reach_m(f)).reduce(f64::max)
        && !(0.02..=5.0).contains(&reach)
    {
        warnings.push(format!(
            "legs reach {reach:.3} m: is the unit of length right? (--unit)"
        ));
    }
    for foot in &found.feet {
        if foot.error.penetration_m > 0.02 {
            warnings.push(format!(
                "foot {} sinks {:.0} mm below its ground",
                foot.name,
                1e3 * foot.error.penetration_m
            ));
        }
    }
    Ok(Findings {
        take,
        body,
        found,
        mirror,
        symmetry,
        seam,
        clip,
        warnings,
    })
}

/// Lowest and highest value of a coordinate.
fn range(take: &Take, coordinate: usize) -> (f64, f64) {
    (take.poses.iter()).fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), pose| {
        (low.min(pose[coordinate]), high.max(pose[coordinate]))
    })
}

impl Findings {
    fn kind(&self) -> &'static str {
        match &self.found.cycle {
            Some(c) if c.closed => "cycle",
            Some(_) => "cycles",
            None if self.take.wraps => "loop",
            None => "path",
        }
    }

    fn body_words(&self) -> String {
        match &self.take.body {
            TakeBody::Joints(names) => format!("robot of {} joints", names.len()),
            TakeBody::Floating(names) => format!("walking robot of {} joints", names.len()),
            TakeBody::Skeleton(skeleton) => format!("skeleton of {} joints", skeleton.len()),
        }
    }

    /// Names of joints that are partners, with what was found about them.
    fn pairs(&self) -> Vec<(String, String, &Symmetry)> {
        let skip = usize::from(matches!(self.take.body, TakeBody::Skeleton(_)));
        let name = |j: usize| self.body.space().parts()[j + skip].name.clone();
        (self.symmetry.iter())
            .map(|s| (name(s.left), name(s.right), s))
            .collect()
    }

    /// Per joint: name, lowest and highest value (for ball joints the range of its largest component),
    /// limits, greatest speed, acceleration, normalised jerk.
    fn joints(&self) -> Vec<JointRow> {
        let period = match self.found.cycle {
            Some(c) => 1.0 / c.frequency_hz,
            None => self.take.duration_s(),
        };
        let limits = self.body.model().map(RobotModel::limits);
        (self.body.space().parts().iter().enumerate())
            .filter(|(_, part)| part.tangent.len() != 6)
            .map(|(i, part)| {
                let own = &self.found.smoothness[part.tangent.clone()];
                let most = own.iter().max_by(|a, b| a.range.total_cmp(&b.range));
                let most = most.copied().unwrap_or_default();
                let single = part.coordinates.len() == 1;
                JointRow {
                    name: part.name.clone(),
                    range: if single {
                        range(&self.take, part.coordinates.start)
                    } else {
                        (0.0, most.range)
                    },
                    limits: limits
                        .as_ref()
                        .and_then(|l| l.get(i))
                        .map(|l| (l.lower, l.upper)),
                    speed: most.speed,
                    acceleration: most.acceleration,
                    // A joint that hardly moves has no smoothness worth telling.
                    jerk: if most.range > 0.01 {
                        most.normalised_jerk(period)
                    } else {
                        0.0
                    },
                }
            })
            .collect()
    }
}

struct JointRow {
    name: String,
    range: (f64, f64),
    limits: Option<(f64, f64)>,
    speed: f64,
    acceleration: f64,
    jerk: f64,
}

fn bar(findings: &Findings, foot: &FootContact) -> String {
    const CELLS: usize = 32;
    let blocks = [' ', '\u{2591}', '\u{2592}', '\u{2593}', '\u{2588}'];
    (foot.over(findings.found.cycle.as_ref(), CELLS).iter())
        .map(|share| blocks[(share * 4.0).round().clamp(0.0, 4.0) as usize])
        .collect()
}

fn print(findings: &Findings) {
    let Findings { take, found, .. } = findings;
    say(format_args!(
        "{} ({}, {})",
        take.name,
        findings.kind(),
        findings.body_words()
    ));
    if !take.origin.is_empty() {
        say(format_args!("  origin     {}", take.origin));
    }
    say(format_args!(
        "  length     {} frames of {:.1} ms, {:.2} s",
        take.len(),
        1e3 * take.dt_s,
        take.duration_s()
    ));
    match &found.cycle {
        Some(c) => say(format_args!(
            "  cycle      {:.3} Hz ({:.1} frames from frame {}), likeness {:.2}{}",
            c.frequency_hz,
            c.frames,
            c.start,
            c.likeness,
            if c.closed { ", closed loop" } else { "" }
        )),
        None => say(format_args!("  cycle      none: nothing in it repeats")),
    }
    if let Some(gait) = found.gait {
        say(format_args!("  gait       looks like: {gait}"));
    }
    let travel = &found.travel;
    say(format_args!(
        "  travel     {:.2} m/s forwards, {:.2} m/s left, turns {:.2} rad/s{}",
        travel.forward_m_s,
        travel.left_m_s,
        travel.turn_rad_s,
        if travel.on_the_spot {
            " (recorded on the spot: what its feet tell)"
        } else {
            ""
        }
    ));
    if let Some(seam) = &findings.seam {
        say(format_args!(
            "  seam       {:.1} mm ({:.0} % of the motion); closing it moves joints by up to {:.3} rad or m",
            1e3 * seam.distance_m,
            100.0 * seam.share,
            seam.moved
        ));
    }
    print_feet(findings);
    for (left, right, s) in findings.pairs() {
        say(format_args!(
            "  symmetric  {left} and {right}: {:.0} % alike, {:.2} of the cycle apart",
            100.0 * s.likeness,
            s.shift
        ));
    }
    print_joints(findings);
    for warning in &findings.warnings {
        say(format_args!("warning: {warning}"));
    }
}

fn print_feet(findings: &Findings) {
    let feet = &findings.found.feet;
    if feet.is_empty() {
        return;
    }
    say(format_args!(
        "  {:<14} {:>10} {:>5}  {:<32}  {:>7} {:>14} {:>10}",
        "foot", "touch-down", "duty", "on the ground", "lift mm", "slide mm (max)", "ground mm"
    ));
    for foot in feet {
        let phase = foot.phase.map_or("-".into(), |p| format!("{p:.2}"));
        say(format_args!(
            "  {:<14} {phase:>10} {:>5.2}  {}  {:>7.0} {:>6.0} ({:>4.0}) {:>12.0}",
            foot.name,
            foot.duty,
            bar(findings, foot),
            1e3 * foot.clearance_m,
            1e3 * foot.slide.mean_m,
            1e3 * foot.slide.largest_m,
            1e3 * foot.ground_m
        ));
    }
}

fn print_joints(findings: &Findings) {
    let rows = findings.joints();
    let ball = matches!(findings.take.body, TakeBody::Skeleton(_));
    let wide = rows.iter().map(|r| r.name.len()).max().unwrap_or(5).max(5);
    let what = if ball { "swings by rad" } else { "range rad" };
    say(format_args!(
        "  {:<wide$} {what:>18} {:>18} {:>7} {:>8} {:>6}",
        "joint", "limits", "rad/s", "rad/s2", "jerk"
    ));
    for row in rows {
        let (low, high) = row.range;
        let range = if ball {
            format!("{high:.3}")
        } else {
            format!("{low:.3} .. {high:.3}")
        };
        let limits = row
            .limits
            .map_or("-".into(), |(low, high)| format!("{low:.3} .. {high:.3}"));
        say(format_args!(
            "  {:<wide$} {range:>18} {limits:>18} {:>7.1} {:>8.0} {:>6.1}",
            row.name, row.speed, row.acceleration, row.jerk
        ));
    }
}

fn to_json(findings: &Findings) -> Value {
    let Findings { take, found, .. } = findings;
    let feet: Vec<Value> = (found.feet.iter())
        .map(|f| {
            json!({
                "name": f.name, "touch_down": f.phase, "duty": f.duty, "stances": f.stances.len(),
                "ground_m": f.ground_m, "clearance_m": f.clearance_m,
                "slide_mean_m": f.slide.mean_m, "slide_largest_m": f.slide.largest_m,
                "penetration_m": f.error.penetration_m, "hover_m": f.error.hover_m,
            })
        })
        .collect();
    let pairs: Vec<Value> = (findings.pairs().into_iter())
        .map(|(left, right, s)| json!({"left": left, "right": right, "likeness": s.likeness, "shift": s.shift}))
        .collect();
    let joints: Vec<Value> = (findings.joints().iter())
        .map(|r| {
            json!({
                "name": r.name, "range": r.range, "limits": r.limits, "speed": r.speed,
                "acceleration": r.acceleration, "normalised_jerk": r.jerk,
            })
        })
        .collect();
    let mut value = json!({
        "name": take.name, "origin": take.origin, "kind": findings.kind(), "body": findings.body_words(),
        "frames": take.len(), "dt_s": take.dt_s, "duration_s": take.duration_s(),
        "cycle": found.cycle.map(|c| json!({
            "frequency_hz": c.frequency_hz, "start_frame": c.start, "frames": c.frames,
            "likeness": c.likeness, "closed": c.closed,
        })),
        "frequency_hz": found.cycle.map(|c| c.frequency_hz),
        "gait": found.gait.map(|g| g.to_string()),
        "travel": {
            "forward_m_s": found.travel.forward_m_s, "left_m_s": found.travel.left_m_s,
            "turn_rad_s": found.travel.turn_rad_s, "on_the_spot": found.travel.on_the_spot,
        },
        "seam": findings.seam.map(|s| json!({"distance_m": s.distance_m, "share": s.share, "moved": s.moved})),
        "feet": feet, "symmetric": pairs, "joints": joints, "mirrored": findings.mirror.is_some(),
        "warnings": findings.warnings,
    });
    if let Some(clip) = &findings.clip {
        value["clip"] = json!({"kind": clip.kind, "root": clip.root, "segments": clip.segments});
    }
    value
}
