//! What `run` keeps of a run: options, the recorder as an onlooker has it, and what the summary says of it.

use super::Failure;
use crate::bus::port::Port;
use crate::bus::{BusAddress, ServoBus};
use crate::config::Character;
use crate::gesture::PerformerScale;
use crate::live::CycleRecord;
use crate::live::clock::unix_now;
use crate::live::recording::Taps;
use crate::pose::PoseHeader;
pub use crate::view::recorder::Kept;
use crate::view::recorder::{About, Channel, Plan, Recorder};
use clap::Args;
use serde_json::{Value, json};
use std::path::PathBuf;

/// Options of what is kept.
#[derive(Args, Debug, Default)]
pub struct KeepOptions {
    /// Record everything into an MCAP file: Foxglove shows it, `handwave replay` runs it again
    #[arg(long, value_name = "FILE.mcap")]
    record: Option<PathBuf>,
    /// Do not write handwave-fault-TIME.mcap when something went wrong (by default runs on real servos do;
    /// [record] in the configuration; HANDWAVE_NO_DUMP=1 does the same)
    #[arg(long)]
    no_dump: bool,
}

/// How a run is driven, for its recording.
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

/// The recorder of a run, if anything is kept of it.
#[derive(Default)]
pub struct Keeping {
    plan: Option<Plan>,
    taps: Option<Taps>,
    recorder: Option<Recorder>,
}

impl Keeping {
    /// What is to be kept: as the options say, else as the configuration does.
    pub fn plan(options: &KeepOptions, character: &Character, is_virtual: bool) -> Self {
        let wish = &character.record;
        let real_servos = !is_virtual && matches!(character.bus, BusAddress::Dynamixel { .. });
        let forbidden =
            options.no_dump || std::env::var_os("HANDWAVE_NO_DUMP").is_some_and(|v| !v.is_empty());
        let dumps = wish.on_fault.unwrap_or(real_servos) && !forbidden;
        let file = options.record.clone().or_else(|| wish.file.clone());
        if file.is_none() && !dumps {
            return Self::default();
        }
        Self {
            plan: Some(Plan {
                file,
                ring: dumps.then(|| (wish.folder.clone(), wish.ring_bytes)),
                telemetry_hz: wish.telemetry_hz,
            }),
            taps: Some(Taps::default()),
            recorder: None,
        }
    }

    /// A port as it is opened.
    pub fn wrap(&mut self, name: &str, port: Box<dyn Port>) -> Box<dyn Port> {
        match &mut self.taps {
            Some(taps) => taps.wrap(name, port),
            None => port,
        }
    }

    /// The bus as it was opened.
    ///
    /// # Errors
    /// A bus whose bytes cannot be seen.
    pub fn wrap_bus(
        &mut self,
        character: &Character,
        bus: Box<dyn ServoBus>,
    ) -> Result<Box<dyn ServoBus>, Failure> {
        let Some(taps) = &mut self.taps else {
            return Ok(bus);
        };
        if character.body.avatar.is_some() {
            return Ok(taps.wrap_bus(bus));
        }
        if taps.names().len() > 1 {
            return Ok(bus);
        }
        let asked = self.plan.as_ref().is_some_and(|plan| plan.file.is_some());
        if asked {
            return Err(Failure::input(
                "the dynamixel2 backend cannot be recorded: it opens its port by itself. Leave backend=dynamixel2 out, or --record",
            ));
        }
        *self = Self::default();
        Ok(bus)
    }

    /// The logs, for the session.
    pub fn taps(&self) -> Option<Taps> {
        self.taps.clone()
    }

    /// Begins to record.
    ///
    /// # Errors
    /// The file cannot be created.
    pub fn begin(
        &mut self,
        character: &Character,
        header: &PoseHeader,
        how: &HowRun<'_>,
    ) -> Result<(), Failure> {
        let (Some(plan), Some(taps)) = (&self.plan, &self.taps) else {
            return Ok(());
        };
        let config = &character.config_file;
        let scale = match character.front_options.scale {
            PerformerScale::Declared(scale) => scale.to_string(),
            PerformerScale::Rest => "rest".into(),
        };
        let logs = taps.names();
        let run = json!({
            "config": config, "character": character.name, "rate_hz": how.rate_hz,
            "duration_s": how.duration_s, "scale": scale, "bus": logs.get(1),
            "source": character.source, "faults": how.faults, "virtual": how.is_virtual, "logs": logs,
        });
        let epoch_ns = match how.is_virtual {
            // The same run gives the same file.
            true => 0,
            false => i64::try_from(unix_now().as_nanos()).unwrap_or(0) - how.now_ns,
        };
        let about = About {
            run,
            files: character.files.kept(),
            header: header.clone(),
            epoch_ns,
            logs,
            channels: Channel::chosen(character.record.channels.as_deref()),
        };
        let recorder = Recorder::start(plan, character, about, taps.clone(), !how.is_virtual);
        self.recorder = Some(recorder.map_err(Failure::input)?);
        Ok(())
    }

    /// Sees every cycle.
    pub fn see(&mut self, record: &CycleRecord) {
        if let Some(recorder) = &mut self.recorder {
            recorder.see(record);
        }
    }

    /// The gestures are others now.
    pub fn rename_gestures(&mut self, names: &[String]) {
        if let Some(recorder) = &mut self.recorder {
            recorder.rename_gestures(names);
        }
    }

    /// Ends the recording, of a run that ended badly for the reason given.
    pub fn finish(self, bad_end: Option<String>) -> Kept {
        self.recorder
            .map_or_else(Kept::default, |recorder| recorder.finish(bad_end))
    }
}

/// What the summary says, line by line.
pub fn lines(kept: &Kept) -> String {
    let mut text = String::new();
    for (path, what) in &kept.files {
        text += &format!("recording     {}: {what}\n", path.display());
    }
    for problem in &kept.problems {
        text += &format!("recording     {problem}\n");
    }
    if kept.lost > 0 {
        text += &format!(
            "recording     {} entries are missing: the disk was too slow; a replay goes up to the first of them\n",
            kept.lost
        );
    }
    text
}

/// The same for the summary's JSON.
pub fn to_json(kept: &Kept) -> Value {
    let file = |(path, what): &(PathBuf, String)| json!({"file": path, "what": what});
    json!({
        "files": kept.files.iter().map(file).collect::<Vec<_>>(),
        "problems": kept.problems, "entries_lost": kept.lost,
    })
}
