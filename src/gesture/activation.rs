//! When a gesture counts as performed (Rhodin 2016, section 9.5.1).

/// Amplitudes (progressions for non-cyclic gestures) at which activity starts and ends.
#[derive(Copy, Clone, Debug, PartialEq)]
pub struct ActivationThresholds {
    /// A silent gesture becomes active above this; default 0.2. Larger: fewer false starts.
    pub rise: f64,
    /// An active gesture falls silent below this; default 0.1. Must not exceed `rise`.
    pub abort: f64,
}

impl Default for ActivationThresholds {
    fn default() -> Self {
        Self {
            rise: 0.2,
            abort: 0.1,
        }
    }
}

/// Activity of one gesture with hysteresis.
#[derive(Copy, Clone, Debug, Default, PartialEq)]
pub struct Activation {
    thresholds: ActivationThresholds,
    active: bool,
}

impl Activation {
    /// A silent gesture.
    pub fn new(thresholds: ActivationThresholds) -> Self {
        Self {
            thresholds,
            active: false,
        }
    }

    /// Takes the present amplitude and returns whether the gesture is active now.
    ///
    /// A value that is not finite changes nothing.
    pub fn update(&mut self, amplitude: f64) -> bool {
        if amplitude > self.thresholds.rise {
            self.active = true;
        } else if amplitude < self.thresholds.abort {
            self.active = false;
        }
        self.active
    }

    /// Whether the gesture is active.
    pub fn is_active(&self) -> bool {
        self.active
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn between_the_thresholds_nothing_changes() {
        let mut activation = Activation::default();
        let seen: Vec<bool> = [0.15, 0.21, 0.15, f64::NAN, 0.11, 0.09, 0.19, 0.3]
            .map(|a| activation.update(a))
            .to_vec();
        assert_eq!(
            seen,
            [false, true, true, true, true, false, false, true],
            "rise above 0.2, fall below 0.1"
        );
    }
}
