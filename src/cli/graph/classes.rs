//! A character's classes of clips as the search sees them, and its edges measured.

use crate::cli::Failure;
use crate::config::Character;
use crate::motion::search::clip_blend::ClipBlend;
use crate::motion::search::{DistanceTables, SearchClass};
use std::sync::Arc;

/// Frames per clip.
pub(super) const FRAMES: usize = 40;

/// Classes in node order; `None` for a pose map.
pub(super) fn classes(
    character: &Character,
    frames: usize,
) -> Result<Vec<Option<Arc<SearchClass>>>, Failure> {
    let space = character.body.space.shared();
    let mut made = Vec::new();
    for parts in &character.classes {
        if parts.map.is_some() {
            made.push(None);
            continue;
        }
        let blend = ClipBlend::new(&parts.name, parts.examples(), &space)
            .map_err(|e| Failure::input(format!("{}: {e}", character.config_name)))?;
        let class = blend
            .search_class(frames, blend.steps())
            .map_err(|e| Failure::input(format!("{}: {e}", character.config_name)))?;
        made.push(Some(Arc::new(class)));
    }
    Ok(made)
}

/// The most similar pair of poses of an edge.
pub(super) struct BestPair {
    /// Clip and normalised time in the class that is left.
    pub(super) exit: (String, f64),
    /// The same in the class that is entered.
    pub(super) entry: (String, f64),
    /// 0..1.
    pub(super) similarity: f64,
    /// Root mean square over the body's points, mm.
    pub(super) distance_mm: f64,
    /// Distance of the least similar pair, mm.
    pub(super) largest_mm: f64,
}

pub(super) fn best_pair(
    source: &SearchClass,
    target: &SearchClass,
    tables: &DistanceTables,
) -> BestPair {
    let mut best = (f64::INFINITY, 0, 0, 0, 0);
    for ks in 0..source.frames() {
        for kd in 0..target.frames() {
            for (cell, d) in tables.block(ks, kd).iter().enumerate() {
                if *d < best.0 {
                    let columns = target.references();
                    best = (*d, ks, kd, cell / columns, cell % columns);
                }
            }
        }
    }
    let (d, ks, kd, i, j) = best;
    BestPair {
        exit: (source.clips[i].clone(), source.time_of(ks)),
        entry: (target.clips[j].clone(), target.time_of(kd)),
        similarity: tables.similarity_of(d),
        distance_mm: 1e3 * d.sqrt(),
        largest_mm: 1e3 * tables.d_max().sqrt(),
    }
}

/// Edges between two classes of clips: their nodes, tables and best pair.
pub(super) struct Edge {
    pub(super) from: usize,
    pub(super) to: usize,
    pub(super) tables: DistanceTables,
    pub(super) best: BestPair,
}

pub(super) fn edges(
    character: &Character,
    classes: &[Option<Arc<SearchClass>>],
) -> Result<Vec<Edge>, Failure> {
    let mut measured = Vec::new();
    for (from, to) in character.graph().1 {
        let (Some(source), Some(target)) = (&classes[*from], &classes[*to]) else {
            continue;
        };
        let tables = DistanceTables::new(source, target).map_err(Failure::input)?;
        let best = best_pair(source, target, &tables);
        measured.push(Edge {
            from: *from,
            to: *to,
            tables,
            best,
        });
    }
    Ok(measured)
}
