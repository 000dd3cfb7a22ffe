//! How classes of a configuration blend their poses: kind, tolerance, ends that keep their way.

use super::body::Body;
use super::error::{ConfigError, Pointer};
use super::file::ClassEntry;
use crate::base::suggest::hint;
use crate::body::blend::BlendingKind;
use crate::body::blend::NonLinear;
use crate::body::{Blending, Feet, PoseSpace, RobotEnds};
use crate::motion::class::{BlendSpec, MotionClass};
use crate::robot::RobotModel;
use crate::robot::ik::ChainIk;
use std::sync::Arc;

/// The blend of a class, and the line that asks for it.
#[derive(Clone, Debug, Default)]
pub(super) struct BlendParts {
    pub(super) spec: BlendSpec,
    pub(super) line: Option<usize>,
}

impl BlendParts {
    /// What they come to for the clips of `class`.
    pub(super) fn of(
        &self,
        class: &MotionClass,
        space: &dyn PoseSpace,
        file: &str,
    ) -> Result<Blending, ConfigError> {
        let blending = class.blending(space, &self.spec);
        blending.map_err(|e| ConfigError {
            file: file.into(),
            line: self.line,
            key: "class.blending".into(),
            problem: e.to_string(),
        })
    }
}

/// Distance of `hybrid` to `non_linear` when none is given, metres.
const TOLERANCE_M: f64 = 0.002;
/// As a user writes them.
const NAMES: [(&str, BlendingKind); 3] = [
    ("linear", BlendingKind::Linear),
    ("non_linear", BlendingKind::NonLinear),
    ("hybrid", BlendingKind::Hybrid),
];

/// Checks `blending`, `tolerance_m` and `ends` of a class.
pub(super) fn blend_parts(
    class: &ClassEntry,
    body: &Body,
    model: Option<&RobotModel>,
    at: &Pointer<'_>,
) -> Result<BlendParts, ConfigError> {
    let kind = match &class.blending {
        None => BlendingKind::Linear,
        Some(name) => {
            let found = NAMES.iter().find(|(n, _)| n == name.get_ref());
            let unknown = || {
                let names = NAMES.map(|(n, _)| n).join(", ");
                let problem = format!("unknown {:?}. Allowed: {names}", name.get_ref());
                at.at(name.span(), "class.blending", problem)
            };
            found.ok_or_else(unknown)?.1
        }
    };
    if let (Some(tolerance), true) = (&class.tolerance_m, kind != BlendingKind::Hybrid) {
        let problem = "tolerance_m goes with blending = \"hybrid\"";
        return Err(at.at(tolerance.span(), "class.tolerance_m", problem));
    }
    let span = class
        .blending
        .as_ref()
        .map_or(class.name.span(), |b| b.span());
    if kind == BlendingKind::Linear {
        if class.ends.is_some() {
            let problem = "ends goes with blending = \"non_linear\" or \"hybrid\"";
            return Err(at.at(span, "class.ends", problem));
        }
        return Ok(BlendParts::default());
    }
    let tolerance_m = class
        .tolerance_m
        .as_ref()
        .map_or(TOLERANCE_M, |t| *t.get_ref());
    if !(1e-4..=1.0).contains(&tolerance_m) {
        let span = class
            .tolerance_m
            .as_ref()
            .map_or(span.clone(), |t| t.span());
        let problem = format!("{tolerance_m} is not in 0.0001..1 m");
        return Err(at.at(span, "class.tolerance_m", problem));
    }
    let mean = match (&body.avatar, model) {
        (Some(avatar), _) => avatar_mean(class, &avatar.feet, at)?,
        (None, Some(_)) if body.feet.is_some() => {
            let problem = "for avatars and arms; of a robot on legs pinned feet take care, its blending is linear";
            return Err(at.at(span, "class.blending", problem));
        }
        (None, Some(model)) => arm_mean(class, model, span.clone(), at)?,
        (None, None) => NonLinear::new(),
    };
    Ok(BlendParts {
        spec: BlendSpec {
            kind,
            mean,
            tolerance_m,
        },
        line: Some(at.line_of(span.start)),
    })
}

/// Means of rotations; named limbs end where their places' mean is.
fn avatar_mean(
    class: &ClassEntry,
    limbs: &crate::body::SkeletonEnds,
    at: &Pointer<'_>,
) -> Result<NonLinear, ConfigError> {
    let Some(ends) = &class.ends else {
        return Ok(NonLinear::new());
    };
    let names = || (0..limbs.count()).map(|l| limbs.name(l));
    if let Some(strange) = ends.iter().find(|e| !names().any(|n| n == e.get_ref())) {
        let hint = hint(strange.get_ref(), names());
        let all: Vec<&str> = names().collect();
        let problem = format!(
            "no limb {:?} in avatar.limb{hint} Limbs: {}",
            strange.get_ref(),
            all.join(", ")
        );
        return Err(at.at(strange.span(), "class.ends", problem));
    }
    let wanted: Vec<&str> = ends.iter().map(|e| e.get_ref().as_str()).collect();
    Ok(NonLinear::new().with_ends(Arc::new(limbs.only(&wanted))))
}

/// Ends of an arm: those named, or the links that nothing hangs on.
fn arm_mean(
    class: &ClassEntry,
    model: &RobotModel,
    span: std::ops::Range<usize>,
    at: &Pointer<'_>,
) -> Result<NonLinear, ConfigError> {
    let wrong = |span, problem: String| at.at(span, "class.ends", problem);
    let links: Vec<&str> = match &class.ends {
        Some(ends) => {
            for end in ends {
                ChainIk::to_link(model, end.get_ref())
                    .map_err(|e| wrong(end.span(), e.to_string()))?;
            }
            ends.iter().map(|e| e.get_ref().as_str()).collect()
        }
        None => {
            let parent = |link: usize| model.joints.iter().any(|j| j.parent == link);
            let leaves = (0..model.links.len()).filter(|link| !parent(*link));
            let names = leaves.map(|link| model.links[link].as_str());
            names
                .filter(|l| ChainIk::to_link(model, l).is_ok())
                .collect()
        }
    };
    let chains: Vec<Vec<usize>> = (links.iter())
        .filter_map(|l| ChainIk::to_link(model, l).ok())
        .map(|chain| chain.joints().collect())
        .collect();
    let shared = (chains.iter().enumerate())
        .any(|(k, a)| chains[..k].iter().any(|b| b.iter().any(|j| a.contains(j))));
    if links.is_empty() || shared {
        let problem = format!(
            "ends that share joints cannot all keep their way, and there must be one: found {:?}; name one end of each chain: ends = [\"LINK\"]",
            links
        );
        let span = class
            .ends
            .as_ref()
            .and_then(|e| e.first())
            .map_or(span, |e| e.span());
        return Err(wrong(span, problem));
    }
    let ends = RobotEnds::new(model.clone(), &links).map_err(|e| wrong(span, e.to_string()))?;
    Ok(NonLinear::new().with_ends(Arc::new(ends)))
}
