//! The study of section 8.6.2: how good a map is by number of pairs, against its variants.
//!
//! Of all pairs some are drawn for learning, the others judge; SNR = 10 log10(V / E) with E the mean
//! squared error and V the same against the mean pose of the judging pairs (eq. 8.4, 8.5), here over
//! joints in place of vertices. Every variant gets the same draws.

use super::error::MappingError;
use super::map::{Pair, scaled};
use super::regression::Regression;
use super::volume::LatentVolume;
use crate::base::random::SplitMix;

/// A map with a part of it left out or put in.
#[derive(Clone, Debug, PartialEq)]
pub struct Variant {
    /// Name in tables and plots.
    pub name: String,
    /// Velocities count (section 8.1.2).
    pub velocities: bool,
    /// Principal axes of the target; `None` learns the joints themselves.
    pub axes: Option<usize>,
    /// Coefficients are clipped to the volume (section 8.2.1).
    pub clipped: bool,
    /// Monomials x^1/2, x, x^2 of every input in place of x alone.
    pub polynomial: bool,
}

impl Variant {
    fn new(name: impl Into<String>) -> Self {
        Self {
            name: name.into(),
            velocities: true,
            axes: Some(usize::MAX),
            clipped: true,
            polynomial: false,
        }
    }

    /// The variants of figures 8.14 and 8.15, and the map with only `axes` principal axes for each of these.
    pub fn all(axes: &[usize]) -> Vec<Self> {
        let full = Self::new("latent");
        let mut all = vec![
            full,
            Self {
                velocities: false,
                ..Self::new("no-velocity")
            },
            Self {
                clipped: false,
                ..Self::new("pca")
            },
            Self {
                axes: None,
                clipped: false,
                ..Self::new("no-pca")
            },
            Self {
                polynomial: true,
                ..Self::new("polynomial")
            },
        ];
        all.extend(axes.iter().map(|d| Self {
            axes: Some(*d),
            ..Self::new(format!("latent-{d}"))
        }));
        all
    }

    /// The input that this variant learns from.
    fn input(&self, scaled: &[f64]) -> Vec<f64> {
        let used = if self.velocities {
            scaled.len()
        } else {
            scaled.len() / 2
        };
        let x = &scaled[..used];
        if !self.polynomial {
            return x.to_vec();
        }
        let root = x.iter().map(|v| v.abs().sqrt().copysign(*v));
        let square = x.iter().map(|v| v * v);
        root.chain(x.iter().copied()).chain(square).collect()
    }
}

/// How a study is run.
#[derive(Clone, Debug, PartialEq)]
pub struct StudyPlan {
    /// Variants compared.
    pub variants: Vec<Variant>,
    /// Numbers of training pairs.
    pub counts: Vec<usize>,
    /// Draws per number.
    pub splits: usize,
    /// sigma^2 of the regression.
    pub noise_variance: f64,
    /// Seed of the draws.
    pub seed: u64,
}

/// One point of a curve.
#[derive(Clone, Debug, PartialEq)]
pub struct Score {
    /// Name of the variant.
    pub variant: String,
    /// Training pairs.
    pub pairs: usize,
    /// Mean SNR over the draws, dB.
    pub snr_db: f64,
    /// Standard deviation over the draws, dB.
    pub deviation_db: f64,
    /// SNR of every draw, dB.
    pub draws_db: Vec<f64>,
}

/// Runs the study over `pairs`, whose sources have the spread `spread_m`; `frames` are the unlabelled
/// target motion.
///
/// # Errors
/// Counts that leave no pair to learn from or to judge by, pairs that teach nothing.
pub fn study(
    pairs: &[Pair],
    spread_m: f64,
    frames: &[Vec<f64>],
    plan: &StudyPlan,
) -> Result<Vec<Score>, MappingError> {
    for count in &plan.counts {
        // Two judges at least, or there is no variance to compare with.
        if *count < 2 || *count + 2 > pairs.len() {
            return Err(MappingError::Option {
                key: "counts",
                found: *count as f64,
                allowed: "2 to two less than the pairs given",
            });
        }
    }
    let inputs: Vec<Vec<f64>> = pairs
        .iter()
        .map(|pair| {
            let mut x = vec![0.0; pair.source.len()];
            scaled(&pair.source, spread_m, &mut x);
            x
        })
        .collect();
    let labels: Vec<String> = pairs.iter().map(|p| p.label.clone()).collect();
    let mut scores = Vec::new();
    for variant in &plan.variants {
        let volume = LatentVolume::learn(frames, variant.axes.unwrap_or(1))?;
        for count in &plan.counts {
            let mut chance = SplitMix::new(plan.seed ^ (*count as u64) << 32);
            let mut draws_db = Vec::new();
            for _ in 0..plan.splits {
                let order = shuffled(pairs.len(), &mut chance);
                let (taught, judging) = order.split_at(*count);
                let pick = |ks: &[usize]| -> Vec<Vec<f64>> {
                    ks.iter().map(|k| variant.input(&inputs[*k])).collect()
                };
                let targets: Vec<Vec<f64>> = taught
                    .iter()
                    .map(|k| match variant.axes {
                        Some(_) => {
                            let mut y = vec![0.0; volume.dimensions()];
                            volume.project(&pairs[*k].target, &mut y);
                            y
                        }
                        None => pairs[*k].target.clone(),
                    })
                    .collect();
                let names: Vec<String> = taught.iter().map(|k| labels[*k].clone()).collect();
                let map = Regression::fit(&pick(taught), &targets, &names, plan.noise_variance)?;
                let answers: Vec<Vec<f64>> = pick(judging)
                    .iter()
                    .map(|x| answer(variant, &volume, &map, x))
                    .collect();
                let truths: Vec<&[f64]> = judging.iter().map(|k| &pairs[*k].target[..]).collect();
                draws_db.push(snr_db(&answers, &truths));
            }
            let mean = draws_db.iter().sum::<f64>() / draws_db.len() as f64;
            let square: f64 = draws_db.iter().map(|d| (d - mean).powi(2)).sum();
            scores.push(Score {
                variant: variant.name.clone(),
                pairs: *count,
                snr_db: mean,
                deviation_db: (square / draws_db.len() as f64).sqrt(),
                draws_db,
            });
        }
    }
    Ok(scores)
}

fn answer(variant: &Variant, volume: &LatentVolume, map: &Regression, x: &[f64]) -> Vec<f64> {
    let mut pose = vec![0.0; volume.joints()];
    if variant.axes.is_none() {
        map.predict(x, &mut pose);
        return pose;
    }
    let mut coefficients = vec![0.0; volume.dimensions()];
    map.predict(x, &mut coefficients);
    if variant.clipped {
        volume.clip(&mut coefficients);
    }
    volume.back(&coefficients, &mut pose);
    pose
}

/// 10 log10(V / E) of eq. 8.4 and 8.5.
pub fn snr_db(answers: &[Vec<f64>], truths: &[&[f64]]) -> f64 {
    let count = truths.len() as f64;
    let joints = truths.first().map_or(0, |t| t.len());
    let mean: Vec<f64> = (0..joints)
        .map(|j| truths.iter().map(|t| t[j]).sum::<f64>() / count)
        .collect();
    let square = |a: &[f64], b: &[f64]| -> f64 {
        a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>()
    };
    let error: f64 = answers.iter().zip(truths).map(|(a, t)| square(a, t)).sum();
    let variance: f64 = truths.iter().map(|t| square(t, &mean)).sum();
    10.0 * (variance / error.max(1e-30)).log10()
}

/// Indices 0 to `count` in random order (Fisher-Yates).
fn shuffled(count: usize, chance: &mut SplitMix) -> Vec<usize> {
    let mut order: Vec<usize> = (0..count).collect();
    for at in (1..count).rev() {
        order.swap(at, (chance.bits() % (at as u64 + 1)) as usize);
    }
    order
}
