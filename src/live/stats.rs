//! What a run measured: cycle counts, latencies, faults. Filled without allocation, printed at the end.

use crate::bus::CycleReport;
use hdrhistogram::Histogram;

/// A fault of one servo, with times since the start of the run.
#[derive(Clone, Debug, PartialEq)]
pub struct ServoFault {
    /// Index of the joint.
    pub joint: usize,
    /// What it did.
    pub kind: FaultKind,
    /// First cycle, seconds.
    pub from_s: f64,
    /// First healthy cycle, seconds; `None` when it lasted to the end.
    pub to_s: Option<f64>,
}

/// What a servo did wrong.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
pub enum FaultKind {
    /// No valid answer.
    Silent,
    /// The answer carried the alert flag: a hardware error is latched.
    Alert,
    /// The servo came back without torque and is not driven.
    Torqueless,
}

impl FaultKind {
    /// All kinds, in the order in which [`Stats::bus`] keeps them.
    pub const ALL: [FaultKind; 3] = [FaultKind::Silent, FaultKind::Alert, FaultKind::Torqueless];

    /// For messages.
    pub fn as_str(self) -> &'static str {
        match self {
            FaultKind::Silent => "silent",
            FaultKind::Alert => "hardware error",
            FaultKind::Torqueless => "without torque",
        }
    }
}

/// Percentiles of a quantity in microseconds.
#[derive(Copy, Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct Percentiles {
    /// Median.
    pub p50: u64,
    /// 99th percentile.
    pub p99: u64,
    /// Largest.
    pub max: u64,
}

/// A histogram of microseconds up to ten seconds, three digits. Records without allocating.
#[derive(Clone, Debug)]
pub struct Microseconds(Histogram<u32>);

const LONGEST_US: u64 = 10_000_000;

impl Default for Microseconds {
    fn default() -> Self {
        Self(
            Histogram::new_with_bounds(1, LONGEST_US, 3)
                .expect("1 us to 10 s at three digits is a valid range"),
        )
    }
}

impl Microseconds {
    /// Counts one value; longer than ten seconds counts as ten.
    pub fn add(&mut self, us: u64) {
        self.0.saturating_record(us.min(LONGEST_US));
    }

    /// Percentiles of what was counted; zeros when nothing was.
    pub fn percentiles(&self) -> Percentiles {
        if self.0.is_empty() {
            return Percentiles::default();
        }
        Percentiles {
            p50: self.0.value_at_quantile(0.5),
            p99: self.0.value_at_quantile(0.99),
            max: self.0.max(),
        }
    }
}

/// Everything a run counted.
#[derive(Clone, Debug)]
pub struct Stats {
    /// Control cycles.
    pub cycles: u64,
    /// Cycles that began later than one period after their deadline.
    pub overruns: u64,
    /// Cycles whose bus exchange ended after the next deadline.
    pub missed: u64,
    /// Cycles in which the envelope had to act.
    pub held_back: u64,
    /// Cycles while playing in which poses counted as lost.
    pub poses_lost: u64,
    /// Pose samples used.
    pub samples: u64,
    /// Answers that were due and did not come.
    pub silent: u64,
    /// Damaged frames.
    pub damaged: u64,
    /// Bytes on the wire.
    pub bytes: u64,
    /// Computing one step.
    pub step: Microseconds,
    /// One bus exchange.
    pub exchange: Microseconds,
    /// Lateness of the cycle's start.
    pub lateness: Microseconds,
    /// From a sample's arrival to the last goal byte handed to the port.
    pub pose_to_wire: Microseconds,
    /// The same of the latest cycle, if a sample was used in it.
    pub latest_pose_to_wire_us: Option<u64>,
    /// Faults, oldest first.
    pub faults: Vec<ServoFault>,
    /// Faults beyond those kept.
    pub more_faults: u64,
    open: [u64; FaultKind::ALL.len()],
}

/// Faults kept with their times; more are only counted.
const FAULTS_KEPT: usize = 512;

impl Default for Stats {
    fn default() -> Self {
        Self {
            cycles: 0,
            overruns: 0,
            missed: 0,
            held_back: 0,
            poses_lost: 0,
            samples: 0,
            silent: 0,
            damaged: 0,
            bytes: 0,
            step: Microseconds::default(),
            exchange: Microseconds::default(),
            lateness: Microseconds::default(),
            pose_to_wire: Microseconds::default(),
            latest_pose_to_wire_us: None,
            faults: Vec::with_capacity(FAULTS_KEPT),
            more_faults: 0,
            open: [0; FaultKind::ALL.len()],
        }
    }
}

impl Stats {
    /// Counts what the bus saw in the cycle at `t_s`.
    pub fn bus(&mut self, t_s: f64, report: &CycleReport) {
        self.silent += u64::from(report.silent);
        self.damaged += u64::from(report.damaged);
        self.bytes += u64::from(report.bytes);
        self.exchange.add(u64::from(report.cycle_us));
        let masks = [
            report.silent_mask,
            report.alert_mask,
            report.torqueless_mask,
        ];
        for (slot, (kind, mask)) in FaultKind::ALL.into_iter().zip(masks).enumerate() {
            let mut changed = mask ^ self.open[slot];
            self.open[slot] = mask;
            while changed != 0 {
                let joint = changed.trailing_zeros() as usize;
                changed &= changed - 1;
                self.change(t_s, joint, kind, mask >> joint & 1 == 1);
            }
        }
    }

    fn change(&mut self, t_s: f64, joint: usize, kind: FaultKind, begins: bool) {
        if !begins {
            let open = self
                .faults
                .iter_mut()
                .rev()
                .find(|f| f.joint == joint && f.kind == kind && f.to_s.is_none());
            if let Some(fault) = open {
                fault.to_s = Some(t_s);
            }
        } else if self.faults.len() < FAULTS_KEPT {
            self.faults.push(ServoFault {
                joint,
                kind,
                from_s: t_s,
                to_s: None,
            });
        } else {
            self.more_faults += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fault_has_a_beginning_and_an_end() {
        let mut stats = Stats::default();
        let report = |mask| CycleReport {
            silent_mask: mask,
            ..CycleReport::default()
        };
        for (t, mask) in [(0.0, 0), (0.5, 0b100), (0.6, 0b100), (0.7, 0), (0.8, 0b1)] {
            stats.bus(t, &report(mask));
        }
        let times: Vec<_> = stats
            .faults
            .iter()
            .map(|f| (f.joint, f.from_s, f.to_s))
            .collect();
        assert_eq!(times, [(2, 0.5, Some(0.7)), (0, 0.8, None)]);
    }
}
