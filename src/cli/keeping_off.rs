//! What `run` keeps of a run in a build without the feature `record`: nothing.

use super::Failure;
use crate::bus::ServoBus;
use crate::bus::port::Port;
use crate::config::Character;
use crate::live::CycleRecord;
use crate::live::recording::Taps;
use crate::pose::PoseHeader;
use clap::Args;
use serde_json::Value;

/// Options of what is kept.
#[derive(Args, Debug, Default)]
pub struct KeepOptions {}

/// How a run is driven, for its recording.
#[expect(dead_code, reason = "nothing is recorded")]
pub struct HowRun<'a> {
    /// Control cycles per second.
    pub rate_hz: f64,
    /// As given.
    pub duration_s: Option<f64>,
    /// Faults as given.
    pub faults: &'a [String],
    /// In virtual time.
    pub is_virtual: bool,
    /// Time since the bus clock's zero, nanoseconds.
    pub now_ns: i64,
}

/// Nothing that was kept.
#[derive(Default)]
pub struct Kept {
    /// What went wrong.
    pub problems: Vec<String>,
}

/// No recorder.
#[derive(Default)]
pub struct Keeping {}

impl Keeping {
    pub fn plan(_: &KeepOptions, _: &Character, _: bool) -> Self {
        Self {}
    }
    pub fn wrap(&mut self, _: &str, port: Box<dyn Port>) -> Box<dyn Port> {
        port
    }
    pub fn wrap_bus(
        &mut self,
        _: &Character,
        bus: Box<dyn ServoBus>,
    ) -> Result<Box<dyn ServoBus>, Failure> {
        Ok(bus)
    }
    pub fn taps(&self) -> Option<Taps> {
        None
    }
    pub fn begin(&mut self, _: &Character, _: &PoseHeader, _: &HowRun<'_>) -> Result<(), Failure> {
        Ok(())
    }
    pub fn see(&mut self, _: &CycleRecord) {}
    pub fn rename_gestures(&mut self, _: &[String]) {}
    pub fn finish(self, _: Option<String>) -> Kept {
        Kept::default()
    }
}

pub fn lines(_: &Kept) -> String {
    String::new()
}

pub fn to_json(_: &Kept) -> Value {
    Value::Null
}
