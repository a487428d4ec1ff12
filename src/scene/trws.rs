//! Labels for the nodes of a graph by sequential tree-reweighted message passing (Kolmogorov 2006, TPAMI 28(10)).

/// A graph whose nodes each take one of a few labels, at a cost.
#[derive(Clone, Debug, Default)]
pub(super) struct LabelGraph {
    /// Cost of each label of each node.
    unary: Vec<Vec<f64>>,
    edges: Vec<Edge>,
}

#[derive(Clone, Debug)]
struct Edge {
    /// The lower and the higher node.
    nodes: [usize; 2],
    /// Cost of a pair of labels, those of the lower node by row.
    costs: Vec<f64>,
}

/// When to stop.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stop {
    /// No message changed by this much in an iteration.
    pub(super) eps: f64,
    /// Iterations, each forward and backward.
    pub(super) max_iterations: usize,
}

impl LabelGraph {
    /// Adds a node with the cost of each of its labels, of which there is at least one; returns its number.
    pub(super) fn add_node(&mut self, costs: Vec<f64>) -> usize {
        self.unary.push(costs);
        self.unary.len() - 1
    }

    /// Adds an edge between two nodes, `a < b`, with the cost of every pair of labels.
    pub(super) fn add_edge(&mut self, a: usize, b: usize, cost: impl Fn(usize, usize) -> f64) {
        let columns = self.unary[b].len();
        let costs = (0..self.unary[a].len() * columns).map(|i| cost(i / columns, i % columns)).collect();
        self.edges.push(Edge { nodes: [a, b], costs });
    }

    /// Sum of all costs of a labelling.
    pub(super) fn energy(&self, labels: &[usize]) -> f64 {
        let nodes: f64 = self.unary.iter().zip(labels).map(|(costs, &label)| costs[label]).sum();
        nodes + self.edges.iter().map(|e| self.cost(e, labels[e.nodes[0]], labels[e.nodes[1]])).sum::<f64>()
    }

    fn cost(&self, edge: &Edge, a: usize, b: usize) -> f64 {
        edge.costs[a * self.unary[edge.nodes[1]].len() + b]
    }

    /// A labelling of low energy, never of higher energy than `start`. Nodes are visited in their order, so the result
    /// is always the same.
    pub(super) fn solve(&self, start: Vec<usize>, stop: Stop) -> Vec<usize> {
        let mut messages = Messages::new(self);
        let mut best = (self.energy(&start), start);
        for _ in 0..stop.max_iterations {
            let labels = messages.forward();
            let energy = self.energy(&labels);
            if energy < best.0 {
                best = (energy, labels);
            }
            if messages.backward() < stop.eps {
                break;
            }
        }
        best.1
    }
}

/// The state of the passes.
struct Messages<'a> {
    graph: &'a LabelGraph,
    /// Per edge, what is said to the lower node if the pass before went backward, else to the higher one.
    messages: Vec<Vec<f64>>,
    /// What was said to lower nodes in the backward pass before.
    last: Vec<Vec<f64>>,
    /// Edges to lower and to higher nodes.
    lower: Vec<Vec<usize>>,
    higher: Vec<Vec<usize>>,
}

impl<'a> Messages<'a> {
    fn new(graph: &'a LabelGraph) -> Self {
        let count = graph.unary.len();
        let (mut lower, mut higher) = (vec![Vec::new(); count], vec![Vec::new(); count]);
        let mut messages = Vec::with_capacity(graph.edges.len());
        for (i, edge) in graph.edges.iter().enumerate() {
            higher[edge.nodes[0]].push(i);
            lower[edge.nodes[1]].push(i);
            messages.push(vec![0.0; graph.unary[edge.nodes[0]].len()]);
        }
        let last = messages.clone();
        Messages { graph, messages, last, lower, higher }
    }

    /// Cost of every label of `node` with all that its edges say.
    fn belief(&self, node: usize) -> Vec<f64> {
        let mut belief = self.graph.unary[node].clone();
        for &edge in self.lower[node].iter().chain(&self.higher[node]) {
            belief.iter_mut().zip(&self.messages[edge]).for_each(|(b, m)| *b += m);
        }
        belief
    }

    /// Share of a node's belief that each of its edges passes on.
    fn share(&self, node: usize) -> f64 {
        1.0 / self.lower[node].len().max(self.higher[node].len()).max(1) as f64
    }

    /// Passes messages from lower to higher nodes and labels every node on the way, given the labels before it.
    fn forward(&mut self) -> Vec<usize> {
        let mut labels = vec![0; self.graph.unary.len()];
        for node in 0..labels.len() {
            let belief = self.belief(node);
            let mut given = self.graph.unary[node].clone();
            for &edge in &self.higher[node] {
                given.iter_mut().zip(&self.messages[edge]).for_each(|(g, m)| *g += m);
            }
            for &edge in &self.lower[node] {
                let edge = &self.graph.edges[edge];
                let label = labels[edge.nodes[0]];
                given.iter_mut().enumerate().for_each(|(l, g)| *g += self.graph.cost(edge, label, l));
            }
            labels[node] = least(&given).0;
            let share = self.share(node);
            for edge in self.higher[node].clone() {
                self.pass_on(edge, &belief, share, |cost, own, other| cost(own, other), 1);
            }
        }
        labels
    }

    /// Passes messages from higher to lower nodes; returns the largest change of what is said to a lower node since the
    /// last time.
    fn backward(&mut self) -> f64 {
        let mut change = 0.0f64;
        for node in (0..self.graph.unary.len()).rev() {
            let belief = self.belief(node);
            let share = self.share(node);
            for edge in self.lower[node].clone() {
                self.pass_on(edge, &belief, share, |cost, own, other| cost(other, own), 0);
                for (now, before) in self.messages[edge].iter().zip(&mut self.last[edge]) {
                    change = change.max((now - *before).abs());
                    *before = *now;
                }
            }
        }
        change
    }

    /// Replaces the message of `edge` by the one to its node `to` (0 lower, 1 higher).
    fn pass_on(
        &mut self,
        edge: usize,
        belief: &[f64],
        share: f64,
        cost_of: impl Fn(&dyn Fn(usize, usize) -> f64, usize, usize) -> f64,
        to: usize,
    ) {
        let graph = self.graph;
        let cost = |a: usize, b: usize| graph.cost(&graph.edges[edge], a, b);
        let own: Vec<f64> = belief.iter().zip(&self.messages[edge]).map(|(b, m)| share * b - m).collect();
        let mut message: Vec<f64> = (0..graph.unary[graph.edges[edge].nodes[to]].len())
            .map(|other| {
                let reached = own.iter().enumerate().map(|(label, c)| c + cost_of(&cost, label, other));
                reached.fold(f64::INFINITY, f64::min)
            })
            .collect();
        let (_, smallest) = least(&message);
        message.iter_mut().for_each(|m| *m -= smallest);
        self.messages[edge] = message;
    }
}

/// The first of the smallest costs.
fn least(costs: &[f64]) -> (usize, f64) {
    let mut best = (0, f64::INFINITY);
    for (label, &cost) in costs.iter().enumerate() {
        if cost < best.1 {
            best = (label, cost);
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;

    const STOP: Stop = Stop { eps: 1e-9, max_iterations: 200 };

    struct Random(u64);

    impl Random {
        fn next(&mut self) -> f64 {
            self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (self.0 >> 40) as f64 / (1u64 << 24) as f64
        }
    }

    /// All labellings, tried one by one.
    fn smallest_energy(graph: &LabelGraph) -> f64 {
        let mut labels = vec![0; graph.unary.len()];
        let mut best = f64::INFINITY;
        loop {
            best = best.min(graph.energy(&labels));
            let Some(i) = (0..labels.len()).find(|&i| labels[i] + 1 < graph.unary[i].len()) else {
                return best;
            };
            labels[i] += 1;
            labels[..i].fill(0);
        }
    }

    fn random_graph(random: &mut Random, nodes: usize, density: f64) -> LabelGraph {
        let mut graph = LabelGraph::default();
        for _ in 0..nodes {
            let labels = 2 + (random.next() * 3.0) as usize;
            graph.add_node((0..labels).map(|_| random.next() * 4.0).collect());
        }
        for b in 1..nodes {
            for a in 0..b {
                if a + 1 == b || random.next() < density {
                    let costs: Vec<f64> = (0..25).map(|_| random.next() * 2.0).collect();
                    graph.add_edge(a, b, |i, j| costs[i * 5 + j]);
                }
            }
        }
        graph
    }

    #[test]
    fn trees_are_solved_exactly() {
        let mut random = Random(1);
        for _ in 0..200 {
            let graph = random_graph(&mut random, 7, 0.0);
            let labels = graph.solve(vec![0; 7], STOP);
            assert!((graph.energy(&labels) - smallest_energy(&graph)).abs() < 1e-9);
        }
    }

    #[test]
    fn graphs_with_loops_come_near_the_optimum_and_never_end_above_the_start() {
        let mut random = Random(2);
        let (mut exact, mut excess) = (0, 0.0f64);
        for _ in 0..200 {
            let graph = random_graph(&mut random, 7, 0.4);
            let start = vec![1; 7];
            let before = graph.energy(&start);
            let labels = graph.solve(start, STOP);
            let (energy, best) = (graph.energy(&labels), smallest_energy(&graph));
            assert!(energy <= before && energy >= best - 1e-9);
            exact += usize::from(energy < best + 1e-9);
            excess = excess.max(energy / best);
        }
        assert!(exact > 150 && excess < 1.15, "{exact} of 200 exact, at most {excess} times the optimum");
    }

    #[test]
    fn nodes_without_edges_take_their_best_label() {
        let mut graph = LabelGraph::default();
        graph.add_node(vec![2.0, 1.0, 1.0]);
        graph.add_node(vec![0.5]);
        assert_eq!(graph.solve(vec![0, 0], STOP), [1, 0]);
    }
}
