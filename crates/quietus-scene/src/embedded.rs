//! The scene the program draws when it is given none: a closed room with a glass sphere, a mirror sphere, a skylight
//! and a small bright lamp.
//!
//! The lamp is a sphere of 6 % of the room's width. Next-event estimation lights the walls well, but the light
//! that glass and mirror throw on floor and walls is found only by paths that hit the lamp by chance, after the
//! scattering at a diffuse surface: a few samples per pixel miss most of it. That is what hierarchical stopping is
//! for, so the scene shows it on purpose. The skylight, large and soft, is easy to find and fills the shadows. Units are metres, y is up, the camera looks along -z.

use std::sync::Arc;

use glam::{Affine2, Affine3A, Mat3, Quat, Vec2, Vec3};
use quietus_trace::desc::{
    Alpha, Camera, ColorParam, Geometry, Image, ImageTexture, Instance, Mapping, Material, MaterialId, Mesh,
    Metal, MetalRough, Object, ObjectId, Roughness, ScalarParam, SceneDesc, Shape, Surface, TexelFilter,
    Texels, Texture, TextureId, Wrap,
};

use crate::framing::look_at;

/// Half the room's width, in x.
const HALF_WIDTH: f32 = 1.6;
/// The room's height.
const HEIGHT: f32 = 2.0;
/// z of the back wall and of the wall behind the camera.
const DEPTH: [f32; 2] = [-1.2, 3.0];
/// Centre of the lamp: to the left, so that glass and mirror throw their light across the floor.
const LAMP: Vec3 = Vec3::new(-0.70, 1.42, 0.02);
/// Radius of the lamp: a diameter of 6 % of the room's width.
const LAMP_RADIUS: f32 = 0.1;
/// Radiance of the lamp: it and the skylight light the back wall to around mid grey.
const LAMP_RADIANCE: Vec3 = Vec3::new(34.0, 26.0, 17.0);
/// Radiance of the skylight.
const SKY_RADIANCE: Vec3 = Vec3::new(5.0, 6.0, 7.2);

/// The scene built into the program; see the module's description for why it looks as it does.
pub fn embedded() -> SceneDesc {
    let mut room = Builder::default();
    add_walls(&mut room);
    add_lamp(&mut room);
    add_skylight(&mut room);
    add_still_life(&mut room);
    let eye = Vec3::new(0.12, 1.40, 2.75);
    let target = Vec3::new(0.03, 0.56, -0.4);
    room.scene.cameras.push(Camera {
        aspect: Some(16.0 / 9.0),
        focus_distance: eye.distance(target),
        ..Camera::perspective("main", look_at(eye, target), 34.0_f32.to_radians())
    });
    room.scene
}

fn add_walls(room: &mut Builder) {
    let (w, h, [back, front]) = (HALF_WIDTH, HEIGHT, DEPTH);
    let white = room.diffuse("plaster", Vec3::new(0.74, 0.71, 0.66));
    let left = room.diffuse("terracotta", Vec3::new(0.62, 0.20, 0.11));
    let right = room.diffuse("petrol", Vec3::new(0.08, 0.27, 0.33));
    let tiles = room.checkered("tiles", Vec3::new(0.66, 0.62, 0.56), Vec3::new(0.30, 0.27, 0.25));
    let at = |x: f32, y: f32, z: f32| Vec3::new(x * w, y * h, z);
    let floor = [at(-1., 0., front), at(1., 0., front), at(1., 0., back), at(-1., 0., back)];
    let ceiling = [at(-1., 1., back), at(1., 1., back), at(1., 1., front), at(-1., 1., front)];
    let back_wall = [at(-1., 0., back), at(1., 0., back), at(1., 1., back), at(-1., 1., back)];
    let front_wall = [at(1., 0., front), at(-1., 0., front), at(-1., 1., front), at(1., 1., front)];
    let left_wall = [at(-1., 0., front), at(-1., 0., back), at(-1., 1., back), at(-1., 1., front)];
    let right_wall = [at(1., 0., back), at(1., 0., front), at(1., 1., front), at(1., 1., back)];
    room.place("floor", quads(&[floor]), tiles);
    room.place("ceiling", quads(&[ceiling]), white);
    room.place("back wall", quads(&[back_wall]), white);
    room.place("front wall", quads(&[front_wall]), white);
    room.place("left wall", quads(&[left_wall]), left);
    room.place("right wall", quads(&[right_wall]), right);
}

/// The bulb, its socket and the cord it hangs on.
fn add_lamp(room: &mut Builder) {
    let mut glow = material("lamp", Surface::Diffuse { reflectance: ColorParam::constant(Vec3::ZERO) });
    glow.emission = ColorParam::constant(LAMP_RADIANCE);
    let glow = room.material(glow);
    let cord = room.diffuse("cord", Vec3::splat(0.05));
    let brass = room.gold("brass", 0.35);
    let socket = LAMP_RADIUS + 0.035;
    room.sphere("lamp", LAMP, LAMP_RADIUS, glow);
    room.place("socket", block(LAMP + Vec3::Y * socket, Vec3::new(0.016, 0.03, 0.016), 0.0), brass);
    let top = LAMP.y + socket + 0.03;
    let middle = Vec3::new(LAMP.x, 0.5 * (top + HEIGHT), LAMP.z);
    room.place("cord", block(middle, Vec3::new(0.004, 0.5 * (HEIGHT - top), 0.004), 0.0), cord);
}

/// A pane in the ceiling, to the right and above the picture's edge, that shines down.
fn add_skylight(room: &mut Builder) {
    let mut sky = material("skylight", Surface::Diffuse { reflectance: ColorParam::constant(Vec3::ZERO) });
    sky.emission = ColorParam::constant(SKY_RADIANCE);
    let sky = room.material(sky);
    let at = |x: f32, z: f32| Vec3::new(x, HEIGHT - 0.01, z);
    room.place("skylight", quads(&[[at(0.1, -0.3), at(1.1, -0.3), at(1.1, 0.9), at(0.1, 0.9)]]), sky);
}

/// What the lamp shines on: spheres of glass, silver, gold and porcelain, and a plinth.
fn add_still_life(room: &mut Builder) {
    let plaster = room.diffuse("plinth", Vec3::new(0.72, 0.70, 0.67));
    let glass = room.glass("glass", Vec3::ONE);
    let amber = room.glass("amber glass", Vec3::new(1.0, 0.62, 0.18));
    let gold = room.gold("gold", 0.3);
    let silver = room.material(material(
        "silver",
        Surface::Conductor {
            metal: Metal::Index { eta: Vec3::new(0.155, 0.117, 0.138), k: Vec3::new(4.828, 3.122, 2.147) },
            roughness: Roughness::SMOOTH,
        },
    ));
    let porcelain = room.material(material(
        "porcelain",
        Surface::MetalRough(Box::new(MetalRough {
            base_color: ColorParam::constant(Vec3::new(0.05, 0.16, 0.42)),
            metallic: ScalarParam::constant(0.0),
            roughness: ScalarParam::constant(0.45),
            clearcoat: ScalarParam::constant(1.0),
            clearcoat_roughness: ScalarParam::constant(0.1),
            ..MetalRough::default()
        })),
    ));
    let plinth = [Vec3::new(0.98, 0.30, -0.72), Vec3::new(0.24, 0.30, 0.24)];
    room.place("plinth", block(plinth[0], plinth[1], 0.35), plaster);
    room.sphere("porcelain ball", Vec3::new(0.98, 0.60 + 0.2, -0.72), 0.2, porcelain);
    room.sphere("mirror ball", Vec3::new(-0.72, 0.42, -0.55), 0.42, silver);
    room.sphere("glass ball", Vec3::new(0.20, 0.34, -0.04), 0.34, glass);
    room.sphere("amber ball", Vec3::new(-0.36, 0.13, 0.36), 0.13, amber);
    room.sphere("gold ball", Vec3::new(0.92, 0.15, 0.10), 0.15, gold);
}

/// Collects materials and objects, each object placed once where it was modelled.
#[derive(Default)]
struct Builder {
    scene: SceneDesc,
}

impl Builder {
    fn material(&mut self, material: Material) -> MaterialId {
        self.scene.materials.push(material);
        MaterialId(self.scene.materials.len() as u32 - 1)
    }

    fn diffuse(&mut self, name: &str, albedo: Vec3) -> MaterialId {
        self.material(material(name, Surface::Diffuse { reflectance: ColorParam::constant(albedo) }))
    }

    fn glass(&mut self, name: &str, tint: Vec3) -> MaterialId {
        let (roughness, tint) = (Roughness::SMOOTH, ColorParam::constant(tint));
        self.material(material(name, Surface::Dielectric { ior: 1.5, roughness, tint }))
    }

    fn gold(&mut self, name: &str, roughness: f32) -> MaterialId {
        let eta = Vec3::new(0.143, 0.375, 1.442);
        let k = Vec3::new(3.983, 2.386, 1.603);
        let roughness = Roughness::perceptual(ScalarParam::constant(roughness));
        self.material(material(name, Surface::Conductor { metal: Metal::Index { eta, k }, roughness }))
    }

    /// A diffuse checkerboard with one period per metre of texture coordinates.
    fn checkered(&mut self, name: &str, light: Vec3, dark: Vec3) -> MaterialId {
        let texel = |color: Vec3| color.extend(1.0).to_array();
        let (light, dark) = (texel(light), texel(dark));
        let image = Image {
            name: name.to_owned(),
            width: 2,
            height: 2,
            texels: Texels::Float(vec![light, dark, dark, light]),
        };
        self.scene.textures.push(Texture::Image(ImageTexture {
            image: Arc::new(image),
            wrap: [Wrap::Repeat; 2],
            filter: TexelFilter::Nearest,
            mapping: Mapping::Uv { set: 0, transform: Affine2::from_scale(Vec2::splat(1.25)) },
            invert: false,
        }));
        let texture = Some(TextureId(self.scene.textures.len() as u32 - 1));
        let reflectance = ColorParam { factor: Vec3::ONE, texture };
        self.material(material(name, Surface::Diffuse { reflectance }))
    }

    fn sphere(&mut self, name: &str, center: Vec3, radius: f32, material: MaterialId) {
        self.place(name, Geometry::Sphere { center, radius }, material);
    }

    fn place(&mut self, name: &str, geometry: Geometry, material: MaterialId) {
        let object = ObjectId(self.scene.objects.len() as u32);
        self.scene
            .objects
            .push(Object { name: name.to_owned(), shapes: vec![Shape::new(geometry, material)] });
        self.scene.instances.push(Instance::still(object, Affine3A::IDENTITY));
    }
}

fn material(name: &str, surface: Surface) -> Material {
    Material {
        name: name.to_owned(),
        surface,
        emission: ColorParam::constant(Vec3::ZERO),
        emission_two_sided: false,
        normal_map: None,
        bump: None,
        alpha: Alpha::Opaque,
    }
}

/// Flat quadrilaterals, corners counter-clockwise seen from the front, texture coordinates in metres.
fn quads(quads: &[[Vec3; 4]]) -> Geometry {
    let mut mesh = Mesh::default();
    for corners in quads {
        let base = mesh.positions.len() as u32;
        let u = (corners[1] - corners[0]).normalize();
        let v = (corners[3] - corners[0]).normalize();
        mesh.positions.extend(corners);
        mesh.uvs[0].extend(corners.map(|p| Vec2::new((p - corners[0]).dot(u), (p - corners[0]).dot(v))));
        mesh.triangles.extend([[base, base + 1, base + 2], [base, base + 2, base + 3]]);
    }
    Geometry::Mesh(Arc::new(mesh))
}

/// A block with the given centre and half sizes, turned about its vertical axis by `turn` radians.
fn block(center: Vec3, half: Vec3, turn: f32) -> Geometry {
    let rotation = Mat3::from_quat(Quat::from_rotation_y(turn));
    let at = |x: f32, y: f32, z: f32| center + rotation * (half * Vec3::new(x, y, z));
    quads(&[
        [at(-1., -1., 1.), at(1., -1., 1.), at(1., 1., 1.), at(-1., 1., 1.)],
        [at(1., -1., 1.), at(1., -1., -1.), at(1., 1., -1.), at(1., 1., 1.)],
        [at(1., -1., -1.), at(-1., -1., -1.), at(-1., 1., -1.), at(1., 1., -1.)],
        [at(-1., -1., -1.), at(-1., -1., 1.), at(-1., 1., 1.), at(-1., 1., -1.)],
        [at(-1., 1., 1.), at(1., 1., 1.), at(1., 1., -1.), at(-1., 1., -1.)],
        [at(-1., -1., -1.), at(1., -1., -1.), at(1., -1., 1.), at(-1., -1., 1.)],
    ])
}
