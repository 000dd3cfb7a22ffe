//! The text of a first character's configuration.

use super::{StarterClip, StarterNames};
use crate::motion::gait::GaitName;
use crate::motion::gait_frames::Walker;
use std::fmt::Write;

/// Servos that a line of 1 Mbaud serves 200 times a second with room to spare.
const SERVOS_AT_ONE_MEGABAUD: usize = 14;

/// The class that a channel drives.
const SIT: &str = r#"
# A channel in a gesture's place: 0 at the first value of its range, 1 at the second.
[[class]]
name = "sit"
channel = { name = "z", range = [-0.03, -0.12] }   # the hand pushed away, m
clip = [{ file = "clips/sit.json" }]
"#;

/// Baud rate at which all joints are served 200 times a second.
pub(super) fn baud(walker: Walker<'_>) -> u32 {
    if walker.model.actuated.len() <= SERVOS_AT_ONE_MEGABAUD {
        1_000_000
    } else {
        2_000_000
    }
}

/// The configuration.
pub(super) fn config(
    walker: Walker<'_>,
    names: &StarterNames<'_>,
    clips: &[StarterClip],
    (slow, fast): (GaitName, GaitName),
    (slow_hz, fast_hz): (f64, f64),
) -> String {
    let has = |name: &str| clips.iter().any(|c| c.file.name == name);
    let (slow, fast) = (slow.name(), fast.name());
    let (greeting, greeting_clip) = if has("greet") {
        ("greeting", "greet")
    } else {
        ("bow", "bow")
    };
    let joints = walker.model.joint_names();
    let width = joints.iter().map(String::len).max().unwrap_or(0) + 3;
    let mut map = String::new();
    for (i, joint) in joints.iter().enumerate() {
        let quoted = format!("\"{joint}\",");
        let _ = writeln!(map, "  {{ name = {quoted:<width$} servo = {} }},", i + 1);
    }
    let acceleration = walker
        .ranges
        .iter()
        .map(|r| r.acceleration)
        .fold(f64::INFINITY, f64::min);
    let baud = baud(walker);
    let not_wired: Vec<String> = clips
        .iter()
        .map(|c| c.file.name.clone())
        .filter(|n| n.contains("turn"))
        .collect();
    let mut steps = String::new();
    for (side, at) in [
        ("", ""),
        ("_left", ", at = { turn = 1.0 }"),
        ("_right", ", at = { turn = -1.0 }"),
    ] {
        for (gait, hz) in [(slow, slow_hz), (fast, fast_hz)] {
            for (length, amplitude) in [("short", 0.5), ("long", 1.0)] {
                let file = format!("clips/{gait}_{length}{side}.json");
                let _ = writeln!(
                    steps,
                    "  {{ file = \"{file}\", amplitude = {amplitude:?}, frequency_hz = {hz:?}{at} }},"
                );
            }
        }
    }
    let (sitting, sit) = if has("sit") {
        (", a hand pushed away makes it sit", SIT)
    } else {
        ("", "")
    };
    format!(
        r#"# {name}: finger drumming makes it {slow} and {fast}, a turned hand turns it, a splayed hand makes it
# {greeting}{sitting}.
# Made by `handwave character new`; plays with no hardware. Paths are relative to this file, unknown keys
# are errors. To change a clip, edit clips/NAME.toml and make it again:
#   handwave clip gait --urdf {urdf} --gait clips/NAME.toml --out clips/NAME.json
# Made as well, for classes of your own: {not_wired}.

name = "{name}"

[input]
source = "file:performances/drum_and_splay.jsonl"  # a recorded hand; `--input` puts another in its place

[[gesture]]
file = "gestures/hand.toml"      # `drum` (cyclic) and `splay` (non-cyclic); `handwave gesture teach` shows your own

# The gesture's amplitude and frequency choose the blend of clips, its phase drives the legs. The hand's yaw
# against the reference, rad, turns the walk; `at` says where in a parameter a clip is played pure (0 when not said).
[[class]]
name = "locomotion"
gesture = "drum"
parameter = [{{ name = "turn", channel = "yaw", range = [-0.6, 0.6], dead_zone = 0.25 }}]
clip = [
  {{ file = "clips/stand.json", amplitude = 0.0 }},    # at rest, at any frequency
{steps}]

[[class]]
name = "{greeting}"
gesture = "splay"        # its progression, 0 to 1, is the way through the clip
clip = [{{ file = "clips/{greeting_clip}.json" }}]
{sit}
[graph]
start = "locomotion"     # played when nothing is performed

# Layers add to whatever is played.
[[layer]]
name = "heading"
channel = "yaw"          # of the hand against the reference, rad
clip = "clips/heading.json"
range = [-0.6, 0.6]
dead_zone = 0.25

[[layer]]
name = "crouch"
channel = "height"       # of the palm above the tracker, m: lower hand, lower body
clip = "clips/crouch.json"
range = [0.14, 0.07]
one_sided = true

[robot]
urdf = "{urdf}"
acceleration_rad_s2 = {acceleration:?}   # what the servos reach with the leg's inertia; a URDF does not tell
# Which servo moves which joint: ids count up in joint order here, so put yours. Servo position =
# zero_pulse + direction * joint position * 4096 / turn; also per joint, with these defaults:
# zero_pulse = 2048, direction = 1 (or -1), range_pulse = [0, 4095] (what the servo may be sent to).
joint = [
{map}]

[bus]
bus = "sim"              # `--bus dynamixel:/dev/ttyUSB0@{baud}` for real servos
baud = {baud}           # of the simulated line
model = "{servo}"

[safety]
end_clip = "clips/lie.json"   # its last pose is where a run ends
on_lost = "idle"         # poses lost: come to rest; or "hold", or "stop": lie down, torque off
"#,
        name = names.name,
        urdf = names.urdf,
        servo = names.servo,
        not_wired = not_wired.join(", "),
    )
}
