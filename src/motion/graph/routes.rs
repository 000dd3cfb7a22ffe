//! Routes through the motion graph: where to go next on the cheapest way to a class.

/// Next node on the cheapest way between any two nodes.
#[derive(Clone, Debug)]
pub struct Routes {
    nodes: usize,
    /// Nodes x nodes: the next node from row towards column.
    next: Vec<Option<usize>>,
    cost: Vec<f64>,
}

impl Routes {
    /// Cheapest ways over `edges`: (from, to, cost), costs above zero. Out-of-range edges, loops and costs
    /// that are not finite are left out. Cost: nodes cubed (Floyd and Warshall).
    pub fn new(nodes: usize, edges: &[(usize, usize, f64)]) -> Self {
        let mut next = vec![None; nodes * nodes];
        let mut cost = vec![f64::INFINITY; nodes * nodes];
        for (from, to, c) in edges {
            let usable = *from < nodes && *to < nodes && from != to && *c > 0.0 && c.is_finite();
            if usable && *c < cost[from * nodes + to] {
                cost[from * nodes + to] = *c;
                next[from * nodes + to] = Some(*to);
            }
        }
        for via in 0..nodes {
            for from in 0..nodes {
                for to in 0..nodes {
                    let through = cost[from * nodes + via] + cost[via * nodes + to];
                    // The margin keeps rounding from making a detour of equal cost.
                    if from != to && through < cost[from * nodes + to] - 1e-12 {
                        cost[from * nodes + to] = through;
                        next[from * nodes + to] = next[from * nodes + via];
                    }
                }
            }
        }
        Self { nodes, next, cost }
    }

    /// The next node from `from` on the way to `to`; `None` when there is no way or they are the same.
    pub fn next(&self, from: usize, to: usize) -> Option<usize> {
        self.next[from * self.nodes + to]
    }

    /// Cost of the whole way; infinite when there is none.
    pub fn cost(&self, from: usize, to: usize) -> f64 {
        if from == to {
            0.0
        } else {
            self.cost[from * self.nodes + to]
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_cheapest_way_may_lead_through_others_and_dead_ends_have_none() {
        let routes = Routes::new(
            4,
            &[
                (0, 1, 1.0),
                (1, 2, 1.0),
                (0, 2, 5.0),
                (2, 3, 1.0),
                (3, 3, 1.0),
                (9, 0, 1.0),
            ],
        );
        assert_eq!(routes.next(0, 2), Some(1));
        assert_eq!(routes.next(0, 3), Some(1));
        assert!((routes.cost(0, 3) - 3.0).abs() < 1e-12);
        assert_eq!(routes.next(3, 0), None);
        assert_eq!(routes.next(2, 2), None);
    }
}
