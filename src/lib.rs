//! Handwave: a performer's hands, body or face bring a robot to life.
//!
//! Poses come in at the top, servo frames go out at the bottom, and between them lies one pure
//! function of time, [`puppet::Puppet::step`]:
//!
//! ```text
//! pose ──> gesture ──> motion ──> robot ──> bus
//! streams   waves       graph,     envelope   Dynamixel servos,
//!           (a, f, phi) classes    (limits)   real or simulated
//! ```
//!
//! From the top of the house to the ground; a module imports only from those below it:
//!
//! - [`cli`]: the commands of the program.
//! - [`view`]: what a person sees of a run.
//! - [`live`]: runs the puppet: clock, control loop, stop signals. The only place that knows threads.
//! - [`config`] builds the parts of a character from one TOML file, [`puppet`] composes them into the step.
//! - [`gesture`]: gestures defined from one example, and the waves they are performed with.
//!   [`motion`]: clips, classes, the graph between them. [`sim`]: simulated servos.
//! - [`pose`]: streams of tracked poses. [`body`]: what the animator needs to know of a body.
//!   [`bus`]: what carries targets to servos and states back.
//! - [`robot`]: URDF model, kinematics, envelope.
//! - [`base`]: time, the clock trait, joint states.
//!
//! Most users run the program or start at [`live::session`]; a robot builder reads [`config::file`]
//! and [`motion::gait`]; who only wants to read gestures needs [`pose`] and [`gesture`]:
//!
//! ```
//! use handwave::gesture::{FrontEnd, FrontEndOptions, GestureSet};
//! use handwave::pose::{PoseFormat, PoseReader, PoseSample};
//!
//! let gestures = include_str!("../configs/gestures/hand.toml");
//! let poses = include_bytes!("../configs/performances/waiting.csv");
//! let gestures = GestureSet::from_toml(gestures, "hand.toml")?;
//! let mut reader = PoseReader::new(&poses[..], PoseFormat::Csv, "waiting.csv")?;
//! let mut front = FrontEnd::new(&gestures, reader.header(), FrontEndOptions::default())?;
//! let mut sample = PoseSample::default();
//! while reader.read_into(&mut sample)? {
//!     front.push(&sample)?;
//! }
//! let drum = front.estimates()[0];
//! assert!(drum.amplitude > 0.8 && (0.8..1.1).contains(&drum.frequency_hz));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod base;
pub mod body;
pub mod bus;
pub mod cli;
pub mod config;
pub mod gesture;
pub mod live;
pub mod motion;
pub mod pose;
pub mod puppet;
pub mod robot;
pub mod sim;
pub mod view;
