//! A recorded take played on a robot: checked before anything moves, eased into and out of.

use crate::base::suggest::hint;
use crate::motion::take::{Take, TakeBody};
use crate::robot::JointEnvelope;

/// On the way to the first row and back from the last no joint is faster than this, rad/s: 40 degrees a second.
const RAMP_RAD_S: f64 = 0.7;
/// Least time of a ramp, seconds.
const RAMP_S: f64 = 1.0;
/// Peak over mean speed of the eased ramp.
const PEAK: f64 = 1.875;
/// A position this far beyond a limit is rounding, radians.
const ROUNDING_RAD: f64 = 2e-3;
/// Speed is measured over this many seconds: a recorded position has steps.
const SPEED_OVER_S: f64 = 0.1;

/// Why a take cannot be played.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PlaybackError {
    /// It is not about joints that stand on a bench.
    #[error("this is no take of joint positions: expected a header `t,<joint>,...`")]
    Body,
    /// Too little to play.
    #[error("there are {0} rows; at least 2 are needed")]
    Rows(usize),
    /// A column that is no joint.
    #[error("column {column:?} is no joint{hint} Joints: {joints}")]
    Unknown {
        /// Column.
        column: String,
        /// The nearest name.
        hint: String,
        /// What there is.
        joints: String,
    },
    /// A position beyond the limits.
    #[error(
        "{joint} is to go to {degrees:.1} deg at {t_s:.2} s, its limits are {lower:.1} to {upper:.1} deg; nothing was moved"
    )]
    Outside {
        /// Joint.
        joint: String,
        /// Where it was to go.
        degrees: f64,
        /// When.
        t_s: f64,
        /// Limit, degrees.
        lower: f64,
        /// Limit, degrees.
        upper: f64,
    },
    /// Faster than allowed.
    #[error(
        "{joint} is to turn at {found:.0} deg/s at {t_s:.2} s, its limit is {limit:.0} deg/s; nothing was moved. \
         Play it slower: --speed {share:.2}"
    )]
    Fast {
        /// Joint.
        joint: String,
        /// Speed, degrees per second.
        found: f64,
        /// When.
        t_s: f64,
        /// Limit, degrees per second.
        limit: f64,
        /// At this share of its speed it fits.
        share: f64,
    },
}

/// A take for the joints of a robot.
#[derive(Clone, Debug)]
pub struct Playback {
    take: Take,
    /// Per joint the column of the take; `None` for one that stays where it is.
    columns: Vec<Option<usize>>,
    speed: f64,
}

impl Playback {
    /// Puts the columns of `take` to `joints`, to be played at `speed` times its own. Steps of the encoder are smoothed.
    ///
    /// # Errors
    /// Too few rows, or a column that is no joint.
    pub fn new(mut take: Take, joints: &[String], speed: f64) -> Result<Self, PlaybackError> {
        let TakeBody::Joints(names) = &take.body else {
            return Err(PlaybackError::Body);
        };
        if take.len() < 2 {
            return Err(PlaybackError::Rows(take.len()));
        }
        if let Some(column) = names.iter().find(|name| !joints.contains(name)) {
            return Err(PlaybackError::Unknown {
                column: column.clone(),
                hint: hint(column, joints.iter().map(String::as_str)),
                joints: joints.join(", "),
            });
        }
        let columns = joints
            .iter()
            .map(|joint| names.iter().position(|name| name == joint))
            .collect();
        smooth(&mut take.poses);
        Ok(Self {
            take,
            columns,
            speed,
        })
    }

    /// How long it plays, seconds.
    pub fn duration_s(&self) -> f64 {
        self.take.duration_s() / self.speed
    }

    /// Positions at `t_s` (clamped to the take), rad; joints without a column stay at `rest`.
    pub fn at(&self, t_s: f64, rest: &[f64]) -> Vec<f64> {
        let (pose, _) = self.take.at(t_s * self.speed);
        let of = |(column, rest): (&Option<usize>, &f64)| {
            column.and_then(|c| pose.get(c).copied()).unwrap_or(*rest)
        };
        self.columns.iter().zip(rest).map(of).collect()
    }

    /// Looks through all of it.
    ///
    /// # Errors
    /// The first position outside `limits`, or speed above them, by joint and time.
    pub fn check(&self, joints: &[String], limits: &[JointEnvelope]) -> Result<(), PlaybackError> {
        let dt_s = self.take.dt_s / self.speed;
        let stride = ((SPEED_OVER_S / dt_s).round() as usize).clamp(1, self.take.len() - 1);
        for ((column, joint), limit) in self.columns.iter().zip(joints).zip(limits) {
            let Some(column) = *column else { continue };
            let q = |row: usize| {
                self.take.poses[row]
                    .get(column)
                    .copied()
                    .unwrap_or(f64::NAN)
            };
            for row in 0..self.take.len() {
                // Written so that NaN fails.
                let inside =
                    q(row) >= limit.lower - ROUNDING_RAD && q(row) <= limit.upper + ROUNDING_RAD;
                if !inside {
                    return Err(PlaybackError::Outside {
                        joint: joint.clone(),
                        degrees: q(row).to_degrees(),
                        t_s: row as f64 * dt_s,
                        lower: limit.lower.to_degrees(),
                        upper: limit.upper.to_degrees(),
                    });
                }
            }
            let speed = |row: usize| (q(row + stride) - q(row)).abs() / (stride as f64 * dt_s);
            let rows = 0..self.take.len() - stride;
            let fastest = rows
                .max_by(|a, b| speed(*a).total_cmp(&speed(*b)))
                .unwrap_or(0);
            if speed(fastest) > limit.velocity {
                return Err(PlaybackError::Fast {
                    joint: joint.clone(),
                    found: speed(fastest).to_degrees(),
                    t_s: fastest as f64 * dt_s,
                    limit: limit.velocity.to_degrees(),
                    share: (0.95 * self.speed * limit.velocity / speed(fastest) * 100.0).floor()
                        / 100.0,
                });
            }
        }
        Ok(())
    }
}

/// A binomial mean over five rows; the ends keep theirs.
fn smooth(poses: &mut [Vec<f64>]) {
    const WEIGHTS: [f64; 5] = [1.0 / 16.0, 4.0 / 16.0, 6.0 / 16.0, 4.0 / 16.0, 1.0 / 16.0];
    let before = poses.to_vec();
    let last = before.len().saturating_sub(1);
    for (row, pose) in poses.iter_mut().enumerate().take(last).skip(1) {
        for (joint, q) in pose.iter_mut().enumerate() {
            let near = |k: usize| before[(row + k).saturating_sub(2).min(last)][joint];
            *q = WEIGHTS.iter().enumerate().map(|(k, w)| w * near(k)).sum();
        }
    }
}

/// An eased way between two poses.
#[derive(Clone, Debug)]
pub struct Ramp {
    from: Vec<f64>,
    to: Vec<f64>,
    /// How long it takes, seconds.
    pub duration_s: f64,
}

impl Ramp {
    /// From `from` to `to`, slow enough for a person beside the robot and for `limits`.
    pub fn new(from: Vec<f64>, to: Vec<f64>, limits: &[JointEnvelope]) -> Self {
        let times = from.iter().zip(&to).zip(limits).map(|((a, b), limit)| {
            let top = RAMP_RAD_S.min(0.5 * limit.velocity);
            PEAK * (b - a).abs() / top
        });
        let duration_s = times.fold(RAMP_S, f64::max);
        Self {
            from,
            to,
            duration_s,
        }
    }

    /// Where it is after `t_s`.
    pub fn at(&self, t_s: f64) -> Vec<f64> {
        let u = (t_s / self.duration_s).clamp(0.0, 1.0);
        // Minimum jerk: at rest at both ends.
        let share = u * u * u * (10.0 + u * (6.0 * u - 15.0));
        let between = self.from.iter().zip(&self.to);
        between.map(|(a, b)| a + share * (b - a)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn take(names: &[&str], rows: Vec<Vec<f64>>) -> Take {
        Take {
            name: "t".into(),
            origin: String::new(),
            dt_s: 0.02,
            body: TakeBody::Joints(names.iter().map(|n| (*n).into()).collect()),
            roots: vec![Default::default(); rows.len()],
            poses: rows,
            wraps: false,
        }
    }

    fn limits() -> Vec<JointEnvelope> {
        vec![
            JointEnvelope {
                lower: -1.0,
                upper: 1.0,
                velocity: 2.0,
                acceleration: 40.0
            };
            2
        ]
    }

    fn joints() -> Vec<String> {
        vec!["a".into(), "b".into()]
    }

    #[test]
    fn a_take_of_strangers_or_of_one_row_is_refused() {
        let unknown = Playback::new(take(&["aa"], vec![vec![0.0]; 3]), &joints(), 1.0);
        let text = unknown.expect_err("no joint of that name").to_string();
        assert!(text.contains("\"aa\"") && text.contains("a, b"), "{text}");
        let short = Playback::new(take(&["a"], vec![vec![0.0]]), &joints(), 1.0);
        assert_eq!(short.expect_err("one row"), PlaybackError::Rows(1));
    }

    #[test]
    fn positions_and_speeds_beyond_the_limits_are_named_with_their_time() {
        let away = (0..50).map(|k| vec![0.0, 0.03 * f64::from(k)]).collect();
        let playback = Playback::new(take(&["a", "b"], away), &joints(), 1.0).expect("joints");
        let text = playback
            .check(&joints(), &limits())
            .expect_err("outside")
            .to_string();
        assert!(
            text.contains("b is to go to 58.") && text.contains("0.68 s"),
            "{text}"
        );

        let fast: Vec<Vec<f64>> = (0..20).map(|k| vec![0.06 * f64::from(k.min(10))]).collect();
        let playback = Playback::new(take(&["a"], fast.clone()), &joints(), 1.0).expect("joints");
        let error = playback.check(&joints(), &limits()).expect_err("too fast");
        let PlaybackError::Fast { share, .. } = error else {
            panic!("{error}");
        };
        assert!((0.55..0.68).contains(&share), "2 of 3 rad/s: {share}");
        let slower = Playback::new(take(&["a"], fast), &joints(), share).expect("joints");
        assert_eq!(slower.check(&joints(), &limits()), Ok(()));
    }

    #[test]
    fn joints_without_a_column_stay() {
        let rows = (0..10).map(|k| vec![0.1 * f64::from(k)]).collect();
        let playback = Playback::new(take(&["b"], rows), &joints(), 1.0).expect("joints");
        let at = playback.at(0.09, &[0.7, -0.7]);
        assert_eq!(at[0], 0.7);
        assert!((at[1] - 0.45).abs() < 1e-9, "{at:?}");
    }

    #[test]
    fn a_ramp_is_slow_and_ends_where_it_should() {
        let ramp = Ramp::new(vec![0.0, 0.0], vec![1.0, -0.2], &limits());
        let (mut fastest, dt): (f64, f64) = (0.0, 1e-3);
        let steps = (ramp.duration_s / dt) as usize;
        for k in 0..steps {
            let (a, b) = (ramp.at(k as f64 * dt), ramp.at((k + 1) as f64 * dt));
            fastest = fastest.max((b[0] - a[0]).abs() / dt);
        }
        assert!(fastest <= 0.701, "{fastest} rad/s");
        assert_eq!(ramp.at(9.0), [1.0, -0.2]);
    }
}
