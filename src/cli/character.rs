//! `handwave character`: a whole character, ready to run, from the URDF of a legged robot.

use super::disk::read;
use super::legged::{Legged, LeggedArgs, load};
use super::{ExitStatus, Failure, say};
use crate::config::Files;
use crate::config::starter::{Starter, StarterNames, starter};
use crate::motion::range::JointRange;
use crate::robot::adapt::adapted_urdf;
use crate::robot::{Leg, RobotModel};
use clap::{Args, Subcommand};
use std::path::{Path, PathBuf};

/// Servo that a new character is simulated with.
const SERVO: &str = "xl430-w250";
/// 80 % of that servo's speed without load, rad/s.
const SERVO_VELOCITY_RAD_S: f64 = 4.77;
/// Half of that servo's turn, with a little room, rad.
const SERVO_REACH_RAD: f64 = 3.13;
/// Parts of the built-in character that every new one gets a copy of.
const COPIED: [&str; 2] = ["gestures/hand.toml", "performances/drum_and_splay.jsonl"];

/// Arguments of `handwave character`.
#[derive(Args, Debug)]
pub struct CharacterArgs {
    #[command(subcommand)]
    command: CharacterCommand,
}

#[derive(Subcommand, Debug)]
enum CharacterCommand {
    /// Write a folder with clips, configuration, gestures and a performance for a legged robot
    #[command(after_help = "Examples:
  handwave character new --urdf dog.urdf --out dog
  handwave run dog/dog.toml
  handwave character new --urdf solo12.urdf --max-velocity 8 --out solo
  handwave character new --urdf spider.urdf --legs front_left=LINK,front_right=LINK,... --out spider

Legs (four or six, three joints each) are found by themselves. Clips: stand, a slow and a fast
gait with short and long steps, turns, heading, crouch, lie, bow and sit, or greet on six legs.
They are scaled to the legs and to simulated XL430 servos (4.77 rad/s); the folder's URDF has
these limits. Everything in the folder may be edited.")]
    New(Box<NewArgs>),
}

#[derive(Args, Debug)]
struct NewArgs {
    #[command(flatten)]
    robot: LeggedArgs,
    /// Folder to write; it must not exist or be empty
    #[arg(long)]
    out: PathBuf,
    /// Name of the character and its file (default: name of the folder)
    #[arg(long)]
    name: Option<String>,
}

/// Runs `handwave character ...`.
pub fn run(args: &CharacterArgs) -> Result<ExitStatus, Failure> {
    match &args.command {
        CharacterCommand::New(args) => new(args),
    }
}

fn new(args: &NewArgs) -> Result<ExitStatus, Failure> {
    let folder = args.out.as_path();
    let name = name(args)?;
    let taken = std::fs::read_dir(folder).is_ok_and(|mut entries| entries.next().is_some());
    if taken || folder.is_file() {
        return Err(Failure::input(format!(
            "--out {}: exists and is not an empty folder; give another, nothing is overwritten",
            folder.display()
        )));
    }
    let found = load(&args.robot)?;
    let text = read(&args.robot.urdf)?;
    let (urdf, changes, robot) = for_servos(&text, found)
        .map_err(|e| Failure::input(format!("{}: {e}", args.robot.urdf.display())))?;
    let names = StarterNames {
        name: &name,
        urdf: &format!("robots/{name}.urdf"),
        servo: SERVO,
    };
    let made = starter(robot.walker(), &names)
        .map_err(|e| Failure::input(format!("{}: {e}", args.robot.urdf.display())))?;
    write_all(folder, &name, &urdf, &made)?;
    report(folder, &name, &made, &changes);
    Ok(ExitStatus::Done)
}

/// Name of the character: it becomes a file name.
fn name(args: &NewArgs) -> Result<String, Failure> {
    let of_folder = || {
        args.out
            .file_name()
            .map(|n| n.to_string_lossy().into_owned())
    };
    let name = args.name.clone().or_else(of_folder).unwrap_or_default();
    let plain = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
    if name.is_empty() || !name.chars().all(plain) {
        return Err(Failure::input(format!(
            "--name {name:?}: a name of letters, digits, - and _ is needed"
        )));
    }
    Ok(name)
}

/// The URDF with the servos' limits, what was changed, and the robot read from it.
fn for_servos(text: &str, found: Legged) -> Result<(String, Vec<String>, Legged), String> {
    let Legged {
        mut model,
        legs,
        facing,
        ranges,
    } = found;
    model.cap_velocity(SERVO_VELOCITY_RAD_S);
    let joints: Vec<(String, f64, f64)> = model
        .joint_names()
        .into_iter()
        .zip(model.limits())
        .map(|(n, l)| {
            (
                n,
                l.lower.max(-SERVO_REACH_RAD),
                l.upper.min(SERVO_REACH_RAD),
            )
        })
        .collect();
    for (joint, lower, upper) in joints {
        model
            .set_range(&joint, lower, upper)
            .map_err(|e| format!("{e} (a servo turns from -3.13 to 3.13)"))?;
    }
    let (urdf, changes) = adapted_urdf(text, &model, &legs).map_err(|e| e.to_string())?;
    let model = RobotModel::from_urdf(&urdf).map_err(|e| e.to_string())?;
    let legs = legs
        .iter()
        .map(|leg| {
            let own = format!("{}_foot", leg.name);
            let link = if leg.tip.coords.norm() > 0.0 {
                own.as_str()
            } else {
                model.links[leg.foot].as_str()
            };
            Leg::to_foot(&model, &leg.name, link).map_err(|e| e.to_string())
        })
        .collect::<Result<Vec<_>, _>>()?;
    let ranges = model
        .limits()
        .iter()
        .zip(&ranges)
        .map(|(l, r)| JointRange {
            velocity: l.velocity,
            acceleration: r.acceleration,
        })
        .collect();
    Ok((
        urdf,
        changes,
        Legged {
            model,
            legs,
            facing,
            ranges,
        },
    ))
}

fn write_all(folder: &Path, name: &str, urdf: &str, made: &Starter) -> Result<(), Failure> {
    let write = |path: &str, text: &str| {
        let path = folder.join(path);
        let parent = path.parent().unwrap_or(folder);
        std::fs::create_dir_all(parent)
            .and_then(|()| std::fs::write(&path, text))
            .map_err(|e| Failure::input(format!("cannot write {}: {e}", path.display())))
    };
    write(&format!("robots/{name}.urdf"), urdf)?;
    for clip in &made.clips {
        let name = &clip.file.name;
        write(&format!("clips/{name}.json"), &clip.file.to_json())?;
        let description = toml::to_string(&clip.description)
            .map_err(|e| Failure::input(format!("clip {name}: {e}")))?;
        write(&format!("clips/{name}.toml"), &description)?;
    }
    for path in COPIED {
        let text = Files::Embedded
            .read(path)
            .map_err(|e| Failure::input(e.to_string()))?;
        write(path, &text)?;
    }
    write(&format!("{name}.toml"), &made.config)
}

fn report(folder: &Path, name: &str, made: &Starter, changes: &[String]) {
    let folder = folder.display();
    let clips: Vec<&str> = made.clips.iter().map(|c| c.file.name.as_str()).collect();
    say(format_args!("{folder}/clips: {}", clips.join(", ")));
    let smaller: Vec<String> = made
        .clips
        .iter()
        .filter(|c| c.size < 0.999)
        .map(|c| format!("{} {:.0} %", c.file.name, 100.0 * c.size))
        .collect();
    if !smaller.is_empty() {
        say(format_args!(
            "smaller than usual, for the joints are no faster or the legs reach no further: {}",
            smaller.join(", ")
        ));
    }
    if let Some(first) = changes.first() {
        let more = match changes.len() {
            1 => String::new(),
            n => format!(" and {} more", n - 1),
        };
        say(format_args!(
            "{folder}/robots/{name}.urdf: limits as {SERVO} servos have them ({first}{more})"
        ));
    }
    let baud = made.baud;
    say(format_args!(
        "\nnext, with simulated servos and a recorded hand:\
         \n  handwave run {folder}/{name}.toml\
         \nthen with real servos, whose ids belong into {name}.toml:\
         \n  handwave bus scan dynamixel:/dev/ttyUSB0@{baud}\
         \n  handwave run {folder}/{name}.toml --bus dynamixel:/dev/ttyUSB0@{baud} --duration 10"
    ));
}
