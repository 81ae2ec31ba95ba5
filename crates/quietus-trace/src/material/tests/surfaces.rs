//! Which BSDF a description becomes, mixtures, and maps of the surface's shape.

use super::*;
use crate::bsdf::Conductor;
use crate::bsdf::ggx::Ggx;
use crate::desc::{Anisotropy, Coat, Hair, HairColor, Metal, RoughnessScale};
use crate::testing::{Rng, Suite, chi_square};
use crate::texture::Footprint;

const NO_TEXTURES: [Texture; 0] = [];

fn surface(surface: Surface) -> MaterialTable {
    MaterialTable::compile(&NO_TEXTURES, &[material(surface)]).expect("sound")
}

fn bsdf(table: &MaterialTable) -> Bsdf<'_> {
    table.bsdf(ID, &SurfacePoint::default(), 0)
}

fn roughness(u: f32, v: f32, scale: RoughnessScale) -> Roughness {
    Roughness { u: ScalarParam::constant(u), v: ScalarParam::constant(v), scale }
}

/// Two directions between which a metal of the given facets is bright.
fn highlight(bsdf: &Bsdf<'_>) -> Vec3 {
    bsdf.eval(Vec3::new(0.28, 0.0, 0.96), Vec3::new(-0.2, 0.15, 0.96).normalize())
}

#[test]
fn roughness_has_scales_and_directions() {
    let metal = Metal::Index { eta: Vec3::splat(0.2), k: Vec3::splat(3.0) };
    let eval = |r| highlight(&bsdf(&surface(Surface::Conductor { metal, roughness: r })));
    let expected = |x, y| {
        let ggx = Ggx::new(Vec2::new(x, y));
        highlight(&Bsdf::Conductor(Conductor::new(Vec3::splat(0.2), Vec3::splat(3.0), ggx)))
    };
    assert_eq!(eval(roughness(0.5, 0.25, RoughnessScale::Squared)), expected(0.25, 0.0625));
    assert_eq!(eval(roughness(0.25, 0.04, RoughnessScale::SquareRoot)), expected(0.5, 0.2));
    assert_eq!(eval(roughness(0.3, 0.3, RoughnessScale::Alpha)), expected(0.3, 0.3));
}

/// At normal incidence the reflectance that was asked for comes out.
#[test]
fn metals_are_known_by_their_reflectance() {
    let color = Vec3::new(0.9, 0.5, 0.04);
    let metal = Metal::Reflectance(ColorParam::constant(color));
    let table = surface(Surface::Conductor { metal, roughness: Roughness::SMOOTH });
    let s = bsdf(&table).sample(Vec3::Z, 0.5, Vec2::splat(0.5)).expect("a mirror");
    assert!((s.weight - color).abs().max_element() < 1e-5, "{}", s.weight);
}

fn coat() -> Coat {
    Coat {
        ior: 1.5,
        roughness: Roughness::SMOOTH,
        thickness: ScalarParam::constant(0.01),
        albedo: ColorParam::constant(Vec3::ZERO),
        g: ScalarParam::constant(0.0),
        max_depth: 10,
    }
}

#[test]
fn coats_have_a_closed_form_unless_light_scatters_below() {
    let reflectance = ColorParam::constant(Vec3::splat(0.5));
    let coated = |coat| surface(Surface::CoatedDiffuse { reflectance, coat });
    assert!(matches!(bsdf(&coated(coat())), Bsdf::CoatedDiffuse(_)));
    let fog = Coat { albedo: ColorParam::constant(Vec3::splat(0.1)), ..coat() };
    assert!(matches!(bsdf(&coated(fog)), Bsdf::Layered(_)));
    let brushed = Coat { roughness: roughness(0.1, 0.2, RoughnessScale::Alpha), ..coat() };
    let table = coated(brushed);
    assert!(matches!(bsdf(&table), Bsdf::Layered(_)) && table.needs_tangent(ID));
}

/// Mixed 1 to 3, of which one part is only half there, and a border between media not at all.
#[test]
fn mixtures_choose_their_parts_by_amount_and_coverage() {
    let half = Alpha::Blend { value: ScalarParam::constant(0.5) };
    let mix = |first, second, amount| {
        let materials = [MaterialId(first), MaterialId(second)];
        material(Surface::Mix { materials, amount: ScalarParam::constant(amount) })
    };
    let materials = [
        mix(1, 2, 0.75),
        diffuse(),
        mix(3, 4, 0.5),
        desc::Material { alpha: half, ..diffuse() },
        material(Surface::Interface),
    ];
    let table = MaterialTable::compile(&NO_TEXTURES, &materials).expect("sound");
    let point = SurfacePoint::default();
    // 1/4 of the first, and 3/4 * (1/2 * 1/2 + 1/2 * 0) of the rest.
    assert_eq!(table.alpha(ID, &point), 0.25 + 0.75 * 0.25);
    assert!(!table.is_opaque(ID) && table.is_interface(MaterialId(4)));
    let mut counts = [0u64; 2];
    let mut rng = Rng::new(1);
    for _ in 0..100_000 {
        match table.resolve(ID, &point, || rng.next_u64()) {
            MaterialId(1) => counts[0] += 1,
            MaterialId(3) => counts[1] += 1,
            other => panic!("{other:?} is no part that can be seen"),
        }
    }
    let expected = [0.25, 0.1875].map(|share| share / 0.4375 * 100_000.0);
    Suite::new(1).judge(chi_square(&counts, &expected), "parts");
    // What is no mixture is itself and wants no random bits.
    assert_eq!(table.resolve(MaterialId(1), &point, || unreachable!()), MaterialId(1));
}

#[test]
fn mixtures_that_cannot_be_are_refused() {
    let refuse = |materials: &[desc::Material]| {
        MaterialTable::compile(&NO_TEXTURES, materials).expect_err("unsound").to_string()
    };
    let mix = |id| {
        let materials = [MaterialId(id), MaterialId(id)];
        material(Surface::Mix { materials, amount: ScalarParam::constant(0.5) })
    };
    assert_eq!(refuse(&[mix(7)]), "material \"it\": it mixes material 7, but there are 1");
    assert!(refuse(&[mix(0)]).contains("mixture must be free of itself"));
    let lamp = desc::Material { emission: ColorParam::constant(Vec3::ONE), ..diffuse() };
    assert!(refuse(&[mix(1), lamp]).contains("without emission of its own"));
}

/// A height that rises by 0.3 per metre along x tilts the normal back by as much.
#[test]
fn bump_maps_tilt_the_normal_against_the_slope() {
    let texels = Texels::Float(vec![[0.0, 0.0, 0.0, 1.0], [1.0, 0.0, 0.0, 1.0]]);
    let image = Arc::new(Image { name: "ramp".into(), width: 2, height: 1, texels });
    let ramp = Texture::Image(ImageTexture {
        image,
        wrap: [Wrap::Clamp; 2],
        filter: TexelFilter::Linear,
        mapping: Mapping::Uv { set: 0, transform: Affine2::IDENTITY },
        invert: false,
    });
    let height = ScalarParam { factor: 0.3, texture: Some((TextureId(0), 0)) };
    let table = table(ramp, desc::Material { bump: Some(height), ..diffuse() });
    assert!(table.needs_tangent(ID) && table.is_textured(ID));
    // Over half a unit of u the ramp rises by 1; there is one unit of u in two metres.
    for size in [1e-2, 1e-9] {
        let uv = [Vec2::new(0.5 * size, 0.0), Vec2::new(0.0, 0.5 * size)];
        let footprint = Footprint { axes: [Vec3::X * size, Vec3::Z * -size], uv: [uv; 2] };
        let point = SurfacePoint { uv: [Vec2::splat(0.5); 2], footprint, ..SurfacePoint::default() };
        let flat = Frame::from_normal_tangent(Vec3::Y, Vec3::X);
        let frame = table.shading_frame(ID, &point, &flat);
        let expected = Vec3::new(-0.3, 1.0, 0.0).normalize();
        assert!((frame.normal - expected).length() < 2e-3, "{size}: {}", frame.normal);
        assert!(frame.tangent.dot(frame.normal).abs() < 1e-6 && frame.tangent.x > 0.9);
    }
}

/// A quarter turn: the lobe is wider along the bitangent.
#[test]
fn anisotropy_turns_the_frame() {
    let anisotropy =
        Anisotropy { strength: 0.8, rotation: std::f32::consts::FRAC_PI_2, texture: Some(TextureId(0)) };
    let m = desc::MetalRough { anisotropy, roughness: ScalarParam::constant(0.3), ..Default::default() };
    // Direction (1, 0), strength 1.
    let table = table(texture([1.0, 0.5, 1.0, 1.0]), material(Surface::MetalRough(Box::new(m))));
    let flat = Frame::from_normal_tangent(Vec3::Z, Vec3::X);
    let frame = table.shading_frame(ID, &SurfacePoint::default(), &flat);
    assert!((frame.tangent - Vec3::Y).length() < 1e-6 && (frame.bitangent + Vec3::X).length() < 1e-6);
    let bsdf = bsdf(&table);
    let at = |w: Vec3| bsdf.eval(Vec3::Z, frame.to_local(w)).x;
    assert!(at(Vec3::new(0.0, 0.6, 0.8)) > 10.0 * at(Vec3::new(0.6, 0.0, 0.8)));
}

/// Across a curve v runs from 0 to 1; a ray through its middle meets no side first.
#[test]
fn hair_knows_where_it_is_hit() {
    let hair = Hair {
        color: HairColor::Absorption(ColorParam::constant(Vec3::splat(0.3))),
        ior: 1.55,
        beta_m: ScalarParam::constant(0.3),
        beta_n: ScalarParam::constant(0.3),
        alpha: 0.0,
    };
    let table = surface(Surface::Hair(Box::new(hair)));
    assert!(table.is_textured(ID) && table.needs_tangent(ID));
    let at = |v: f32, wi: Vec3| {
        let point = SurfacePoint { uv: [Vec2::new(0.5, v); 2], ..SurfacePoint::default() };
        table.bsdf(ID, &point, 0).eval(Vec3::Z, wi).x
    };
    let (left, right) = (Vec3::new(0.0, -0.6, 0.8), Vec3::new(0.0, 0.6, 0.8));
    assert!((at(0.5, left) / at(0.5, right) - 1.0).abs() < 1e-5);
    // Off the middle light is thrown to that side.
    assert!(at(0.65, right) > 2.0 * at(0.65, left) && at(0.35, left) > 2.0 * at(0.35, right));
}
