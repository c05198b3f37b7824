//! Minimum cut of a graph (Dinic, 1970), in integers.

use std::collections::VecDeque;

struct Arc {
    to: u32,
    left: i64,
}

/// A graph between a source, which stands for the inside, and a sink, which stands for the outside.
pub(super) struct Graph {
    arcs: Vec<Arc>,
    of_node: Vec<Vec<u32>>,
    source: usize,
    sink: usize,
}

impl Graph {
    pub fn new(nodes: usize) -> Graph {
        Graph { arcs: Vec::new(), of_node: vec![Vec::new(); nodes + 2], source: nodes, sink: nodes + 1 }
    }

    /// Adds the costs of a node: if it ends outside, and if it ends inside.
    pub fn add_node(&mut self, node: usize, if_outside: i64, if_inside: i64) {
        if if_outside > 0 {
            self.add_border(self.source, node, if_outside, 0);
        }
        if if_inside > 0 {
            self.add_border(node, self.sink, if_inside, 0);
        }
    }

    /// Adds the cost of `inside` ending inside while `outside` ends outside, and of the reverse.
    pub fn add_border(&mut self, inside: usize, outside: usize, cost: i64, reverse: i64) {
        for (from, to, left) in [(inside, outside, cost), (outside, inside, reverse)] {
            self.of_node[from].push(self.arcs.len() as u32);
            self.arcs.push(Arc { to: to as u32, left });
        }
    }

    /// Returns which nodes are inside; of several minimum cuts the one with the smallest inside.
    pub fn inside(mut self) -> Vec<bool> {
        let mut level = self.levels();
        while level[self.sink] != u32::MAX {
            let mut next = vec![0usize; self.of_node.len()];
            while self.augment(&level, &mut next) {}
            level = self.levels();
        }
        level.truncate(self.source);
        level.into_iter().map(|level| level != u32::MAX).collect()
    }

    /// Returns the distance of each node from the source in arcs that have capacity left.
    fn levels(&self) -> Vec<u32> {
        let mut level = vec![u32::MAX; self.of_node.len()];
        level[self.source] = 0;
        let mut open = VecDeque::from([self.source]);
        while let Some(node) = open.pop_front() {
            for arc in self.of_node[node].iter().map(|arc| &self.arcs[*arc as usize]) {
                if arc.left > 0 && level[arc.to as usize] == u32::MAX {
                    level[arc.to as usize] = level[node] + 1;
                    open.push_back(arc.to as usize);
                }
            }
        }
        level
    }

    /// Sends flow along one path of the level graph; returns whether there was one.
    fn augment(&mut self, level: &[u32], next: &mut [usize]) -> bool {
        let mut path: Vec<u32> = Vec::new();
        let mut node = self.source;
        loop {
            if node == self.sink {
                let flow = path.iter().map(|arc| self.arcs[*arc as usize].left).min().unwrap_or(0);
                for arc in path {
                    self.arcs[arc as usize].left -= flow;
                    self.arcs[arc as usize ^ 1].left += flow;
                }
                return true;
            }
            let arcs = &self.of_node[node];
            let onwards = (next[node]..arcs.len()).find(|place| {
                let arc = &self.arcs[arcs[*place] as usize];
                arc.left > 0 && level[arc.to as usize] == level[node] + 1
            });
            match onwards {
                Some(place) => {
                    next[node] = place;
                    path.push(arcs[place]);
                    node = self.arcs[arcs[place] as usize].to as usize;
                }
                None => {
                    next[node] = arcs.len();
                    let Some(back) = path.pop() else { return false };
                    node = self.arcs[back as usize ^ 1].to as usize;
                    next[node] += 1;
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_cheapest_border_is_cut() {
        // A chain from inside to outside: its second border is the cheapest.
        let mut graph = Graph::new(4);
        graph.add_node(0, 100, 0);
        graph.add_node(3, 0, 100);
        for (node, cost) in [(0, 9), (1, 2), (2, 9)] {
            graph.add_border(node, node + 1, cost, 0);
        }
        assert_eq!(graph.inside(), [true, true, false, false]);
    }

    #[test]
    fn a_node_follows_its_own_costs() {
        let mut graph = Graph::new(2);
        graph.add_node(0, 5, 1);
        graph.add_node(1, 1, 5);
        graph.add_border(0, 1, 3, 3);
        assert_eq!(graph.inside(), [true, false]);
        let mut tied = Graph::new(2);
        tied.add_node(0, 5, 1);
        tied.add_node(1, 1, 5);
        tied.add_border(0, 1, 50, 50);
        // Equal costs: the smallest inside.
        assert_eq!(tied.inside(), [false, false]);
    }
}
