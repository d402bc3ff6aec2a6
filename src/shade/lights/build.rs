//! Building the light tree, top down.
//!
//! A node starts as one range of lights; the range of the highest cost is split until there are eight. The cost of a
//! range is its weight × squared diagonal × measure of the directions it shines in (the surface area orientation
//! heuristic of Conty Estevez and Kulla 2018, with the bounding sphere for the area and, for the cone, the cap whose
//! normals have the same mean). O(n log n).

use super::tree::{LEAF, LightTree, Node, Place, TRAIL_BITS, WIDTH};
use crate::math::alias::AliasTable;
use glam::Vec3;
use std::f32::consts::{FRAC_PI_2, PI};
use std::ops::Range;
use wide::f32x8;

/// Candidates for a split along an axis.
const BINS: usize = 16;

/// Largest leaf of lights that look alike.
const LARGEST_LEAF: usize = 4;

/// Levels that are split by cost; below them by count, so that a trail of 64 bits always suffices.
const COST_LEVELS: u32 = 8;

/// A light to the tree.
#[derive(Clone, Copy, Debug)]
pub(super) struct Emitter {
    /// Corners; equal for a point.
    pub corners: [Vec3; 3],
    /// Shines less than 90° from this unit vector; zero: everywhere.
    pub axis: Vec3,
    /// Radiant intensity along the axis: what it gives at distance 1, positive.
    pub weight: f64,
}

#[derive(Clone, Copy)]
struct Item {
    corners: [Vec3; 3],
    axis: Vec3,
    /// Relative to the largest.
    weight: f32,
    centre: Vec3,
    light: u32,
}

/// What the cost of a range of lights depends on.
#[derive(Clone, Copy)]
struct Bounds {
    lower: Vec3,
    upper: Vec3,
    weight: f32,
    /// Weighted sum of the axes.
    axis: Vec3,
}

/// The lights of one child.
struct Cluster {
    centre: Vec3,
    radius: f32,
    axis: Vec3,
    spread: f32,
    weight: f32,
}

impl Bounds {
    const EMPTY: Self =
        Self { lower: Vec3::INFINITY, upper: Vec3::NEG_INFINITY, weight: 0.0, axis: Vec3::ZERO };

    fn of(items: &[Item]) -> Self {
        items.iter().fold(Self::EMPTY, |bounds, item| bounds.with(item))
    }

    fn with(&self, item: &Item) -> Self {
        let [a, b, c] = item.corners;
        Self {
            lower: self.lower.min(a.min(b).min(c)),
            upper: self.upper.max(a.max(b).max(c)),
            weight: self.weight + item.weight,
            axis: self.axis + item.axis * item.weight,
        }
    }

    fn join(&self, o: &Self) -> Self {
        Self {
            lower: self.lower.min(o.lower),
            upper: self.upper.max(o.upper),
            weight: self.weight + o.weight,
            axis: self.axis + o.axis,
        }
    }

    fn cost(&self) -> f32 {
        if self.weight <= 0.0 {
            return 0.0;
        }
        let mean = (self.axis.length() / self.weight).min(1.0);
        // A cap of half-angle o has a mean axis of length (1 + cos o) / 2.
        let cos = 2.0 * mean - 1.0;
        let (o, sin) = (cos.acos(), (1.0 - cos * cos).max(0.0).sqrt());
        let w = (o + FRAC_PI_2).min(PI);
        let directions =
            2.0 * PI * (1.0 - cos) + FRAC_PI_2 * (2.0 * w * sin - (o - 2.0 * w).cos() - 2.0 * o * sin + cos);
        self.weight * (self.upper - self.lower).length_squared() * directions
    }
}

/// Bounds of the centres.
fn centres(items: &[Item]) -> (Vec3, Vec3) {
    let all = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    items.iter().fold(all, |(lower, upper), item| (lower.min(item.centre), upper.max(item.centre)))
}

/// Whether the lights stay together: one, all in one place, or few that look alike from everywhere.
fn is_leaf(items: &[Item]) -> bool {
    let (lower, upper) = centres(items);
    if lower == upper {
        return true;
    }
    if items.len() > LARGEST_LEAF {
        return false;
    }
    let all = Bounds::of(items);
    let diagonal = |b: &Bounds| (b.upper - b.lower).length();
    let largest = items.iter().map(|item| diagonal(&Bounds::EMPTY.with(item))).fold(0.0, f32::max);
    diagonal(&all) <= 1.5 * largest && all.axis.length() >= 0.95 * all.weight
}

/// Reorders the lights so that those `left` come first; returns how many.
fn partition(items: &mut [Item], left: impl Fn(&Item) -> bool) -> usize {
    let mut count = 0;
    for i in 0..items.len() {
        if left(&items[i]) {
            items.swap(i, count);
            count += 1;
        }
    }
    count
}

/// Which bin of an axis a centre falls into.
fn bin(centre: f32, lower: f32, extent: f32) -> usize {
    (((centre - lower) / extent * BINS as f32) as usize).min(BINS - 1)
}

/// The cheapest split along any axis: (axis, last bin on the left).
fn cheapest(items: &[Item], lower: Vec3, extent: Vec3) -> Option<(usize, usize)> {
    let mut best = None;
    let mut least = f32::INFINITY;
    for axis in (0..3).filter(|&axis| extent[axis] > 0.0) {
        let mut bins = [Bounds::EMPTY; BINS];
        for item in items {
            let bin = &mut bins[bin(item.centre[axis], lower[axis], extent[axis])];
            *bin = bin.with(item);
        }
        let mut right = [0.0; BINS];
        let mut joined = Bounds::EMPTY;
        for i in (1..BINS).rev() {
            joined = joined.join(&bins[i]);
            right[i] = if joined.weight > 0.0 { joined.cost() } else { f32::INFINITY };
        }
        // Thin slices are no better than their longest side.
        let stretch = extent.max_element() / extent[axis];
        let mut joined = Bounds::EMPTY;
        for i in 0..BINS - 1 {
            joined = joined.join(&bins[i]);
            let cost = stretch * (joined.cost() + right[i + 1]);
            if joined.weight > 0.0 && cost < least {
                least = cost;
                best = Some((axis, i));
            }
        }
    }
    best
}

/// Splits lights that are no leaf; returns how many are on the left, neither none nor all.
fn split(items: &mut [Item], by_cost: bool) -> usize {
    let (lower, upper) = centres(items);
    let extent = upper - lower;
    let found = by_cost.then(|| cheapest(items, lower, extent)).flatten();
    let count = found.map_or(0, |(axis, last)| {
        partition(items, |item| bin(item.centre[axis], lower[axis], extent[axis]) <= last)
    });
    if count > 0 && count < items.len() {
        return count;
    }
    let axis = extent.max_position();
    let middle = items.len() / 2;
    items.select_nth_unstable_by(middle, |a, b| a.centre[axis].total_cmp(&b.centre[axis]));
    middle
}

/// The ranges that become the children of a node.
fn children(items: &mut [Item], by_cost: bool) -> Vec<Range<usize>> {
    struct Part {
        range: Range<usize>,
        is_leaf: bool,
        cost: f32,
    }
    let part = |items: &[Item], range: Range<usize>| {
        let items = &items[range.clone()];
        let cost = if by_cost { Bounds::of(items).cost() } else { items.len() as f32 };
        Part { is_leaf: is_leaf(items), cost, range }
    };
    let mut parts = vec![part(items, 0..items.len())];
    while parts.len() < WIDTH {
        let open = (0..parts.len()).filter(|&i| !parts[i].is_leaf);
        let Some(widest) = open.max_by(|&a, &b| parts[a].cost.total_cmp(&parts[b].cost)) else { break };
        let range = parts[widest].range.clone();
        let middle = range.start + split(&mut items[range.clone()], by_cost);
        parts[widest] = part(items, range.start..middle);
        parts.push(part(items, middle..range.end));
    }
    parts.into_iter().map(|part| part.range).collect()
}

/// Sphere and cone around lights. `slack`, m, covers the rounding of positions.
fn cluster(items: &[Item], slack: f32) -> Cluster {
    let bounds = Bounds::of(items);
    let centre = 0.5 * bounds.lower + 0.5 * bounds.upper;
    let reach = |item: &Item| item.corners.map(|c| (c - centre).length()).into_iter().fold(0.0, f32::max);
    let radius = items.iter().map(reach).fold(0.0, f32::max) * 1.001 + slack;
    let everywhere = items.iter().any(|item| item.axis == Vec3::ZERO);
    let axis = if everywhere { Vec3::ZERO } else { bounds.axis.normalize_or_zero() };
    let cos = items.iter().map(|item| item.axis.dot(axis)).fold(1.0, f32::min);
    // Up to 90° the sine: cosθ + sin o is positive where θ < o + 90°. Beyond, no direction is dark.
    let spread = if cos > 0.0 { (1.0 - cos * cos).max(0.0).sqrt() } else { 1.0 - cos };
    Cluster { centre, radius, axis, spread: spread + 1e-3, weight: bounds.weight }
}

impl Node {
    /// From at most eight clusters and where they lead.
    fn new(clusters: &[(Cluster, u32)]) -> Self {
        let column = |f: fn(&Cluster) -> f32, empty: f32| {
            f32x8::new(std::array::from_fn(|i| clusters.get(i).map_or(empty, |(cluster, _)| f(cluster))))
        };
        Self {
            centre: [column(|c| c.centre.x, 0.0), column(|c| c.centre.y, 0.0), column(|c| c.centre.z, 0.0)],
            radius: column(|c| c.radius, 1.0),
            axis: [column(|c| c.axis.x, 0.0), column(|c| c.axis.y, 0.0), column(|c| c.axis.z, 0.0)],
            spread: column(|c| c.spread, 0.0),
            weight: column(|c| c.weight, 0.0),
            child: std::array::from_fn(|i| clusters.get(i).map_or(LEAF, |&(_, link)| link)),
        }
    }
}

impl LightTree {
    /// Builds the tree over lights in a scene with a diagonal of `extent` metres.
    pub fn new(emitters: &[Emitter], extent: f32) -> Self {
        let largest = emitters.iter().map(|e| e.weight).fold(0.0, f64::max);
        let mut items: Vec<Item> = emitters
            .iter()
            .enumerate()
            .map(|(i, e)| {
                let [a, b, c] = e.corners;
                Item {
                    corners: e.corners,
                    axis: e.axis,
                    // Bounded below: products of importances must not vanish in f32.
                    weight: (e.weight / largest).max(1e-20) as f32,
                    centre: (a.min(b).min(c) + a.max(b).max(c)) * 0.5,
                    light: i as u32,
                }
            })
            .collect();
        let mut tree = Self { places: vec![Place::default(); items.len()], ..Self::default() };
        if !items.is_empty() {
            let reach = items.iter().map(|i| i.centre.abs().max_element()).fold(0.0, f32::max);
            tree.root = tree.subtree(&mut items, 0, 0, 1e-5 * extent + 1e-6 * reach);
        }
        tree
    }

    /// Adds the subtree over `items`, found by `trail` at `level`, and returns the link to it.
    fn subtree(&mut self, items: &mut [Item], level: u32, trail: u64, slack: f32) -> u32 {
        if is_leaf(items) {
            return self.leaf(items, trail);
        }
        let index = self.nodes.len();
        self.nodes.push(Node::new(&[]));
        let mut clusters = Vec::with_capacity(WIDTH);
        for (i, range) in children(items, level < COST_LEVELS).into_iter().enumerate() {
            let items = &mut items[range];
            let trail = trail | (i as u64) << (TRAIL_BITS * level);
            clusters.push((cluster(items, slack), self.subtree(items, level + 1, trail, slack)));
        }
        self.nodes[index] = Node::new(&clusters);
        index as u32
    }

    /// Adds a leaf and returns the link to it.
    fn leaf(&mut self, items: &[Item], trail: u64) -> u32 {
        let table = AliasTable::new(items.iter().map(|item| f64::from(item.weight)))
            .expect("the weights are positive and finite");
        self.leaves.push((self.bins.len() as u32, items.len() as u32));
        self.bins.extend_from_slice(table.bins());
        for (i, item) in items.iter().enumerate() {
            self.order.push((item.light, table.pdf(i)));
            self.places[item.light as usize] = Place { trail, pdf: table.pdf(i) };
        }
        LEAF | (self.leaves.len() as u32 - 1)
    }
}
