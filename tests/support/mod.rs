//! What integration tests share, one module per concern.
#![allow(dead_code, reason = "each test program uses a part")]

pub mod bench;
pub mod character;
pub mod counting;
pub mod data;
pub mod folder;
pub mod limits;
pub mod motion;
pub mod program;
pub mod recipe;
pub mod rig;
pub mod scenario;
pub mod simulator;
pub mod spectrum;
pub mod targets;
