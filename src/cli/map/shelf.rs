//! What the commands of `handwave map` share: source recording, target clips, pairs.

use crate::cli::{Failure, poses};
use crate::gesture::FeatureSpec;
use crate::motion::clip::{Clip, ClipFile};
use crate::motion::mapping::spread_m;
use crate::pose::{GlobalOptions, Recording};
use crate::robot::RobotModel;
use clap::Args;
use std::path::{Path, PathBuf};

/// How the source is read.
#[derive(Args, Debug)]
pub(super) struct SourceArgs {
    /// The pose stream (.jsonl or .csv)
    #[arg(long)]
    pub(super) poses: PathBuf,
    /// The point that is the body; its motion does not count (default: palm, else wrist, else the centroid)
    #[arg(long, value_name = "POINT")]
    anchor: Option<String>,
    /// Whether turns of the whole body are removed (default: in 3-D with three points or more)
    #[arg(long, value_name = "BOOL")]
    yaw: Option<bool>,
    /// Whether height is removed (default: with an anchor)
    #[arg(long, value_name = "BOOL")]
    height: Option<bool>,
    /// w: weight of velocities, s
    #[arg(
        long,
        value_name = "S",
        default_value_t = 0.1,
        allow_negative_numbers = true
    )]
    velocity_weight: f64,
    /// Standard deviation of the one-sided smoothing, s
    #[arg(
        long,
        value_name = "S",
        default_value_t = 0.1,
        allow_negative_numbers = true
    )]
    smoothing: f64,
}

/// Target clips and pairs.
#[derive(Args, Debug)]
pub(super) struct TargetArgs {
    /// A clip of unlabelled target motion, which pairs may name without its path (repeatable)
    #[arg(long, value_name = "CLIP")]
    clip: Vec<PathBuf>,
    /// A pair (repeatable)
    #[arg(long, value_name = "T=CLIP@PHASE")]
    pair: Vec<String>,
    /// Pairs from a file, one a line
    #[arg(long, value_name = "FILE")]
    pairs: Option<PathBuf>,
}

impl TargetArgs {
    /// Puts the clips on the shelf; returns the pairs.
    pub(super) fn read(&self, shelf: &mut Shelf) -> Result<Vec<Wish>, Failure> {
        for clip in &self.clip {
            shelf.add(clip)?;
        }
        shelf.wishes(&self.pair, self.pairs.as_deref())
    }
}

/// A source recording with its features.
pub(super) struct Source {
    pub(super) recording: Recording,
    pub(super) spec: FeatureSpec,
    pub(super) spread_m: f64,
    /// Times and features of the samples, not scaled.
    pub(super) times_s: Vec<f64>,
    pub(super) features: Vec<Vec<f64>>,
}

impl SourceArgs {
    pub(super) fn read(&self) -> Result<Source, Failure> {
        for (key, value, most) in [
            ("--velocity-weight", self.velocity_weight, 10.0),
            ("--smoothing", self.smoothing, 2.0),
        ] {
            if !(value >= 0.0 && value <= most) {
                return Err(Failure::input(format!(
                    "{key} {value} is not in 0..{most} s"
                )));
            }
        }
        let name = self.poses.display().to_string();
        let failed = |e: &dyn std::fmt::Display| Failure::input(format!("{name}: {e}"));
        let (recording, _) = poses::read(&self.poses)?;
        if recording.header.points.is_empty() {
            return Err(failed(
                &"the stream has channels only; make points of them first, with `handwave poses import FILE --as-points A,B,...`",
            ));
        }
        let recording = recording
            .without_gaps()
            .map_err(|point| failed(&format!("point {point} is never seen")))?;
        let global = GlobalOptions {
            anchor: self.anchor.clone(),
            yaw: self.yaw,
            height: self.height,
        };
        let spec =
            FeatureSpec::of_recording(&recording, global, self.velocity_weight, self.smoothing)
                .map_err(|e| failed(&e))?;
        let all = spec.features(&recording).map_err(|e| failed(&e))?;
        let times_s = all.iter().map(|(i, _)| recording.samples[*i].t).collect();
        let features: Vec<Vec<f64>> = all.into_iter().map(|(_, feature)| feature).collect();
        let spread_m = spread_m(&name, &features).map_err(Failure::input)?;
        Ok(Source {
            recording,
            spec,
            spread_m,
            times_s,
            features,
        })
    }
}

impl Source {
    /// Index of the feature nearest to `t_s`.
    pub(super) fn at(&self, t_s: f64) -> Result<usize, String> {
        let (from, to) = self.recording.span_s();
        if !(t_s >= from - 1e-6 && t_s <= to + 1e-6) {
            return Err(format!(
                "time {t_s} s is not in the recording, {from:.3}..{to:.3} s"
            ));
        }
        let near = (0..self.times_s.len()).min_by(|a, b| {
            let away = |k: usize| (self.times_s[k] - t_s).abs();
            away(*a).total_cmp(&away(*b))
        });
        near.ok_or_else(|| "no sample gives a feature".into())
    }
}

/// A target pose as asked for: a clip and a place in it.
#[derive(Clone, Debug)]
pub(super) struct Target {
    /// As written.
    pub(super) text: String,
    /// Index of the clip on the shelf.
    pub(super) clip: usize,
    /// Fraction of the cycle or progression.
    pub(super) phase: f64,
}

/// A pair as asked for.
#[derive(Clone, Debug)]
pub(super) struct Wish {
    /// Time in the recording, s.
    pub(super) t_s: f64,
    pub(super) target: Target,
}

/// Target clips, all for the same joints.
#[derive(Debug, Default)]
pub(super) struct Shelf {
    names: Vec<String>,
    pub(super) joints: Vec<String>,
    pub(super) clips: Vec<Clip>,
}

impl Shelf {
    /// An empty shelf for a robot's joints; the first clip's joints without a robot.
    pub(super) fn of(model: Option<&RobotModel>) -> Self {
        Self {
            joints: model.map(RobotModel::joint_names).unwrap_or_default(),
            ..Self::default()
        }
    }

    /// Adds the clip at `path`; twice is once.
    fn add(&mut self, path: &Path) -> Result<usize, Failure> {
        let name = path.display().to_string();
        if let Some(known) = self.names.iter().position(|n| *n == name) {
            return Ok(known);
        }
        let text = std::fs::read_to_string(path).map_err(|e| {
            Failure::input(format!(
                "{name}: cannot be read: {e}; name a --clip or the path of one"
            ))
        })?;
        let file =
            ClipFile::from_json(&text).map_err(|e| Failure::input(format!("{name}: {e}")))?;
        if self.joints.is_empty() {
            self.joints.clone_from(&file.joints);
        }
        let clip = file
            .for_body(&self.joints)
            .map_err(|e| Failure::input(format!("{name}: {e}")))?;
        self.names.push(name);
        self.clips.push(clip);
        Ok(self.clips.len() - 1)
    }

    /// `CLIP@PHASE`; a path is taken from `folder`.
    pub(super) fn target(&mut self, text: &str, folder: &Path) -> Result<Target, Failure> {
        let wrong = |problem: &str| {
            Failure::input(format!(
                "target {text:?}: {problem}; write CLIP@PHASE such as arm_keys@0.25, PHASE in 0..1"
            ))
        };
        let (clip, phase) = text.rsplit_once('@').ok_or_else(|| wrong("no @"))?;
        let phase: f64 = phase
            .trim()
            .parse()
            .ok()
            .filter(|p| (0.0..=1.0).contains(p))
            .ok_or_else(|| wrong("its phase is no number in 0..1"))?;
        let clip = clip.trim();
        let known = (self.names.iter()).position(|name| {
            name == clip || Path::new(name).file_stem().is_some_and(|stem| stem == clip)
        });
        let clip = match known {
            Some(index) => index,
            None => self.add(&folder.join(clip))?,
        };
        Ok(Target {
            text: text.into(),
            clip,
            phase,
        })
    }

    /// `T=CLIP@PHASE`; a path is taken from `folder`.
    fn wish(&mut self, text: &str, folder: &Path) -> Result<Wish, Failure> {
        let wrong = || {
            Failure::input(format!(
                "pair {text:?}: write T=CLIP@PHASE such as 5.85=arm_keys@0.25, T in seconds of the recording"
            ))
        };
        let (t, target) = text.split_once('=').ok_or_else(wrong)?;
        let t_s = t.trim().parse().ok().filter(|t: &f64| t.is_finite());
        Ok(Wish {
            t_s: t_s.ok_or_else(wrong)?,
            target: self.target(target.trim(), folder)?,
        })
    }

    /// Pairs of the command line and of a pairs file, in this order.
    fn wishes(&mut self, pairs: &[String], file: Option<&Path>) -> Result<Vec<Wish>, Failure> {
        let mut wishes = Vec::new();
        for pair in pairs {
            wishes.push(self.wish(pair, Path::new(""))?);
        }
        let Some(file) = file else {
            return Ok(wishes);
        };
        let name = file.display();
        let text = std::fs::read_to_string(file)
            .map_err(|e| Failure::input(format!("{name}: cannot be read: {e}")))?;
        let folder = file.parent().unwrap_or(Path::new(""));
        for (index, line) in text.lines().enumerate() {
            let line = line.split('#').next().unwrap_or_default().trim();
            if !line.is_empty() {
                let wish = self
                    .wish(line, folder)
                    .map_err(|e| Failure::input(format!("{name}:{}: {e}", index + 1)))?;
                wishes.push(wish);
            }
        }
        Ok(wishes)
    }

    /// The pose of a target.
    pub(super) fn pose(&self, target: &Target) -> Vec<f64> {
        let mut pose = vec![0.0; self.joints.len()];
        self.clips[target.clip].pose(target.phase, &mut pose);
        pose
    }
}

/// The robot of `--urdf`.
pub(super) fn robot(path: Option<&Path>) -> Result<Option<RobotModel>, Failure> {
    let Some(path) = path else {
        return Ok(None);
    };
    let name = path.display();
    let text = std::fs::read_to_string(path)
        .map_err(|e| Failure::input(format!("{name}: cannot be read: {e}")))?;
    let model = RobotModel::from_urdf(&text).map_err(|e| Failure::input(format!("{name}: {e}")))?;
    Ok(Some(model))
}

/// Lowest and highest position of every joint; open without a robot.
pub(super) fn limits(model: Option<&RobotModel>, joints: usize) -> (Vec<f64>, Vec<f64>) {
    match model {
        Some(model) => {
            let limits = model.limits();
            (
                limits.iter().map(|l| l.lower).collect(),
                limits.iter().map(|l| l.upper).collect(),
            )
        }
        None => (vec![f64::NEG_INFINITY; joints], vec![f64::INFINITY; joints]),
    }
}
