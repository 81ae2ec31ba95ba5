//! Scenes and rays for measuring the ray kernel, the same on every machine.

use std::f32::consts::{PI, TAU};
use std::sync::Arc;

use glam::{Affine3A, Vec3};
use quietus_trace::bvh::{Accel, Hit, Ray};
use quietus_trace::desc::{Geometry, Instance, MaterialId, Mesh, Object, ObjectId, Shape};
use quietus_trace::geometry::{offset_ray_origin, triangle};
use quietus_trace::isa::{Isa, Job, Level};

/// A mesh to trace rays in.
pub(crate) struct Scene {
    pub(crate) name: &'static str,
    pub(crate) mesh: Arc<Mesh>,
    /// Where the camera stands and looks at.
    pub(crate) camera: [Vec3; 2],
    /// Corner and edges of the parallelogram that shadow rays are aimed at.
    pub(crate) light: [Vec3; 3],
}

/// Rays of one kind.
pub(crate) struct Rays {
    pub(crate) kind: &'static str,
    pub(crate) rays: Vec<Ray>,
    /// Whether they only ask whether there is a hit.
    pub(crate) shadow: bool,
}

impl Scene {
    /// An icosphere of 1.31 million triangles with bumps of several sizes, seen from outside.
    pub(crate) fn lump() -> Self {
        let mut builder = Builder::default();
        builder.lump(Vec3::ZERO, 1.0, 8, 1.0);
        Self {
            name: "lump",
            mesh: builder.finish(),
            camera: [Vec3::new(0.5, 0.7, 2.4), Vec3::ZERO],
            light: [Vec3::new(1.0, 3.0, 1.0), Vec3::X, Vec3::Z],
        }
    }

    /// A hall with two storeys of fluted columns, arches, curtains, statues and plants, open above.
    pub(crate) fn atrium() -> Self {
        let mut builder = Builder::default();
        builder.hall();
        for storey in 0..2 {
            for i in 0..10 {
                for side in [-1.0, 1.0] {
                    let foot = Vec3::new(-13.5 + 3.0 * i as f32, 4.0 * storey as f32, 4.0 * side);
                    builder.column(foot, 3.0);
                    if i < 9 {
                        builder.arch(foot + 3.0 * Vec3::Y, 3.0);
                    }
                    if i < 9 && (i + storey) % 2 == 0 {
                        builder.curtain(foot + Vec3::new(0.4, 0.3, 0.0), 2.2, 2.6);
                    }
                }
            }
        }
        for i in 0..4 {
            let x = -9.0 + 6.0 * i as f32;
            builder.lump(Vec3::new(x, 1.1, 0.0), 0.6, 5, 2.0);
            builder.plant(Vec3::new(x + 3.0, 0.0, 2.5), 40_000);
        }
        Self {
            name: "atrium",
            mesh: builder.finish(),
            camera: [Vec3::new(-13.0, 2.0, 0.6), Vec3::new(8.0, 2.8, -0.4)],
            light: [Vec3::new(-12.0, 11.0, -3.0), 24.0 * Vec3::X, 6.0 * Vec3::Z],
        }
    }

    /// What [`Accel::build`] takes.
    pub(crate) fn objects(&self) -> ([Object; 1], [Instance; 1]) {
        let geometry = Geometry::Mesh(self.mesh.clone());
        let shape = Shape::new(geometry, MaterialId(0));
        let object = Object { name: self.name.into(), shapes: vec![shape] };
        ([object], [Instance::still(ObjectId(0), Affine3A::IDENTITY)])
    }

    pub(crate) fn build(&self) -> Accel {
        let (objects, instances) = self.objects();
        Accel::build(&objects, &instances, |_| true)
    }

    /// Primary rays of a picture, diffuse bounces off what they meet and what those meet, and shadow rays from
    /// what the primary rays meet.
    pub(crate) fn rays(&self, accel: &Accel, width: u32, height: u32) -> [Rays; 4] {
        let mut random = Random(1);
        let primary = self.primary(width, height);
        let hits = trace(accel, &primary);
        let shadow = self.shadow(&primary, &hits, &mut random);
        let first = self.bounce(&primary, &hits, &mut random);
        let second = self.bounce(&first, &trace(accel, &first), &mut random);
        let rays = |kind, rays| Rays { kind, rays, shadow: false };
        [
            rays("primary", primary),
            rays("bounce 1", first),
            rays("bounce 2", second),
            Rays { kind: "shadow", rays: shadow, shadow: true },
        ]
    }

    /// Tile by tile of 8x8 pixels, as a renderer does.
    fn primary(&self, width: u32, height: u32) -> Vec<Ray> {
        let forward = (self.camera[1] - self.camera[0]).normalize();
        let right = forward.cross(Vec3::Y).normalize();
        let up = right.cross(forward);
        let half = (0.5 * 55f32.to_radians()).tan();
        let tiles = (0..height / 8).flat_map(|y| (0..width / 8).map(move |x| (x, y)));
        let pixels = tiles.flat_map(|(x, y)| (0..64).map(move |i| (8 * x + i % 8, 8 * y + i / 8)));
        let ray = |(x, y)| {
            let [x, y] = [(x, width), (y, height)]
                .map(|(i, n): (u32, u32)| (i as f32 + 0.5 - 0.5 * n as f32) / (0.5 * height as f32));
            ray(self.camera[0], (forward + half * (x * right - y * up)).normalize(), f32::INFINITY)
        };
        pixels.map(ray).collect()
    }

    /// Hit point moved to the side the ray came from, and the normal on that side.
    fn leave(&self, ray: &Ray, hit: &Hit) -> (Vec3, Vec3) {
        let indices = self.mesh.triangles[hit.primitive as usize];
        let vertices = indices.map(|i| self.mesh.positions[i as usize]);
        let normal = (vertices[1] - vertices[0]).cross(vertices[2] - vertices[0]).normalize_or(Vec3::Y);
        let normal = if normal.dot(ray.direction) > 0.0 { -normal } else { normal };
        let error = triangle::point_error(vertices, hit.u, hit.v);
        (offset_ray_origin(triangle::point(vertices, hit.u, hit.v), error, normal, normal), normal)
    }

    fn bounce(&self, rays: &[Ray], hits: &[Option<Hit>], random: &mut Random) -> Vec<Ray> {
        let hit_rays = rays.iter().zip(hits).filter_map(|(ray, hit)| Some((ray, (*hit)?)));
        let bounced = hit_rays.map(|(r, hit)| {
            let (origin, normal) = self.leave(r, &hit);
            // A unit vector on a sphere that touches the surface has the cosine's distribution.
            ray(origin, (normal + 0.9999 * random.unit()).normalize(), f32::INFINITY)
        });
        bounced.collect()
    }

    fn shadow(&self, rays: &[Ray], hits: &[Option<Hit>], random: &mut Random) -> Vec<Ray> {
        let hit_rays = rays.iter().zip(hits).filter_map(|(ray, hit)| Some((ray, (*hit)?)));
        let towards = hit_rays.map(|(r, hit)| {
            let (origin, _) = self.leave(r, &hit);
            let [corner, x, y] = self.light;
            ray(origin, corner + random.next() * x + random.next() * y - origin, 0.9999)
        });
        towards.collect()
    }
}

fn ray(origin: Vec3, direction: Vec3, t_max: f32) -> Ray {
    Ray { t_max, ..Ray::new(origin, direction, 0.0) }
}

/// What each ray meets.
pub(crate) fn trace(accel: &Accel, rays: &[Ray]) -> Vec<Option<Hit>> {
    struct Trace<'a>(&'a Accel, &'a [Ray]);

    impl Job for Trace<'_> {
        type Output = Vec<Option<Hit>>;

        #[inline(always)]
        fn run<I: Isa>(self, isa: I) -> Self::Output {
            self.1.iter().map(|ray| self.0.closest(isa, ray, |_| true)).collect()
        }
    }

    Level::detect().run(Trace(accel, rays))
}

/// Traces all rays and returns how many hit.
pub(crate) fn count_hits(accel: &Accel, rays: &Rays) -> usize {
    struct Count<'a>(&'a Accel, &'a Rays);

    impl Job for Count<'_> {
        type Output = usize;

        #[inline(always)]
        fn run<I: Isa>(self, isa: I) -> usize {
            let Self(accel, Rays { rays, shadow, .. }) = self;
            if *shadow {
                rays.iter().filter(|ray| accel.occluded(isa, ray, |_| true)).count()
            } else {
                rays.iter().filter(|ray| accel.closest(isa, ray, |_| true).is_some()).count()
            }
        }
    }

    Level::detect().run(Count(accel, rays))
}

/// Numbers of a linear congruential generator (Knuth's MMIX).
struct Random(u64);

impl Random {
    /// Uniform in 0..1.
    fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (self.0 >> 40) as f32 / (1u64 << 24) as f32
    }

    fn unit(&mut self) -> Vec3 {
        let z = 2.0 * self.next() - 1.0;
        let (sin, cos) = (TAU * self.next()).sin_cos();
        let r = (1.0 - z * z).max(0.0).sqrt();
        Vec3::new(r * cos, r * sin, z)
    }
}

#[derive(Default)]
struct Builder(Mesh);

impl Builder {
    fn finish(self) -> Arc<Mesh> {
        Arc::new(self.0)
    }

    /// A surface over the unit square, in `nu` by `nv` cells.
    fn patch(&mut self, nu: u32, nv: u32, surface: impl Fn(f32, f32) -> Vec3) {
        let base = self.0.positions.len() as u32;
        for j in 0..=nv {
            let row = (0..=nu).map(|i| surface(i as f32 / nu as f32, j as f32 / nv as f32));
            self.0.positions.extend(row);
        }
        for j in 0..nv {
            for i in 0..nu {
                let [a, b] = [base + j * (nu + 1) + i, base + (j + 1) * (nu + 1) + i];
                self.0.triangles.extend([[a, a + 1, b + 1], [a, b + 1, b]]);
            }
        }
    }

    /// Floor, walls, galleries and roof of few large triangles, as buildings have.
    fn hall(&mut self) {
        self.patch(6, 2, |u, v| Vec3::new(30.0 * u - 15.0, 0.0, 14.0 * v - 7.0));
        for side in [-1.0, 1.0] {
            self.patch(8, 3, |u, v| Vec3::new(30.0 * u - 15.0, 9.0 * v, 7.0 * side));
            self.patch(2, 2, |u, v| Vec3::new(15.0 * side, 9.0 * v, 14.0 * u - 7.0));
            for y in [3.9, 8.5] {
                self.patch(6, 1, |u, v| Vec3::new(30.0 * u - 15.0, y, side * (3.6 + 3.4 * v)));
            }
        }
    }

    /// 24 flutes, slightly swollen.
    fn column(&mut self, foot: Vec3, height: f32) {
        self.patch(96, 24, |u, v| {
            let swell = 0.32 - 0.06 * v * v + 0.12 * (1.0 - (v * (1.0 - v) * 4.0)).powi(8);
            let radius = swell * (1.0 - 0.05 * (24.0 * TAU * u).cos().max(0.0));
            foot + Vec3::new(radius * (TAU * u).cos(), height * v, radius * (TAU * u).sin())
        });
    }

    /// Half a ring to the next column.
    fn arch(&mut self, from: Vec3, width: f32) {
        self.patch(48, 24, |u, v| {
            let radius = 0.5 * width + 0.25 * (TAU * v).cos() - 0.3;
            let (sin, cos) = (PI * u).sin_cos();
            let center = from + Vec3::new(0.5 * width, 0.0, 0.3 * (TAU * v).sin());
            center + Vec3::new(-radius * cos, 0.6 * radius * sin, 0.0)
        });
    }

    fn curtain(&mut self, corner: Vec3, width: f32, height: f32) {
        self.patch(150, 60, |u, v| {
            let fold = 0.12 * (9.0 * TAU * u).sin() * (1.2 - v) + 0.05 * (3.0 * v + 20.0 * u).sin();
            corner + Vec3::new(width * u, height * v, fold)
        });
    }

    /// An icosphere with bumps.
    fn lump(&mut self, center: Vec3, radius: f32, level: u32, frequency: f32) {
        let phi = 0.5 * (1.0 + 5f32.sqrt());
        let mut points = Vec::new();
        for (a, b) in [(1.0, phi), (-1.0, phi), (1.0, -phi), (-1.0, -phi)] {
            points.extend([[0.0, a, b], [a, b, 0.0], [b, 0.0, a]].map(|p| Vec3::from(p).normalize()));
        }
        // Faces of an icosahedron: three corners at least distance from each other.
        let near = |a: Vec3, b: Vec3| (a.dot(b) - 1.0 / 5f32.sqrt()).abs() < 1e-3;
        for a in 0..12 {
            for b in a + 1..12 {
                for c in b + 1..12 {
                    let [p, q, r] = [points[a], points[b], points[c]];
                    if near(p, q) && near(q, r) && near(r, p) {
                        let flip = (q - p).cross(r - p).dot(p) < 0.0;
                        self.face(center, radius, level, frequency, if flip { [p, r, q] } else { [p, q, r] });
                    }
                }
            }
        }
    }

    /// One face of the icosahedron, in `4^level` triangles.
    fn face(&mut self, center: Vec3, radius: f32, level: u32, frequency: f32, [p, q, r]: [Vec3; 3]) {
        let n = 1u32 << level;
        let base = self.0.positions.len() as u32;
        let row = |j: u32| base + j * (n + 1) - j * (j.max(1) - 1) / 2;
        for j in 0..=n {
            for i in 0..=n - j {
                let [u, v] = [i as f32 / n as f32, j as f32 / n as f32];
                let direction = (p * (1.0 - u - v) + q * u + r * v).normalize();
                let bump: f32 = (0..7)
                    .map(|octave| {
                        let f = frequency * 1.9f32.powi(octave + 1);
                        let x = f * direction + octave as f32;
                        0.25 / f * ((x.x + x.y.sin()).sin() + (x.y - 1.3 * x.z).cos() * (x.z + x.x).sin())
                    })
                    .sum();
                self.0.positions.push(center + radius * (1.0 + bump) * direction);
            }
        }
        for j in 0..n {
            for i in 0..n - j {
                let [a, b] = [row(j) + i, row(j + 1) + i];
                self.0.triangles.push([a, a + 1, b]);
                if i + j + 1 < n {
                    self.0.triangles.push([a + 1, b + 1, b]);
                }
            }
        }
    }

    /// A cloud of leaves.
    fn plant(&mut self, foot: Vec3, leaves: u32) {
        let mut random = Random(foot.x.to_bits().into());
        for _ in 0..leaves {
            let height = random.next();
            let spread = 0.9 * (height * (1.1 - height)).sqrt();
            let out = random.unit();
            let center = foot + Vec3::new(spread * out.x, 2.2 * height, spread * out.z);
            let (along, across) = (0.05 * random.unit(), 0.02 * random.unit());
            let base = self.0.positions.len() as u32;
            self.0.positions.extend([center - along, center + across, center + along, center - across]);
            self.0.triangles.extend([[base, base + 1, base + 2], [base, base + 2, base + 3]]);
        }
    }
}
