//! Look-ups against closed forms, pyramids against their means.

use glam::{Affine2, Affine3A};
use proptest::prelude::*;

use super::*;
use crate::desc::{ImageTexture, Wrap};
use crate::testing::{Mean, Rng, Suite};

/// An image whose texels, in reading order, are those of `texel`.
fn image(width: u32, height: u32, texel: impl Fn(u32, u32) -> [f32; 4]) -> Arc<Image> {
    let texels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).map(|(x, y)| texel(x, y));
    Arc::new(Image { name: "drawn".into(), width, height, texels: Texels::Float(texels.collect()) })
}

fn textured(image: Arc<Image>, wrap: Wrap, filter: TexelFilter) -> ImageTexture {
    let mapping = Mapping::Uv { set: 0, transform: Affine2::IDENTITY };
    ImageTexture { image, wrap: [wrap; 2], filter, mapping, invert: false }
}

/// 2x2 texels whose red channel is 0, 1, 2, 3 in reading order.
fn numbers(wrap: Wrap, filter: TexelFilter) -> ImageTexture {
    textured(image(2, 2, |x, y| [(2 * y + x) as f32, 0.0, 0.0, 1.0]), wrap, filter)
}

fn table(textures: &[Texture]) -> TextureTable {
    TextureTable::compile(textures, |_| false).expect("sound textures")
}

fn at(u: f32, v: f32) -> SurfacePoint {
    SurfacePoint { uv: [Vec2::new(u, v); 2], ..SurfacePoint::default() }
}

/// The last texture at a point.
fn look(textures: &[Texture], point: &SurfacePoint) -> Vec4 {
    table(textures).lookup(TextureId(textures.len() as u32 - 1), point)
}

fn red(texture: &ImageTexture, u: f32, v: f32) -> f32 {
    look(&[Texture::Image(texture.clone())], &at(u, v)).x
}

const WRAPS: [Wrap; 4] = [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp, Wrap::Black];
const FILTERS: [TexelFilter; 2] = [TexelFilter::Nearest, TexelFilter::Linear];

#[test]
fn the_origin_is_the_top_left_corner() {
    let t = numbers(Wrap::Repeat, TexelFilter::Nearest);
    assert_eq!(
        [red(&t, 0.1, 0.1), red(&t, 0.9, 0.1), red(&t, 0.1, 0.9), red(&t, 0.9, 0.9)],
        [0.0, 1.0, 2.0, 3.0]
    );
}

#[test]
fn bilinear_passes_through_texel_centres_and_mixes_between() {
    let t = numbers(Wrap::Clamp, TexelFilter::Linear);
    assert_eq!([red(&t, 0.25, 0.25), red(&t, 0.75, 0.25), red(&t, 0.25, 0.75)], [0.0, 1.0, 2.0]);
    assert_eq!([red(&t, 0.5, 0.25), red(&t, 0.25, 0.5), red(&t, 0.5, 0.5)], [0.5, 1.0, 1.5]);
}

#[test]
fn wraps_do_what_they_say() {
    for (wrap, expected) in [
        // Texel columns at u = -0.75, -0.25, 0.25, 0.75, 1.25, 1.75, 2.25.
        (Wrap::Repeat, [0.0, 1.0, 0.0, 1.0, 0.0, 1.0, 0.0]),
        (Wrap::Mirror, [1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0]),
        (Wrap::Clamp, [0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0]),
        (Wrap::Black, [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]),
    ] {
        for filter in FILTERS {
            let t = numbers(wrap, filter);
            let found = [-0.75, -0.25, 0.25, 0.75, 1.25, 1.75, 2.25].map(|u| red(&t, u, 0.25));
            assert_eq!(found, expected, "{wrap:?} {filter:?}");
        }
    }
    // Across the seam: the mean of both ends, the end itself, or half of it.
    let at_seam = WRAPS.map(|wrap| red(&numbers(wrap, TexelFilter::Linear), 1.0, 0.25));
    assert_eq!(at_seam, [0.5, 1.0, 1.0, 0.5]);
    let outside = look(&[Texture::Image(numbers(Wrap::Black, TexelFilter::Linear))], &at(0.5, 9.0));
    assert_eq!(outside, Vec4::ZERO);
}

/// Over the edges of the octahedral square look-ups go on with what lies there on the sphere: where the image is a smooth
/// function of direction, there are no seams.
#[test]
fn octahedral_images_go_on_over_their_edges() {
    let side = 64;
    let color = |direction: Vec3| (0.5 + 0.5 * direction).extend(1.0).to_array();
    let texels = (0..side * side).map(|i| {
        let place = Vec2::new((i % side) as f32 + 0.5, (i / side) as f32 + 0.5) / side as f32;
        color(crate::light::equal_area_direction(place))
    });
    let image =
        Image { name: String::new(), width: side, height: side, texels: Texels::Float(texels.collect()) };
    let texture = |wrap: Wrap| {
        let image = ImageTexture {
            wrap: [wrap; 2],
            image: Arc::new(image.clone()),
            ..numbers(wrap, TexelFilter::Linear)
        };
        [Texture::Image(image)]
    };
    // The map is continuous but not smooth: no direction is further from its neighbour's than two texels' diagonals. A
    // step over an edge is as long as this share of a texel.
    let most = 2.0 * std::f32::consts::PI / side as f32;
    let share = 0.002 * side as f32;
    let (sphere, tiled) = (texture(Wrap::Octahedral), texture(Wrap::Repeat));
    let mut seams = 0;
    for i in 0..100 {
        let along = (i as f32 + 0.5) / 100.0;
        for (inside, outside) in [
            ([0.001, along], [-0.001, along]),
            ([0.999, along], [1.001, along]),
            ([along, 0.001], [along, -0.001]),
            ([along, 0.999], [along, 1.001]),
        ] {
            let step = |textures: &[Texture; 1]| {
                let [a, b] = [inside, outside].map(|[u, v]| look(textures, &at(u, v)));
                (a - b).abs().max_element()
            };
            assert!(step(&sphere) < share * most, "{outside:?}: {}", step(&sphere));
            seams += usize::from(step(&tiled) > share * most);
            let [u, v] = outside;
            let expected =
                color(crate::light::equal_area_direction(crate::light::fold_square(Vec2::new(u, v))));
            let found = look(&sphere, &at(u, v));
            assert!((found - Vec4::from_array(expected)).abs().max_element() < most, "{outside:?}: {found}");
        }
    }
    assert!(seams > 300, "tiles do have seams: {seams}");
}

#[test]
fn inverted_images_show_the_opposite_and_keep_their_alpha() {
    let texture = textured(image(1, 1, |_, _| [0.25, 1.0, 3.0, 0.5]), Wrap::Repeat, TexelFilter::Linear);
    let inverted = ImageTexture { invert: true, ..texture };
    assert_eq!(look(&[Texture::Image(inverted)], &at(0.5, 0.5)), Vec4::new(0.75, 0.0, 0.0, 0.5));
}

#[test]
fn the_transform_and_the_set_of_coordinates_apply() {
    let transform = Affine2::from_translation(Vec2::new(0.5, 0.0));
    let mapping = Mapping::Uv { set: 1, transform };
    let texture = ImageTexture { mapping, ..numbers(Wrap::Repeat, TexelFilter::Nearest) };
    let point = SurfacePoint { uv: [Vec2::splat(9.9), Vec2::splat(0.25)], ..SurfacePoint::default() };
    assert_eq!(look(&[Texture::Image(texture)], &point).x, 1.0);
}

#[test]
fn eight_bits_decode_by_their_curves() {
    let image = |texels| Image { name: "grey".into(), width: 1, height: 1, texels };
    let srgb = image(Texels::Srgb8(vec![[0, 255, 188, 51]])).texel(0, 0);
    // 188 is the code of middle grey: ((188 / 255 + 0.055) / 1.055)^2.4.
    assert_eq!([srgb.x, srgb.y, srgb.w], [0.0, 1.0, 0.2]);
    assert!((srgb.z - 0.502_886_5).abs() < 1e-6, "{}", srgb.z);
    let linear = image(Texels::Linear8(vec![[0, 255, 51, 102]])).texel(0, 0);
    assert_eq!(linear, Vec4::new(0.0, 1.0, 0.2, 0.4));
}

/// Texture space is the world, moved by (1, 2, 3).
fn moved() -> Affine3A {
    Affine3A::from_translation(Vec3::new(1.0, 2.0, 3.0))
}

/// A direction in texture space, three units long, as a place in the world.
fn place(direction: Vec3) -> SurfacePoint {
    let position = 3.0 * direction.normalize() - Vec3::new(1.0, 2.0, 3.0);
    SurfacePoint { position, ..SurfacePoint::default() }
}

#[test]
fn mappings_follow_their_formulas() {
    let axes = [Vec3::new(1.0, 0.0, 0.0), Vec3::new(0.0, 2.0, 1.0)];
    let planar = Mapping::Planar { from_world: moved(), axes, offset: Vec2::new(0.5, -0.5) };
    let point = SurfacePoint { position: Vec3::new(4.0, 5.0, 6.0), ..SurfacePoint::default() };
    // In texture space (5, 7, 9).
    assert_eq!(planar.coordinates(&point), Vec2::new(5.5, 22.5));
    let spherical = Mapping::Spherical { from_world: moved() };
    let cylindrical = Mapping::Cylindrical { from_world: moved() };
    for (direction, theta, phi) in [
        (Vec3::Z, 0.0, 0.0),
        (Vec3::NEG_Z, 1.0, 0.0),
        (Vec3::X, 0.5, 0.0),
        (Vec3::Y, 0.5, 0.25),
        (Vec3::NEG_X, 0.5, 0.5),
        (Vec3::NEG_Y, 0.5, 0.75),
        (Vec3::new(-1.0, -1.0, 2.0_f32.sqrt()), 0.25, 0.625),
    ] {
        let point = place(direction);
        let near = |found: Vec2, expected: Vec2| {
            assert!((found - expected).abs().max_element() < 1e-5, "{direction}: {found}, {expected}");
        };
        near(spherical.coordinates(&point), Vec2::new(theta, phi));
        near(cylindrical.coordinates(&point), Vec2::new(phi, 3.0 * direction.normalize().z));
    }
}

/// Steps of coordinates along a short axis are the derivative, also where an angle starts again.
#[test]
fn footprints_of_mappings_are_short_across_their_seams() {
    for mapping in [Mapping::Spherical { from_world: moved() }, Mapping::Cylindrical { from_world: moved() }]
    {
        for angle in [0.0_f32, 1.0, 3.0, std::f32::consts::TAU - 1e-4] {
            let direction = Vec3::new(angle.cos(), angle.sin(), 0.0);
            let along = 1e-2 * Vec3::new(-angle.sin(), angle.cos(), 0.0);
            let footprint = Footprint { axes: [along, -along], ..Footprint::POINT };
            let [forth, back] = mapping.footprint(&SurfacePoint { footprint, ..place(direction) });
            // A step of 0.01 at radius 3, in turns.
            let expected = 1e-2 / (3.0 * std::f32::consts::TAU);
            let turned = |step: Vec2| step.abs().max_element();
            assert!((turned(forth) - expected).abs() < 1e-5 && (turned(back) - expected).abs() < 1e-5);
        }
    }
}

/// A colour, alone.
fn constant(value: f32) -> Texture {
    Texture::Constant(Vec4::new(value, value, value, 1.0))
}

fn color(id: u32) -> ColorParam {
    ColorParam { factor: Vec3::ONE, texture: Some(TextureId(id)) }
}

#[test]
fn boards_alternate_in_two_and_three_dimensions() {
    let colors = [ColorParam::constant(Vec3::ZERO), ColorParam::constant(Vec3::ONE)];
    let mapping = Mapping::Uv { set: 0, transform: Affine2::from_scale(Vec2::new(4.0, 2.0)) };
    let flat = [Texture::Checkerboard { mapping, colors }];
    for (u, v, expected) in
        [(0.1, 0.1, 0.0), (0.3, 0.1, 1.0), (0.1, 0.6, 1.0), (0.3, 0.6, 0.0), (-0.1, 0.1, 1.0)]
    {
        assert_eq!(look(&flat, &at(u, v)).x, expected, "{u}, {v}");
    }
    let mapping = Mapping::Solid { from_world: Affine3A::from_scale(Vec3::splat(0.5)) };
    let solid = [Texture::Checkerboard { mapping, colors }];
    for corner in 0..8 {
        let bit = |i: u32| (corner >> i & 1) as f32;
        let position = 2.0 * (Vec3::new(bit(0), bit(1), bit(2)) + Vec3::new(0.5, -0.5, 0.2));
        let point = SurfacePoint { position, ..SurfacePoint::default() };
        let odd = (corner as u32).count_ones().is_multiple_of(2);
        assert_eq!(look(&solid, &point).x, f32::from(u8::from(odd)), "{corner:03b}");
    }
}

#[test]
fn graphs_are_evaluated_from_their_leaves() {
    let half = ScalarParam::constant(0.5);
    let numbers = Texture::Image(numbers(Wrap::Clamp, TexelFilter::Nearest));
    // (3 * 0.5) * 0.75 + 0.5 * 0.25, where the image shows 3.
    let scaled = Texture::Scale { color: color(0), scale: half };
    let amount = ScalarParam { factor: 1.0, texture: Some((TextureId(2), 1)) };
    let mixed = Texture::Mix { colors: [color(1), ColorParam::constant(Vec3::splat(0.5))], amount };
    let value = look(&[numbers, scaled, constant(0.25), mixed], &at(0.9, 0.9));
    assert_eq!((value.x, value.w), (1.25, 1.0));
    // Amounts beyond 0..1 are no mixtures.
    let amount = ScalarParam::constant(7.0);
    let mixed = Texture::Mix { colors: [color(0), color(1)], amount };
    assert_eq!(look(&[constant(0.1), constant(0.2), mixed], &at(0.0, 0.0)).x, 0.2);
}

#[test]
fn means_are_those_of_the_parts() {
    let image = Texture::Image(numbers(Wrap::Clamp, TexelFilter::Nearest));
    let colors = [color(0), ColorParam::constant(Vec3::splat(0.5))];
    let mapping = Mapping::Uv { set: 0, transform: Affine2::IDENTITY };
    let board = Texture::Checkerboard { mapping, colors };
    let mixed = Texture::Mix { colors, amount: ScalarParam::constant(0.25) };
    let scaled = Texture::Scale { color: color(2), scale: ScalarParam::constant(2.0) };
    let table = table(&[image, board, mixed, scaled]);
    let means = [0, 1, 2, 3].map(|id| table.mean(TextureId(id)).x);
    assert_eq!(means, [1.5, 1.0, 1.25, 2.5]);
}

#[test]
fn textures_that_cannot_be_looked_up_are_refused() {
    let refused = |textures: &[Texture]| {
        TextureTable::compile(textures, |_| false).expect_err("must be refused").to_string()
    };
    let image = |change: &dyn Fn(&mut ImageTexture)| {
        let mut texture = numbers(Wrap::Repeat, TexelFilter::Linear);
        change(&mut texture);
        refused(&[Texture::Image(texture)])
    };
    let with_size = |width, height| {
        move |t: &mut ImageTexture| {
            let image = Arc::get_mut(&mut t.image).expect("only one");
            (image.width, image.height) = (width, height);
        }
    };
    assert_eq!(image(&with_size(2, 3)), "texture 0 \"drawn\": 2x3 texels were announced, but there are 4");
    assert!(image(&with_size(0, 1)).contains("it is 0x1 texels, at least 1x1 is needed"));
    let uv = |set, x| Mapping::Uv { set, transform: Affine2::from_translation(Vec2::new(x, 0.0)) };
    assert!(image(&|t| t.mapping = uv(2, 0.0)).contains("0 or 1 was expected"));
    assert!(image(&|t| t.mapping = uv(0, f32::NAN)).contains("its mapping is not finite"));
    assert!(
        image(&|t| t.mapping = Mapping::Solid { from_world: moved() }).contains("solid textures has three")
    );
    let scale = |color, factor, texture| Texture::Scale { color, scale: ScalarParam { factor, texture } };
    let own = scale(color(0), 1.0, None);
    assert_eq!(refused(&[own]), "texture 0: it names texture 0, expected an earlier one");
    let later = scale(color(0), 1.0, Some((TextureId(9), 0)));
    assert_eq!(refused(&[constant(1.0), later]), "texture 1: it names texture 9, expected an earlier one");
    let channel = scale(color(0), 1.0, Some((TextureId(0), 4)));
    assert!(refused(&[constant(1.0), channel]).contains("reads channel 4 of a texture, expected 0 to 3"));
    assert!(refused(&[constant(1.0), scale(color(0), f32::NAN, None)]).contains("expected a finite number"));
    assert!(refused(&[constant(f32::NAN)]).contains("expected finite numbers"));
}

/// 300 textures, each a mixture of the one before with itself: 2^300 look-ups, or a refusal.
#[test]
fn graphs_that_multiply_look_ups_are_refused() {
    let amount = ScalarParam::constant(0.5);
    let mixed = |id: u32| Texture::Mix { colors: [color(id), color(id)], amount };
    let textures: Vec<_> = [constant(1.0)].into_iter().chain((0..300).map(mixed)).collect();
    let error = TextureTable::compile(&textures, |_| false).expect_err("too many");
    assert!(error.problem.contains("looks up over 256 others"), "{error}");
    assert!(TextureTable::compile(&textures[..7], |_| false).is_ok());
}

/// Every level of a pyramid has the mean of the image: for floats but for rounding, for 8 bits within what rounding
/// each texel by half a code could add up to.
#[test]
fn pyramids_keep_the_mean() {
    let mut rng = Rng::new(7);
    for (width, height) in [(1, 1), (1, 9), (7, 5), (64, 64), (100, 3), (257, 130)] {
        let texels: Vec<[u8; 4]> =
            (0..width * height).map(|_| [(); 4].map(|()| (rng.next_1d().powi(3) * 256.0) as u8)).collect();
        let floats = texels.iter().map(|t| t.map(|code| f32::from(code) / 255.0)).collect();
        for texels in [Texels::Srgb8(texels.clone()), Texels::Linear8(texels), Texels::Float(floats)] {
            let image = Arc::new(Image { name: String::new(), width, height, texels });
            let mean = |image: &Image| {
                let texels = (0..image.height).flat_map(|y| (0..image.width).map(move |x| (x, y)));
                let sum: Vec4 = texels.map(|(x, y)| image.texel(x, y)).sum();
                sum / (image.width as f32 * image.height as f32)
            };
            let pyramid = Pyramid::new(&image, true);
            let last = pyramid.levels.last().expect("the image itself");
            assert_eq!((last.width, last.height), (1, 1));
            assert_eq!(pyramid.levels.len() as u32, width.max(height).ilog2() + 1);
            let room = match image.texels {
                // The steepest step of the sRGB curve, at its bright end, is 2.23 / 255.
                Texels::Srgb8(_) => 0.5 * 2.3 / 255.0,
                Texels::Linear8(_) => 0.5 / 255.0,
                Texels::Float(_) => 0.0,
            };
            for level in &pyramid.levels {
                let off = (mean(level) - mean(&image)).abs().max_element();
                assert!(off <= room + 1e-5, "{}x{} of {width}x{height}: {off}", level.width, level.height);
            }
        }
    }
}

/// A look-up over the whole image is its mean, one over less than a texel is bilinear, and in between it never leaves
/// the range of the texels.
#[test]
fn wider_footprints_see_more() {
    let board = image(64, 64, |x, y| [((x ^ y) & 1) as f32, 0.0, 0.0, 1.0]);
    let table = table(&[Texture::Image(textured(board, Wrap::Repeat, TexelFilter::Linear))]);
    let over = |texels: f32, u: f32| {
        let half = 0.5 * texels / 64.0;
        let footprint =
            Footprint { uv: [[Vec2::new(half, 0.0), Vec2::new(0.0, half)]; 2], ..Footprint::POINT };
        table.lookup(TextureId(0), &SurfacePoint { footprint, ..at(u, 0.5 / 64.0) }).x
    };
    for (u, own) in [(0.5 / 64.0, 0.0), (1.5 / 64.0, 1.0)] {
        assert_eq!([over(0.0, u), over(1.0, u)], [own, own]);
        // Half-way to the level whose texels are all 0.5.
        assert_eq!(over(1.5, u), 0.5 * (own + 0.5));
        for texels in [2.0, 3.0, 64.0, 1e9] {
            assert_eq!(over(texels, u), 0.5, "{texels}");
        }
    }
}

/// A footprint far longer than wide is filtered as to its width: 1 texel here, however the image is turned under it.
#[test]
fn long_footprints_do_not_blur_across() {
    let stripes = image(64, 64, |x, _| [(x & 1) as f32, 0.0, 0.0, 1.0]);
    let table = table(&[Texture::Image(textured(stripes, Wrap::Repeat, TexelFilter::Linear))]);
    let over = |a: Vec2, b: Vec2| {
        let footprint = Footprint { uv: [[a / 64.0, b / 64.0]; 2], ..Footprint::POINT };
        table.lookup(TextureId(0), &SurfacePoint { footprint, ..at(1.5 / 64.0, 0.5) }).x
    };
    assert_eq!(over(Vec2::new(0.5, 0.0), Vec2::new(0.0, 7.0)), 1.0);
    // The same ellipse by another pair of conjugate half axes: no axis of it is short.
    let (a, b) = (Vec2::new(0.5, 0.0), Vec2::new(0.0, 7.0));
    let (sin, cos) = 0.8_f32.sin_cos();
    assert!((over(a * cos + b * sin, b * cos - a * sin) - 1.0).abs() < 1e-5);
    // Beyond the limit it is: 0.5 x 32 is filtered as over 4 texels.
    assert_eq!(over(Vec2::new(0.5, 0.0), Vec2::new(0.0, 32.0)), 0.5);
}

/// Nearest texels and exact textures are never filtered.
#[test]
fn exact_textures_ignore_footprints() {
    let footprint = Footprint { uv: [[Vec2::X, Vec2::Y]; 2], ..Footprint::POINT };
    let point = SurfacePoint { footprint, ..at(0.9, 0.9) };
    let nearest = Texture::Image(numbers(Wrap::Repeat, TexelFilter::Nearest));
    assert_eq!(look(&[nearest], &point).x, 3.0);
    let linear = Texture::Image(numbers(Wrap::Clamp, TexelFilter::Linear));
    let scaled = Texture::Scale { color: color(0), scale: ScalarParam::constant(2.0) };
    // Through the second texture the first is exact too.
    let compile = |exact| TextureTable::compile(&[linear.clone(), scaled.clone()], |id| exact && id.0 == 1);
    let of = |exact| compile(exact).expect("sound").lookup(TextureId(1), &point).x;
    assert_eq!((of(true), of(false)), (6.0, 3.0));
    let bytes = |exact| compile(exact).expect("sound").bytes();
    assert_eq!((bytes(true), bytes(false)), (4 * 16, 5 * 16));
}

/// Textures that share an image share its pyramid.
#[test]
fn images_are_filtered_once() {
    let image = image(16, 16, |_, _| [1.0; 4]);
    let texture = |wrap| Texture::Image(textured(Arc::clone(&image), wrap, TexelFilter::Linear));
    let table = table(&[texture(Wrap::Repeat), texture(Wrap::Clamp)]);
    assert_eq!(table.bytes(), (256 + 64 + 16 + 4 + 1) * 16);
}

fn wild() -> impl Strategy<Value = f32> {
    prop_oneof![
        any::<f32>(),
        -3.0..3.0_f32,
        prop::sample::select(vec![
            f32::NAN,
            f32::INFINITY,
            f32::NEG_INFINITY,
            f32::MAX,
            f32::MIN,
            1e30,
            -1e-30,
            16_777_215.0,
            1.0,
            -1.0,
            0.0
        ]),
    ]
}

fn wild_vec2() -> impl Strategy<Value = Vec2> {
    (wild(), wild()).prop_map(|(x, y)| Vec2::new(x, y))
}

fn wild_vec3() -> impl Strategy<Value = Vec3> {
    (wild(), wild(), wild()).prop_map(|(x, y, z)| Vec3::new(x, y, z))
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2000, failure_persistence: None, ..ProptestConfig::default() })]
    /// Whatever the coordinates: an answer between the least and the greatest texel.
    #[test]
    fn look_ups_answer_whatever_they_are_asked(
        uv in wild_vec2(), position in wild_vec3(), axis in wild_vec3(), a in wild_vec2(), b in wild_vec2(),
        size in (1..9_u32, 1..9_u32), wrap in 0..4_usize, filter in 0..2_usize, mapping in 0..4_usize,
        invert: bool,
    ) {
        let from_world = moved();
        let axes = [Vec3::X, Vec3::ONE];
        let mapping = [
            Mapping::Uv { set: 1, transform: Affine2::from_scale(Vec2::splat(1e3)) },
            Mapping::Planar { from_world, axes, offset: Vec2::ZERO },
            Mapping::Spherical { from_world },
            Mapping::Cylindrical { from_world },
        ][mapping];
        let image = image(size.0, size.1, |x, y| [((x + y) % 3) as f32 * 0.5, 0.0, 1.0, 1.0]);
        let texture = ImageTexture { mapping, invert, ..textured(image, WRAPS[wrap], FILTERS[filter]) };
        let colors = [color(0), ColorParam::constant(Vec3::ONE)];
        let board = Texture::Checkerboard { mapping, colors };
        let footprint = Footprint { axes: [axis, position], uv: [[a, b]; 2] };
        let point = SurfacePoint { uv: [uv; 2], position, footprint, ..SurfacePoint::default() };
        for value in [look(&[Texture::Image(texture.clone())], &point), look(&[Texture::Image(texture), board], &point)] {
            prop_assert!(value.min_element() >= -1e-6 && value.max_element() <= 1.0 + 1e-6, "{value}");
        }
    }
}

/// What patterns are on average, over many places and normals, is what `mean` says.
#[test]
fn patterns_have_the_means_they_state() {
    const DRAWS: usize = 40_000;
    let solid = Affine3A::from_scale(Vec3::splat(0.9));
    let mapping = Mapping::Planar { from_world: solid, axes: [Vec3::X, Vec3::Y], offset: Vec2::ZERO };
    let unit =
        Mapping::Planar { from_world: Affine3A::IDENTITY, axes: [Vec3::X, Vec3::Y], offset: Vec2::ZERO };
    let colors = [Vec3::ONE, Vec3::ZERO].map(ColorParam::constant);
    let corners = [0.1, 0.5, 0.2, 0.9].map(Vec3::splat);
    let (octaves, roughness) = (4, 0.5);
    let noise = |pattern| Texture::Noise { from_world: solid, pattern };
    // How far the mean over all of space may be off what is stated: noise repeats after 256 cells, chance decides
    // which dots there are, and means of noise are those of 4096 places.
    let patterns = [
        (Texture::Corners { mapping: unit, colors: corners }, 1.0, 0.0),
        (Texture::Dots { mapping, colors }, 200.0, 0.02),
        (Texture::Facing { direction: Vec3::Y, colors }, 1.0, 0.0),
        (noise(NoisePattern::Brownian { octaves, roughness }), 200.0, 0.02),
        (noise(NoisePattern::Wrinkled { octaves, roughness }), 200.0, 0.02),
        (noise(NoisePattern::Windy), 200.0, 0.02),
        (noise(NoisePattern::Marble { octaves, roughness, scale: 2.0, variation: 0.5 }), 200.0, 0.02),
    ];
    let mut suite = Suite::new(patterns.len());
    let mut rng = Rng::new(11);
    for (texture, extent, slack) in patterns {
        let table = TextureTable::compile(std::slice::from_ref(&texture), |_| true).expect("sound");
        let mean = Mean::of(DRAWS, || {
            let position = extent * Vec3::new(rng.next_1d(), rng.next_1d(), rng.next_1d());
            let normal = rng.next_direction();
            let (a, b) = normal.any_orthonormal_pair();
            let footprint = Footprint { axes: [a, b], ..Footprint::POINT };
            let point = SurfacePoint { position, footprint, ..SurfacePoint::default() };
            f64::from(table.lookup(TextureId(0), &point).x)
        });
        let stated = f64::from(table.mean(TextureId(0)).x);
        let above = mean.p_at_most(stated + slack).min(mean.p_at_least(stated - slack));
        suite.judge(above, format_args!("{texture:?}: {} instead of {stated}", mean.mean()));
    }
}

#[test]
fn dots_are_round_and_apart() {
    let mapping = Mapping::Uv { set: 0, transform: Affine2::IDENTITY };
    let colors = [Vec3::ONE, Vec3::ZERO].map(ColorParam::constant);
    let table = table(&[Texture::Dots { mapping, colors }]);
    let dotted = |u: f32, v: f32| table.lookup(TextureId(0), &at(u, v)).x == 1.0;
    let mut cells = [0; 2];
    for i in 0..400 {
        let (x, y) = ((i % 20) as f32, (i / 20) as f32);
        // The middle of a cell is covered by every dot that it may have, its rim by none.
        cells[usize::from(dotted(x, y))] += 1;
        assert!(!dotted(x + 0.5, y + 0.1) && !dotted(x - 0.2, y + 0.499));
    }
    assert!(cells[0] > 100 && cells[1] > 100, "{cells:?}");
}

#[test]
fn unsound_patterns_are_refused() {
    let refuse = |texture| TextureTable::compile(&[texture], |_| false).expect_err("unsound").problem;
    let noise = |pattern| Texture::Noise { from_world: Affine3A::IDENTITY, pattern };
    let message = refuse(noise(NoisePattern::Brownian { octaves: 100, roughness: 0.5 }));
    assert!(message.contains("100 octaves"), "{message}");
    assert!(refuse(noise(NoisePattern::Wrinkled { octaves: 1, roughness: f32::NAN })).contains("NaN"));
    let colors = [ColorParam::constant(Vec3::ONE); 2];
    assert!(refuse(Texture::Facing { direction: Vec3::ZERO, colors }).contains("direction"));
}
