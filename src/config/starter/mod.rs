//! A first character for any legged robot: clips scaled to its legs, and the configuration that plays them.
//!
//! Lengths of poses are parts of the leg length, so that a small robot bows as deeply as a large one.
//! What the joints cannot do is made smaller and said.

mod file;

use crate::motion::clip::ClipFile;
use crate::motion::gait::{BodyPose, GaitDescription, GaitError, GaitName};
use crate::motion::gait_frames::{Authored, Walker, author};
use crate::motion::range::JointRange;

/// Cycles per second at which the slow and the fast gait are played pure: tempi of a drumming hand.
const SLOW_HZ: f64 = 0.8;
/// See [`SLOW_HZ`].
const FAST_HZ: f64 = 1.7;
/// Share of the joints' speed and acceleration that a clip uses at its tempo; the rest is for blending
/// and for catching up with the performer.
const SHARE: f64 = 0.6;
/// Stride of a curved gait over that of the straight one, and its turn over that of a turn in place.
const CURVE: (f64, f64) = (0.75, 0.5);
/// A pose or stride is never made smaller than this part.
const LEAST: f64 = 0.15;

/// A clip of the character, with the description that it was made from.
#[derive(Clone, Debug)]
pub struct StarterClip {
    /// The clip.
    pub file: ClipFile,
    /// What `handwave clip gait` makes it from.
    pub description: GaitDescription,
    /// Its size over the usual, 0..1: less where legs reach no further or joints are no faster.
    pub size: f64,
}

/// A whole character, in memory.
#[derive(Clone, Debug)]
pub struct Starter {
    /// Its clips; each lies in `clips/NAME.json`, its description in `clips/NAME.toml`.
    pub clips: Vec<StarterClip>,
    /// Text of the configuration.
    pub config: String,
    /// Baud rate that the configuration asks for.
    pub baud: u32,
}

/// Names in the configuration.
#[derive(Clone, Debug)]
pub struct StarterNames<'a> {
    /// Name of the character.
    pub name: &'a str,
    /// Path of its URDF, relative to the configuration.
    pub urdf: &'a str,
    /// Servo model that is simulated.
    pub servo: &'a str,
}

/// Makes the character.
pub fn starter(walker: Walker<'_>, names: &StarterNames<'_>) -> Result<Starter, GaitError> {
    let ranges: Vec<JointRange> = walker
        .ranges
        .iter()
        .map(|r| JointRange {
            velocity: SHARE * r.velocity,
            acceleration: SHARE * r.acceleration,
        })
        .collect();
    let easy = Walker {
        ranges: &ranges,
        ..walker
    };
    let mut clips = vec![fitted(easy, |_| {
        Ok(GaitDescription::preset("stand", GaitName::Stand))
    })?];
    // Height of the root link as the clip of standing has it.
    let height_m = clips[0].file.body.first().map_or(0.0, |b| b[2]);
    let body = Proportions::of(walker, height_m);
    let (slow, fast) = if walker.legs.len() == 6 {
        (GaitName::Ripple, GaitName::Tripod)
    } else {
        (GaitName::Walk, GaitName::Trot)
    };
    for (gait, hz) in [(slow, SLOW_HZ), (fast, FAST_HZ)] {
        let name = gait.name();
        let long = fitted(
            easy,
            |amount| Ok(body.steps(name, "long", gait, hz, amount)),
        )?;
        let (stride, lift) = (
            long.file.root.forward_m,
            long.description.step_height_m.unwrap_or(0.0),
        );
        let mut short = body.steps(name, "short", gait, hz, 0.5);
        short.stride_m = Some(0.5 * stride);
        short.step_height_m = Some(0.6 * lift);
        let short = fitted(easy, |amount| Ok(scaled(&short, amount)))?;
        for (side, sign) in [("left", 1.0), ("right", -1.0)] {
            // A short step turns as far for its length as a long one: the same curve.
            for (straight, turn_rad) in [(&short, 0.5 * body.turn_rad), (&long, body.turn_rad)] {
                let mut curve = straight.description.clone();
                curve.name = format!("{}_{side}", curve.name);
                curve.stride_m = curve.stride_m.map(|m| CURVE.0 * m);
                curve.turn_rad = sign * CURVE.1 * turn_rad;
                clips.push(fitted(easy, |amount| Ok(scaled(&curve, amount)))?);
            }
        }
        clips.push(short);
        clips.push(long);
        for (side, sign) in [("left", 1.0), ("right", -1.0)] {
            clips.push(fitted(easy, |amount| {
                let mut turn = body.steps(name, &format!("turn_{side}"), gait, hz, amount);
                turn.turn_rad = sign * body.turn_rad * amount;
                turn.stride_m = Some(0.0);
                Ok(turn)
            })?);
        }
    }
    for (name, pose) in body.poses(walker) {
        clips.push(fitted(easy, |amount| Ok(body.path(name, &pose, amount)))?);
    }
    let config = file::config(walker, names, &clips, (slow, fast), (SLOW_HZ, FAST_HZ));
    Ok(Starter {
        clips,
        config,
        baud: file::baud(walker),
    })
}

/// Authors a description, made smaller until the robot can do it.
fn fitted(
    walker: Walker<'_>,
    make: impl Fn(f64) -> Result<GaitDescription, GaitError>,
) -> Result<StarterClip, GaitError> {
    let mut amount = 1.0;
    loop {
        let description = make(amount)?;
        match author(&description, walker, true) {
            Ok(Authored { file, .. }) => {
                return Ok(StarterClip {
                    file,
                    description,
                    size: amount,
                });
            }
            Err(e @ (GaitError::Leg { .. } | GaitError::TooFast { .. })) => {
                amount *= 0.93;
                if amount < LEAST {
                    return Err(e);
                }
            }
            Err(e) => return Err(e),
        }
    }
}

/// A gait with all its lengths, and its turn, times `amount`.
fn scaled(description: &GaitDescription, amount: f64) -> GaitDescription {
    let mut less = description.clone();
    less.stride_m = less.stride_m.map(|v| v * amount);
    less.step_height_m = less.step_height_m.map(|v| v * amount);
    less.turn_rad *= amount;
    less
}

/// What poses are scaled by.
struct Proportions {
    leg_m: f64,
    height_m: f64,
    /// Middle to the front hips, metres.
    half_m: f64,
    /// Turn of one cycle that moves the feet about as far as a long stride, rad.
    turn_rad: f64,
    sprawls: bool,
}

impl Proportions {
    fn of(walker: Walker<'_>, height_m: f64) -> Self {
        let standing = walker.legs.iter().map(|l| l.standing(walker.facing).foot);
        let (mut half_m, mut radius): (f64, f64) = (0.01, 0.01);
        for foot in standing {
            half_m = half_m.max(foot.x.abs());
            radius = radius.max(foot.coords.xy().norm());
        }
        let leg_m = walker
            .legs
            .iter()
            .map(|l| l.length(walker.model))
            .fold(f64::INFINITY, f64::min);
        let sprawls = walker.legs.iter().any(|l| l.sprawls(walker.facing));
        let round = |v: f64| (v * 1e4).round() / 1e4;
        Self {
            leg_m: round(leg_m),
            height_m: round(height_m),
            half_m,
            turn_rad: (0.4 * leg_m / radius).min(0.6),
            sprawls,
        }
    }

    /// Part of the leg length, to a tenth of a millimetre.
    fn of_leg(&self, part: f64) -> f64 {
        (part * self.leg_m * 1e4).round() / 1e4
    }

    fn steps(
        &self,
        name: &str,
        kind: &str,
        gait: GaitName,
        hz: f64,
        amount: f64,
    ) -> GaitDescription {
        let mut steps = GaitDescription::preset(&format!("{name}_{kind}"), gait);
        steps.frequency_hz = Some(hz);
        let part = if self.sprawls { 0.32 } else { 0.45 };
        steps.stride_m = Some(self.of_leg(part * amount));
        steps.step_height_m = Some(self.of_leg(0.1 * amount));
        steps.body_height_m = Some(self.height_m);
        steps
    }

    /// The far ends of the paths, by name.
    fn poses(&self, walker: Walker<'_>) -> Vec<(&'static str, BodyPose)> {
        let lower = |part: f64| Some(self.height_m - self.of_leg(part));
        // Front or rear goes down by this part of the leg.
        let pitch = |part: f64| (part * self.leg_m / self.half_m).clamp(-0.5, 0.5).asin();
        let mut poses = vec![
            (
                "heading",
                BodyPose {
                    yaw_rad: 0.16,
                    ..BodyPose::default()
                },
            ),
            (
                "crouch",
                BodyPose {
                    body_height_m: lower(if self.sprawls { 0.12 } else { 0.175 }),
                    ..BodyPose::default()
                },
            ),
            (
                "lie",
                BodyPose {
                    body_height_m: lower(if self.sprawls { 0.27 } else { 0.43 }),
                    ..BodyPose::default()
                },
            ),
        ];
        if walker.legs.len() == 6 {
            let up = [self.of_leg(0.2), 0.0, self.of_leg(0.5)];
            let front = walker.legs.iter().filter(|l| l.name.starts_with("front"));
            poses.push((
                "greet",
                BodyPose {
                    pitch_rad: -0.15,
                    forward_m: -self.of_leg(0.15),
                    feet: front.map(|l| (l.name.clone(), up)).collect(),
                    ..BodyPose::default()
                },
            ));
        } else {
            poses.push((
                "bow",
                BodyPose {
                    body_height_m: lower(0.125),
                    pitch_rad: pitch(0.17),
                    forward_m: -self.of_leg(0.1),
                    ..BodyPose::default()
                },
            ));
            poses.push((
                "sit",
                BodyPose {
                    body_height_m: lower(0.125),
                    pitch_rad: -pitch(0.2),
                    forward_m: -self.of_leg(0.1),
                    ..BodyPose::default()
                },
            ));
        }
        poses
    }

    /// From standing to `amount` of the way to a pose.
    fn path(&self, name: &str, end: &BodyPose, amount: f64) -> GaitDescription {
        let mut path = GaitDescription::preset(name, GaitName::Stand);
        path.gait = None;
        path.body_height_m = Some(self.height_m);
        let round = |v: f64| (v * 1e4).round() / 1e4;
        let mut pose = end.clone();
        pose.body_height_m = pose
            .body_height_m
            .map(|h| round(self.height_m + amount * (h - self.height_m)));
        pose.pitch_rad = round(pose.pitch_rad * amount);
        pose.yaw_rad = round(pose.yaw_rad * amount);
        pose.forward_m = round(pose.forward_m * amount);
        for way in pose.feet.values_mut() {
            *way = way.map(|v| round(v * amount));
        }
        path.pose = vec![BodyPose::default(), pose];
        path
    }
}
