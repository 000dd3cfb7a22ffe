//! Reads the text of a BVH file, strictly: every fault names its line, what was found and what may stand there.

use super::{BvhFile, BvhJoint, Channel, MAX_DEPTH, MAX_JOINTS};
use crate::pose::LineFault;
use crate::pose::json::shown;

/// Frame times allowed, seconds: 1 to 10,000 frames per second.
const FRAME_TIMES_S: (f64, f64) = (1e-4, 1.0);

/// Numbers beyond are no places and no angles; their squares overflow nothing.
const LARGEST: f64 = 1e6;

const CHANNEL_NAMES: &str = "Xposition, Yposition, Zposition, Xrotation, Yrotation, Zrotation";

impl BvhFile {
    /// Reads a BVH file from its text.
    ///
    /// # Errors
    /// The first line that is not as it should be: an unknown word, a missing or repeated part, a
    /// number that is none or beyond a million, a joint name used twice, over [`MAX_JOINTS`] joints
    /// or [`MAX_DEPTH`] levels, a frame with another count of numbers than the skeleton has
    /// channels, another count of frames than announced, a frame time outside 0.0001 to 1 s.
    pub fn parse(text: &str) -> Result<Self, LineFault> {
        let mut words = Words::new(text.trim_start_matches('\u{feff}'));
        let joints = hierarchy(&mut words)?;
        motion(&mut words, joints)
    }
}

/// The words of a text with their lines; braces are words of their own, and a colon ends one.
struct Words<'a> {
    text: &'a str,
    /// What comes next, in bytes.
    at: usize,
    /// Line of the last word or line, from 1.
    line: u64,
    /// Up to where line ends are counted into `line`, in bytes.
    counted: usize,
}

impl<'a> Words<'a> {
    fn new(text: &'a str) -> Self {
        Self {
            text: text.trim_end(),
            at: 0,
            line: 1,
            counted: 0,
        }
    }

    /// Makes `line` the line of the byte at `offset`, which never lies before an earlier one.
    fn count_to(&mut self, offset: usize) {
        let passed = &self.text[self.counted..offset];
        self.line += passed.bytes().filter(|byte| *byte == b'\n').count() as u64;
        self.counted = offset;
    }

    fn fault(&self, found: impl Into<String>, allowed: impl Into<String>) -> LineFault {
        LineFault {
            line: self.line,
            found: found.into(),
            allowed: allowed.into(),
        }
    }

    /// The next word; at the end of the text a fault that says what is missing.
    fn next(&mut self, allowed: &str) -> Result<&'a str, LineFault> {
        let word = self.text[self.at..].trim_start();
        let start = self.text.len() - word.len();
        self.count_to(start);
        if word.is_empty() {
            return Err(self.fault("the end of the file", allowed));
        }
        let is_brace = |c: char| c == '{' || c == '}';
        let ends = |c: char| c.is_whitespace() || is_brace(c);
        let length = if word.starts_with(is_brace) {
            1
        } else {
            let end = word.find(ends).unwrap_or(word.len());
            word[..end].find(':').map_or(end, |colon| colon + 1)
        };
        self.at = start + length;
        Ok(&word[..length])
    }

    /// What is left of the line up to `stop`, trimmed.
    fn rest_of_line(&mut self, stop: Option<char>) -> &'a str {
        let rest = &self.text[self.at..];
        let end = rest.find(|c| c == '\n' || Some(c) == stop);
        let end = end.unwrap_or(rest.len());
        self.at += end;
        rest[..end].trim()
    }

    /// The next line that is not blank, trimmed; `None` at the end of the text.
    fn next_line(&mut self) -> Option<&'a str> {
        while self.at < self.text.len() {
            let start = self.at;
            let rest = &self.text[start..];
            let (line, length) = rest
                .split_once('\n')
                .map_or((rest, rest.len()), |(line, _)| (line, line.len() + 1));
            self.at += length;
            if !line.trim().is_empty() {
                self.count_to(start);
                return Some(line.trim());
            }
        }
        None
    }

    fn expect(&mut self, word: &str) -> Result<(), LineFault> {
        let found = self.next(&format!("`{word}`"))?;
        if found.eq_ignore_ascii_case(word) {
            Ok(())
        } else {
            Err(self.fault(shown(found), format!("`{word}`")))
        }
    }

    fn number(&mut self, what: &str) -> Result<f64, LineFault> {
        let word = self.next(what)?;
        number(word).ok_or_else(|| self.fault(shown(word), what))
    }
}

/// A finite number of a size that can be a length or an angle.
fn number(word: &str) -> Option<f64> {
    word.parse()
        .ok()
        .filter(|value: &f64| value.abs() <= LARGEST)
}

/// A joint whose closing brace has not come yet.
struct Open {
    joint: usize,
    line: u64,
    has_offset: bool,
    has_channels: bool,
}

/// Reads from `HIERARCHY` to `MOTION`.
fn hierarchy(words: &mut Words<'_>) -> Result<Vec<BvhJoint>, LineFault> {
    words.expect("HIERARCHY")?;
    let mut joints: Vec<BvhJoint> = Vec::new();
    let mut channels = 0;
    let mut open: Vec<Open> = Vec::new();
    loop {
        let Some(top) = open.last_mut() else {
            let allowed = if joints.is_empty() {
                "`ROOT NAME {`"
            } else {
                "`MOTION`, or another `ROOT NAME {`"
            };
            let word = words.next(allowed)?;
            if word.eq_ignore_ascii_case("MOTION") && !joints.is_empty() {
                return Ok(joints);
            }
            if !word.eq_ignore_ascii_case("ROOT") {
                return Err(words.fault(shown(word), allowed));
            }
            open.push(begin_joint(words, &mut joints, None, channels)?);
            continue;
        };
        let name = joints[top.joint].name.clone();
        let is_end = joints[top.joint].is_end;
        let allowed = match (is_end, top.has_offset) {
            (true, _) => "`OFFSET x y z`, then `}`",
            (false, false) => "`OFFSET x y z` first",
            (false, true) => {
                "`CHANNELS count name...` once, `JOINT NAME {`, `End Site {` or the closing `}`"
            }
        };
        let word = words.next(&format!("{allowed} (in joint `{name}`)"))?;
        let known = |expected: &str| word.eq_ignore_ascii_case(expected);
        if known("OFFSET") && !top.has_offset {
            top.has_offset = true;
            let what = format!("three numbers up to {LARGEST} after OFFSET");
            for axis in 0..3 {
                joints[top.joint].offset[axis] = words.number(&what)?;
            }
        } else if known("CHANNELS") && top.has_offset && !top.has_channels && !is_end {
            top.has_channels = true;
            joints[top.joint].channels = read_channels(words)?;
            channels += joints[top.joint].channels.len();
        } else if known("JOINT") && top.has_offset && !is_end {
            let parent = top.joint;
            check_depth(words, open.len())?;
            open.push(begin_joint(words, &mut joints, Some(parent), channels)?);
        } else if known("End") && top.has_offset && !is_end {
            let parent = top.joint;
            check_depth(words, open.len())?;
            open.push(begin_end(words, &mut joints, parent, channels)?);
        } else if word == "}" && top.has_offset {
            open.pop();
        } else if word == "}" {
            let line = top.line;
            return Err(words.fault(
                format!("the end of joint `{name}` (line {line}) without an OFFSET"),
                allowed,
            ));
        } else {
            return Err(words.fault(format!("{} in joint `{name}`", shown(word)), allowed));
        }
    }
}

fn check_depth(words: &Words<'_>, depth: usize) -> Result<(), LineFault> {
    if depth < MAX_DEPTH {
        return Ok(());
    }
    Err(words.fault(
        format!("a joint inside {depth} others"),
        format!("at most {MAX_DEPTH} levels"),
    ))
}

/// Reads name and opening brace of a joint and adds it.
fn begin_joint(
    words: &mut Words<'_>,
    joints: &mut Vec<BvhJoint>,
    parent: Option<usize>,
    first_channel: usize,
) -> Result<Open, LineFault> {
    let name = words.rest_of_line(Some('{'));
    let allowed = "a name of its own for every joint, without comma or quote";
    if name.is_empty() || name.contains([',', '"']) {
        return Err(words.fault(format!("joint name {}", shown(name)), allowed));
    }
    if joints.iter().any(|joint| joint.name == name) {
        return Err(words.fault(format!("joint `{name}` twice"), allowed));
    }
    add(words, joints, name.to_owned(), parent, first_channel, false)
}

/// Reads `Site {` and adds the End Site of `parent`.
fn begin_end(
    words: &mut Words<'_>,
    joints: &mut Vec<BvhJoint>,
    parent: usize,
    first_channel: usize,
) -> Result<Open, LineFault> {
    words.expect("Site")?;
    // Some programs name it; its name is of no use.
    words.rest_of_line(Some('{'));
    let base = format!("{}_end", joints[parent].name);
    let taken = |name: &str| joints.iter().any(|joint| joint.name == name);
    let mut name = base.clone();
    let mut count = 1;
    while taken(&name) {
        count += 1;
        name = format!("{base}{count}");
    }
    add(words, joints, name, Some(parent), first_channel, true)
}

fn add(
    words: &mut Words<'_>,
    joints: &mut Vec<BvhJoint>,
    name: String,
    parent: Option<usize>,
    first_channel: usize,
    is_end: bool,
) -> Result<Open, LineFault> {
    if joints.len() >= MAX_JOINTS {
        return Err(words.fault(
            format!("joint number {}", joints.len() + 1),
            format!("at most {MAX_JOINTS} joints with their End Sites"),
        ));
    }
    let line = words.line;
    words.expect("{")?;
    joints.push(BvhJoint {
        name,
        parent,
        offset: [0.0; 3],
        channels: Vec::new(),
        first_channel,
        is_end,
    });
    Ok(Open {
        joint: joints.len() - 1,
        line,
        has_offset: false,
        has_channels: is_end,
    })
}

fn read_channels(words: &mut Words<'_>) -> Result<Vec<Channel>, LineFault> {
    let allowed = "0 to 6 after CHANNELS, then as many names";
    let word = words.next(allowed)?;
    let count = word.parse().ok().filter(|count| *count <= 6usize);
    let count = count.ok_or_else(|| words.fault(shown(word), allowed))?;
    let mut channels = Vec::with_capacity(count);
    for _ in 0..count {
        let word = words.next(CHANNEL_NAMES)?;
        let channel = Channel::of(word)
            .ok_or_else(|| words.fault(shown(word), format!("{count} of {CHANNEL_NAMES}")))?;
        if channels.contains(&channel) {
            return Err(words.fault(
                format!("channel {} twice in a joint", shown(word)),
                "every channel once",
            ));
        }
        channels.push(channel);
    }
    Ok(channels)
}

/// Reads what follows `MOTION`.
fn motion(words: &mut Words<'_>, joints: Vec<BvhJoint>) -> Result<BvhFile, LineFault> {
    let channels: usize = joints.iter().map(|joint| joint.channels.len()).sum();
    if channels == 0 {
        return Err(words.fault("a skeleton without a channel", "CHANNELS in some joint"));
    }
    let allowed = "`Frames: N` with N at least 1";
    words.expect("Frames:")?;
    let word = words.next(allowed)?;
    let announced = word.parse().ok().filter(|count| *count >= 1u64);
    let announced = announced.ok_or_else(|| words.fault(shown(word), allowed))?;
    words.expect("Frame")?;
    words.expect("Time:")?;
    let allowed = format!(
        "a frame time of {} to {} s",
        FRAME_TIMES_S.0, FRAME_TIMES_S.1
    );
    let frame_time_s = words.number(&allowed)?;
    if !(frame_time_s >= FRAME_TIMES_S.0 && frame_time_s <= FRAME_TIMES_S.1) {
        return Err(words.fault(format!("{frame_time_s} s"), allowed));
    }
    let left = words.rest_of_line(None);
    if !left.is_empty() {
        return Err(words.fault(shown(left), "the end of the line after the frame time"));
    }
    let mut values = Vec::new();
    let mut frames = 0u64;
    let mut first_frame_line = 0;
    while let Some(line) = words.next_line() {
        if frames == announced {
            return Err(words.fault(
                format!("more than the {announced} frames announced"),
                "as many lines of numbers as `Frames:` says; correct the number or the frames",
            ));
        }
        if frames == 0 {
            first_frame_line = words.line;
        }
        let before = values.len();
        for word in line.split_whitespace() {
            let value = number(word).ok_or_else(|| {
                words.fault(
                    format!("{} in frame {}", shown(word), frames + 1),
                    format!("numbers up to {LARGEST}"),
                )
            })?;
            if values.len() - before < channels {
                values.push(value);
            } else {
                return Err(frame_fault(words, line, frames, channels));
            }
        }
        if values.len() - before != channels {
            return Err(frame_fault(words, line, frames, channels));
        }
        frames += 1;
    }
    if frames < announced {
        return Err(words.fault(
            format!("the end of the file after {frames} of {announced} frames"),
            "as many lines of numbers as `Frames:` says; the file is cut off, or the number is wrong",
        ));
    }
    Ok(BvhFile {
        joints,
        frame_time_s,
        channels,
        values,
        first_frame_line,
    })
}

fn frame_fault(words: &Words<'_>, line: &str, frames: u64, channels: usize) -> LineFault {
    words.fault(
        format!(
            "{} numbers in frame {}",
            line.split_whitespace().count(),
            frames + 1
        ),
        format!("{channels} numbers a frame, one for every channel of the skeleton"),
    )
}
