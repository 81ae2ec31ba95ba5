//! The ray kernel: one loop over both levels of trees.
//!
//! A node's eight boxes are tested at once; the nearest child is visited next, the others wait on a stack,
//! farthest first. Entries that lie behind the nearest hit by the time they come up are dropped. Box tests are
//! conservative (Ize 2013, "Robust BVH Ray Traversal"): distances to near planes are rounded down and to far
//! planes up by more than their arithmetic can be off, so a ray never misses the box of what it meets.

use std::mem::MaybeUninit;

use glam::{Affine3A, Vec3};

use super::binary::{MAX_DEPTH, WIDTH};
use super::leaf::LeafQuery;
use super::source::FILTERED;
use super::wide::{Link, Node, Store};
use super::{Accel, Hit, Inner, Ray, STILL};
use crate::geometry::triangle::ShearedLanes;
use crate::geometry::{BLOCK, Candidates};
use crate::isa::{Isa, Job, Lanes};

/// Entries a traversal may need: in each of two trees all but one child of a node per level, the marker between
/// them, and the root.
const STACK: usize = 2 * (WIDTH - 1) * MAX_DEPTH + 2;

/// Bounds the relative error of a distance to a plane: a subtraction, a reciprocal and a product, in each of the
/// two distances compared (half an epsilon each), doubled because room is cheap.
const SLACK: f32 = 4.0 * f32::EPSILON;

/// Outside of any instance's tree.
const WORLD: u32 = u32::MAX;

/// Asks the trees about one ray. `ANY`: whether any hit will do.
pub(super) struct Query<'a, F, const ANY: bool> {
    pub(super) accel: &'a Accel,
    pub(super) ray: &'a Ray,
    pub(super) filter: F,
}

/// A ray as nodes and blocks want it.
#[derive(Clone, Copy)]
struct Prepared<I: Isa> {
    origin: [I::F32x8; 3],
    near: [I::F32x8; 3],
    far: [I::F32x8; 3],
    /// By axis: whether it runs downwards, so that the maximum is the near plane.
    down: [usize; 3],
    sheared: ShearedLanes<I>,
}

impl<I: Isa> Prepared<I> {
    #[inline(always)]
    fn new(isa: I, origin: Vec3, direction: Vec3) -> Self {
        let reciprocal = 1.0 / direction;
        let [near, far] = [reciprocal * (1.0 - SLACK), reciprocal * (1.0 + SLACK)];
        let down = reciprocal.cmplt(Vec3::ZERO);
        Self {
            origin: [isa.splat(origin.x), isa.splat(origin.y), isa.splat(origin.z)],
            near: [isa.splat(near.x), isa.splat(near.y), isa.splat(near.z)],
            far: [isa.splat(far.x), isa.splat(far.y), isa.splat(far.z)],
            down: [usize::from(down.test(0)), usize::from(down.test(1)), usize::from(down.test(2))],
            sheared: ShearedLanes::new(isa, origin, direction),
        }
    }

    /// Distances to the planes of a node that the ray passes first on an axis.
    #[inline(always)]
    fn enter(&self, isa: I, node: &Node, axis: usize) -> I::F32x8 {
        let plane = isa.load(&node.planes[axis][self.down[axis] & 1]);
        isa.mul(isa.sub(plane, self.origin[axis]), self.near[axis])
    }

    /// Distances to the planes of a node that the ray passes last on an axis.
    #[inline(always)]
    fn leave(&self, isa: I, node: &Node, axis: usize) -> I::F32x8 {
        let plane = isa.load(&node.planes[axis][(self.down[axis] & 1) ^ 1]);
        isa.mul(isa.sub(plane, self.origin[axis]), self.far[axis])
    }

    /// Which children of a node the ray meets, and at what distance it enters them.
    #[inline(always)]
    fn children(&self, isa: I, node: &Node, t_min: I::F32x8, t_max: I::F32x8) -> (u32, I::F32x8) {
        // A ray that runs within a plane is 0 times infinity away from it, NaN: not a number that excludes
        // anything. As first operands NaNs are passed over.
        let mut enter = isa.max(self.enter(isa, node, 2), t_min);
        enter = isa.max(self.enter(isa, node, 1), enter);
        enter = isa.max(self.enter(isa, node, 0), enter);
        let mut leave = isa.min(self.leave(isa, node, 2), t_max);
        leave = isa.min(self.leave(isa, node, 1), leave);
        leave = isa.min(self.leave(isa, node, 0), leave);
        (isa.le(enter, leave), enter)
    }
}

/// A subtree and the distance at which the ray enters it, in one number: the distance's bits, the link's below them.
/// Distances are at least 0, and such floats are ordered as their bits are.
#[derive(Clone, Copy, PartialEq, PartialOrd)]
struct Entry(u64);

impl Entry {
    #[inline(always)]
    fn new(link: Link, t: f32) -> Self {
        Self(u64::from(t.to_bits()) << 32 | u64::from(link.bits()))
    }

    #[inline(always)]
    fn link(self) -> Link {
        Link::from_bits(self.0 as u32)
    }

    #[inline(always)]
    fn t(self) -> f32 {
        f32::from_bits((self.0 >> 32) as u32)
    }
}

/// Subtrees still to be visited.
struct Stack<'a> {
    /// Apart from the length: rustc would clear all of a structure that is uninitialised only in parts.
    entries: &'a mut [MaybeUninit<Entry>; STACK],
    /// Entries below are initialised.
    len: usize,
}

impl Stack<'_> {
    #[inline(always)]
    fn push(&mut self, entry: Entry) {
        self.entries[self.len].write(entry);
        self.len += 1;
    }

    #[inline(always)]
    fn pop(&mut self) -> Option<Entry> {
        self.len = self.len.checked_sub(1)?;
        // SAFETY: `push` has written the entries below the former length.
        Some(unsafe { self.entries[self.len].assume_init() })
    }

    /// Pushes the children in `mask` but the nearest, which is returned; unless any order will do, the next nearest
    /// ends on top.
    #[inline(always)]
    fn push_children<I: Isa, const ANY: bool>(
        &mut self,
        isa: I,
        store: &Store,
        links: &[Link; WIDTH],
        mut mask: u32,
        t: &Lanes,
    ) -> Link {
        let mut nearest = take_lane(links, &mut mask, t);
        let first = self.len;
        while mask != 0 {
            let child = take_lane(links, &mut mask, t);
            let farther = if child < nearest { std::mem::replace(&mut nearest, child) } else { child };
            store.prefetch(isa, farther.link());
            self.push(farther);
            if ANY {
                continue;
            }
            // SAFETY: `push` has written the entries below the length.
            let pushed = unsafe { self.entries[first..self.len].assume_init_mut() };
            let mut at = pushed.len() - 1;
            while at > 0 && pushed[at - 1] < farther {
                pushed[at] = pushed[at - 1];
                at -= 1;
            }
            pushed[at] = farther;
        }
        nearest.link()
    }
}

/// The child in the lowest lane of `mask`, which is taken out of it.
#[inline(always)]
fn take_lane(links: &[Link; WIDTH], mask: &mut u32, t: &Lanes) -> Entry {
    let lane = mask.trailing_zeros() as usize & (WIDTH - 1);
    *mask &= *mask - 1;
    Entry::new(links[lane], t.0[lane])
}

/// The nearest hit so far.
struct Best {
    t: f32,
    u: f32,
    v: f32,
    /// Whose tree; `WORLD` for none.
    instance: u32,
    /// Primitive's id; `u32::MAX` for none.
    id: u32,
}

impl<F: FnMut(&Hit) -> bool, const ANY: bool> Job for Query<'_, F, ANY> {
    type Output = Option<Hit>;

    #[inline(always)]
    fn run<I: Isa>(mut self, isa: I) -> Option<Hit> {
        let Ray { origin, direction, t_min, t_max, time } = *self.ray;
        let finite = origin.is_finite() && direction.is_finite() && direction != Vec3::ZERO;
        // So written that NaN fails.
        if !(finite && t_min < t_max) {
            return None;
        }
        let mut best = Best { t: t_max.min(f32::MAX), u: 0.0, v: 0.0, instance: WORLD, id: u32::MAX };
        let mut entries = [const { MaybeUninit::uninit() }; STACK];
        let mut stack = Stack { entries: &mut entries, len: 0 };
        let mut ray = Prepared::new(isa, origin, direction);
        let mut local = (origin, direction);
        let mut instance = WORLD;
        let t_min = isa.splat(t_min);
        let mut t_max = isa.splat(best.t);
        let mut link = self.accel.root;
        loop {
            if let Some(node) = link.as_node() {
                // SAFETY: links come from roots and nodes of this store.
                let node = unsafe { self.accel.store.node(node) };
                let (mask, t) = ray.children(isa, node, t_min, t_max);
                if mask != 0 {
                    let store = &self.accel.store;
                    link = stack.push_children::<I, ANY>(isa, store, &node.links, mask, &isa.store(t));
                    continue;
                }
            } else if let Some(index) = link.as_instance() {
                let inner = &self.accel.instances[index];
                stack.push(Entry::new(Link::LEAVE, 0.0));
                local = if inner.motion == STILL {
                    into(&inner.to_object, origin, direction)
                } else {
                    into(&self.accel.to_object_at(inner, time), origin, direction)
                };
                ray = Prepared::new(isa, local.0, local.1);
                instance = inner.instance;
                link = inner.root;
                continue;
            } else {
                let found = if let Some(index) = link.as_triangles() {
                    // SAFETY: as for nodes.
                    let block = unsafe { self.accel.store.triangles(index) };
                    match block.intersect(isa, &ray.sheared, t_min, t_max) {
                        Some(found) => self.accept(isa, &mut best, instance, &found, block.ids()),
                        None => false,
                    }
                } else {
                    let store = &self.accel.store;
                    let (t_min, t_max) = (self.ray.t_min, best.t);
                    match isa.outline(LeafQuery { store, link, ray: local, time, t_min, t_max }) {
                        Some((found, ids)) => self.accept(isa, &mut best, instance, &found, &ids),
                        None => false,
                    }
                };
                if found {
                    if ANY {
                        break;
                    }
                    t_max = isa.splat(best.t);
                }
            }
            link = loop {
                let Some(entry) = stack.pop() else {
                    return self.accel.hit(&best);
                };
                let link = entry.link();
                if link == Link::LEAVE {
                    local = (origin, direction);
                    ray = Prepared::new(isa, origin, direction);
                    instance = WORLD;
                } else if ANY || entry.t() <= best.t {
                    break link;
                }
            };
        }
        self.accel.hit(&best)
    }
}

/// The ray in an object's space; distances stay as they are.
#[inline(always)]
fn into(to_object: &Affine3A, origin: Vec3, direction: Vec3) -> (Vec3, Vec3) {
    (to_object.transform_point3(origin), to_object.transform_vector3(direction))
}

impl<F: FnMut(&Hit) -> bool, const ANY: bool> Query<'_, F, ANY> {
    /// Takes what is nearer than the best so far, and says whether something was.
    #[inline(always)]
    fn accept<I: Isa>(
        &mut self,
        isa: I,
        best: &mut Best,
        instance: u32,
        found: &Candidates,
        ids: &[u32; BLOCK],
    ) -> bool {
        let mut mask = found.mask;
        let mut any = false;
        while mask != 0 {
            let lane = mask.trailing_zeros() as usize & (WIDTH - 1);
            mask &= mask - 1;
            let (t, u, v) = (found.t.0[lane], found.u.0[lane], found.v.0[lane]);
            let id = ids[lane];
            let candidate = Best { t, u, v, instance, id };
            if t > best.t || (t == best.t && !self.accel.precedes(&candidate, best)) {
                continue;
            }
            if id & FILTERED != 0 && !self.accel.hit(&candidate).is_some_and(|hit| (self.filter)(&hit)) {
                continue;
            }
            *best = candidate;
            // Its miss passes behind the rest of the traversal.
            isa.prefetch(&self.accel.references[(id & !FILTERED) as usize]);
            any = true;
            if ANY {
                break;
            }
        }
        any
    }
}

impl Accel {
    /// From the world to the object of an instance that moves.
    #[cold]
    fn to_object_at(&self, inner: &Inner, time: f32) -> Affine3A {
        self.motions[inner.motion as usize].at(time).inverse()
    }

    fn reference(&self, instance: u32, id: u32) -> super::source::Reference {
        let mut reference = self.references[(id & !FILTERED) as usize];
        if instance != WORLD {
            reference.instance = instance;
        }
        reference
    }

    /// Of two hits at the same distance, whether `a` is on the earlier primitive.
    #[cold]
    fn precedes(&self, a: &Best, b: &Best) -> bool {
        b.id == u32::MAX || self.reference(a.instance, a.id) < self.reference(b.instance, b.id)
    }

    fn hit(&self, best: &Best) -> Option<Hit> {
        if best.id == u32::MAX {
            return None;
        }
        let reference = self.reference(best.instance, best.id);
        Some(Hit {
            t: best.t,
            u: best.u,
            v: best.v,
            instance: reference.instance,
            shape: reference.shape,
            primitive: reference.primitive,
        })
    }
}
