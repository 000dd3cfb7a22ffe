//! The bus of a body that has no servos: an avatar. It is where it is told to be, at once.

use super::{BusError, CycleReport, ServoBus, TorqueReport};
use crate::base::JointState;

/// Takes targets and gives them back as states; nothing moves, nothing fails.
#[derive(Clone, Debug)]
pub struct NoServos {
    names: Vec<String>,
    positions: Vec<f64>,
}

impl NoServos {
    /// For the coordinates `names`, standing at `start`; both of one length.
    pub fn new(names: Vec<String>, start: Vec<f64>) -> Self {
        Self {
            names,
            positions: start,
        }
    }

    fn show(&self, states: &mut [JointState]) {
        for (state, position) in states.iter_mut().zip(&self.positions) {
            state.position = *position;
        }
    }
}

impl ServoBus for NoServos {
    fn joints(&self) -> &[String] {
        &self.names
    }

    fn prepare(&mut self, states: &mut [JointState]) -> Result<(), BusError> {
        self.show(states);
        Ok(())
    }

    fn arm(&mut self) -> Result<(), BusError> {
        Ok(())
    }

    fn goals(&self, out_rad: &mut [f64]) {
        out_rad.copy_from_slice(&self.positions);
    }

    fn exchange(
        &mut self,
        targets_rad: &[f64],
        states: &mut [JointState],
    ) -> Result<CycleReport, BusError> {
        self.positions.copy_from_slice(targets_rad);
        self.show(states);
        Ok(CycleReport::default())
    }

    fn torque_off(&mut self) -> Result<TorqueReport, BusError> {
        Ok(TorqueReport::default())
    }

    fn rearm(&mut self, _: usize) -> Result<(), BusError> {
        Ok(())
    }

    fn reboot(&mut self, _: usize) -> Result<(), BusError> {
        Ok(())
    }
}
