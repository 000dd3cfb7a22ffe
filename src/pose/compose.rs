//! Performances put together from recordings: cut, loop, hold, at any tempo and size.
//!
//! A recipe is a TOML file:
//!
//! ```toml
//! handwave = "recipe"
//! version = 1
//! seed = 1                      # where in the recordings' noise each segment starts
//!
//! [sources]                     # recordings, relative to this file; all with the same points
//! waiting = "waiting.csv"
//!
//! [[segment]]                   # segments follow one another
//! kind = "hold"                 # one pose, held
//! source = "waiting"
//! from = 0.5                    # the pose at `from`, or with `to` the mean pose between them
//! to = 1.6
//! duration_s = 3.0
//!
//! [[segment]]
//! kind = "loop"                 # from..to over and over
//! source = "waiting"
//! from = 0.5
//! to = 1.6
//! crossfade_s = 0.1             # the end of the loop fades into what precedes `from`
//! speed = 0.8                   # times as fast as recorded (default 1)
//! size = 0.7                    # times as large, about the mean pose of from..to (default 1)
//! reverse = true                # a loop backwards (default false)
//! shift_m = [0.0, 0.1, 0.0]     # the whole pose moved, metres (default: not)
//! turn_rad = 0.4                # and turned about the vertical through its first point (default: not)
//! duration_s = 8.0
//! join_s = 0.5                  # eased blend out of the segment before (default 0.4)
//!
//! [[segment]]
//! kind = "cut"                  # from..to once; backwards where to < from
//! source = "waiting"
//! from = 0.2
//! to = 1.0
//! ```
//!
//! What keeps a composed stream like a tracked one:
//! - **Noise.** Each recording is split into a smooth part (Gaussian in time, deviation 12 ms) and
//!   the residual, which is the sensor's noise; what sticks out of the noise (a strike too quick
//!   for the Gaussian) is cut back to four times its usual size. Tempo, size, holds and joins act on the smooth part
//!   only; the residual is played at the recorded rate on top, row after row, all points together,
//!   round and round.
//! - **Time steps.** The steps are the recording's own, in their order, dropped frames included.
//! - **Joins.** The segment before runs on while the new one starts; a smooth step blends from one to
//!   the other. Turning and shape are blended apart, as a hand turns between two postures without
//!   shrinking half-way. A loop that follows a loop over the same stretch takes over its phase.

mod source;

use super::{PoseError, PoseHeader, PoseSample, Recording};
use crate::base::random::SplitMix;
use serde::Deserialize;
use source::{Source, add, blend, mix, smooth_step};
use std::collections::BTreeMap;
use std::path::Path;

/// Shortest step of a composed stream: what its time stamps can show.
const SHORTEST_STEP_S: f64 = 2e-4;
/// Longest composed stream in seconds.
const LONGEST_S: f64 = 3600.0;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RecipeTable {
    handwave: String,
    version: u64,
    #[serde(default)]
    seed: u64,
    sources: BTreeMap<String, String>,
    segment: Vec<SegmentTable>,
}

#[derive(Copy, Clone, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Kind {
    Hold,
    Loop,
    Cut,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct SegmentTable {
    kind: Kind,
    source: String,
    from: f64,
    to: Option<f64>,
    duration_s: Option<f64>,
    #[serde(default = "one")]
    speed: f64,
    #[serde(default = "one")]
    size: f64,
    #[serde(default)]
    crossfade_s: f64,
    #[serde(default)]
    reverse: bool,
    #[serde(default)]
    shift_m: [f64; 3],
    #[serde(default)]
    turn_rad: f64,
    #[serde(default = "default_join")]
    join_s: f64,
}

fn one() -> f64 {
    1.0
}

fn default_join() -> f64 {
    0.4
}

type Pose = Vec<[f64; 3]>;

/// A segment ready to play.
struct Segment {
    kind: Kind,
    source: usize,
    from: f64,
    to: f64,
    speed: f64,
    size: f64,
    crossfade: f64,
    duration: f64,
    join: f64,
    /// The pose about which size acts, and the pose of a hold.
    center: Pose,
    /// Where in the loop it starts, seconds of the recording.
    start: f64,
    /// A loop runs backwards.
    reverse: bool,
    /// The whole pose is turned about the vertical through the recording's first point, then moved.
    turn_rad: f64,
    shift_m: [f64; 3],
}

impl Segment {
    /// The smooth pose `u` seconds after the segment's start; also beyond its end.
    fn at(&self, sources: &[Source], u: f64) -> Pose {
        let mut pose = self.in_place(sources, u);
        let centre = pose.first().copied().unwrap_or_default();
        let (sin, cos) = self.turn_rad.sin_cos();
        for p in &mut pose {
            let [x, z] = [p[0] - centre[0], p[2] - centre[2]];
            p[0] = centre[0] + cos * x + sin * z + self.shift_m[0];
            p[1] += self.shift_m[1];
            p[2] = centre[2] - sin * x + cos * z + self.shift_m[2];
        }
        pose
    }

    fn in_place(&self, sources: &[Source], u: f64) -> Pose {
        let source = &sources[self.source];
        let mut pose = match self.kind {
            Kind::Hold => return self.center.clone(),
            Kind::Cut => {
                let length = (self.to - self.from).abs();
                let way = (u * self.speed).clamp(0.0, length);
                source.at(self.from + way * (self.to - self.from).signum())
            }
            Kind::Loop => {
                let length = self.to - self.from;
                let on = if self.reverse { -u } else { u };
                let p = (self.start + on * self.speed).rem_euclid(length);
                let pose = source.at(self.from + p);
                let into = p - (length - self.crossfade);
                if into > 0.0 {
                    let before = source.at(self.from + p - length);
                    mix(&pose, &before, smooth_step(into / self.crossfade))
                } else {
                    pose
                }
            }
        };
        if self.size != 1.0 {
            pose = mix(&self.center, &pose, self.size);
        }
        pose
    }
}

/// Composes the performance that the recipe at `path` describes.
///
/// The same recipe and recordings give the same samples, bit for bit on one build.
///
/// # Errors
/// Unreadable recipe or recordings; keys and values that are not allowed, with the segment's number.
pub fn compose(path: &Path) -> Result<Recording, PoseError> {
    let file = path.display().to_string();
    let text = std::fs::read_to_string(path).map_err(|source| PoseError::Read {
        file: file.clone(),
        source,
    })?;
    let wrong = |key: &str, what: String| PoseError::Recipe {
        file: file.clone(),
        key: key.into(),
        what,
    };
    let recipe: RecipeTable = toml::from_str(&text)
        .map_err(|error| wrong("TOML", error.to_string().trim_end().to_owned()))?;
    if recipe.handwave != "recipe" {
        let found = format!("found {:?}; allowed: \"recipe\"", recipe.handwave);
        return Err(wrong("handwave", found));
    }
    if recipe.version != 1 {
        let found = format!("found {}; allowed: 1", recipe.version);
        return Err(wrong("version", found));
    }
    let folder = path.parent().unwrap_or(Path::new(""));
    let mut header: Option<PoseHeader> = None;
    let mut sources = Vec::new();
    for (name, relative) in &recipe.sources {
        let key = format!("sources.{name}");
        let (recording, _) = Recording::read(&folder.join(relative))?;
        let never = |point: String| wrong(&key, format!("point `{point}` is never seen in it"));
        if recording.header.points.is_empty() {
            let what = "channels only; a performance is composed of points (`handwave poses import --as-points` makes points of channels)";
            return Err(wrong(&key, what.into()));
        }
        if recording.samples.len() < 2 {
            return Err(wrong(&key, "one sample only; at least 2 are needed".into()));
        }
        let first = header.get_or_insert_with(|| recording.header.clone());
        if first.points != recording.header.points || first.dim != recording.header.dim {
            return Err(wrong(
                &key,
                "other points than the first source; all sources need the same, in the same order"
                    .into(),
            ));
        }
        sources.push(Source::new(&recording).map_err(never)?);
    }
    let Some(mut header) = header else {
        return Err(wrong("sources", "none; name at least one recording".into()));
    };
    header.channels.clear();
    let segments = segments_of(&recipe, &sources, &wrong)?;
    let samples = play(&header, &segments, &sources, recipe.seed);
    Ok(Recording { header, samples })
}

/// Checks the segments' values and works out centres, lengths and phases.
fn segments_of(
    recipe: &RecipeTable,
    sources: &[Source],
    wrong: &dyn Fn(&str, String) -> PoseError,
) -> Result<Vec<Segment>, PoseError> {
    let mut segments: Vec<Segment> = Vec::new();
    let mut total = 0.0;
    for (index, table) in recipe.segment.iter().enumerate() {
        let key = |part: &str| format!("segment {} ({part})", index + 1);
        let names: Vec<&str> = recipe.sources.keys().map(String::as_str).collect();
        let Some(source) = names.iter().position(|name| **name == table.source) else {
            let what = format!("found {:?}; allowed: {}", table.source, names.join(", "));
            return Err(wrong(&key("source"), what));
        };
        let span = sources[source].span();
        let inside = |part: &str, t: f64| {
            if t >= span.0 && t <= span.1 {
                return Ok(());
            }
            let what = format!("found {t}; allowed: {:.3} to {:.3} s", span.0, span.1);
            Err(wrong(&key(part), what))
        };
        let within = |part: &str, value: f64, low: f64, high: f64| {
            if value >= low && value <= high {
                return Ok(());
            }
            let what = format!("found {value}; allowed: {low} to {high}");
            Err(wrong(&key(part), what))
        };
        inside("from", table.from)?;
        let to = table.to.unwrap_or(table.from);
        inside("to", to)?;
        within("speed", table.speed, 0.05, 20.0)?;
        within("size", table.size, 0.0, 10.0)?;
        within("join_s", table.join_s, 0.0, 10.0)?;
        let length = to - table.from;
        let duration = match (table.kind, table.duration_s) {
            (_, Some(duration)) => duration,
            (Kind::Cut, None) => length.abs() / table.speed,
            _ => {
                let what = "missing; a hold and a loop need one, in seconds".into();
                return Err(wrong(&key("duration_s"), what));
            }
        };
        within("duration_s", duration, 0.01, LONGEST_S - total)?;
        if table.reverse && table.kind != Kind::Loop {
            let what = "is for loops; a cut runs backwards with `to` before `from`".into();
            return Err(wrong(&key("reverse"), what));
        }
        within("turn_rad", table.turn_rad, -3.2, 3.2)?;
        for axis in table.shift_m {
            within("shift_m", axis, -10.0, 10.0)?;
        }
        if table.kind == Kind::Cut {
            within("to", length.abs(), 0.01, LONGEST_S).map_err(|_| {
                wrong(
                    &key("to"),
                    "a cut needs `to`, 0.01 s or more from `from`".into(),
                )
            })?;
        }
        if table.kind == Kind::Loop {
            if length < 0.05 {
                let what = format!("found {to}; a loop needs `to` 0.05 s or more after `from`");
                return Err(wrong(&key("to"), what));
            }
            let room = (table.from - span.0).min(length);
            if !(table.crossfade_s >= 0.0 && table.crossfade_s <= room) {
                let what = format!(
                    "found {}; allowed: 0 to {room:.3} s, what the recording has before `from`",
                    table.crossfade_s
                );
                return Err(wrong(&key("crossfade_s"), what));
            }
        }
        total += duration;
        let mut start = 0.0;
        if let Some(before) = segments.last()
            && before.kind == Kind::Loop
            && table.kind == Kind::Loop
            && (before.source, before.from, before.to) == (source, table.from, to)
        {
            let on = if before.reverse {
                -before.duration
            } else {
                before.duration
            };
            start = (before.start + on * before.speed).rem_euclid(length);
        }
        segments.push(Segment {
            kind: table.kind,
            source,
            from: table.from,
            to,
            speed: table.speed,
            size: table.size,
            crossfade: table.crossfade_s,
            duration,
            join: table.join_s,
            center: sources[source].mean(table.from, to),
            start,
            reverse: table.reverse,
            turn_rad: table.turn_rad,
            shift_m: table.shift_m,
        });
    }
    if segments.is_empty() {
        return Err(wrong("segment", "none; a recipe needs at least one".into()));
    }
    Ok(segments)
}

/// Plays the segments one after the other.
fn play(
    header: &PoseHeader,
    segments: &[Segment],
    sources: &[Source],
    seed: u64,
) -> Vec<PoseSample> {
    let mut random = SplitMix::new(seed);
    let mut samples: Vec<PoseSample> = Vec::new();
    let (mut t, mut begin) = (0.0, 0.0);
    for (index, segment) in segments.iter().enumerate() {
        let source = &sources[segment.source];
        // Step k leads from row k to row k + 1 of the recording.
        let steps = source.times.len() - 1;
        let mut row = (random.bits() % steps as u64) as usize;
        let before = index.checked_sub(1).map(|before| &segments[before]);
        while t < begin + segment.duration - 1e-9 {
            let u = t - begin;
            let mut pose = segment.at(sources, u);
            if let Some(before) = before.filter(|_| u < segment.join) {
                let last = before.at(sources, before.duration + u);
                pose = blend(header, &last, &pose, smooth_step(u / segment.join));
            }
            add(&mut pose, &source.residual[row + 1], 1.0);
            samples.push(PoseSample {
                t,
                points: pose.into_iter().map(Some).collect(),
                confidence: Vec::new(),
                channels: Vec::new(),
            });
            t += (source.times[row + 1] - source.times[row]).max(SHORTEST_STEP_S);
            row = (row + 1) % steps;
        }
        begin += segment.duration;
    }
    samples
}
