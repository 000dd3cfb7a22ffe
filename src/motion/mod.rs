//! Motion: clips, classes, graph, transitions.
