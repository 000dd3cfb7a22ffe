//! A map as the text of its file.

use super::file::{MapFile, VERSION, VolumeSource};

impl MapFile {
    /// The file's text, the same bytes for the same map. Lengths to 0.1 mm, angles to a micro-radian.
    pub fn to_toml(&self) -> String {
        let mut lines: Vec<String> = Vec::new();
        let quoted = |name: &str| toml::Value::from(name).to_string();
        let names = |names: &[String]| {
            let all: Vec<String> = names.iter().map(|n| quoted(n)).collect();
            format!("[{}]", all.join(", "))
        };
        let row = |t: Option<f64>, places: &[[f64; 3]]| {
            let cells = places.iter().flat_map(|p| &p[..self.header.dim]);
            let cells = cells.map(|v| decimal(*v, 4));
            let all: Vec<String> = t.map(|t| decimal(t, 4)).into_iter().chain(cells).collect();
            format!("[{}]", all.join(", "))
        };
        let list = |numbers: &[f64]| {
            let all: Vec<String> = numbers.iter().map(|v| decimal(*v, 9)).collect();
            format!("[{}]", all.join(", "))
        };
        lines.push(
            "# A pose map, written by `handwave map learn`. Metres, radians, seconds.".into(),
        );
        lines.push("handwave = \"map\"".into());
        lines.push(format!("version = {VERSION}"));
        lines.push("\n[source]".into());
        lines.push(format!("points = {}", names(&self.header.points)));
        lines.push(format!("dim = {}", self.header.dim));
        lines.push(format!("reference = {}", row(None, &self.reference)));
        lines.push(format!("mean = {}", row(None, &self.mean)));
        lines.push(format!("spread_m = {}", decimal(self.spread_m, 6)));
        let mut global = Vec::new();
        if let Some(anchor) = &self.global.anchor {
            global.push(format!("anchor = {}", quoted(anchor)));
        }
        for (key, value) in [("yaw", self.global.yaw), ("height", self.global.height)] {
            if let Some(value) = value {
                global.push(format!("{key} = {value}"));
            }
        }
        if !global.is_empty() {
            lines.push(format!("global = {{ {} }}", global.join(", ")));
        }
        lines.push(format!("recording = {}", quoted(&self.recording)));
        lines.push("\n[options]".into());
        for (key, value) in [
            ("velocity_weight_s", self.velocity_weight_s),
            ("smoothing_s", self.smoothing_s),
            ("noise_variance", self.noise_variance),
        ] {
            lines.push(format!("{key} = {}", decimal(value, 6)));
        }
        lines.push(format!("components = {}", self.components));
        lines.push(format!("yaw_ratio = {}", decimal(self.yaw_ratio, 6)));
        lines.push("\n[target]".into());
        lines.push(format!("joints = {}", names(&self.joints)));
        match &self.volume {
            VolumeSource::Clips(clips) => lines.push(format!("clips = {}", names(clips))),
            VolumeSource::Volume(volume, root) => {
                lines.push("\n[volume]".into());
                lines.push(format!("mean = {}", list(&volume.mean)));
                lines.push("axes = [".into());
                for axis in volume.axes.chunks_exact(self.joints.len()) {
                    lines.push(format!("  {},", list(axis)));
                }
                lines.push("]".into());
                lines.push(format!("low = {}", list(&volume.low)));
                lines.push(format!("high = {}", list(&volume.high)));
                lines.push(format!("kept = {}", decimal(volume.kept, 6)));
                let rows: Vec<String> = root
                    .chunks_exact(volume.dimensions().max(1))
                    .map(list)
                    .collect();
                if !rows.is_empty() {
                    lines.push(format!("root = [{}]", rows.join(", ")));
                }
            }
        }
        for pair in &self.pairs {
            lines.push("\n[[pair]]".into());
            lines.push(format!("name = {}", quoted(&pair.name)));
            let joints: Vec<String> = self
                .joints
                .iter()
                .zip(&pair.pose)
                .map(|(name, q)| format!("{} = {}", quoted(name), decimal(*q, 6)))
                .collect();
            lines.push(format!("pose = {{ {} }}", joints.join(", ")));
            lines.push("frames = [".into());
            for (t, frame) in pair.times_s.iter().zip(&pair.frames) {
                lines.push(format!("  {},", row(Some(*t), frame)));
            }
            lines.push("]".into());
        }
        lines.push(String::new());
        lines.join("\n")
    }
}

/// `value` with at most `decimals` decimals and at least one, as TOML wants its floats.
fn decimal(value: f64, decimals: usize) -> String {
    let mut text = format!("{value:.decimals$}");
    while text.ends_with('0') && !text.ends_with(".0") {
        text.pop();
    }
    if text == "-0.0" { "0.0".into() } else { text }
}

#[cfg(test)]
mod tests {
    use super::super::file::MapFileError;
    use super::*;

    const ARM: &str = include_str!("../../../configs/maps/arm.toml");

    #[test]
    fn what_is_written_reads_back_the_same() {
        let map = MapFile::from_toml(ARM).expect("the shipped map");
        assert_eq!(map.to_toml(), ARM);
        let again = MapFile::from_toml(&map.to_toml()).expect("its own text");
        assert_eq!(again, map);
        let mut linked = map.clone();
        linked.volume = VolumeSource::Clips(vec!["../clips/a.json".into()]);
        let again = MapFile::from_toml(&linked.to_toml()).expect("its own text");
        assert_eq!(again, linked);
    }

    #[test]
    fn the_example_of_the_documentation_is_a_map() {
        let example: String = include_str!("file.rs")
            .lines()
            .skip_while(|line| *line != "//! ```toml")
            .skip(1)
            .take_while(|line| *line != "//! ```")
            .map(|line| line.trim_start_matches("//!").to_owned() + "\n")
            .collect();
        // It shows both ways to say what poses are admissible; a map has one.
        let error = MapFile::from_toml(&example).expect_err("both ways");
        assert!(error.to_string().contains("found both"), "{error}");
        let one = example.replacen("clips = ", "# clips = ", 1);
        let map = MapFile::from_toml(&one).expect("the example");
        assert_eq!(map.pairs.len(), 1);
        assert_eq!(map.velocity_weight_s, 0.1);
    }

    #[test]
    fn values_that_are_not_allowed_are_named() {
        for (from, to, key) in [
            ("handwave = \"map\"", "handwave = \"gestures\"", "handwave"),
            ("dim = 3", "dim = 4", "source.dim"),
            ("reference = [", "reference = [1.0, ", "source.reference"),
            ("spread_m = 0.", "spread_m = -0.", "source.spread_m"),
            (
                "noise_variance = 0.05",
                "noise_variance = 0.0",
                "options.noise_variance",
            ),
            ("components = 50", "components = 0", "options.components"),
            ("low = [-", "low = [", "volume.low"),
            ("axes = [\n  [", "axes = [\n  [0.5, ", "volume.axes row 1"),
            ("frames = [\n  [0.0", "frames = [\n  [5.0", "frames row 2"),
            ("\"joint1\" = ", "\"joint9\" = ", "pair 1"),
        ] {
            assert!(ARM.contains(from), "{from:?}");
            match MapFile::from_toml(&ARM.replacen(from, to, 1)) {
                Err(MapFileError::Value { key: found, .. }) => {
                    assert!(
                        found.contains(key),
                        "{to:?}: blamed {found:?}, expected {key:?}"
                    );
                }
                other => panic!("{to:?} gave {other:?}"),
            }
        }
    }
}
