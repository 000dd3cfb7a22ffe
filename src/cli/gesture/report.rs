//! How good a definition is, and who answers to whom: the same words and rows for `define` and `check`.

use crate::cli::say;
use crate::gesture::{
    Confusion, Definition, FrontEndOptions, Gesture, GestureKind, GestureSet, Response, Verdict,
    confusion_of, responses, sizes_m,
};
use crate::pose::global::size_of;
use serde_json::{Value, json};

/// Plane answers above this are named.
pub(super) const CONFUSABLE: f64 = 0.2;

/// What is known about a fresh definition.
pub(super) struct Quality {
    gesture: Gesture,
    periodicity: Option<f64>,
    closure: f64,
    moved_m: f64,
    body_m: f64,
    /// Other gestures with the larger of the two planes' answers to each other's frames.
    planes: Vec<(String, f64)>,
    verdict: Option<Verdict>,
}

impl Quality {
    /// Of `definition`, which is part of `set`.
    pub fn of(set: &GestureSet, definition: &Definition) -> Result<Self, String> {
        let name = &definition.gesture.name;
        let anchor = |anchor| format!("global.anchor {anchor:?} is none of the points");
        let index = set
            .index_of(name)
            .ok_or_else(|| format!("no gesture `{name}`"))?;
        let moved = sizes_m(set).map_err(anchor)?;
        let table = responses(set).map_err(anchor)?;
        let answer = |gesture: usize, shown: usize| {
            let found = table.iter();
            found
                .filter(|r| r.gesture == gesture && r.shown == shown)
                .map(|r| r.largest)
                .fold(0.0, f64::max)
        };
        let others = set.gestures.iter().enumerate();
        let planes = others
            .filter(|(other, _)| *other != index)
            .map(|(o, g)| (g.name.clone(), answer(index, o).max(answer(o, index))))
            .collect();
        let played =
            confusion_of(set, FrontEndOptions::default(), index).map_err(|e| e.to_string())?;
        Ok(Self {
            periodicity: definition.periodicity,
            closure: definition.closure,
            moved_m: moved[index],
            body_m: definition
                .gesture
                .frames
                .first()
                .map_or(0.0, |f| size_of(f)),
            planes,
            verdict: played.verdicts().into_iter().nth(index),
            gesture: definition.gesture.clone(),
        })
    }

    /// Whether it can start anything at all.
    pub fn works(&self) -> bool {
        self.verdict.as_ref().is_some_and(|v| v.works)
    }

    /// Prints the report.
    pub fn say(&self, json: bool) {
        let gesture = &self.gesture;
        let share = self.moved_m / self.body_m.max(1e-9);
        let planes = |(name, answer): &(String, f64)| format!("`{name}` {answer:.2}");
        if json {
            let verdict = self.verdict.as_ref();
            let planes = self.planes.iter();
            let object = json!({
                "gesture": gesture.name, "kind": gesture.kind.name(),
                "duration_s": gesture.duration_s, "frames": gesture.frames.len(),
                "periodicity": self.periodicity, "closure": self.closure,
                "moved_m": self.moved_m, "moved_share": share,
                "planes": planes.map(|(n, a)| json!({"gesture": n, "largest": a})).collect::<Vec<_>>(),
                "reads_itself": verdict.map(|v| v.own), "works": self.works(),
                "verdict": verdict.map(|v| v.words.as_str()),
            });
            say(format_args!("{object}"));
            return;
        }
        describe(gesture, self.periodicity, self.closure);
        say(format_args!(
            "  size         {:.1} mm per point, {:.0} % of the body{}",
            1e3 * self.moved_m,
            1e2 * share,
            if share < 0.05 {
                ": small, the tracker's noise will show; make it larger"
            } else {
                ""
            }
        ));
        if let Some(periodicity) = self.periodicity.filter(|p| *p < 0.8) {
            say(format_args!(
                "  regularity   {periodicity:.2}: uneven; a steadier example reads better"
            ));
        }
        if gesture.kind == GestureKind::Cyclic && self.closure > 0.5 {
            say(format_args!(
                "  closure      {:.2}: the end is not where the start was; show steady periods",
                self.closure
            ));
        }
        if !self.planes.is_empty() {
            let list: Vec<String> = self.planes.iter().map(planes).collect();
            say(format_args!("  planes       answer to {}", list.join(", ")));
        }
        if let Some(verdict) = &self.verdict {
            say(format_args!("  by playing   {}", verdict.words));
        }
    }
}

/// Length and regularity of a definition, on a line.
pub(super) fn describe(gesture: &Gesture, periodicity: Option<f64>, closure: f64) {
    match gesture.kind {
        GestureKind::Cyclic => {
            let repeats = periodicity
                .map_or_else(String::new, |value| format!(", autocorrelation {value:.2}"));
            say(format_args!(
                "`{}`: one period of {:.3} s ({:.2} Hz), {} frames, closes within {closure:.2} of its size{repeats}",
                gesture.name,
                gesture.duration_s,
                1.0 / gesture.duration_s,
                gesture.frames.len(),
            ));
        }
        GestureKind::NonCyclic => say(format_args!(
            "`{}`: rest to extreme in {:.3} s, {} frames",
            gesture.name,
            gesture.duration_s,
            gesture.frames.len()
        )),
    }
}

/// Prints what every plane answers to every gesture's frames.
pub(super) fn say_planes(set: &GestureSet, table: &[Response], json: bool) {
    if !json {
        say(format_args!(
            "Planes: what each answers to the frames of each gesture\n{:<16} {:<16} {:>7} {:>8}  ",
            "plane of", "shown", "mean", "largest"
        ));
    }
    for response in table {
        let plane = &set.gestures[response.gesture].name;
        let shown = &set.gestures[response.shown].name;
        let confusable = response.gesture != response.shown && response.largest > CONFUSABLE;
        if json {
            let object = json!({
                "table": "planes", "gesture": plane, "shown": shown, "mean": response.mean,
                "largest": response.largest, "confusable": confusable,
            });
            say(format_args!("{object}"));
        } else {
            say(format_args!(
                "{plane:<16} {shown:<16} {:>7.3} {:>8.3}  {}",
                response.mean,
                response.largest,
                if confusable { "may be confused" } else { "" }
            ));
        }
    }
}

/// Prints the confusion matrix and the verdicts.
pub(super) fn say_confusion(set: &GestureSet, played: &Confusion, json: bool) {
    let name = |gesture: usize| set.gestures[gesture].name.as_str();
    if json {
        for r in &played.readings {
            let row: Value = json!({
                "table": "played", "performed": name(r.performed), "speed": r.speed, "size": r.size,
                "gesture": name(r.read), "mean": r.mean, "largest": r.largest,
                "confusable": r.performed != r.read && r.largest > CONFUSABLE,
            });
            say(format_args!("{row}"));
        }
    } else {
        let columns: Vec<String> = set
            .gestures
            .iter()
            .map(|g| format!("{:>12.12}", g.name))
            .collect();
        say(format_args!(
            "\nPlayed: the largest amplitude that each gesture (columns) reads while one (rows) is performed\n{:<16} {:>5} {:>5} {}",
            "performed",
            "speed",
            "size",
            columns.join(" ")
        ));
        for row in played.readings.chunks(set.gestures.len().max(1)) {
            let cells: Vec<String> = row.iter().map(|r| format!("{:>12.2}", r.largest)).collect();
            say(format_args!(
                "{:<16} {:>5} {:>5} {}",
                name(row[0].performed),
                row[0].speed,
                row[0].size,
                cells.join(" ")
            ));
        }
        say(format_args!(""));
    }
    for verdict in played.verdicts() {
        if json {
            let row = json!({
                "table": "verdict", "gesture": name(verdict.gesture), "reads_itself": verdict.own,
                "reads_itself_least": verdict.least_own, "works": verdict.works,
                "confused": verdict.confused.iter().map(|(other, there, back)| json!({
                    "gesture": name(*other), "it_reads": there, "this_reads": back,
                })).collect::<Vec<_>>(),
                "verdict": verdict.words,
            });
            say(format_args!("{row}"));
        } else {
            say(format_args!("{}", verdict.words));
        }
    }
}
