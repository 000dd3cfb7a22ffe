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

use super::{GlobalFit, GlobalOptions, PoseError, PoseHeader, PoseSample, Recording};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::Path;

/// Deviation of the Gaussian that splits a recording into motion and noise, seconds.
const SPLIT_SIGMA_S: f64 = 0.012;
/// Residuals beyond this many usual sizes (median of the modulus, per coordinate) are motion.
const NOISE_REACH: f64 = 4.0;
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

/// A recording split into motion and noise.
struct Source {
    times: Vec<f64>,
    smooth: Vec<Pose>,
    residual: Vec<Pose>,
}

impl Source {
    fn new(recording: &Recording) -> Result<Self, String> {
        let rows = recording.filled()?;
        let times: Vec<f64> = recording.samples.iter().map(|s| s.t).collect();
        let mut smooth = Vec::with_capacity(rows.len());
        for t in &times {
            let reach = 4.0 * SPLIT_SIGMA_S;
            let first = times.partition_point(|other| *other < t - reach);
            let last = times.partition_point(|other| *other <= t + reach);
            let mut pose: Pose = vec![[0.0; 3]; recording.header.points.len()];
            let mut total = 0.0;
            for k in first..last {
                let u = (times[k] - t) / SPLIT_SIGMA_S;
                let weight = (-0.5 * u * u).exp();
                total += weight;
                add(&mut pose, &rows[k], weight);
            }
            scale(&mut pose, 1.0 / total);
            smooth.push(pose);
        }
        let mut residual: Vec<Pose> = rows
            .iter()
            .zip(&smooth)
            .map(|(row, smooth)| {
                let mut rest = row.clone();
                add(&mut rest, smooth, -1.0);
                rest
            })
            .collect();
        for point in 0..recording.header.points.len() {
            for axis in 0..3 {
                let mut sizes: Vec<f64> = residual.iter().map(|r| r[point][axis].abs()).collect();
                sizes.sort_by(f64::total_cmp);
                let reach = NOISE_REACH * sizes[sizes.len() / 2];
                for row in &mut residual {
                    row[point][axis] = row[point][axis].clamp(-reach, reach);
                }
            }
        }
        Ok(Self {
            times,
            smooth,
            residual,
        })
    }

    fn span(&self) -> (f64, f64) {
        (
            self.times.first().copied().unwrap_or(0.0),
            self.times.last().copied().unwrap_or(0.0),
        )
    }

    /// The smooth part at `t`, held beyond the ends.
    fn at(&self, t: f64) -> Pose {
        let after = self.times.partition_point(|time| *time <= t);
        if after == 0 || after == self.times.len() {
            return self.smooth[after.saturating_sub(1)].clone();
        }
        let span = self.times[after] - self.times[after - 1];
        let u = (t - self.times[after - 1]) / span;
        mix(&self.smooth[after - 1], &self.smooth[after], u)
    }

    fn mean(&self, from: f64, to: f64) -> Pose {
        let mut pose = vec![[0.0; 3]; self.smooth[0].len()];
        const STEPS: usize = 200;
        for k in 0..STEPS {
            let t = from + (to - from) * (k as f64 + 0.5) / STEPS as f64;
            add(&mut pose, &self.at(t), 1.0 / STEPS as f64);
        }
        pose
    }
}

fn add(pose: &mut [[f64; 3]], other: &[[f64; 3]], weight: f64) {
    for (a, b) in pose.iter_mut().zip(other) {
        for axis in 0..3 {
            a[axis] += weight * b[axis];
        }
    }
}

fn scale(pose: &mut [[f64; 3]], factor: f64) {
    for value in pose.as_flattened_mut() {
        *value *= factor;
    }
}

fn mix(a: &[[f64; 3]], b: &[[f64; 3]], u: f64) -> Pose {
    let mut pose = a.to_vec();
    scale(&mut pose, 1.0 - u);
    add(&mut pose, b, u);
    pose
}

/// The pose a share `u` of the way from `a` to `b`: place, yaw and shape each go their own way.
fn blend(header: &PoseHeader, a: &[[f64; 3]], b: &[[f64; 3]], u: f64) -> Pose {
    let fit = match GlobalFit::new(header, a, &GlobalOptions::default()) {
        Ok(fit) if header.points.len() >= 3 => fit,
        // One or two points are no body that could turn.
        _ => return mix(a, b, u),
    };
    let mut turned = b.to_vec();
    let motion = fit.remove(b, None, &mut turned);
    // `turned` lies on `a` but for its shape; where b's height was kept it still has it.
    let mut pose = mix(a, &turned, u);
    let body = fit.body(&pose);
    let (sin, cos) = (u * motion.yaw_rad).sin_cos();
    let rise = u * fit.removed_rise(b);
    for place in &mut pose {
        let (x, z) = (place[0] - body[0], place[2] - body[2]);
        *place = [
            x * cos + z * sin + body[0] + u * motion.x_m,
            place[1] + rise,
            z * cos - x * sin + body[2] + u * motion.z_m,
        ];
    }
    pose
}

fn smooth_step(u: f64) -> f64 {
    let u = u.clamp(0.0, 1.0);
    u * u * (3.0 - 2.0 * u)
}

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
}

impl Segment {
    /// The smooth pose `u` seconds after the segment's start; also beyond its end.
    fn at(&self, sources: &[Source], u: f64) -> Pose {
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
                let p = (self.start + u * self.speed).rem_euclid(length);
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

/// A small generator of pseudo-random numbers (SplitMix64): the same everywhere, for ever.
struct SplitMix(u64);

impl SplitMix {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
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
            start = (before.start + before.duration * before.speed).rem_euclid(length);
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
    let mut random = SplitMix(seed);
    let mut samples: Vec<PoseSample> = Vec::new();
    let (mut t, mut begin) = (0.0, 0.0);
    for (index, segment) in segments.iter().enumerate() {
        let source = &sources[segment.source];
        // Step k leads from row k to row k + 1 of the recording.
        let steps = source.times.len() - 1;
        let mut row = (random.next() % steps as u64) as usize;
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
