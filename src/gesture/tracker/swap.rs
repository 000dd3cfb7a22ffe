//! Trackers take the left hand for the right one: noticed when it happens, and undone.

use super::outlier::OutlierFilter;

/// Exchanging the sides must fit the past this many times better than leaving them.
const BETTER: f64 = 4.0;
/// Sides that have been exchanged for this long are what the tracker means, seconds.
const BELIEVED_S: f64 = 2.0;

/// Undoes exchanged sides in sets whose point names come in pairs of left and right.
///
/// A sample in which both sides of all pairs fit their own past better after an exchange, and do not
/// fit it as they are, is exchanged; so are the samples after it until they fit better as they come.
/// Hands that cross pass close by one another, each on its own way: nothing is surprising then, and
/// nothing is exchanged. When poses were missing for a while the tracker is believed.
#[derive(Clone, Debug)]
pub(in crate::gesture) struct SideSwaps {
    pairs: Vec<(usize, usize)>,
    /// Since when the tracker has the sides exchanged.
    exchanged_since: Option<f64>,
    undone: u64,
}

impl SideSwaps {
    /// Finds the pairs among `names`.
    pub fn new(names: &[String]) -> Self {
        let mut pairs = Vec::new();
        for (left, name) in names.iter().enumerate() {
            let other = mirrored(name);
            if let Some(right) = other.and_then(|other| names.iter().position(|n| *n == other)) {
                pairs.push((left, right));
            }
        }
        Self {
            pairs,
            exchanged_since: None,
            undone: 0,
        }
    }

    /// Puts exchanged sides back, in `places`, `seen` and `weights` alike. Allocates nothing.
    pub fn pass(
        &mut self,
        t: f64,
        filter: &mut OutlierFilter,
        places: &mut [[f64; 3]],
        seen: &mut [bool],
        weights: &mut [f64],
    ) {
        if self.pairs.is_empty() {
            return;
        }
        let (tracks, allowance) = filter.tracks();
        // Distance from what was expected, and what is within reason, as it comes and exchanged.
        let (mut off, mut allowed) = ([0.0; 2], [0.0; 2]);
        let mut judged = false;
        for (left, right) in &self.pairs {
            for (point, place) in [(*left, *right), (*right, *left)] {
                if !seen[point] {
                    continue;
                }
                let as_it_comes = tracks[point].judge(t, places[point], allowance);
                let exchanged = tracks[place].judge(t, places[point], allowance);
                if as_it_comes.allowed_m.is_finite() && exchanged.allowed_m.is_finite() {
                    judged = true;
                    off[0] += as_it_comes.off_m;
                    off[1] += exchanged.off_m;
                    allowed[0] += as_it_comes.allowed_m;
                    allowed[1] += exchanged.allowed_m;
                }
            }
        }
        let now = usize::from(self.exchanged_since.is_some());
        let other = 1 - now;
        if !judged {
            self.exchanged_since = None;
        } else if off[now] > allowed[now]
            && off[other] <= allowed[other]
            && BETTER * off[other] < off[now]
        {
            self.exchanged_since = if now == 0 { Some(t) } else { None };
        } else if self.exchanged_since.is_some_and(|t0| t - t0 > BELIEVED_S) {
            for (left, right) in &self.pairs {
                tracks.swap(*left, *right);
            }
            self.exchanged_since = None;
        }
        if self.exchanged_since.is_some() {
            self.undone += 1;
            for (left, right) in &self.pairs {
                places.swap(*left, *right);
                seen.swap(*left, *right);
                weights.swap(*left, *right);
            }
        }
    }

    /// Samples in which sides were exchanged back since the last reset.
    pub fn undone(&self) -> u64 {
        self.undone
    }

    /// Forgets all samples.
    pub fn reset(&mut self) {
        self.exchanged_since = None;
        self.undone = 0;
    }
}

/// The name of the point on the right when `name` is one on the left.
fn mirrored(name: &str) -> Option<String> {
    for (left, right) in [("left", "right"), ("Left", "Right"), ("LEFT", "RIGHT")] {
        if name.contains(left) {
            return Some(name.replacen(left, right, 1));
        }
    }
    // A lone `l` between separators or at an end: `hand_l`, `L.wrist`, `arm-L`.
    let separator = |c: char| !c.is_alphanumeric();
    let bytes = name.as_bytes();
    let alone = |at: usize| {
        let before = name[..at].chars().next_back();
        let after = name[at + 1..].chars().next();
        before.is_none_or(separator) && after.is_none_or(separator) && bytes.len() > 1
    };
    let (at, letter) = (name.char_indices()).find(|(at, c)| "lL".contains(*c) && alone(*at))?;
    let right = if letter == 'l' { "r" } else { "R" };
    Some(format!("{}{right}{}", &name[..at], &name[at + 1..]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pairs_are_found_by_any_way_of_naming_sides() {
        for (left, right) in [
            ("left_hand", "right_hand"),
            ("HandLeft", "HandRight"),
            ("wrist_L", "wrist_R"),
            ("hand.l", "hand.r"),
            ("L_knee", "R_knee"),
            ("l.left_toe", "l.right_toe"),
        ] {
            let names = [right, "palm", left, "l", "lip", "leftover"].map(String::from);
            assert_eq!(SideSwaps::new(&names).pairs, [(2, 0)], "{left}, {right}");
        }
        let alone = ["left_hand", "palm", "lip_lower"].map(String::from);
        assert!(SideSwaps::new(&alone).pairs.is_empty());
    }
}
