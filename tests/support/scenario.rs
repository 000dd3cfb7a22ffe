//! One injected fault, played by the built-in quadruped in virtual time: what came of it.

use super::character::{RATE_HZ, built_in};
use super::folder::Folder;
use super::program::{AT_MOST, Ended, Running};
use super::targets::Targets;
use serde_json::Value;

/// The legs trot from about 6 s on.
pub const STRIKES_S: f64 = 8.0;
/// Faults that last are over by then.
pub const OVER_S: f64 = 9.0;
/// When the performance is brought to its end.
const DURATION: &str = "10";
/// A control cycle.
pub const CYCLE_S: f64 = 1.0 / RATE_HZ;
/// The servo that ails: a thigh, which swings while the legs trot.
pub const SERVO: u64 = 8;
/// Its joint.
pub const JOINT: &str = "rear_left_thigh";

/// A run with a fault.
pub struct Played {
    pub spec: String,
    pub ended: Ended,
    pub summary: Value,
    pub targets: Targets,
}

/// One entry of the summary's faults.
#[derive(Clone, Debug)]
pub struct Seen {
    pub servo: u64,
    pub joint: String,
    pub kind: String,
    pub from_s: f64,
    /// The end of the run when it lasted to it.
    pub to_s: f64,
}

/// Plays with the faults `specs`. Checked of every run: it ends with one of `codes`, no target left the
/// envelope, and the torque of all servos was read back off unless the bus is gone (3).
#[track_caller]
pub fn play(specs: &[&str], codes: &[i32]) -> Played {
    let folder = Folder::empty();
    let mut args = vec![
        "run",
        "--headless",
        "--speed",
        "max",
        "--bus",
        "sim",
        "--json",
        "--targets",
        "a.csv",
        "--duration",
        DURATION,
        "--seed",
        "7",
    ];
    for spec in specs {
        args.extend(["--fault", spec]);
    }
    let ended = Running::start_in(&folder.path(""), &args).wait(AT_MOST);
    let spec = specs.join(" and ");
    let code = ended.code.unwrap_or(-1);
    assert!(
        codes.contains(&code),
        "{spec}: exit {code}, declared {codes:?}: {ended:#?}"
    );
    assert!(!ended.err.contains("panicked"), "{spec}: {ended:#?}");
    let played = Played {
        summary: ended.json(),
        targets: Targets::read(&folder.path("a.csv")),
        ended,
        spec,
    };
    let limits = built_in().limits;
    let watch = played.targets.expect_inside(&limits, RATE_HZ);
    assert!(
        watch.speed.share > 0.2,
        "{}: it hardly moved: {}",
        played.spec,
        watch.extremes()
    );
    if code != 3 {
        let off = played.summary["torque_off"].as_array().map(Vec::len);
        assert_eq!(
            off,
            Some(12),
            "{}: torque read back: {}",
            played.spec,
            played.summary
        );
        let left = played.lying();
        assert!(
            left < 1e-6,
            "{}: the end is {left} rad from lying",
            played.spec
        );
    }
    played
}

impl Played {
    pub fn code(&self) -> i32 {
        self.ended.code.unwrap_or(-1)
    }

    pub fn faults(&self) -> Vec<Seen> {
        let end_s = self.targets.rows.len() as f64 * CYCLE_S;
        let entries = self.summary["faults"]
            .as_array()
            .cloned()
            .unwrap_or_default();
        entries
            .iter()
            .map(|fault| Seen {
                servo: fault["servo"].as_u64().unwrap_or(0),
                joint: fault["joint"].as_str().unwrap_or("").to_owned(),
                kind: fault["fault"].as_str().unwrap_or("").to_owned(),
                from_s: fault["from_s"].as_f64().unwrap_or(f64::NAN),
                to_s: fault["to_s"].as_f64().unwrap_or(end_s),
            })
            .collect()
    }

    /// Cycles in which healthy joint had no new state, of the joint with most.
    pub fn healthy_missed(&self) -> (u64, String) {
        let mut missed = std::collections::BTreeMap::new();
        for seen in self.faults() {
            if seen.servo != SERVO && seen.kind == "silent" {
                let cycles = ((seen.to_s - seen.from_s) / CYCLE_S).round() as u64;
                *missed.entry(seen.joint).or_insert(0) += cycles;
            }
        }
        let most = missed.into_iter().max_by_key(|(_, cycles)| *cycles);
        most.map_or((0, String::new()), |(joint, cycles)| (cycles, joint))
    }

    /// Fails unless the servo that ails is reported within three cycles of `visible_s`, by name and id.
    #[track_caller]
    pub fn expect_reported(&self, visible_s: f64) -> Seen {
        let own: Vec<Seen> = self
            .faults()
            .into_iter()
            .filter(|f| f.servo == SERVO)
            .collect();
        let first = own.first().unwrap_or_else(|| {
            panic!(
                "{}: servo {SERVO} is not reported: {}",
                self.spec, self.summary
            )
        });
        assert_eq!(first.joint, JOINT, "{}", self.spec);
        let after = ((first.from_s - visible_s) / CYCLE_S).round();
        assert!(
            (0.0..=3.0).contains(&after),
            "{}: reported {after} cycles after {visible_s} s: {first:?}",
            self.spec
        );
        first.clone()
    }

    /// Fails unless every report is of the servo that ails.
    #[track_caller]
    pub fn expect_healthy_joints_missed_at_most(&self, cycles: u64) {
        let (missed, joint) = self.healthy_missed();
        assert!(
            missed <= cycles,
            "{}: joint {joint} missed {missed} cycles, at most {cycles}: {}",
            self.spec,
            self.summary["faults"]
        );
        let others = self
            .faults()
            .into_iter()
            .find(|f| f.servo != SERVO && f.kind != "silent");
        assert!(
            others.is_none(),
            "{}: a healthy servo is blamed: {others:?}",
            self.spec
        );
    }

    /// Fails unless the last message names the joint, its servo and a command.
    #[track_caller]
    pub fn expect_advice(&self) {
        // A command to type, or what to look at by hand.
        let advice = [
            "handwave bus ",
            "Look whether",
            "Clear what blocks",
            "check its supply",
        ];
        let err = &self.ended.err;
        assert!(
            err.contains(JOINT) && advice.iter().any(|part| err.contains(part)),
            "{}: the message names {JOINT} and what to do: {err}",
            self.spec,
        );
    }

    /// Fails unless the other legs go on while the fault lasts.
    #[track_caller]
    pub fn expect_others_to_move(&self) {
        // Thighs of the other legs.
        for joint in [1, 4, 10] {
            let rows =
                &self.targets.rows[(STRIKES_S * RATE_HZ) as usize..(OVER_S * RATE_HZ) as usize];
            let (low, high) = rows.iter().fold((f64::MAX, f64::MIN), |(low, high), row| {
                (low.min(row[joint]), high.max(row[joint]))
            });
            let way = high - low;
            assert!(
                way > 0.2,
                "{}: joint {joint} moved by {way:.3} rad only between {STRIKES_S} and {OVER_S} s",
                self.spec
            );
        }
    }

    /// Distance of the last target from lying, rad.
    fn lying(&self) -> f64 {
        let character = built_in();
        let end = character.end_pose.expect("an end pose");
        let last = self.targets.rows.last().expect("rows");
        // A servo whose fault lasts is left where it was found: it is not driven.
        let left_out = |joint: &str| {
            let faults = self.summary["faults"].as_array();
            faults.is_some_and(|all| {
                all.iter()
                    .any(|f| f["joint"] == joint && f["to_s"].is_null())
            })
        };
        let joints = last.iter().zip(&end).zip(&character.joints);
        let ways = joints
            .filter(|(_, joint)| !left_out(joint))
            .map(|((a, b), _)| (a - b).abs());
        ways.fold(0.0, f64::max)
    }

    /// For the notes of a bench.
    pub fn line(&self) -> String {
        let (missed, _) = self.healthy_missed();
        let kinds: Vec<String> = self
            .faults()
            .iter()
            .filter(|f| f.servo == SERVO)
            .take(3)
            .map(|f| format!("{} {:.3}..{:.3}", f.kind, f.from_s, f.to_s))
            .collect();
        format!(
            "{}: exit {}, healthy missed {missed}, damage {}, overruns {}, servo {SERVO}: {}",
            self.spec,
            self.code(),
            self.summary["damage"],
            self.summary["overruns"],
            kinds.join(", ")
        )
    }
}
