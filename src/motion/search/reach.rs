//! Which nodes of a motion graph can be reached, and from which there is a way back.

/// What is wrong with the shape of a graph.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Reach {
    /// Nodes that no way from the start leads to.
    pub unreachable: Vec<usize>,
    /// Nodes that can be reached but from which no way leads back to the start.
    pub dead_ends: Vec<usize>,
}

/// Follows the edges (from, to) of a graph of `nodes` nodes from `start`, forwards and backwards.
pub fn reach(nodes: usize, start: usize, edges: &[(usize, usize)]) -> Reach {
    let follow = |step: &dyn Fn(&(usize, usize)) -> (usize, usize)| {
        let mut seen = vec![false; nodes];
        if let Some(first) = seen.get_mut(start) {
            *first = true;
        }
        // A way is never longer than there are nodes.
        for _ in 0..nodes {
            for (from, to) in edges.iter().map(step) {
                if from < nodes && to < nodes && seen[from] {
                    seen[to] = true;
                }
            }
        }
        seen
    };
    let out = follow(&|edge| *edge);
    let back = follow(&|(from, to)| (*to, *from));
    Reach {
        unreachable: (0..nodes).filter(|n| !out[*n]).collect(),
        dead_ends: (0..nodes).filter(|n| out[*n] && !back[*n]).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_node_without_a_way_in_or_back_is_named() {
        // 0 -> 1 -> 0, 1 -> 2 (no way back), 3 -> 0 (no way in), 4 alone.
        let found = reach(5, 0, &[(0, 1), (1, 0), (1, 2), (3, 0)]);
        assert_eq!(found.unreachable, [3, 4]);
        assert_eq!(found.dead_ends, [2]);
        assert_eq!(reach(1, 0, &[]), Reach::default());
        assert_eq!(reach(0, 0, &[(7, 9)]), Reach::default());
    }
}
