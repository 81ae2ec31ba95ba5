//! Groups lights that are near each other, shine the same way and are alike in power.

use super::bounds::LightBounds;

/// Candidate planes are between this many slices along an axis.
const BUCKETS: usize = 12;
/// Groups with more lights are only sliced along their longest axis, and in parallel.
const LARGE: usize = 4096;

/// A light, or two groups.
#[derive(Debug)]
pub(super) enum Group {
    Light(LightBounds, u32),
    Pair(LightBounds, Box<[Group; 2]>),
}

impl Group {
    /// Bounds of all its lights.
    pub(super) fn bounds(&self) -> &LightBounds {
        match self {
            Self::Light(bounds, _) | Self::Pair(bounds, _) => bounds,
        }
    }

    /// The number of the light, if it is one.
    pub(super) fn light(&self) -> Option<u32> {
        match self {
            Self::Light(_, light) => Some(*light),
            Self::Pair(..) => None,
        }
    }

    /// Up to `most` groups (one at least) that make up this one, opened where that gains most.
    pub(super) fn open(&self, most: usize) -> Vec<&Self> {
        let mut open = vec![self];
        while open.len() < most {
            let pairs = (0..open.len()).filter(|&i| open[i].light().is_none());
            let cost = |i: &usize| open[*i].bounds().cost();
            let Some(widest) = pairs.max_by(|a, b| cost(a).total_cmp(&cost(b))) else { break };
            let Self::Pair(_, halves) = open[widest] else { unreachable!("only pairs were looked at") };
            open[widest] = &halves[0];
            open.push(&halves[1]);
        }
        open
    }
}

/// A light to be grouped.
#[derive(Clone, Copy)]
struct Item {
    bounds: LightBounds,
    light: u32,
}

/// A binary tree over the lights that have power and finite bounds; none where there are none.
pub(super) fn binary(lights: &[LightBounds]) -> Option<Group> {
    let shines = |b: &LightBounds| {
        b.power > 0.0 && b.power.is_finite() && b.bounds.min.is_finite() && b.bounds.max.is_finite()
    };
    let mut items: Vec<Item> = (0u32..)
        .zip(lights)
        .filter(|(_, bounds)| shines(bounds))
        .map(|(light, &bounds)| Item { bounds, light })
        .collect();
    (!items.is_empty()).then(|| group(&mut items))
}

fn group(items: &mut [Item]) -> Group {
    if let [item] = items {
        return Group::Light(item.bounds, item.light);
    }
    let middle = partition(items);
    let large = items.len() > LARGE;
    let (left, right) = items.split_at_mut(middle);
    let halves =
        if large { rayon::join(|| group(left), || group(right)) } else { (group(left), group(right)) };
    Group::Pair(halves.0.bounds().union(halves.1.bounds()), Box::new([halves.0, halves.1]))
}

/// Sorts two or more items into two parts, none of them empty; returns where the second starts.
fn partition(items: &mut [Item]) -> usize {
    let center = |item: &Item| item.bounds.center();
    let (mut min, mut max) = (center(&items[0]), center(&items[0]));
    for item in items.iter() {
        (min, max) = (min.min(center(item)), max.max(center(item)));
    }
    let extent = max - min;
    let longest = extent.max_position();
    let axes = if items.len() > LARGE { longest..longest + 1 } else { 0..3 };
    let slice = |item: &Item, axis: usize| {
        let place = (center(item)[axis] - min[axis]) / extent[axis] * BUCKETS as f32;
        (place as usize).min(BUCKETS - 1)
    };
    let mut best: Option<(f32, usize, usize)> = None;
    for axis in axes.filter(|&axis| extent[axis] > 0.0) {
        let mut buckets = [None; BUCKETS];
        for item in items.iter() {
            let bucket = &mut buckets[slice(item, axis)];
            *bucket = merged(*bucket, Some(item.bounds));
        }
        // Thin slices are wide across (section 4.3 of the paper): longer axes are the better ones to cut.
        let stretch = extent[longest] / extent[axis];
        for (cut, cost) in costs(&buckets) {
            let cost = stretch * cost;
            if best.is_none_or(|best| cost < best.0) {
                best = Some((cost, axis, cut));
            }
        }
    }
    // Lights in one place cannot be told apart by it: any halves will do.
    let Some((_, axis, cut)) = best else { return items.len() / 2 };
    let mut middle = 0;
    for i in 0..items.len() {
        if slice(&items[i], axis) <= cut {
            items.swap(i, middle);
            middle += 1;
        }
    }
    middle
}

/// The cost of cutting after each bucket, where both sides have lights.
fn costs(buckets: &[Option<LightBounds>; BUCKETS]) -> impl Iterator<Item = (usize, f32)> {
    let mut below = *buckets;
    let mut above = *buckets;
    for i in 1..BUCKETS {
        below[i] = merged(below[i - 1], below[i]);
        let i = BUCKETS - 1 - i;
        above[i] = merged(above[i], above[i + 1]);
    }
    (0..BUCKETS - 1).filter_map(move |cut| Some((cut, below[cut]?.cost() + above[cut + 1]?.cost())))
}

fn merged(a: Option<LightBounds>, b: Option<LightBounds>) -> Option<LightBounds> {
    match (a, b) {
        (Some(a), Some(b)) => Some(a.union(&b)),
        _ => a.or(b),
    }
}
