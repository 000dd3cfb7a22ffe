//! A pose map: features of a source pose in, an admissible target pose out.

use super::error::MappingError;
use super::regression::{NOISE_VARIANCE, Regression};
use super::root::RootMap;
use super::volume::{LatentVolume, check_limits};

/// Mean squared length that source poses are scaled to. See [`scaled`].
pub const SCALED_SQUARE: f64 = 5.0;

/// Scales a raw feature so that one noise variance serves all trackers.
///
/// `spread_m` is the root mean square distance of the source poses from their mean: the square root
/// of the mean squared length of a feature's places. A hand moves its points by centimetres, a body
/// by decimetres, and a tracker has 3 points or 67; after scaling a typical source pose has the squared
/// length [`SCALED_SQUARE`] for all of them: a hundred times the noise of 0.05, so that pairs are met to
/// about a hundredth. Velocities are scaled alike, so w keeps its meaning.
pub fn scaled(feature: &[f64], spread_m: f64, out: &mut [f64]) {
    let scale = SCALED_SQUARE.sqrt() / spread_m;
    for (out, x) in out.iter_mut().zip(feature) {
        *out = x * scale;
    }
}

/// Root mean square length of the places of `features` (their first half), metres.
///
/// # Errors
/// Below a micrometre the source does not move; `what` names it.
pub fn spread_m(what: &str, features: &[Vec<f64>]) -> Result<f64, MappingError> {
    let square: f64 = features
        .iter()
        .map(|f| f[..f.len() / 2].iter().map(|v| v * v).sum::<f64>())
        .sum();
    let spread_m = (square / features.len().max(1) as f64).sqrt();
    if spread_m > 1e-6 && spread_m.is_finite() {
        Ok(spread_m)
    } else {
        Err(MappingError::ConstantSource {
            where_: what.into(),
            spread_m,
        })
    }
}

/// A source pose and the target pose that it stands for.
#[derive(Clone, Debug, PartialEq)]
pub struct Pair {
    /// Name for messages, such as `pair 2 (5.85 s = reach@1)`.
    pub label: String,
    /// Feature of the source pose, not scaled.
    pub source: Vec<f64>,
    /// Target pose, one number per joint.
    pub target: Vec<f64>,
}

/// Settings of a map.
#[derive(Copy, Clone, Debug, PartialEq)]
pub struct MapOptions {
    /// sigma^2 of eq. 8.3.
    pub noise_variance: f64,
    /// Turn of the root per turn of the performer (r of section 8.5); 0 leaves the heading alone.
    pub yaw_ratio: f64,
}

impl Default for MapOptions {
    fn default() -> Self {
        Self {
            noise_variance: NOISE_VARIANCE,
            yaw_ratio: 0.0,
        }
    }
}

/// A learned map with its work space; using it allocates nothing.
#[derive(Clone, Debug)]
pub struct PoseMap {
    volume: LatentVolume,
    regression: Regression,
    root: RootMap,
    spread_m: f64,
    yaw_ratio: f64,
    x: Vec<f64>,
    coefficients: Vec<f64>,
    scratch: Vec<f64>,
}

impl PoseMap {
    /// Learns the map of `pairs` into `volume`.
    ///
    /// # Errors
    /// Too few, duplicate or unusable pairs, target poses outside of the joint limits.
    pub fn learn(
        pairs: &[Pair],
        spread_m: f64,
        volume: LatentVolume,
        root: RootMap,
        options: MapOptions,
    ) -> Result<Self, MappingError> {
        if !(spread_m > 0.0 && spread_m.is_finite()) {
            return Err(MappingError::Option {
                key: "spread_m",
                found: spread_m,
                allowed: "above zero, metres",
            });
        }
        if !options.yaw_ratio.is_finite() || options.yaw_ratio.abs() > 100.0 {
            return Err(MappingError::Option {
                key: "yaw_ratio",
                found: options.yaw_ratio,
                allowed: "-100..100",
            });
        }
        let (mut xs, mut ys) = (Vec::new(), Vec::new());
        let mut labels = Vec::new();
        for pair in pairs {
            let what = format!("{}: target pose", pair.label);
            super::error::numbers(&what, &pair.target, volume.joints())?;
            super::error::finite(&format!("{}: source pose", pair.label), &pair.source)?;
            check_limits(&what, &pair.target, &volume.lower, &volume.upper)?;
            let mut x = vec![0.0; pair.source.len()];
            scaled(&pair.source, spread_m, &mut x);
            xs.push(x);
            let mut y = vec![0.0; volume.dimensions()];
            volume.project(&pair.target, &mut y);
            ys.push(y);
            labels.push(pair.label.clone());
        }
        let regression = Regression::fit(&xs, &ys, &labels, options.noise_variance)?;
        Ok(Self {
            x: vec![0.0; regression.inputs()],
            coefficients: vec![0.0; volume.dimensions()],
            scratch: vec![0.0; regression.uncertainty().scratch_len()],
            volume,
            regression,
            root,
            spread_m,
            yaw_ratio: options.yaw_ratio,
        })
    }

    /// The target pose of `feature` (not scaled) into `out`: always inside the volume and the joint
    /// limits, whatever the input. A feature of another length is answered with the mean pose.
    pub fn apply(&mut self, feature: &[f64], out: &mut [f64]) {
        if feature.len() == self.x.len() {
            scaled(feature, self.spread_m, &mut self.x);
            self.regression.predict(&self.x, &mut self.coefficients);
        } else {
            self.coefficients.fill(0.0);
        }
        self.volume.confine(&mut self.coefficients, out);
    }

    /// How uncertain the map is at `feature` (eq. 8.3), and the same as a share of the prior's, 0..1:
    /// the bar that is large where a pair would teach much.
    pub fn uncertainty(&mut self, feature: &[f64]) -> (f64, f64) {
        if feature.len() != self.x.len() {
            return (0.0, 0.0);
        }
        scaled(feature, self.spread_m, &mut self.x);
        let uncertainty = self.regression.uncertainty();
        let q = uncertainty.q(&self.x, &mut self.scratch);
        let prior = uncertainty.prior(&self.x);
        // A pose too far away for its square to be a number teaches nothing.
        (q, if prior.is_finite() { q / prior } else { 0.0 })
    }

    /// Root velocity (forwards, left; m/s) while the pose changes by `change` (per joint and second).
    pub fn root_velocity(&mut self, change: &[f64]) -> [f64; 2] {
        if self.root.weights.is_empty() {
            return [0.0; 2];
        }
        let joints = self.volume.joints();
        for (c, axis) in self
            .coefficients
            .iter_mut()
            .zip(self.volume.axes.chunks_exact(joints))
        {
            *c = axis.iter().zip(change).map(|(a, v)| a * v).sum();
        }
        self.root.velocity(&self.coefficients)
    }

    /// Turn of the root per turn of the performer.
    pub fn yaw_ratio(&self) -> f64 {
        self.yaw_ratio
    }

    /// The volume of admissible poses.
    pub fn volume(&self) -> &LatentVolume {
        &self.volume
    }

    /// Numbers in a feature.
    pub fn inputs(&self) -> usize {
        self.x.len()
    }

    /// Numbers in a target pose.
    pub fn joints(&self) -> usize {
        self.volume.joints()
    }
}
