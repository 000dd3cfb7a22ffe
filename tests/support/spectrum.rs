//! The dominant frequency of motion.

/// Frequency with the most power summed over `signals` (sampled at `rate_hz`), Hann-windowed,
/// on a fine grid within `band_hz`, the peak interpolated.
pub fn dominant_hz(signals: &[Vec<f64>], rate_hz: f64, band_hz: (f64, f64)) -> f64 {
    const STEP_HZ: f64 = 0.01;
    let count = ((band_hz.1 - band_hz.0) / STEP_HZ) as usize;
    let powers: Vec<f64> = (0..=count)
        .map(|k| band_hz.0 + STEP_HZ * k as f64)
        .map(|hz| signals.iter().map(|s| power(s, hz / rate_hz)).sum())
        .collect();
    let best = (1..count)
        .max_by(|a, b| powers[*a].total_cmp(&powers[*b]))
        .expect("a band of some width");
    let (a, b, c) = (powers[best - 1], powers[best], powers[best + 1]);
    let curvature = a - 2.0 * b + c;
    let shift = if curvature < 0.0 {
        0.5 * (a - c) / curvature
    } else {
        0.0
    };
    band_hz.0 + STEP_HZ * (best as f64 + shift)
}

fn power(signal: &[f64], cycles_per_sample: f64) -> f64 {
    let mean = signal.iter().sum::<f64>() / signal.len() as f64;
    let (mut re, mut im) = (0.0, 0.0);
    for (index, value) in signal.iter().enumerate() {
        let u = (index as f64 + 0.5) / signal.len() as f64;
        let window = 0.5 - 0.5 * (std::f64::consts::TAU * u).cos();
        let angle = std::f64::consts::TAU * cycles_per_sample * index as f64;
        re += window * (value - mean) * angle.cos();
        im += window * (value - mean) * angle.sin();
    }
    re * re + im * im
}
