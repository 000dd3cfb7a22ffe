//! A cycle in words: the JSON messages that a recording and its viewers take from a [`CycleRecord`].

use super::channel::Channel;
use crate::config::Character;
use crate::live::CycleRecord;
use serde_json::{Map, Value, json};

/// Makes messages of cycles, so many times a second of the run's time; what is wrong on the bus at once.
#[derive(Debug)]
pub(super) struct Telemetry {
    every_s: f64,
    next_s: f64,
    trouble: [u64; 4],
    joints: Vec<String>,
    gestures: Vec<String>,
    classes: Vec<String>,
    layers: Vec<String>,
}

/// Six decimals: a micrometre, a microradian.
fn rounded(value: f64) -> Value {
    ((value * 1e6).round() / 1e6).into()
}

fn by_name<'a>(names: &'a [String], values: impl IntoIterator<Item = f64> + 'a) -> Value {
    let pairs = names.iter().cloned().zip(values);
    Value::Object(pairs.map(|(name, v)| (name, rounded(v))).collect())
}

impl Telemetry {
    /// For `character`, at `rate_hz`.
    pub fn new(character: &Character, rate_hz: f64) -> Self {
        let named = |names: &mut dyn Iterator<Item = &String>| names.cloned().collect::<Vec<_>>();
        Self {
            every_s: 1.0 / rate_hz,
            next_s: 0.0,
            trouble: [0; 4],
            joints: character.joints.clone(),
            gestures: named(&mut character.gestures.gestures.iter().map(|g| &g.name)),
            classes: named(&mut character.classes.iter().map(|c| &c.name)),
            layers: character.layer_names(),
        }
    }

    /// The gestures are others now.
    pub fn rename_gestures(&mut self, names: &[String]) {
        self.gestures = names.to_vec();
    }

    /// Hands over the messages of a cycle, if it is time for some.
    pub fn see(&mut self, record: &CycleRecord, mut say: impl FnMut(Channel, String)) {
        let bus = &record.bus;
        let trouble = [
            bus.silent_mask,
            bus.alert_mask,
            bus.torqueless_mask,
            bus.ramping_mask,
        ];
        let changed = trouble != self.trouble;
        self.trouble = trouble;
        let due = record.t_s + 1e-9 >= self.next_s;
        if due {
            self.next_s = (self.next_s + self.every_s).max(record.t_s);
            say(Channel::Gestures, self.gestures(record).to_string());
            say(Channel::Graph, self.graph(record).to_string());
            let t = rounded(record.t_s);
            let position = by_name(&self.joints, record.targets.iter().copied());
            say(
                Channel::Target,
                json!({"t": t, "position": position}).to_string(),
            );
            let states = || record.states.iter();
            let state = json!({
                "t": t,
                "position": by_name(&self.joints, states().map(|s| s.position)),
                "velocity": by_name(&self.joints, states().map(|s| s.velocity)),
                "effort": by_name(&self.joints, states().map(|s| s.effort)),
            });
            say(Channel::State, state.to_string());
        }
        if due || changed {
            say(Channel::Bus, self.bus(record).to_string());
        }
    }

    fn gestures(&self, record: &CycleRecord) -> Value {
        let each = self.gestures.iter().zip(&record.gestures).map(|(name, g)| {
            let wave = json!({
                "amplitude": rounded(g.amplitude), "frequency_hz": rounded(g.frequency_hz),
                "phase_rad": rounded(g.phase_rad), "quality": rounded(g.quality),
            });
            (name.clone(), wave)
        });
        json!({"t": rounded(record.t_s), "gestures": each.collect::<Map<_, _>>()})
    }

    fn graph(&self, record: &CycleRecord) -> Value {
        let class = |index: usize| self.classes.get(index).cloned().unwrap_or_default();
        let transition = record.transition.as_ref().map(|(t, weight)| {
            json!({"from": class(t.from), "to": class(t.to), "weight": rounded(*weight)})
        });
        json!({
            "t": rounded(record.t_s),
            "stage": format!("{:?}", record.stage).to_lowercase(),
            "active": class(record.active),
            "transition": transition,
            "clips": record.clips.iter().map(|w| rounded(*w)).collect::<Vec<_>>(),
            "layers": by_name(&self.layers, record.layers.iter().copied()),
            "root": {
                "x": rounded(record.root.x_m), "y": rounded(record.root.y_m),
                "yaw_rad": rounded(record.root.yaw_rad),
            },
            "held_back": record.held_back,
            "pose_age_s": record.pose_age_s.map(rounded),
            "poses_lost": record.poses_lost,
        })
    }

    fn bus(&self, record: &CycleRecord) -> Value {
        let bus = &record.bus;
        let mut joints = Map::new();
        for (mask, what) in [
            (bus.silent_mask, "silent"),
            (bus.alert_mask, "hardware error"),
            (bus.torqueless_mask, "without torque"),
            (bus.ramping_mask, "ramping"),
        ] {
            for (index, name) in self.joints.iter().enumerate().take(64) {
                if mask >> index & 1 == 1 {
                    joints.insert(name.clone(), what.into());
                }
            }
        }
        let mut message = json!({
            "t": rounded(record.t_s),
            "fresh": bus.fresh, "silent": bus.silent, "damaged": bus.damaged, "bytes": bus.bytes,
            "cycle_us": bus.cycle_us, "goal_sent_us": bus.goal_sent_us,
            "late_us": record.late_us, "overruns": record.overruns, "missed": record.missed,
            "joints": joints,
        });
        let health = || self.joints.iter().zip(&record.health);
        let known: Map<_, _> = health()
            .filter_map(|(name, h)| Some((name.clone(), rounded(h.temperature_c?))))
            .collect();
        if !known.is_empty() {
            message["temperature_c"] = known.into();
        }
        let known: Map<_, _> = health()
            .filter_map(|(name, h)| Some((name.clone(), rounded(h.voltage_v?))))
            .collect();
        if !known.is_empty() {
            message["voltage_v"] = known.into();
        }
        let known: Map<_, _> = health()
            .filter(|(_, h)| h.hardware_error != 0)
            .map(|(name, h)| (name.clone(), h.hardware_error.into()))
            .collect();
        if !known.is_empty() {
            message["hardware_error"] = known.into();
        }
        message
    }
}
