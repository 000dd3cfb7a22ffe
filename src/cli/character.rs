//! `handwave character`: a whole character from the URDF of a legged robot.

use super::{ExitStatus, Failure};
use clap::Args;

/// Arguments of `handwave character`.
#[derive(Args, Debug)]
pub struct CharacterArgs {}

/// Runs `handwave character ...`.
pub fn run(_: &CharacterArgs) -> Result<ExitStatus, Failure> {
    Ok(ExitStatus::Done)
}
