//! The recipe of the bundled performance: what is performed when.

use serde::Deserialize;

#[derive(Debug, Deserialize)]
struct Recipe {
    segment: Vec<Entry>,
}

#[derive(Debug, Deserialize)]
struct Entry {
    kind: String,
    source: String,
    from: f64,
    to: Option<f64>,
    #[serde(default = "one")]
    speed: f64,
    #[serde(default)]
    join_s: f64,
    duration_s: Option<f64>,
}

fn one() -> f64 {
    1.0
}

/// A stretch of the performance, on the clock of the pose stream.
#[derive(Clone, Debug)]
pub struct Segment {
    pub kind: String,
    pub source: String,
    pub from_s: f64,
    pub to_s: f64,
    /// Until here it is blended with the segment before it.
    pub joined_s: f64,
    /// Of a loop: its tempo.
    pub frequency_hz: f64,
}

/// Segments of the bundled performance, from its recipe.
pub fn segments() -> Vec<Segment> {
    let path = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/configs/performances/drum_and_splay.toml"
    );
    let text = std::fs::read_to_string(path).expect("the recipe");
    let recipe: Recipe = toml::from_str(&text).expect("a recipe");
    let mut at_s = 0.0;
    recipe
        .segment
        .into_iter()
        .map(|entry| {
            let way = entry.to.map_or(0.0, |to| (to - entry.from).abs());
            let duration_s = entry.duration_s.unwrap_or(way / entry.speed);
            let from_s = at_s;
            at_s += duration_s;
            Segment {
                from_s,
                to_s: at_s,
                joined_s: from_s + entry.join_s,
                frequency_hz: if entry.kind == "loop" {
                    entry.speed / way
                } else {
                    0.0
                },
                kind: entry.kind,
                source: entry.source,
            }
        })
        .collect()
}

/// The stretches in which fingers drum.
pub fn drumming() -> Vec<Segment> {
    let all = segments().into_iter();
    all.filter(|s| s.kind == "loop").collect()
}
