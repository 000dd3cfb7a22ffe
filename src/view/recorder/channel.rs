//! The channels of a recording that people look at, with the JSON Schema of each.

/// A JSON channel.
#[derive(Copy, Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Channel {
    /// Pose samples as they were used, in the form of a pose stream; times since cycle 0.
    Poses,
    /// Amplitude, frequency and phase per gesture.
    Gestures,
    /// Stage, class being played, transition, layers, root.
    Graph,
    /// Joint targets after the envelope.
    Target,
    /// Measured joint states.
    State,
    /// What the bus saw; health of the servos.
    Bus,
    /// Every read and write of a port, decoded.
    Frames,
}

impl Channel {
    /// All, in the order of their numbers in a file.
    pub const ALL: [Channel; 7] = [
        Channel::Poses,
        Channel::Gestures,
        Channel::Graph,
        Channel::Target,
        Channel::State,
        Channel::Bus,
        Channel::Frames,
    ];

    /// Its topic.
    pub fn topic(self) -> &'static str {
        match self {
            Channel::Poses => "/poses",
            Channel::Gestures => "/gestures",
            Channel::Graph => "/graph",
            Channel::Target => "/joints/target",
            Channel::State => "/joints/state",
            Channel::Bus => "/bus",
            Channel::Frames => "/bus/frames",
        }
    }

    /// Name of its schema, and the schema.
    pub fn schema(self) -> (&'static str, &'static str) {
        match self {
            Channel::Poses => (
                "handwave.Pose",
                r#"{"type":"object","description":"a sample of a pose stream; m, y up","properties":{"t":{"type":"number","description":"s since cycle 0"},"p":{"type":"array","items":{"type":["array","null"],"items":{"type":"number"}}},"c":{"type":"array","items":{"type":"number"}},"ch":{"type":"object"}}}"#,
            ),
            Channel::Gestures => (
                "handwave.Gestures",
                r#"{"type":"object","properties":{"t":{"type":"number"},"gestures":{"type":"object","additionalProperties":{"type":"object","properties":{"amplitude":{"type":"number"},"frequency_hz":{"type":"number"},"phase_rad":{"type":"number"},"quality":{"type":"number"}}}}}}"#,
            ),
            Channel::Graph => (
                "handwave.Graph",
                r#"{"type":"object","properties":{"t":{"type":"number"},"stage":{"type":"string"},"active":{"type":"string"},"transition":{"type":["object","null"],"properties":{"from":{"type":"string"},"to":{"type":"string"},"weight":{"type":"number"}}},"clips":{"type":"array","items":{"type":"number"}},"layers":{"type":"object","additionalProperties":{"type":"number"}},"root":{"type":"object","properties":{"x":{"type":"number"},"y":{"type":"number"},"yaw_rad":{"type":"number"}}},"held_back":{"type":"integer"},"pose_age_s":{"type":["number","null"]},"poses_lost":{"type":"boolean"}}}"#,
            ),
            Channel::Target => (
                "handwave.Targets",
                r#"{"type":"object","description":"rad (m for prismatic joints)","properties":{"t":{"type":"number"},"position":{"type":"object","additionalProperties":{"type":"number"}}}}"#,
            ),
            Channel::State => (
                "handwave.States",
                r#"{"type":"object","description":"rad, rad/s, share of the largest load","properties":{"t":{"type":"number"},"position":{"type":"object","additionalProperties":{"type":"number"}},"velocity":{"type":"object","additionalProperties":{"type":"number"}},"effort":{"type":"object","additionalProperties":{"type":"number"}}}}"#,
            ),
            Channel::Bus => (
                "handwave.Bus",
                r#"{"type":"object","properties":{"t":{"type":"number"},"fresh":{"type":"integer"},"silent":{"type":"integer"},"damaged":{"type":"integer"},"bytes":{"type":"integer"},"cycle_us":{"type":"integer"},"goal_sent_us":{"type":"integer"},"late_us":{"type":"integer"},"overruns":{"type":"integer"},"missed":{"type":"integer"},"joints":{"type":"object","description":"what is wrong, by joint","additionalProperties":{"type":"string"}},"temperature_c":{"type":"object","additionalProperties":{"type":"number"}},"voltage_v":{"type":"object","additionalProperties":{"type":"number"}},"hardware_error":{"type":"object","additionalProperties":{"type":"integer"}}}}"#,
            ),
            Channel::Frames => (
                "handwave.Frame",
                r#"{"type":"object","properties":{"bus":{"type":"string"},"dir":{"enum":["tx","rx"]},"what":{"type":"string","description":"instructions and statuses in it"},"hex":{"type":"string"}}}"#,
            ),
        }
    }

    /// Those chosen by `[record] channels`; all when nothing is chosen.
    pub fn chosen(names: Option<&[String]>) -> Vec<Channel> {
        let all = Channel::ALL.into_iter();
        all.filter(|c| names.is_none_or(|names| names.iter().any(|n| c.is_chosen_by(n))))
            .collect()
    }

    /// Whether the choice `name` stands for it.
    pub fn is_chosen_by(self, name: &str) -> bool {
        let own = match self {
            Channel::Poses => "poses",
            Channel::Gestures => "gestures",
            Channel::Graph => "graph",
            Channel::Target | Channel::State => "joints",
            Channel::Bus => "bus",
            Channel::Frames => "frames",
        };
        own == name
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn schemas_are_json_and_every_choice_is_some_channel() {
        for channel in Channel::ALL {
            let (name, schema) = channel.schema();
            let parsed: serde_json::Value =
                serde_json::from_str(schema).unwrap_or_else(|e| panic!("{name}: {e}"));
            assert_eq!(parsed["type"], "object", "{name}");
        }
        let some = ["joints".to_owned()];
        assert_eq!(
            Channel::chosen(Some(&some)),
            [Channel::Target, Channel::State]
        );
        assert_eq!(Channel::chosen(None), Channel::ALL);
    }
}
