//! Typed configuration: one TOML file names a whole character; checked at load, built into parts.
//!
//! [`mod@file`] is what a user writes, [`files`] where its parts are read from (a folder, or those
//! embedded in the program), [`build`] checks it and makes the parts, [`map`] learns the pose maps it names, [`error`] tells what is wrong.

mod avatar;
mod blending;
pub mod body;
pub mod build;
mod channel;
mod class;
pub mod edit;
pub mod error;
pub mod file;
pub mod files;
mod gestures;
mod layer;
pub mod map;
mod motion;
mod numbers;
mod parts;
pub mod record;
pub mod safety;
mod search;
mod servos;
pub mod starter;

pub use avatar::Avatar;
pub use build::{Character, load};
pub use error::ConfigError;
pub use files::Files;
pub use gestures::GestureFiles;
