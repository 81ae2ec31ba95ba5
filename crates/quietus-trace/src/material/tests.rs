//! Materials against what their descriptions say.

mod surfaces;

use std::sync::Arc;

use glam::{Affine2, Vec2, Vec4};

use super::*;
use crate::bsdf::Bsdf;
use crate::desc::{Image, ImageTexture, Mapping, TexelFilter, Texels, Wrap};
use crate::frame::Frame;

/// One texel, linear.
fn texture(texel: [f32; 4]) -> Texture {
    let image = Image { name: "one texel".into(), width: 1, height: 1, texels: Texels::Float(vec![texel]) };
    Texture::Image(ImageTexture {
        image: Arc::new(image),
        wrap: [Wrap::Repeat; 2],
        filter: TexelFilter::Linear,
        mapping: Mapping::Uv { set: 0, transform: Affine2::IDENTITY },
        invert: false,
    })
}

fn material(surface: Surface) -> desc::Material {
    desc::Material {
        name: "it".into(),
        surface,
        emission: ColorParam::constant(Vec3::ZERO),
        emission_two_sided: false,
        normal_map: None,
        bump: None,
        alpha: Alpha::Opaque,
    }
}

fn diffuse() -> desc::Material {
    material(Surface::Diffuse { reflectance: ColorParam::constant(Vec3::splat(0.5)) })
}

const ID: MaterialId = MaterialId(0);

fn table(texture: Texture, material: desc::Material) -> MaterialTable {
    MaterialTable::compile(&[texture], &[material]).expect("sound")
}

#[test]
fn textures_and_vertex_colours_multiply_the_base_colour() {
    let metal_rough = desc::MetalRough {
        base_color: ColorParam { factor: Vec3::new(1.0, 0.5, 0.25), texture: Some(TextureId(0)) },
        metallic: ScalarParam::constant(0.0),
        specular: ScalarParam::constant(0.0),
        ..Default::default()
    };
    let table = table(texture([0.5, 0.5, 1.0, 1.0]), material(Surface::MetalRough(Box::new(metal_rough))));
    let point = SurfacePoint { color: Vec4::new(0.8, 1.0, 1.0, 1.0), ..Default::default() };
    // Without a specular reflection all light reaches the diffuse lobe.
    let f = table.bsdf(ID, &point, 0).eval(Vec3::Z, Vec3::Z) * std::f32::consts::PI;
    let expected = Vec3::new(0.4, 0.25, 0.25);
    assert!(f.cmple(expected).all() && f.cmpge(0.99 * expected).all(), "{f}");
}

#[test]
fn unlit_surfaces_scatter_nothing_and_show_their_colour() {
    let unlit = desc::MetalRough {
        base_color: ColorParam::constant(Vec3::splat(0.3)),
        unlit: true,
        ..Default::default()
    };
    let table = table(texture([1.0; 4]), material(Surface::MetalRough(Box::new(unlit))));
    assert!(matches!(table.bsdf(ID, &SurfacePoint::default(), 0), Bsdf::Black));
    assert_eq!(table.unlit_color(ID, &SurfacePoint::default()), Some(Vec3::splat(0.3)));
}

#[test]
fn emission_has_sides() {
    let emission = ColorParam { factor: Vec3::splat(4.0), texture: Some(TextureId(0)) };
    let mut lamp = desc::Material { emission, ..diffuse() };
    let one_sided = table(texture([0.5, 0.25, 0.0, 1.0]), lamp.clone());
    let point = SurfacePoint::default();
    assert_eq!(one_sided.emission(ID, &point, true), Vec3::new(2.0, 1.0, 0.0));
    assert_eq!(one_sided.emission(ID, &point, false), Vec3::ZERO);
    assert_eq!(one_sided.mean_emission(ID), Vec3::new(2.0, 1.0, 0.0));
    lamp.emission_two_sided = true;
    assert_eq!(table(texture([0.5; 4]), lamp).emission(ID, &point, false), Vec3::splat(2.0));
}

#[test]
fn coverage_is_masked_or_blended() {
    let value = ScalarParam { factor: 1.0, texture: Some((TextureId(0), 3)) };
    let with = |alpha| table(texture([0.0, 0.0, 0.0, 0.5]), desc::Material { alpha, ..diffuse() });
    let point = SurfacePoint::default();
    let faint = SurfacePoint { color: Vec4::new(1.0, 1.0, 1.0, 0.5), ..point };
    let mask = with(Alpha::Mask { value, cutoff: 0.5 });
    assert_eq!([mask.alpha(ID, &point), mask.alpha(ID, &faint)], [1.0, 0.0]);
    let blend = with(Alpha::Blend { value });
    assert_eq!([blend.alpha(ID, &point), blend.alpha(ID, &faint)], [0.5, 0.25]);
    let opaque = with(Alpha::Opaque);
    assert!(opaque.is_opaque(ID) && !blend.is_opaque(ID) && opaque.alpha(ID, &faint) == 1.0);
}

#[test]
fn normal_maps_tilt_the_frame_towards_tangent_and_bitangent() {
    // (0.6, 0, 0.8) in tangent space.
    let mapped = desc::Material { normal_map: Some((TextureId(0), 1.0)), ..diffuse() };
    let table = table(texture([0.8, 0.5, 0.9, 1.0]), mapped);
    let frame = Frame::from_normal_tangent(Vec3::Y, Vec3::X);
    let tilted = table.shading_frame(ID, &SurfacePoint::default(), &frame);
    assert!((tilted.normal - Vec3::new(0.6, 0.8, 0.0)).length() < 1e-6, "{tilted:?}");
    assert!((tilted.tangent - Vec3::new(0.8, -0.6, 0.0)).length() < 1e-6, "{tilted:?}");
}

/// A coat without a map of its own keeps the smooth normal over a bumpy base.
#[test]
fn the_coat_ignores_the_bumps_of_the_base() {
    let coated = desc::MetalRough {
        base_color: ColorParam::constant(Vec3::ZERO),
        clearcoat: ScalarParam::constant(1.0),
        specular: ScalarParam::constant(0.0),
        metallic: ScalarParam::constant(0.0),
        ..Default::default()
    };
    let bumpy = desc::Material {
        normal_map: Some((TextureId(0), 1.0)),
        ..material(Surface::MetalRough(Box::new(coated)))
    };
    let table = table(texture([0.8, 0.5, 0.9, 1.0]), bumpy);
    let point = SurfacePoint::default();
    let smooth = Frame::from_normal_tangent(Vec3::Z, Vec3::X);
    let base = table.shading_frame(ID, &point, &smooth);
    let wo = Vec3::new(0.28, 0.0, 0.96);
    // Only the coat is left: it mirrors at the smooth normal.
    let s = table.bsdf(ID, &point, 0).sample(base.to_local(wo), 0.5, Vec2::splat(0.5)).expect("coat");
    let wi = base.to_world(s.wi);
    assert!(s.delta && (wi - Vec3::new(-0.28, 0.0, 0.96)).length() < 1e-5, "{wi}");
}

#[test]
fn errors_name_the_material_the_field_and_what_was_expected() {
    let compile = |m: desc::Material| {
        MaterialTable::compile(&[texture([0.0; 4])], &[m]).expect_err("unsound").to_string()
    };
    let color = |factor, texture| Surface::Diffuse { reflectance: ColorParam { factor, texture } };
    assert_eq!(
        compile(material(color(Vec3::ONE, Some(TextureId(1))))),
        "material \"it\": reflectance names texture 1, but there are 1"
    );
    assert_eq!(
        compile(material(color(Vec3::new(0.0, -1.0, 0.0), None))),
        "material \"it\": reflectance must be finite and at least 0, but is [0, -1, 0]"
    );
    let channel = ScalarParam { factor: 1.0, texture: Some((TextureId(0), 4)) };
    assert_eq!(
        compile(desc::Material { alpha: Alpha::Blend { value: channel }, ..diffuse() }),
        "material \"it\": alpha must be read from a texture channel in 0..4, but is 4"
    );
    let glass = Surface::Dielectric {
        ior: f32::NAN,
        roughness: crate::desc::Roughness::SMOOTH,
        tint: ColorParam::constant(Vec3::ONE),
    };
    assert_eq!(compile(material(glass)), "material \"it\": ior must be finite and above 0, but is NaN");
}
