//! When feet stand: low and slow, with hysteresis; their touch-down phases, duty and clearance.

use super::{Cycle, Travel};
use crate::body::{Feet, RootPose};
use crate::motion::metrics::{FootSlide, GroundError, foot_slide, ground_error};
use crate::motion::take::Take;
use nalgebra::{Point3, Vector3};
use std::f64::consts::TAU;

/// A stretch of frames in which a foot stands.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
pub struct Stance {
    /// First frame of it.
    pub start: usize,
    /// First frame after it; of a closed cycle it may lie behind the end.
    pub end: usize,
}

/// What one foot does.
#[derive(Clone, Debug)]
pub struct FootContact {
    /// Name of its limb.
    pub name: String,
    /// Height of the foot's point when it stands, metres.
    pub ground_m: f64,
    /// Per frame whether it stands.
    pub contact: Vec<bool>,
    /// Its stances, in order.
    pub stances: Vec<Stance>,
    /// Fraction of the cycle at which it touches down; `None` without a cycle or touch-down.
    pub phase: Option<f64>,
    /// Fraction of the time on the ground.
    pub duty: f64,
    /// Highest point above the ground, metres.
    pub clearance_m: f64,
    /// Way over the ground while it stands (with the ground's own motion taken off, for motions on the
    /// spot).
    pub slide: FootSlide,
    /// Below and above the ground.
    pub error: GroundError,
    /// Height above the ground per frame, metres.
    pub heights_m: Vec<f64>,
}

/// Height above the ground below which a foot may stand, and above which it does not any more, as shares
/// of the leg's reach.
const HEIGHT: (f64, f64) = (0.055, 0.085);
/// Speed below which it may stand and above which it does not, as shares of its speed in swing ...
const SPEED: (f64, f64) = (0.22, 0.35);
/// ... but not below these many reaches per second: a foot that trembles stands.
const TREMBLE_PER_S: (f64, f64) = (0.25, 0.4);
/// Shortest stance and shortest swing, seconds.
const SHORTEST_S: f64 = 0.04;
/// The ground's height is that of the lowest of all frames but this share.
const OUTLIERS: f64 = 0.04;
/// Feet that stand are at most this share of the leg's reach above the lowest.
const LOW_PART: f64 = 0.1;
/// A foot in swing is faster than this share of all frames.
const SWING: f64 = 0.85;

/// Finds the contacts of all feet.
///
/// `travel` tells whether the root moves; where it stands and the low feet slide all one way, the motion
/// was recorded on the spot: `travel` gets the speed that the feet tell, and the ground moves.
pub fn find(
    take: &Take,
    feet: &dyn Feet,
    cycle: Option<&Cycle>,
    travel: &mut Travel,
) -> Vec<FootContact> {
    let n = take.len();
    let closed = cycle.is_some_and(|c| c.closed);
    let local: Vec<Vec<Point3<f64>>> = (0..feet.count())
        .map(|f| take.poses.iter().map(|p| feet.position(p, f)).collect())
        .collect();
    let ground: Vec<f64> = local.iter().map(|p| low_end(p)).collect();
    let mut roots = take.roots.clone();
    if let Some(drift) = ground_drift(take, feet, &local, &ground, travel) {
        travel.on_the_spot = true;
        (travel.forward_m_s, travel.left_m_s) = (-drift.x, -drift.y);
        let step = crate::body::RootAdvance {
            forward_m: -drift.x * take.dt_s,
            left_m: -drift.y * take.dt_s,
            yaw_rad: 0.0,
        };
        roots = (0..n)
            .map(|k| {
                let mut root = RootPose::default();
                root.travel(step.scaled(k as f64));
                root
            })
            .collect();
    }
    (local.iter().enumerate())
        .map(|(f, local)| {
            let world: Vec<Point3<f64>> = (local.iter().zip(&roots))
                .map(|(p, root)| root.to_world(*p))
                .collect();
            let speeds = speeds(&world, take.dt_s, closed);
            let reach = feet.reach_m(f);
            let ground = standing_height(&world, &speeds, ground[f], reach);
            let mut contact = hysteresis(&world, &speeds, ground, reach, closed);
            let shortest = (SHORTEST_S / take.dt_s).round().max(1.0) as usize;
            // The last frame of a loop is its first one.
            let period = if closed { n - 1 } else { n };
            clean(&mut contact[..period], shortest, closed);
            if closed {
                contact[n - 1] = contact[0];
            }
            let stances = stances(&contact[..period], closed);
            let counted = |k: usize| (world[k], contact[k]);
            FootContact {
                name: feet.name(f).into(),
                ground_m: ground,
                phase: cycle.and_then(|c| phase(&stances, c, closed)),
                duty: duty(&contact[..period], cycle),
                clearance_m: local.iter().map(|p| p.z - ground).fold(0.0, f64::max),
                slide: foot_slide((0..n).map(counted)),
                error: ground_error((0..n).map(counted), ground),
                heights_m: local.iter().map(|p| p.z - ground).collect(),
                contact,
                stances,
            }
        })
        .collect()
}

/// The height of the ground under a foot: low, but not that of outliers.
fn low_end(points: &[Point3<f64>]) -> f64 {
    quantile(points.iter().map(|p| p.z), OUTLIERS)
}

/// Height of a foot when it stands: the middle of those at which it is slow and low. A floor that is not
/// level, or a toe that dips when it pushes, makes the lowest height too low.
fn standing_height(world: &[Point3<f64>], speeds: &[f64], low: f64, reach: f64) -> f64 {
    let slow = slow_limits(speeds, reach).0;
    let standing = (world.iter().zip(speeds))
        .filter(|(p, speed)| **speed < slow && p.z < low + LOW_PART * reach)
        .map(|(p, _)| p.z);
    if standing.clone().count() < 3 {
        return low;
    }
    quantile(standing, 0.5)
}

/// Speeds below which a foot may stand and above which it does not, m/s.
fn slow_limits(speeds: &[f64], reach: f64) -> (f64, f64) {
    let swing = quantile(speeds.iter().copied(), SWING);
    (
        (SPEED.0 * swing).max(TREMBLE_PER_S.0 * reach),
        (SPEED.1 * swing).max(TREMBLE_PER_S.1 * reach),
    )
}

fn quantile(values: impl Iterator<Item = f64>, share: f64) -> f64 {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    let last = values.len().saturating_sub(1);
    values
        .get((share * last as f64) as usize)
        .copied()
        .unwrap_or(0.0)
}

/// Speeds of a foot at every frame, m/s, all directions: of the step before or after it, whichever is
/// slower, so that the first and the last frame of a stance count as standing. Across the ends of a closed
/// cycle too.
fn speeds(world: &[Point3<f64>], dt_s: f64, closed: bool) -> Vec<f64> {
    let n = world.len();
    let step = |k: usize| (world[k + 1] - world[k]).norm() / dt_s;
    (0..n)
        .map(|k| {
            // The last frame of a loop is its first one.
            let around = closed && n > 2;
            let before = match k.checked_sub(1) {
                Some(before) => step(before),
                None if around => step(n - 2),
                None => f64::INFINITY,
            };
            let after = match k + 1 < n {
                true => step(k),
                false if around => step(0),
                false => f64::INFINITY,
            };
            before.min(after)
        })
        .collect()
}

/// The velocity of the ground in the travelling frame, where the root stands and the feet that are down
/// all slide one way.
fn ground_drift(
    take: &Take,
    feet: &dyn Feet,
    local: &[Vec<Point3<f64>>],
    ground: &[f64],
    travel: &Travel,
) -> Option<Vector3<f64>> {
    let (mut x, mut y, mut all) = (Vec::new(), Vec::new(), Vec::new());
    for (f, points) in local.iter().enumerate() {
        let low = ground[f] + 0.5 * HEIGHT.0 * feet.reach_m(f);
        for w in points.windows(3) {
            let v = (w[2] - w[0]) / (2.0 * take.dt_s);
            all.push(v.x.hypot(v.y));
            if w[1].z < low {
                x.push(v.x);
                y.push(v.y);
            }
        }
    }
    if x.is_empty() {
        return None;
    }
    let spread = |values: &[f64]| {
        let of = |share| quantile(values.iter().copied(), share);
        of(0.8) - of(0.2)
    };
    let drift = Vector3::new(
        quantile(x.iter().copied(), 0.5),
        quantile(y.iter().copied(), 0.5),
        0.0,
    );
    let usual = quantile(all.into_iter(), 0.5);
    let one_way = spread(&x) < 1.2 * drift.norm();
    let stands = travel.speed_m_s() < 0.2 * drift.norm() && travel.turn_rad_s.abs() < 0.5;
    (stands && one_way && drift.norm() > 0.4 * usual && drift.norm() > 0.05).then_some(drift)
}

/// Contact while low and slow: two limits for each, so that it does not flicker.
fn hysteresis(
    world: &[Point3<f64>],
    speeds: &[f64],
    ground: f64,
    reach: f64,
    closed: bool,
) -> Vec<bool> {
    let (on, off) = slow_limits(speeds, reach);
    let mut contact = vec![false; world.len()];
    let mut stands = false;
    // A closed cycle is run through twice, so that its beginning knows its end.
    for _ in 0..=usize::from(closed) {
        for (k, (point, speed)) in world.iter().zip(speeds).enumerate() {
            let height = point.z - ground;
            stands = if stands {
                height < HEIGHT.1 * reach && *speed < off
            } else {
                height < HEIGHT.0 * reach && *speed < on
            };
            contact[k] = stands;
        }
    }
    contact
}

/// Fills swings and then removes stances shorter than `shortest` frames.
fn clean(contact: &mut [bool], shortest: usize, closed: bool) {
    let n = contact.len();
    for value in [true, false] {
        let runs = runs(contact, !value, closed);
        for (start, end) in runs {
            let cut = !closed && (start == 0 || end == n);
            if end - start < shortest && !cut && end - start < n {
                (start..end).for_each(|k| contact[k % n] = value);
            }
        }
    }
}

/// Stretches of `value`; of a closed cycle one may reach over its end.
fn runs(contact: &[bool], value: bool, closed: bool) -> Vec<(usize, usize)> {
    let n = contact.len();
    let mut found: Vec<(usize, usize)> = Vec::new();
    for (k, contact) in contact.iter().enumerate() {
        if *contact != value {
            continue;
        }
        match found.last_mut() {
            Some((_, end)) if *end == k => *end = k + 1,
            _ => found.push((k, k + 1)),
        }
    }
    if closed
        && found.len() > 1
        && found[0].0 == 0
        && let Some(last) = found.last().copied()
        && last.1 == n
    {
        let first = found.remove(0);
        if let Some(last) = found.last_mut() {
            last.1 = n + first.1;
        }
    }
    found
}

fn stances(contact: &[bool], closed: bool) -> Vec<Stance> {
    (runs(contact, true, closed).into_iter())
        .map(|(start, end)| Stance { start, end })
        .collect()
}

/// Circular mean of the touch-downs, half a frame before the first frame of contact.
fn phase(stances: &[Stance], cycle: &Cycle, closed: bool) -> Option<f64> {
    let (mut sin, mut cos) = (0.0, 0.0);
    // A stance that was there from the beginning did not touch down.
    for stance in stances.iter().filter(|s| closed || s.start > 0) {
        let turn = TAU * (stance.start as f64 - 0.5 - cycle.start as f64) / cycle.frames;
        sin += turn.sin();
        cos += turn.cos();
    }
    (sin.hypot(cos) > 1e-3).then(|| (sin.atan2(cos) / TAU).rem_euclid(1.0))
}

/// Share of frames in contact, over whole cycles where there are some.
fn duty(contact: &[bool], cycle: Option<&Cycle>) -> f64 {
    let whole = cycle.map_or(contact.len(), |c| {
        let cycles = (contact.len() as f64 / c.frames).floor().max(1.0);
        ((cycles * c.frames).round() as usize).min(contact.len())
    });
    let down = contact[..whole].iter().filter(|c| **c).count();
    down as f64 / whole.max(1) as f64
}

impl FootContact {
    /// Share of contact in each of `cells` equal parts of the cycle, over all cycles of the take; without
    /// a cycle over the take.
    pub fn over(&self, cycle: Option<&Cycle>, cells: usize) -> Vec<f64> {
        let n = self.contact.len();
        let (mut down, mut all) = (vec![0.0; cells], vec![0.0; cells]);
        let (start, frames) = cycle.map_or((0.0, n as f64), |c| (c.start as f64, c.frames));
        // Finer than frames, so that no cell stays empty.
        let fine = (4 * cells).div_ceil(frames as usize + 1).max(1);
        for k in 0..n * fine {
            let at = k as f64 / fine as f64;
            let cell = ((at - start) / frames).rem_euclid(1.0) * cells as f64;
            let cell = (cell as usize).min(cells.saturating_sub(1));
            all[cell] += 1.0;
            down[cell] += f64::from(u8::from(self.contact[k / fine]));
        }
        (down.iter().zip(all))
            .map(|(d, a)| if a > 0.0 { d / a } else { 0.0 })
            .collect()
    }
}
