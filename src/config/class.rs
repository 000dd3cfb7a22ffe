//! Classes of a configuration, checked and resolved to indices.

use super::blending::{BlendParts, blend_parts};
use super::body::Body;
use super::error::{ConfigError, Pointer};
use super::file::{CharacterFile, ClassEntry, ClipEntry};
use super::files::Files;
use super::layer::{channel_index, channel_map};
use super::map::{MapParts, load_map};
use super::motion::clip;
use crate::base::suggest::hint;
use crate::body::Blending;
use crate::gesture::{FrontEnd, GestureKind, GestureSet};
use crate::motion::class::{ClassOptions, EXTRA, Example, Play};
use crate::motion::clip::ClipKind;
use crate::motion::layer::ChannelMap;
use crate::motion::node::ClassInput;
use crate::motion::weights::{Parameters, WeightKind};
use crate::robot::{JointEnvelope, RobotModel};

/// A class before it is built.
#[derive(Clone, Debug)]
pub struct ClassParts {
    /// Class name.
    pub name: String,
    /// Index of its gesture in the gesture set; `None` for a pose map that needs none.
    pub gesture: Option<usize>,
    /// The pose map, in place of clips.
    pub map: Option<MapParts>,
    /// How it is played.
    pub options: ClassOptions,
    /// The gesture is to be performed in the opposite sense.
    pub reverse: bool,
    /// The channel that drives it, in place of a gesture.
    pub(super) channel: Option<ChannelParts>,
    /// Channels that drive its parameters beside amplitude and frequency.
    pub(super) extra: Vec<ChannelParts>,
    pub(super) examples: Vec<Example>,
    /// How poses are to be blended, and what that comes to for the clips.
    pub(super) blend: BlendParts,
    pub(super) blending: Blending,
}

/// What a channel drives, not yet bound to it.
#[derive(Clone, Debug)]
pub(super) struct ChannelParts {
    pub(super) channel: String,
    pub(super) map: ChannelMap,
    /// Line in the configuration, for messages.
    pub(super) line: usize,
}

impl ClassParts {
    /// Example clips with their parameters; none for a pose map.
    pub fn examples(&self) -> &[Example] {
        &self.examples
    }

    /// What drives the class, in words.
    pub fn driven_by(&self, gestures: &GestureSet) -> String {
        let by = match (
            self.gesture.and_then(|g| gestures.gestures.get(g)),
            &self.channel,
        ) {
            (Some(gesture), _) => {
                let sense = if self.reverse {
                    ", in the opposite sense"
                } else {
                    ""
                };
                format!("gesture {} ({}{sense})", gesture.name, gesture.kind.name())
            }
            (None, Some(channel)) => format!("channel {}", channel.channel),
            (None, None) => "no gesture: played while nothing is performed".into(),
        };
        match self.options.play {
            Play::Gesture => by,
            Play::Once => format!("{by}; played once by the clock"),
            Play::Loop => format!("{by}; round and round by the clock"),
        }
    }

    /// Names of the example clips, in the order of the class's weights.
    pub fn clip_names(&self) -> Vec<String> {
        self.examples.iter().map(|e| e.clip.name.clone()).collect()
    }

    /// What drives the class, bound to the channels of `front`.
    pub(super) fn input(
        &self,
        front: &FrontEnd,
        features: &mut std::ops::RangeFrom<usize>,
        config_name: &str,
    ) -> Result<ClassInput, ConfigError> {
        let bind = |parts: &ChannelParts, key: &str| {
            let channel = channel_index(front, &parts.channel).map_err(|e| ConfigError {
                file: config_name.into(),
                line: Some(parts.line),
                key: key.into(),
                problem: format!("class {}: {e}", self.name),
            })?;
            Ok::<_, ConfigError>((channel, parts.map))
        };
        let mut extra = [None; EXTRA];
        for (slot, parts) in extra.iter_mut().zip(&self.extra) {
            *slot = Some(bind(parts, "class.parameter.channel")?);
        }
        Ok(ClassInput {
            gesture: self.gesture,
            reverse: self.reverse,
            channel: (self.channel.as_ref())
                .map(|parts| bind(parts, "class.channel.name"))
                .transpose()?,
            feature: self.map.as_ref().and_then(|_| features.next()),
            extra,
        })
    }
}

/// Classes in node order, with their clips.
#[allow(clippy::too_many_arguments, reason = "what a class is checked against")]
pub(super) fn class_parts(
    files: &Files,
    file: &CharacterFile,
    body: &Body,
    model: Option<&RobotModel>,
    joints: &[String],
    limits: &[JointEnvelope],
    gestures: &GestureSet,
    at: &Pointer<'_>,
) -> Result<Vec<ClassParts>, ConfigError> {
    if file.class.is_empty() {
        return Err(at.key("class", "no motion class; add a [[class]] with clips"));
    }
    let mut parts: Vec<ClassParts> = Vec::new();
    for class in &file.class {
        let name = class.name.get_ref();
        if parts.iter().any(|p| p.name == *name) {
            return Err(at.at(
                class.name.span(),
                "class.name",
                format!("{name:?} is used twice"),
            ));
        }
        let gesture = (class.gesture.as_ref())
            .map(|entry| gesture_named(entry, "class.gesture", gestures, at))
            .transpose()?;
        if let (Some(path), Some(_)) = (&class.map, &body.avatar) {
            let problem = "a pose map drives a robot; a class of an avatar has clips";
            return Err(at.at(path.span(), "class.map", problem));
        }
        if let (Some(blending), Some(_)) = (&class.blending, &class.map) {
            let problem = "a pose map has no clips to blend";
            return Err(at.at(blending.span(), "class.blending", problem));
        }
        if let Some(path) = &class.map {
            parts.push(direct_parts(
                files, file, class, path, joints, limits, gesture, at,
            )?);
            continue;
        }
        let play = play(class, at)?;
        let channel = channel(class, at)?;
        check_drive(class, gesture, channel.is_some(), play, at)?;
        if class.clip.is_empty() {
            return Err(at.at(
                class.name.span(),
                "class.clip",
                "neither clips nor a map; give clip = [{ file = ... }] or map = \"maps/NAME.toml\"",
            ));
        }
        let (extra, names) = extra_parts(class, at)?;
        let kind = match (gesture, play) {
            (_, Play::Loop) => Some(ClipKind::Cycle),
            (_, Play::Once) => Some(ClipKind::Path),
            (Some(gesture), Play::Gesture) => Some(match gestures.gestures[gesture].kind {
                GestureKind::Cyclic => ClipKind::Cycle,
                GestureKind::NonCyclic => ClipKind::Path,
            }),
            (None, Play::Gesture) => None,
        };
        let mut examples = Vec::new();
        for entry in &class.clip {
            let in_range = (0.0..=10.0).contains(&entry.amplitude)
                && (0.0..=50.0).contains(&entry.frequency_hz);
            if !in_range {
                return Err(at.at(
                    entry.file.span(),
                    "class.clip",
                    format!(
                        "amplitude {} must lie in 0..10, frequency_hz {} in 0..50",
                        entry.amplitude, entry.frequency_hz
                    ),
                ));
            }
            let clip = clip(files, &entry.file, "class.clip.file", body, kind, at)?;
            if clip.kind == ClipKind::Cycle && entry.amplitude > 0.0 && entry.frequency_hz <= 0.0 {
                return Err(at.at(
                    entry.file.span(),
                    "class.clip.frequency_hz",
                    format!(
                        "clip {} is a cycle and needs a frequency above 0 Hz",
                        clip.name
                    ),
                ));
            }
            if play == Play::Gesture {
                let (name, repeats) = match gesture {
                    Some(g) => {
                        let g = &gestures.gestures[g];
                        (
                            format!("gesture {:?}", g.name),
                            g.kind == GestureKind::Cyclic,
                        )
                    }
                    None => ("a channel".into(), false),
                };
                if repeats != (clip.kind == ClipKind::Cycle) {
                    let driven = if repeats { "cyclic" } else { "non-cyclic" };
                    let kind = if clip.kind == ClipKind::Cycle {
                        "cycle"
                    } else {
                        "path"
                    };
                    return Err(at.at(
                        entry.file.span(),
                        "class.clip",
                        format!(
                            "clip {} is a {kind}, {name} is {driven}; cyclic gestures drive cycles, non-cyclic ones and channels paths (or play = \"once\": the clock drives it)",
                            clip.name,
                        ),
                    ));
                }
            }
            examples.push(Example {
                clip,
                parameters: parameters(entry, &names, at)?,
            });
        }
        let at_rest = examples.iter().filter(|e| e.parameters[0] == 0.0).count();
        let cyclic = examples.iter().any(|e| e.clip.kind == ClipKind::Cycle);
        if cyclic && play == Play::Gesture && at_rest != 1 {
            return Err(at.at(
                class.name.span(),
                "class.clip",
                format!(
                    "{at_rest} clips have amplitude = 0; a cyclic class needs exactly one, which is played while nothing is performed (`handwave clip gait --gait stand` makes it)"
                ),
            ));
        }
        parts.push(ClassParts {
            name: name.clone(),
            gesture,
            map: None,
            options: ClassOptions {
                play,
                leave: leave(class, at)?,
                limb_advance: limb_advance(class, at)?,
                weights: weights(class, at)?,
                extra: names,
            },
            reverse: class.reverse,
            channel,
            extra,
            examples,
            blend: blend_parts(class, body, model, at)?,
            blending: Blending::Linear,
        });
    }
    Ok(parts)
}

/// The channel that drives a class in place of a gesture.
fn channel(class: &ClassEntry, at: &Pointer<'_>) -> Result<Option<ChannelParts>, ConfigError> {
    let Some(entry) = &class.channel else {
        return Ok(None);
    };
    Ok(Some(ChannelParts {
        channel: entry.name.get_ref().clone(),
        map: channel_map(&entry.range, true, entry.dead_zone, "class.channel", at)?,
        line: at.line_of(entry.name.span().start),
    }))
}

/// A class of clips has exactly one thing that drives it.
fn check_drive(
    class: &ClassEntry,
    gesture: Option<usize>,
    channel: bool,
    play: Play,
    at: &Pointer<'_>,
) -> Result<(), ConfigError> {
    let problem = match (gesture, channel) {
        (Some(_), true) => "has both gesture and channel; keep one",
        (None, false) if play != Play::Loop => {
            "a class of clips needs a gesture (or a channel) that drives it; only one with `map`, or with play = \"loop\", may be without"
        }
        (None, _) if class.reverse => "reverse = true is for a class with a gesture",
        _ => return Ok(()),
    };
    Err(at.at(class.name.span(), "class.gesture", problem))
}

/// What moves a class along.
fn play(class: &ClassEntry, at: &Pointer<'_>) -> Result<Play, ConfigError> {
    let Some(play) = &class.play else {
        return Ok(Play::Gesture);
    };
    Ok(match play.get_ref().as_str() {
        "gesture" => Play::Gesture,
        "once" => Play::Once,
        "loop" => Play::Loop,
        other => {
            let problem = format!("unknown {other:?}. Allowed: gesture, once, loop");
            return Err(at.at(play.span(), "class.play", problem));
        }
    })
}

/// When a class may be left.
fn leave(class: &ClassEntry, at: &Pointer<'_>) -> Result<Vec<[f64; 2]>, ConfigError> {
    let Some(windows) = &class.leave else {
        return Ok(Vec::new());
    };
    let unit = 0.0..=1.0;
    let bad = |w: &&[f64; 2]| !(unit.contains(&w[0]) && unit.contains(&w[1]));
    if let Some([from, to]) = windows.get_ref().iter().find(bad) {
        let problem =
            format!("[{from}, {to}]: both must lie in 0..1, fractions of the cycle or path");
        return Err(at.at(windows.span(), "class.leave", problem));
    }
    Ok(windows.get_ref().clone())
}

/// What a limb may gain or lose against the body.
fn limb_advance(class: &ClassEntry, at: &Pointer<'_>) -> Result<f64, ConfigError> {
    let Some(part) = &class.limb_advance else {
        return Ok(ClassOptions::default().limb_advance);
    };
    let value = *part.get_ref();
    if !(0.0..1.0).contains(&value) {
        let problem = format!("{value} is not in 0..1 (below 1)");
        return Err(at.at(part.span(), "class.limb_advance", problem));
    }
    Ok(value)
}

/// How a class turns parameters into weights.
fn weights(class: &ClassEntry, at: &Pointer<'_>) -> Result<WeightKind, ConfigError> {
    let Some(name) = &class.weights else {
        return Ok(WeightKind::default());
    };
    WeightKind::by_name(name.get_ref()).ok_or_else(|| {
        let problem = format!(
            "unknown {:?}. Allowed: {}",
            name.get_ref(),
            WeightKind::NAMES.join(", ")
        );
        at.at(name.span(), "class.weights", problem)
    })
}

/// A class's parameters beside amplitude and frequency, and their names.
fn extra_parts(
    class: &ClassEntry,
    at: &Pointer<'_>,
) -> Result<(Vec<ChannelParts>, Vec<String>), ConfigError> {
    let (mut parts, mut names) = (Vec::new(), Vec::new());
    for entry in &class.parameter {
        let name = entry.name.get_ref();
        let taken = ["amplitude", "frequency_hz"].contains(&name.as_str()) || names.contains(name);
        if taken || names.len() == EXTRA {
            let problem = format!(
                "{name:?} cannot be added: a class has amplitude, frequency_hz and at most {EXTRA} parameters of other names"
            );
            return Err(at.at(entry.name.span(), "class.parameter", problem));
        }
        parts.push(ChannelParts {
            channel: entry.channel.get_ref().clone(),
            map: channel_map(
                &entry.range,
                entry.one_sided,
                entry.dead_zone,
                "class.parameter",
                at,
            )?,
            line: at.line_of(entry.channel.span().start),
        });
        names.push(name.clone());
    }
    Ok((parts, names))
}

/// Parameters at which a clip is played pure.
fn parameters(
    entry: &ClipEntry,
    names: &[String],
    at: &Pointer<'_>,
) -> Result<Parameters, ConfigError> {
    let mut values = vec![entry.amplitude, entry.frequency_hz];
    for name in names {
        let value = entry.at.get(name).copied().unwrap_or(0.0);
        if !(-10.0..=10.0).contains(&value) {
            let problem = format!("{name} = {value} is not in -10..10");
            return Err(at.at(entry.file.span(), "class.clip.at", problem));
        }
        values.push(value);
    }
    if let Some(strange) = entry.at.keys().find(|k| !names.contains(k)) {
        let hint = hint(strange, names.iter().map(String::as_str));
        let problem = format!("no parameter {strange:?}{hint} Name it in class.parameter first");
        return Err(at.at(entry.file.span(), "class.clip.at", problem));
    }
    Ok(Parameters::from_slice(&values).unwrap_or_default())
}

/// Index of the gesture that `entry` names.
pub(super) fn gesture_named(
    entry: &toml::Spanned<String>,
    key: &str,
    gestures: &GestureSet,
    at: &Pointer<'_>,
) -> Result<usize, ConfigError> {
    let wanted = entry.get_ref();
    let names = || gestures.gestures.iter().map(|g| g.name.as_str());
    names().position(|g| g == wanted).ok_or_else(|| {
        let hint = hint(wanted, names());
        let all: Vec<&str> = names().collect();
        let problem = format!("no gesture {wanted:?}{hint} Gestures: {}", all.join(", "));
        at.at(entry.span(), key, problem)
    })
}

/// A class that maps poses.
#[allow(clippy::too_many_arguments, reason = "what a class is checked against")]
fn direct_parts(
    files: &Files,
    file: &CharacterFile,
    class: &ClassEntry,
    path: &toml::Spanned<String>,
    joints: &[String],
    limits: &[JointEnvelope],
    gesture: Option<usize>,
    at: &Pointer<'_>,
) -> Result<ClassParts, ConfigError> {
    let name = class.name.get_ref();
    if !class.clip.is_empty() {
        let problem = "a class has clips or a map, not both; make two classes of it";
        return Err(at.at(path.span(), "class.map", problem));
    }
    // Without a gesture it would never let another class begin, so it is the one that plays meanwhile.
    let start = file.graph.start.as_ref().map(|s| s.get_ref());
    let starts = start.or(file.class.first().map(|c| c.name.get_ref())) == Some(name);
    if gesture.is_none() && !starts {
        let problem = format!(
            "class {name} maps poses and has no gesture: it is played while nothing is performed, so it must be graph.start; or give it a gesture that activates it"
        );
        return Err(at.at(class.name.span(), "class.map", problem));
    }
    let lower: Vec<f64> = limits.iter().map(|l| l.lower).collect();
    let upper: Vec<f64> = limits.iter().map(|l| l.upper).collect();
    let map = load_map(files, path.get_ref(), joints, &lower, &upper)
        .map_err(|e| at.at(path.span(), "class.map", e))?;
    Ok(ClassParts {
        name: name.clone(),
        gesture,
        map: Some(map),
        options: ClassOptions::default(),
        reverse: class.reverse,
        channel: None,
        extra: Vec::new(),
        examples: Vec::new(),
        blend: BlendParts::default(),
        blending: Blending::Linear,
    })
}
