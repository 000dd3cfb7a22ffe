//! What goes into teaching a gesture and comes out of it: marks, options, phases, reasons why not.

use super::define::FEWEST_FRAMES;
use super::{DefineError, GestureKind, Novelty, PeriodEstimate, teach_search as search};

/// What the performer (or a helper with a pedal) says.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
pub enum Mark {
    /// Begin: the count-down, then the recording. After a result: once more.
    Start,
    /// One period (or several) is over.
    End,
    /// This is the rest pose; the movement follows.
    Rest,
    /// This is the extreme pose.
    Extreme,
    /// What one button means now: start or rest, then end or extreme, then accept (or once more).
    Next,
    /// The result is taken.
    Accept,
    /// Nothing is taken.
    Cancel,
}

/// What is taught and how.
#[derive(Clone, Debug, PartialEq)]
pub struct TeachOptions {
    /// Name of the gesture.
    pub name: String,
    /// Where it comes from, for people.
    pub source: String,
    /// Whether it repeats.
    pub kind: GestureKind,
    /// Seconds from the start mark to the recording; 0 to 60.
    pub count_down_s: f64,
    /// The count-down begins with the first pose, without a mark, and the movement may begin later.
    pub hands_free: bool,
    /// The recording is given up after this long, seconds.
    pub longest_s: f64,
}

/// Where in the work it is.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
pub enum TeachPhase {
    /// For the start mark, or the first pose.
    Waiting,
    /// To the recording.
    CountDown,
    /// The gesture is performed.
    Recording,
    /// There is a definition; accept it, cancel, or start once more.
    Done,
    /// There is a reason why not; start once more, or cancel.
    Failed,
    /// Nothing is wanted any more.
    Cancelled,
}

/// What a user interface shows.
#[derive(Copy, Clone, Debug, PartialEq)]
pub struct TeachView {
    /// Where in the work it is.
    pub phase: TeachPhase,
    /// Seconds left of the count-down.
    pub left_s: f64,
    /// Seconds recorded.
    pub recorded_s: f64,
    /// How new the present pose is; `None` before the first.
    pub pose: Option<Novelty>,
    /// How new the movement of about the last second is, 0 (red) to 1 (green).
    pub movement: f64,
    /// Whether the pose has moved since the recording began.
    pub moved: bool,
    /// The period as far as it shows.
    pub period: Option<PeriodEstimate>,
}

/// Why there is no definition.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum TeachError {
    /// No complete pose came.
    #[error("no pose came in which every point was seen{}; check the tracker and its view of the performer", unseen(.0))]
    NoPoses(Vec<String>),
    /// The pose stood still.
    #[error(
        "nothing moved in {seconds:.1} s (over {needed_mm:.1} mm are needed, {moved_mm:.1} mm were seen): perform the gesture larger, and begin it at the end of the count-down"
    )]
    NothingMoved {
        /// Seconds recorded.
        seconds: f64,
        /// Movement seen, root mean square over the points, millimetres.
        moved_mm: f64,
        /// Movement needed, millimetres.
        needed_mm: f64,
    },
    /// It moved and did not repeat.
    #[error(
        "no period: in {seconds:.1} s nothing repeated (autocorrelation {periodicity:.2}, needed {:.2}); show three periods at a steady speed, or use --kind non-cyclic for a movement that does not repeat",
        search::PERIODIC
    )]
    NoPeriod {
        /// Seconds recorded.
        seconds: f64,
        /// Highest autocorrelation found.
        periodicity: f64,
    },
    /// It moved and came to no extreme.
    #[error(
        "no extreme: in {seconds:.1} s the pose neither rested away from where it began nor turned back; go to the extreme and hold it for a second"
    )]
    NoExtreme {
        /// Seconds recorded.
        seconds: f64,
    },
    /// The end mark came too soon.
    #[error(
        "too short: {frames} poses between the marks, a gesture needs at least {FEWEST_FRAMES}; mark the end after a whole period"
    )]
    TooShort {
        /// Poses between the marks.
        frames: usize,
    },
    /// The performer does not want it.
    #[error("cancelled; nothing was written")]
    Cancelled,
    /// The frames make no gesture.
    #[error("{0}")]
    Define(#[from] DefineError),
}

fn unseen(points: &[String]) -> String {
    if points.is_empty() {
        return String::new();
    }
    format!(" (never seen: {})", points.join(", "))
}
