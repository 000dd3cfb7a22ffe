//! Which clips belong in one class: pairwise warp cost after alignment, grouping, refusal of strangers.
//!
//! Between unrelated clips there is no safe in-between (Casas 2013, 3.2.1). The thresholds were set on
//! recorded motion: walk, jog and run of one person, trot and pace of one dog (each leg aligned on its
//! own) cost at most 0.24; jumps, spins and turns against them at least 0.40; the project's walks and trots
//! among themselves 0.02. `tests/class_building.rs` holds these figures.

mod parameters;

pub use parameters::{Suggested, suggest_parameters};

use super::warp::{Alignment, FeatureClip, PairMatch, WarpError, align, match_pair};
use std::fmt;

/// From this normalised warp cost on two clips are unrelated.
pub const UNRELATED_FROM: f64 = 0.33;
/// Mean poses this many times the movement's size apart are unrelated: one lies, the other stands.
pub const APART_FROM: f64 = 4.0;

/// How two clips fit, for reading.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct PairFigures {
    /// Name of the first clip.
    pub a: String,
    /// Name of the second clip.
    pub b: String,
    /// Normalised warp cost, limbs aligned on their own where clips have limbs: 0 the same movement,
    /// near 1 unrelated; `None` if one of the two does not move or they are of different kinds.
    pub cost: Option<f64>,
    /// Cost of one warp for the whole body, see [`PairMatch::shape`].
    pub whole_cost: Option<f64>,
    /// Distance of the mean poses over the size of the movements; `None` for different kinds.
    pub place: Option<f64>,
    /// Whether they may be in one class.
    pub related: bool,
}

impl fmt::Display for PairFigures {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} and {}: ", self.a, self.b)?;
        match (self.cost, self.place) {
            (_, None) => write!(f, "one is a cycle, the other a path"),
            (None, Some(place)) => write!(
                f,
                "one stands still, mean poses {place:.2} movements apart (allowed below {APART_FROM})"
            ),
            (Some(cost), Some(place)) => write!(
                f,
                "warp cost {cost:.2} (allowed below {UNRELATED_FROM}), mean poses {place:.2} movements apart (below {APART_FROM})"
            ),
        }
    }
}

/// Clips grouped into classes.
#[derive(Clone, Debug, PartialEq)]
pub struct Grouping {
    /// Clips of each class, by index; a class's first clip is the first one given.
    pub groups: Vec<Vec<usize>>,
    /// Every pair of clips once.
    pub pairs: Vec<PairFigures>,
}

/// What [`check_class`] measured on a class that holds together.
#[derive(Clone, Debug, PartialEq)]
pub struct ClassReport {
    /// Every pair of clips once.
    pub pairs: Vec<PairFigures>,
    /// The largest cost among the pairs that hold the class together.
    pub worst: f64,
}

/// Why clips do not make a class.
#[derive(Clone, Debug, thiserror::Error, PartialEq)]
pub enum ClassMismatch {
    /// Clips that cannot be compared.
    #[error(transparent)]
    Warp(#[from] WarpError),
    /// Clips that do not belong together.
    #[error(
        "these clips do not make one class; they fall into {}. {}Give each group a class of its own and join them by a transition{}",
        listed(.groups),
        .nearest.as_ref().map(|n| format!("Nearest across: {n}. ")).unwrap_or_default(),
        if *.has_limbs { "" } else { "; if they are gaits with legs out of step, name the limbs in the clips' \"segments\", so that each is aligned on its own" }
    )]
    Unrelated {
        /// Names of the clips of each group.
        groups: Vec<Vec<String>>,
        /// The pair from different groups that fits best.
        nearest: Option<Box<PairFigures>>,
        /// Whether the clips have limbs.
        has_limbs: bool,
    },
}

fn listed(groups: &[Vec<String>]) -> String {
    let named: Vec<String> = groups
        .iter()
        .map(|g| format!("({})", g.join(", ")))
        .collect();
    named.join(" and ")
}

/// Figures of one pair. Clips of different kinds are unrelated, not an error.
pub fn compare(a: &FeatureClip, b: &FeatureClip) -> Result<PairFigures, WarpError> {
    let mut figures = PairFigures {
        a: a.name.clone(),
        b: b.name.clone(),
        cost: None,
        whole_cost: None,
        place: None,
        related: false,
    };
    if a.cyclic != b.cyclic {
        return Ok(figures);
    }
    let found: PairMatch = match_pair(a, b)?;
    figures.place = Some(found.place);
    if !found.still {
        figures.cost = Some(found.by_limb);
        figures.whole_cost = Some(found.shape);
    }
    let cost = figures.cost.unwrap_or(0.0);
    figures.related = cost < UNRELATED_FROM && found.place < APART_FROM;
    Ok(figures)
}

/// Groups clips into classes: those that move by single linkage over related pairs; one that stands
/// still (a rest pose) joins the group with the nearest mean pose.
pub fn group(clips: &[FeatureClip]) -> Result<Grouping, WarpError> {
    if clips.is_empty() {
        return Err(WarpError::Empty);
    }
    let n = clips.len();
    let mut pairs = Vec::new();
    let mut label: Vec<usize> = (0..n).collect();
    // Still clip, moving clip or other still clip, place.
    let mut rests: Vec<(usize, usize, f64)> = Vec::new();
    for a in 0..n {
        for b in a + 1..n {
            let figures = compare(&clips[a], &clips[b])?;
            if figures.related && figures.cost.is_some() {
                join(&mut label, a, b);
            } else if figures.related {
                let (rest, other) = if clips[a].spread() < clips[b].spread() {
                    (a, b)
                } else {
                    (b, a)
                };
                rests.push((rest, other, figures.place.unwrap_or(f64::INFINITY)));
            }
            pairs.push(figures);
        }
    }
    rests.sort_by(|x, y| x.2.total_cmp(&y.2));
    let mut joined = vec![false; n];
    for (rest, other, _) in rests {
        if !joined[rest] {
            joined[rest] = true;
            join(&mut label, rest, other);
        }
    }
    let mut groups: Vec<Vec<usize>> = Vec::new();
    let mut seen: Vec<usize> = Vec::new();
    for (clip, of) in label.iter().enumerate() {
        match seen.iter().position(|s| s == of) {
            Some(at) => groups[at].push(clip),
            None => {
                seen.push(*of);
                groups.push(vec![clip]);
            }
        }
    }
    Ok(Grouping { groups, pairs })
}

fn join(label: &mut [usize], a: usize, b: usize) {
    let (keep, give) = (label[a].min(label[b]), label[a].max(label[b]));
    label
        .iter_mut()
        .filter(|l| **l == give)
        .for_each(|l| *l = keep);
}

/// Whether `clips` make one class: all of them in one group of [`group`].
pub fn check_class(clips: &[FeatureClip]) -> Result<ClassReport, ClassMismatch> {
    let Grouping { groups, pairs } = group(clips)?;
    if groups.len() == 1 {
        let related = pairs.iter().filter(|p| p.related);
        let worst = related.filter_map(|p| p.cost).fold(0.0, f64::max);
        return Ok(ClassReport { pairs, worst });
    }
    let group_of = |name: &str| {
        groups
            .iter()
            .position(|g| g.iter().any(|c| clips[*c].name == name))
    };
    let across = pairs.iter().filter(|p| group_of(&p.a) != group_of(&p.b));
    let gap = |p: &PairFigures| {
        let cost = p.cost.map_or(0.0, |c| c / UNRELATED_FROM);
        p.place
            .map_or(f64::INFINITY, |place| cost.max(place / APART_FROM))
    };
    // Clips with one name look like one group; then any pair will do.
    let nearest = across
        .min_by(|x, y| gap(x).total_cmp(&gap(y)))
        .or(pairs.first())
        .cloned();
    Err(ClassMismatch::Unrelated {
        groups: groups
            .iter()
            .map(|g| g.iter().map(|c| clips[*c].name.clone()).collect())
            .collect(),
        nearest: nearest.map(Box::new),
        has_limbs: clips.iter().any(|c| !c.limbs.is_empty()),
    })
}

/// One class that [`suggest`] proposes.
#[derive(Clone, Debug, PartialEq)]
pub struct SuggestedClass {
    /// Indices of the clips.
    pub clips: Vec<usize>,
    /// How they align; one entry per clip of [`Self::clips`].
    pub alignment: Alignment,
}

/// Groups clips and aligns each group.
pub fn suggest(
    clips: &[FeatureClip],
) -> Result<(Vec<SuggestedClass>, Vec<PairFigures>), WarpError> {
    let Grouping { groups, pairs } = group(clips)?;
    let classes = groups
        .into_iter()
        .map(|members| {
            let own: Vec<FeatureClip> = members.iter().map(|c| clips[*c].clone()).collect();
            Ok(SuggestedClass {
                alignment: align(&own)?,
                clips: members,
            })
        })
        .collect::<Result<_, WarpError>>()?;
    Ok((classes, pairs))
}
