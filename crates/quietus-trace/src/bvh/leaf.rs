//! The rarer leaves: all but triangles and instances.
//!
//! They are tested in a function of their own, so that the ray kernel's loop stays small.

use glam::Vec3;

use super::item::Kind;
use super::singles::Solid;
use super::wide::{Link, Store};
use crate::geometry::curve::CurveRay;
use crate::geometry::triangle::ShearedLanes;
use crate::geometry::{BLOCK, Candidates, patch, quadric};
use crate::isa::{Isa, Job};

/// Asks one leaf about a ray.
pub(super) struct LeafQuery<'a> {
    pub(super) store: &'a Store,
    pub(super) link: Link,
    /// Origin and direction in the tree's space.
    pub(super) ray: (Vec3, Vec3),
    pub(super) time: f32,
    pub(super) t_min: f32,
    pub(super) t_max: f32,
}

impl Job for LeafQuery<'_> {
    /// What was met, and what it is called.
    type Output = Option<(Candidates, [u32; BLOCK])>;

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) -> Self::Output {
        let Self { store, link, ray: (origin, direction), time, .. } = self;
        let (t_min, t_max) = (isa.splat(self.t_min), isa.splat(self.t_max));
        let (kind, index) = link.as_leaf();
        match kind {
            Kind::MovingTriangle => {
                let block = &store.moving[index];
                let ray = ShearedLanes::new(isa, origin, direction);
                Some((block.intersect(isa, &ray, time, t_min, t_max)?, *block.ids()))
            }
            Kind::Sphere => {
                let block = &store.spheres[index];
                Some((block.intersect(isa, origin, direction, (t_min, t_max))?, *block.ids()))
            }
            Kind::Curve => {
                let curve = &store.singles.curves[index];
                let ray = CurveRay::new(origin, direction);
                Some((curve.intersect(isa, &ray, t_min, t_max)?, [curve.id(); BLOCK]))
            }
            Kind::Ribbon => {
                let ribbon = &store.singles.ribbons[index];
                let ray = CurveRay::new(origin, direction);
                Some((ribbon.intersect(isa, &ray, t_min, t_max)?, [ribbon.id(); BLOCK]))
            }
            Kind::Solid => {
                let (solid, id) = &store.singles.solids[index];
                let range = (self.t_min, self.t_max);
                let (t, u, v) = match solid {
                    Solid::Patch(corners) => patch::intersect(origin, direction, range, corners)?,
                    Solid::Quadric(quadric) => {
                        (quadric::intersect(origin, direction, range, quadric)?, 0.0, 0.0)
                    }
                };
                Some((Candidates::single(t, u, v), [*id; BLOCK]))
            }
            Kind::Triangle | Kind::Instance => unreachable!("the kernel's loop sees to these"),
        }
    }
}
