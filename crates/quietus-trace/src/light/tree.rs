//! A hierarchy over lights: descends to one light by how much each group of lights may do for the receiver.
//!
//! Conty Estevez and Kulla 2018, "Importance Sampling of Many Lights with Adaptive Tree Splitting", with nodes of
//! eight children whose importances are computed at once. Wide nodes look at lights more closely than narrow ones
//! do (fewer bounds of bounds between the root and a light), and up to eight lights are compared directly. The
//! probability of a given light is found on the way back, from the light to the root.

use super::bounds::{LightBounds, Receiver};
use super::build;
use crate::isa::{Isa, Lanes};

/// Children of a node.
pub(super) const WIDTH: usize = 8;

/// Set in a child's link where it is a light and not a node.
pub(super) const LEAF: u32 = 1 << 31;

/// The place of a light that is in no node.
const NOWHERE: u32 = u32::MAX;

/// Least cosine that light may leave a group with, unless it cannot leave at all: the bounds of spot lights end
/// where their light does, not where the cosine does.
const LEAST_COSINE: f32 = 0.01;

/// Keeps distances above 0.
const TINY: f32 = 1e-30;

/// Eight children, property by property.
#[derive(Clone, Debug, Default)]
#[repr(align(64))]
struct Node {
    center: [Lanes; 3],
    /// Half the diagonal.
    radius: Lanes,
    /// One over its square; infinite for points.
    inverse_radius2: Lanes,
    axis: [Lanes; 3],
    cos_o: Lanes,
    sin_o: Lanes,
    cos_e: Lanes,
    /// -1 where light is sent against the axis too, else 1.
    back: Lanes,
    /// 0 in lanes without a child.
    intensity: Lanes,
    links: [u32; WIDTH],
    /// How many children there are, in the lowest lanes.
    count: u32,
    /// The place of this node in its parent, see [`place`].
    place: u32,
}

/// The hierarchy.
#[derive(Clone, Debug)]
pub(super) struct LightTree {
    nodes: Vec<Node>,
    /// For every light, where it is.
    places: Vec<u32>,
}

/// A lane of a node.
fn place(node: usize, lane: usize) -> u32 {
    (node * WIDTH + lane) as u32
}

/// What a node's children may do for a receiver, and the sum.
struct Importances {
    lanes: [f32; WIDTH],
    sum: f32,
    /// How many of the lanes are children.
    count: usize,
}

impl LightTree {
    /// A tree over `lights`; those without power, or with bounds that are not finite, stay out. None where all do.
    pub(super) fn new(lights: &[LightBounds]) -> Option<Self> {
        let mut tree = Self { nodes: Vec::new(), places: vec![NOWHERE; lights.len()] };
        let root = build::binary(lights)?;
        tree.append(&root, NOWHERE);
        Some(tree)
    }

    /// Writes out a subtree and returns its node's number.
    fn append(&mut self, group: &build::Group, place_in_parent: u32) -> u32 {
        let number = self.nodes.len();
        self.nodes.push(Node { place: place_in_parent, ..Node::default() });
        for (lane, child) in group.open(WIDTH).into_iter().enumerate() {
            let here = place(number, lane);
            let link = match child.light() {
                Some(light) => {
                    self.places[light as usize] = here;
                    light | LEAF
                }
                None => self.append(child, here),
            };
            self.nodes[number].set(lane, child.bounds(), link);
        }
        number as u32
    }

    /// How much irradiance all lights together may cause, were nothing in between.
    #[inline(always)]
    pub(super) fn irradiance<I: Isa>(&self, isa: I, receiver: &Receiver) -> f32 {
        self.nodes[0].importances(isa, receiver).sum
    }

    /// A light and the probability of choosing it, for `u` in `[0, 1)`; none where none can be seen to matter.
    #[inline(always)]
    pub(super) fn sample<I: Isa>(&self, isa: I, receiver: &Receiver, mut u: f32) -> Option<(u32, f32)> {
        let (mut probability, mut node) = (1.0, &self.nodes[0]);
        loop {
            let importances = node.importances(isa, receiver);
            let (lane, share) = importances.choose(&mut u)?;
            probability *= share;
            let link = node.links[lane];
            if link & LEAF != 0 {
                return Some((link & !LEAF, probability));
            }
            node = &self.nodes[link as usize];
        }
    }

    /// The probability with which [`Self::sample`] chooses `light`.
    #[inline(always)]
    pub(super) fn probability<I: Isa>(&self, isa: I, receiver: &Receiver, light: u32) -> f32 {
        let mut probability = 1.0;
        let mut place = self.places[light as usize];
        if place == NOWHERE {
            return 0.0;
        }
        while place != NOWHERE {
            let node = &self.nodes[place as usize / WIDTH];
            let importances = node.importances(isa, receiver);
            let own = importances.lanes[place as usize % WIDTH];
            if own <= 0.0 {
                return 0.0;
            }
            probability *= own / importances.sum;
            place = node.place;
        }
        probability
    }
}

impl Importances {
    /// A lane and its share of the sum, in proportion to its importance; `u` becomes fit for the next choice.
    #[inline(always)]
    fn choose(&self, u: &mut f32) -> Option<(usize, f32)> {
        if !(self.sum > 0.0 && self.sum.is_finite()) {
            return None;
        }
        let mut rest = *u * self.sum;
        let mut chosen = None;
        for (lane, &importance) in self.lanes[..self.count].iter().enumerate() {
            if importance > 0.0 {
                chosen = Some((lane, rest));
                if rest < importance {
                    break;
                }
                rest -= importance;
            }
        }
        let (lane, rest) = chosen?;
        let importance = self.lanes[lane];
        *u = (rest / importance).clamp(0.0, 1.0 - f32::EPSILON / 2.0);
        Some((lane, importance / self.sum))
    }
}

impl Node {
    fn set(&mut self, lane: usize, child: &LightBounds, link: u32) {
        let center = child.center();
        for axis in 0..3 {
            self.center[axis].0[lane] = center[axis];
            self.axis[axis].0[lane] = child.axis[axis];
        }
        let radius2 = child.radius2();
        self.radius.0[lane] = radius2.sqrt();
        self.inverse_radius2.0[lane] = 1.0 / radius2;
        self.count = self.count.max(lane as u32 + 1);
        let (sin_o, cos_o) = child.theta_o.sin_cos();
        (self.sin_o.0[lane], self.cos_o.0[lane]) = (sin_o.max(0.0), cos_o);
        self.cos_e.0[lane] = child.theta_e.cos();
        self.back.0[lane] = if child.two_sided { -1.0 } else { 1.0 };
        self.intensity.0[lane] = child.intensity();
        self.links[lane] = link;
    }

    /// A bound-like estimate of the irradiance each child causes: "Physically Based Rendering", 4th edition, section
    /// 12.6.3, equation 12.8 and around, with intensity for power so that flat and round lights compare well.
    ///
    /// Angles are subtracted and clamped by their sines and cosines alone.
    #[inline(always)]
    fn importances<I: Isa>(&self, isa: I, receiver: &Receiver) -> Importances {
        let (zero, one) = (isa.splat(0.0), isa.splat(1.0));
        let p = receiver.position;
        // From the group to the receiver.
        let v = [
            isa.sub(isa.splat(p.x), isa.load(&self.center[0])),
            isa.sub(isa.splat(p.y), isa.load(&self.center[1])),
            isa.sub(isa.splat(p.z), isa.load(&self.center[2])),
        ];
        let distance2 = isa.max(dot(isa, v, v), isa.splat(TINY));
        let inverse2 = isa.div(one, distance2);
        let inverse = isa.sqrt(inverse2);
        // Angle under which the group is seen; everything from within.
        let sin_b = isa.mul(isa.load(&self.radius), inverse);
        let cos_b = isa.select_lt(one, sin_b, isa.splat(-1.0), sine(isa, sin_b));
        let sin_b = isa.select_lt(one, sin_b, zero, sin_b);
        // Angle between the axis and the receiver, less that of the cone, less that under which the group is seen.
        let axis = [isa.load(&self.axis[0]), isa.load(&self.axis[1]), isa.load(&self.axis[2])];
        let cos_w = isa.mul(dot(isa, v, axis), inverse);
        let cos_w = isa.max(cos_w, isa.mul(isa.load(&self.back), cos_w));
        let sin_w = sine(isa, cos_w);
        let (cos_o, sin_o) = (isa.load(&self.cos_o), isa.load(&self.sin_o));
        let cos_x = cos_less(isa, (cos_w, sin_w), (cos_o, sin_o));
        let sin_x = isa.sub(isa.mul(sin_w, cos_o), isa.mul(cos_w, sin_o));
        let sin_x = isa.select_lt(cos_o, cos_w, zero, isa.max(sin_x, zero));
        let cosine = cos_less(isa, (cos_x, sin_x), (cos_b, sin_b));
        let leaving = isa.max(cosine, isa.splat(LEAST_COSINE));
        let leaving = isa.select_lt(isa.load(&self.cos_e), cosine, leaving, zero);
        // From within the distance does not count.
        let inverse2 = isa.min(inverse2, isa.load(&self.inverse_radius2));
        let mut importance = isa.mul(isa.mul(isa.load(&self.intensity), leaving), inverse2);
        if let Some((normal, back)) = receiver.facing() {
            let normal = [isa.splat(-normal.x), isa.splat(-normal.y), isa.splat(-normal.z)];
            let cos_i = isa.mul(dot(isa, v, normal), inverse);
            let cos_i = isa.max(cos_i, isa.mul(isa.splat(back), cos_i));
            let arriving = cos_less(isa, (cos_i, sine(isa, cos_i)), (cos_b, sin_b));
            importance = isa.mul(importance, isa.max(arriving, zero));
        }
        let lanes = isa.store(importance).0;
        let [a, b, c, d, e, f, g, h] = lanes;
        let sum = ((a + b) + (c + d)) + ((e + f) + (g + h));
        Importances { lanes, sum, count: (self.count as usize).min(WIDTH) }
    }
}

#[inline(always)]
fn dot<I: Isa>(isa: I, a: [I::F32x8; 3], b: [I::F32x8; 3]) -> I::F32x8 {
    isa.add(isa.add(isa.mul(a[0], b[0]), isa.mul(a[1], b[1])), isa.mul(a[2], b[2]))
}

/// The sine, at least 0, of a cosine.
#[inline(always)]
fn sine<I: Isa>(isa: I, cosine: I::F32x8) -> I::F32x8 {
    isa.sqrt(isa.max(isa.sub(isa.splat(1.0), isa.mul(cosine, cosine)), isa.splat(0.0)))
}

/// Cosine of the angle `a` less `b`, both in 0..pi, or of 0 where that is negative.
#[inline(always)]
fn cos_less<I: Isa>(isa: I, a: (I::F32x8, I::F32x8), b: (I::F32x8, I::F32x8)) -> I::F32x8 {
    let difference = isa.add(isa.mul(a.0, b.0), isa.mul(a.1, b.1));
    isa.select_lt(b.0, a.0, isa.splat(1.0), difference)
}
