//! The comparison of Table 4.2: online search at several depths, stored transitions, all pairs.

use super::State;
use super::calibrate::{Calibration, calibrate, random_requests};
use super::class::SearchClass;
use super::find::{OptionsError, Search, SearchOptions, Target};
use super::stored::StoredTransitions;
use super::tables::DistanceTables;
use crate::base::Clock;
use std::sync::Arc;

/// Depths searched online.
const DEPTHS: [usize; 4] = [3, 5, 10, 12];
/// Depth of the paper's table, at which kappa is calibrated and all pairs are visited.
const DEPTH: usize = 10;
/// Numbers of stored transitions.
const STORED: [usize; 3] = [1, 5, 10];
/// Requests that kappa is calibrated with; others than those of the study.
const CALIBRATION_REQUESTS: usize = 20;
/// Passes over all requests, of which the quickest counts for each.
const PASSES: usize = 5;
/// Nodes of a trellis from which on all pairs take seconds and are visited once.
const MANY_PARAMETERS: usize = 3;

/// What is compared.
#[derive(Copy, Clone, Debug, PartialEq)]
pub struct StudyOptions {
    /// Random requests, the same for every method.
    pub requests: usize,
    /// Where they begin.
    pub seed: u64,
    /// Options of all searches; depth and kappa are set by the study.
    pub search: SearchOptions,
}

/// One method's figures, means over the requests.
#[derive(Clone, Debug, PartialEq)]
pub struct MethodRow {
    /// `online-DEPTH`, `stored-POINTS` or `exhaustive-DEPTH`.
    pub method: String,
    /// `E_S + lambda E_L`.
    pub cost: f64,
    /// `E_S`.
    pub e_s: f64,
    /// Latency, seconds.
    pub latency_s: f64,
    /// Median over the requests of the time one takes, microseconds; the best of several passes each.
    pub time_us: f64,
}

/// The rows and what they were measured with.
#[derive(Clone, Debug, PartialEq)]
pub struct StudyResult {
    /// One row per method.
    pub rows: Vec<MethodRow>,
    /// The kappa used.
    pub calibration: Calibration,
    /// Requests used: those that every method can answer (an open class may have passed all stored points).
    pub requests: usize,
    /// Largest difference of the cost of a request between the search and all pairs.
    pub off: f64,
}

/// Compares the methods on one edge. `clock` measures.
///
/// # Errors
/// Classes that cannot be compared, options out of range.
pub fn study(
    source: &Arc<SearchClass>,
    target: &Arc<SearchClass>,
    options: &StudyOptions,
    clock: &dyn Clock,
) -> Result<StudyResult, OptionsError> {
    let tables = Arc::new(DistanceTables::new(source, target)?);
    let search_at = |l_max: usize, kappa: f64| {
        let options = SearchOptions {
            l_max,
            kappa,
            ..options.search
        };
        Search::new(source.clone(), target.clone(), tables.clone(), options)
    };
    let mut judge = search_at(DEPTH, options.search.kappa)?;
    let others = random_requests(&judge, CALIBRATION_REQUESTS, !options.seed);
    let calibration = calibrate(&mut judge, &others)?;
    let mut stored: Vec<(usize, StoredTransitions)> = STORED
        .iter()
        .map(|count| {
            let (source, target) = (source.clone(), target.clone());
            let points =
                StoredTransitions::new(source, target, tables.clone(), *count, judge.options());
            (*count, points)
        })
        .collect();
    let mut requests = random_requests(&judge, 20 * options.requests, options.seed);
    requests.retain(|(from, to)| stored.iter_mut().all(|(_, s)| s.find(from, to).is_some()));
    requests.truncate(options.requests);

    let mut rows = Vec::new();
    let mut costs = Vec::new();
    for depth in DEPTHS {
        let mut search = search_at(depth, calibration.kappa)?;
        let (row, all) = measure(&requests, PASSES, clock, &mut |from, to| {
            online(search.find(from, &Target::State(*to)))
        });
        if depth == DEPTH {
            costs = all;
        }
        rows.push(named(format!("online-{depth}"), row));
    }
    for (count, points) in &mut stored {
        let (row, _) = measure(&requests, PASSES, clock, &mut |from, to| {
            let found = points.find(from, to)?;
            Some([found.cost.total(), found.cost.similarity, found.latency_s])
        });
        rows.push(named(format!("stored-{count}"), row));
    }
    let nodes = source.parameters().max(target.parameters());
    let passes = if nodes >= MANY_PARAMETERS { 1 } else { PASSES };
    let (row, all) = measure(&requests, passes, clock, &mut |from, to| {
        online(judge.exhaustive(from, &Target::State(*to)))
    });
    rows.push(named(format!("exhaustive-{DEPTH}"), row));
    let off = costs.iter().zip(&all).map(|(a, b)| (a - b).abs());
    Ok(StudyResult {
        rows,
        calibration,
        requests: requests.len(),
        off: off.fold(0.0, f64::max),
    })
}

type Answer = Option<[f64; 3]>;

fn online<E>(found: Result<super::Found, E>) -> Answer {
    let found = found.ok()?;
    Some([found.cost.total(), found.cost.similarity, found.latency_s])
}

fn named(method: String, [cost, e_s, latency_s, time_us]: [f64; 4]) -> MethodRow {
    MethodRow {
        method,
        cost,
        e_s,
        latency_s,
        time_us,
    }
}

/// Means of cost, E_S and latency, the median time in microseconds; and every request's cost.
fn measure(
    requests: &[(State, State)],
    passes: usize,
    clock: &dyn Clock,
    answer: &mut dyn FnMut(&State, &State) -> Answer,
) -> ([f64; 4], Vec<f64>) {
    let mut times = vec![f64::INFINITY; requests.len()];
    let mut answers = vec![[f64::NAN; 3]; requests.len()];
    for _ in 0..passes {
        for (index, (from, to)) in requests.iter().enumerate() {
            let before = clock.now();
            let found = answer(from, to);
            let took_us = clock.now().saturating_since(before).as_secs_f64() * 1e6;
            times[index] = times[index].min(took_us);
            answers[index] = found.unwrap_or([f64::NAN; 3]);
        }
    }
    times.sort_by(f64::total_cmp);
    let count = requests.len().max(1) as f64;
    let mean = |d: usize| answers.iter().map(|a| a[d]).sum::<f64>() / count;
    let median = times.get(times.len() / 2).copied().unwrap_or(f64::NAN);
    let costs = answers.iter().map(|a| a[0]).collect();
    ([mean(0), mean(1), mean(2), median], costs)
}
