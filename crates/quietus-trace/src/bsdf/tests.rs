//! Statistical tests of every BSDF: samplers against densities, weights, reciprocity, energy.

mod witness;

use std::collections::BTreeMap;
use std::f32::consts::PI;
use std::sync::Mutex;

use glam::{Vec2, Vec3};

use super::{
    Bsdf, BsdfSample, Conductor, Dielectric, Diffuse, DiffuseTransmission, FilmParams, FrostedTable,
    MetalRough, MetalRoughParams, ThinDielectric,
    albedo_table::{LobeAlbedo, MAX_ERROR},
    frosted,
    ggx::Ggx,
};
use crate::testing::{Mean, Rng, Suite, chi_square_directions, direction};

fn metal_rough(p: MetalRoughParams) -> Bsdf<'static> {
    Bsdf::MetalRough(MetalRough::new(&p))
}

/// Gold at 630, 532 and 465 nm, roughly.
const GOLD: (Vec3, Vec3) = (Vec3::new(0.18, 0.42, 1.37), Vec3::new(3.42, 2.35, 1.77));

fn glass(ior: f32, roughness: f32) -> Bsdf<'static> {
    Bsdf::Dielectric(Dielectric::new(ior, Ggx::from_roughness(roughness), Vec3::ONE))
}

fn gold(ggx: Option<Ggx>) -> Bsdf<'static> {
    Bsdf::Conductor(Conductor::new(GOLD.0, GOLD.1, ggx))
}

/// Facets wider across than along the tangent.
fn brushed(along: f32, across: f32) -> Option<Ggx> {
    Ggx::new(Vec2::new(along, across))
}

/// Those of one lobe that have a density, over the range of widths from `least_roughness`.
fn plain_bsdfs(least_roughness: f32) -> Vec<(String, Bsdf<'static>)> {
    let mut all = vec![("diffuse".to_owned(), Bsdf::Diffuse(Diffuse { reflectance: Vec3::ONE }))];
    for roughness in [0.04, 0.15, 0.5, 1.0].into_iter().filter(|&r| r >= least_roughness) {
        all.push((format!("conductor, roughness {roughness}"), gold(Ggx::from_roughness(roughness))));
        for ior in [1.5, 1.0 / 1.33] {
            all.push((format!("glass {ior}, roughness {roughness}"), glass(ior, roughness)));
        }
    }
    let least_alpha = least_roughness * least_roughness;
    for (along, across) in [(0.01f32, 0.4), (0.3, 0.05)].into_iter().filter(|p| p.0.min(p.1) >= least_alpha) {
        let ggx = brushed(along, across);
        all.push((format!("brushed metal {along}, {across}"), gold(ggx)));
        let glass = Bsdf::Dielectric(Dielectric::new(1.5, ggx, Vec3::ONE));
        all.push((format!("brushed glass {along}, {across}"), glass));
    }
    all.push(("leaf".to_owned(), leaf()));
    all.push(("oily glass".to_owned(), oily_glass(Ggx::from_roughness(0.4))));
    for (ior, roughness) in [(1.8, 0.7), (1.0 / 1.5, 1.0), (1.5, 0.4)] {
        all.push((
            format!("frosted glass {ior}, roughness {roughness}"),
            frosted_glass(ior, roughness, Vec3::new(0.9, 0.5, 1.0)),
        ));
    }
    all
}

fn oily_glass(ggx: Option<Ggx>) -> Bsdf<'static> {
    let film = FilmParams { strength: 0.9, ior: 1.8, thickness: 300.0 };
    Bsdf::Dielectric(Dielectric::new(1.5, ggx, Vec3::ONE).with_film(film))
}

/// Glass that keeps its light, with tables made once for each kind.
fn frosted_glass(ior: f32, roughness: f32, tint: Vec3) -> Bsdf<'static> {
    static TABLES: Mutex<BTreeMap<[u32; 2], &FrostedTable>> = Mutex::new(BTreeMap::new());
    let surface = Dielectric::new(ior, Ggx::from_roughness(roughness), tint);
    let key = [ior, roughness].map(f32::to_bits);
    let mut tables = TABLES.lock().expect("no test panics here");
    let make = || &*Box::leak(Box::new(FrostedTable::new(ior, Some(roughness * roughness))));
    let table: &FrostedTable = tables.entry(key).or_insert_with(make);
    Bsdf::FrostedGlass(table.glass(surface))
}

fn leaf() -> Bsdf<'static> {
    let (reflectance, transmittance) = (Vec3::new(0.3, 0.6, 0.2), Vec3::new(0.5, 0.4, 0.1));
    Bsdf::DiffuseTransmission(DiffuseTransmission { reflectance, transmittance })
}

/// Metal-rough surfaces of each kind that has only densities.
fn layered_bsdfs() -> Vec<(String, Bsdf<'static>)> {
    let base = MetalRoughParams { base_color: Vec3::new(0.9, 0.5, 0.2), ..Default::default() };
    let plastic = MetalRoughParams { metallic: 0.0, roughness: 0.3, ..base };
    let tilt = Vec3::new(0.2, -0.1, 1.0).normalize();
    let named = [
        ("metal", MetalRoughParams { roughness: 0.4, ..base }),
        ("rough metal", base),
        ("plastic", plastic),
        ("half metal", MetalRoughParams { metallic: 0.5, ..plastic }),
        ("thin wall", MetalRoughParams { transmission: 0.7, ..plastic }),
        ("coated", MetalRoughParams { clearcoat: 1.0, clearcoat_roughness: 0.2, ..plastic }),
        (
            "tilted coat",
            MetalRoughParams { clearcoat: 0.5, clearcoat_roughness: 0.3, clearcoat_normal: tilt, ..plastic },
        ),
    ];
    let cloth = MetalRoughParams { sheen_color: Vec3::new(0.8, 0.4, 1.0), sheen_roughness: 0.3, ..plastic };
    let color = Vec3::new(0.2, 1.0, 0.6);
    let film = FilmParams { strength: 0.9, ior: 1.4, thickness: 350.0 };
    let others = [
        ("brushed metal", MetalRoughParams { roughness: 0.4, anisotropy: 0.6, ..base }),
        ("brushed plastic", MetalRoughParams { anisotropy: 0.9, transmission: 0.5, ..plastic }),
        ("cloth", cloth),
        ("coated cloth", MetalRoughParams { clearcoat: 0.6, clearcoat_roughness: 0.3, ..cloth }),
        (
            "petal",
            MetalRoughParams { diffuse_transmission: 0.6, diffuse_transmission_color: color, ..plastic },
        ),
        ("half glass petal", MetalRoughParams { diffuse_transmission: 0.6, transmission: 0.5, ..cloth }),
        ("tempered metal", MetalRoughParams { film, roughness: 0.4, ..base }),
        ("bubble", MetalRoughParams { film, transmission: 0.8, ior: 1.0, ..plastic }),
        (
            "oily plastic",
            MetalRoughParams { film: FilmParams { ior: 1.9, ..film }, metallic: 0.3, ..plastic },
        ),
    ];
    let all = named.into_iter().chain(others);
    all.map(|(name, p)| (name.to_owned(), metal_rough(p))).collect()
}

fn all_rough(least_roughness: f32) -> Vec<(String, Bsdf<'static>)> {
    [plain_bsdfs(least_roughness), layered_bsdfs()].concat()
}

/// Those with delta parts.
fn smooth_bsdfs() -> Vec<(String, Bsdf<'static>)> {
    let plastic = MetalRoughParams { metallic: 0.0, roughness: 0.0, ..Default::default() };
    let film = FilmParams { strength: 1.0, ior: 1.33, thickness: 400.0 };
    let named = [
        ("mirror", gold(None)),
        ("pane", Bsdf::ThinDielectric(ThinDielectric { ior: 1.5 })),
        ("smooth glass", glass(1.5, 0.0)),
        ("smooth oily glass", oily_glass(None)),
        ("smooth plastic", metal_rough(plastic)),
        ("smooth thin wall", metal_rough(MetalRoughParams { transmission: 1.0, ..plastic })),
        ("smooth coat", metal_rough(MetalRoughParams { clearcoat: 0.7, roughness: 0.5, ..plastic })),
        ("smooth bubble", metal_rough(MetalRoughParams { transmission: 1.0, ior: 1.0, film, ..plastic })),
    ];
    named.map(|(name, b)| (name.to_owned(), b)).to_vec()
}

/// Outgoing directions by cosine, from both sides, off every axis.
fn outgoing() -> Vec<Vec3> {
    [1.0f32, 0.8, 0.3, 0.02, -0.999, -0.6, -0.1]
        .map(|z| {
            let r = (1.0 - z * z).sqrt();
            Vec3::new(r * 0.6, -r * 0.8, z)
        })
        .to_vec()
}

fn judge_densities(bsdfs: &[(String, Bsdf<'static>)]) {
    let mut suite = Suite::new(bsdfs.len() * outgoing().len());
    for (i, (name, bsdf)) in bsdfs.iter().enumerate() {
        for (j, wo) in outgoing().into_iter().enumerate() {
            let sample = |rng: &mut Rng| {
                let s = bsdf.sample(wo, rng.next_1d(), rng.next_2d())?;
                assert!(!s.delta);
                Some(s.wi)
            };
            let seed = (i * 100 + j) as u64;
            let p = chi_square_directions(seed, 150_000, sample, |wi| bsdf.pdf(wo, wi));
            suite.judge(p, format!("{name}, wo = {wo}"));
        }
    }
}

/// Two tests, so that they run side by side.
#[test]
fn samples_follow_the_density_of_plain_bsdfs() {
    judge_densities(&plain_bsdfs(0.0));
}

#[test]
fn samples_follow_the_density_of_metal_rough() {
    judge_densities(&layered_bsdfs());
}

/// A random metal-rough surface of any kind, white where `white`.
fn random_metal_rough(rng: &mut Rng, white: bool, least_roughness: f32) -> MetalRoughParams {
    let mut often_plain = |plain: f32| if rng.next_1d() < 0.3 { plain } else { rng.next_1d() };
    let [metallic, specular, transmission, clearcoat] = [0.0, 1.0, 0.0, 0.0].map(&mut often_plain);
    let [anisotropy, sheen, sheen_roughness] = [0.0; 3].map(&mut often_plain);
    let [roughness, clearcoat_roughness] = [0.0, 0.0].map(|r| often_plain(r).max(least_roughness));
    let [film_strength, diffuse_transmission] = [0.0; 2].map(&mut often_plain);
    let tilt = Vec3::new(rng.next_1d() - 0.5, rng.next_1d() - 0.5, 1.0).normalize();
    let film =
        FilmParams { strength: film_strength, ior: 1.0 + rng.next_1d(), thickness: 900.0 * rng.next_1d() };
    let mut color = || Vec3::new(rng.next_1d(), rng.next_1d(), rng.next_1d());
    MetalRoughParams {
        base_color: if white { Vec3::ONE } else { color() },
        metallic,
        roughness,
        ior: 1.0 + 2.0 * color().x,
        specular,
        specular_color: if white { Vec3::ONE } else { 2.0 * color() },
        transmission,
        diffuse_transmission,
        diffuse_transmission_color: if white { Vec3::ONE } else { color() },
        film,
        clearcoat,
        clearcoat_roughness,
        clearcoat_normal: if color().x < 0.5 { Vec3::Z } else { tilt },
        anisotropy,
        sheen_color: sheen * if white { Vec3::ONE } else { color() },
        sheen_roughness,
    }
}

/// Any BSDF, white where `white`, no lobe narrower than `least_roughness` makes it.
fn random_bsdf(rng: &mut Rng, white: bool, least_roughness: f32) -> Bsdf<'static> {
    let color = if white { Vec3::ONE } else { Vec3::new(rng.next_1d(), rng.next_1d(), rng.next_1d()) };
    let roughness = (1.2 * rng.next_1d() - 0.2).max(least_roughness);
    let alpha = roughness.max(0.0).powi(2);
    let aspect = if rng.next_1d() < 0.5 { 1.0 } else { 1.0 + 20.0 * rng.next_1d() };
    let ggx = brushed(alpha, aspect * alpha).filter(|_| roughness > 0.0);
    match rng.next_u64() % 8 {
        0 => Bsdf::Diffuse(Diffuse { reflectance: color }),
        1 => Bsdf::Conductor(Conductor::new(0.1 + 2.0 * color, 4.0 * color, ggx)),
        2 => {
            let plain = Dielectric::new(0.5 + 2.0 * rng.next_1d(), ggx, color);
            let (ior, thickness) = (1.0 + rng.next_1d(), 900.0 * rng.next_1d());
            let strength = (2.0 * rng.next_1d() - 1.0).max(0.0);
            Bsdf::Dielectric(plain.with_film(FilmParams { strength, ior, thickness }))
        }
        3 => Bsdf::ThinDielectric(ThinDielectric { ior: 1.0 + rng.next_1d() }),
        4 => {
            let share = rng.next_1d();
            let (reflectance, transmittance) = (share * color, (1.0 - share) * color);
            Bsdf::DiffuseTransmission(DiffuseTransmission { reflectance, transmittance })
        }
        5 => {
            let kind = rng.next_u64() as usize;
            frosted_glass([0.6, 1.33, 1.5, 2.4][kind % 4], [0.3, 0.5, 0.8, 1.0][kind / 4 % 4], color)
        }
        _ => metal_rough(random_metal_rough(rng, white, least_roughness)),
    }
}

/// What comes out of a channel under light of radiance 1 from all sides, the compression of radiance by `eta^2` undone.
fn white_furnace(bsdf: &Bsdf<'_>, wo: Vec3, rng: &mut Rng, samples: usize, channel: usize) -> Mean {
    Mean::of(samples, || {
        let sample = bsdf.sample(wo, rng.next_1d(), rng.next_2d());
        sample.map_or(0.0, |s| f64::from(s.weight[channel] * s.eta * s.eta))
    })
}

#[test]
fn no_light_is_gained() {
    let mut rng = Rng::new(11);
    let cases = 400;
    let mut suite = Suite::new(cases);
    for case in 0..cases {
        let bsdf = random_bsdf(&mut rng, true, 0.0);
        let wo = direction(f64::from(rng.next_1d()).sqrt() * 1.57, f64::from(rng.next_1d()) * 6.0);
        let wo = if rng.next_1d() < 0.5 { -wo } else { wo };
        let mean = white_furnace(&bsdf, wo, &mut rng, 20_000, case % 3);
        suite.judge(mean.p_at_most(1.0), format!("{bsdf:?}, wo = {wo}, mean {}", mean.mean()));
    }
}

#[test]
fn no_light_is_lost_where_nothing_absorbs() {
    let mut rng = Rng::new(12);
    let white_mirror = MetalRoughParams { roughness: 0.0, ..Default::default() };
    let cases = [
        ("diffuse", Bsdf::Diffuse(Diffuse { reflectance: Vec3::ONE })),
        ("smooth glass", glass(1.5, 0.0)),
        ("smooth oily glass", oily_glass(None)),
        ("pane", Bsdf::ThinDielectric(ThinDielectric { ior: 1.7 })),
        ("mirror", metal_rough(white_mirror)),
        ("white below smooth", metal_rough(MetalRoughParams { metallic: 0.0, ..white_mirror })),
        ("thin wall", metal_rough(MetalRoughParams { metallic: 0.0, transmission: 1.0, ..white_mirror })),
    ];
    let mut suite = Suite::new(cases.len() * outgoing().len());
    for (name, bsdf) in cases {
        for wo in outgoing() {
            let mean = white_furnace(&bsdf, wo, &mut rng, 100_000, 0);
            suite.judge(mean.p_equals(1.0), format!("{name}, wo = {wo}, mean {}", mean.mean()));
        }
    }
}

/// The lobe of Kulla and Conty brings back all that single scattering loses, except for the rounding of the table:
/// `lost(wo) * mean(lost(wi)) / mean_lost`, where each rounded factor is short by twice the table's error at most.
#[test]
fn rough_white_metal_keeps_what_the_table_knows() {
    let mut rng = Rng::new(13);
    let mut suite = Suite::new(2 * 3 * outgoing().len());
    for roughness in [0.3, 0.6, 1.0] {
        let metal = metal_rough(MetalRoughParams { roughness, ..Default::default() });
        let lobe = LobeAlbedo::new(Ggx::from_roughness(roughness));
        for wo in outgoing() {
            let mean = white_furnace(&metal, wo, &mut rng, 100_000, 0);
            let short = f64::from(2.0 * MAX_ERROR * (1.0 + lobe.at(wo).lost() / lobe.mean().lost()));
            suite.judge(mean.p_at_most(1.0), format!("{roughness}, {wo}: {}", mean.mean()));
            suite.judge(mean.p_at_least(1.0 - short), format!("{roughness}, {wo}: {}", mean.mean()));
        }
    }
}

/// As much is lost as tables are rounded down by: at most twice their error at `wo`, and as much of the mean.
#[test]
fn frosted_glass_keeps_its_light() {
    let mut rng = Rng::new(19);
    let kinds = [(1.5, 0.5), (1.8, 0.7), (2.4, 1.0), (0.7, 0.8)];
    let mut suite = Suite::new(2 * kinds.len() * outgoing().len());
    for (ior, roughness) in kinds {
        let glass = frosted_glass(ior, roughness, Vec3::ONE);
        for wo in outgoing() {
            let mean = white_furnace(&glass, wo, &mut rng, 100_000, 0);
            suite.judge(mean.p_at_most(1.0), format!("{ior}, {roughness}, {wo}: {}", mean.mean()));
            let least = 1.0 - 2.0 * f64::from(frosted::MAX_ERROR);
            suite.judge(mean.p_at_least(least), format!("{ior}, {roughness}, {wo}: {}", mean.mean()));
        }
    }
}

/// From the thinner side every facet has a way out, and from the denser one most that are drawn: a bound of those that have
/// none is left out. Where they were all drawn, a fifth of all draws would end in the second kind and half of them in the third.
#[test]
fn frosted_glass_hardly_ends_paths() {
    let mut rng = Rng::new(20);
    let kinds = [(1.5, 0.5, 0.02), (1.8, 0.7, 0.025), (1.5, 1.0, 0.05)];
    let mut suite = Suite::new(kinds.len() * outgoing().iter().filter(|wo| wo.z < 0.0).count());
    for (ior, roughness, most) in kinds {
        let glass = frosted_glass(ior, roughness, Vec3::ONE);
        for wo in outgoing() {
            let mut ends = || glass.sample(wo, rng.next_1d(), rng.next_2d()).is_none();
            let ended = Mean::of(20_000, || f64::from(u8::from(ends())));
            if wo.z > 0.0 {
                assert_eq!(ended.mean(), 0.0, "{ior}, {roughness}, {wo}");
            } else {
                suite.judge(ended.p_at_most(most), format!("{ior}, {roughness}, {wo}: {}", ended.mean()));
            }
        }
    }
}

/// Sampling with weights and plain integration of `eval` over the sphere agree.
#[test]
fn weights_integrate_what_eval_says() {
    let mut rng = Rng::new(14);
    // Uniform directions hardly ever find narrow lobes.
    let wide = all_rough(0.3);
    let mut suite = Suite::new(wide.len() * outgoing().len());
    for (name, bsdf) in wide {
        for wo in outgoing() {
            let sampled = Mean::of(100_000, || {
                let sample = bsdf.sample(wo, rng.next_1d(), rng.next_2d());
                sample.map_or(0.0, |s| f64::from(s.weight.y))
            });
            let integrated =
                Mean::of(100_000, || f64::from(4.0 * PI * bsdf.eval(wo, rng.next_direction()).y));
            let p = sampled.p_same(&integrated);
            suite.judge(p, format!("{name}, wo = {wo}: {} and {}", sampled.mean(), integrated.mean()));
        }
    }
}

/// Relative rounding of values and densities: a lobe of width alpha magnifies the rounding of directions by
/// `1 / alpha`, and a handful of operations add theirs.
fn rounding(roughness: f32) -> f32 {
    64.0 * f32::EPSILON / (roughness * roughness)
}

#[test]
fn sample_eval_and_pdf_agree() {
    let mut rng = Rng::new(15);
    for (name, bsdf) in all_rough(0.15) {
        for _ in 0..2000 {
            let wo = rng.next_direction();
            let Some(s) = bsdf.sample(wo, rng.next_1d(), rng.next_2d()) else { continue };
            assert_eq!(s.transmission, wo.z * s.wi.z < 0.0, "{name}");
            if grazes(wo, &s) {
                continue;
            }
            let (value, pdf) = bsdf.eval_pdf(wo, s.wi);
            let tolerance = rounding(0.15);
            assert!(
                (pdf / s.pdf - 1.0).abs() < tolerance,
                "{name}, {wo} -> {}: pdf {pdf}, sampled {}",
                s.wi,
                s.pdf
            );
            let difference = (value / pdf - s.weight).abs().max_element();
            assert!(
                difference < tolerance * s.weight.max_element(),
                "{name}: {value} / {pdf}, sampled {}",
                s.weight
            );
        }
    }
}

/// Whether cosines of a few roundings decide: of a direction with the surface, or with the facet between both.
fn grazes(wo: Vec3, s: &BsdfSample) -> bool {
    let facet = (wo + s.eta * s.wi).normalize_or_zero();
    wo.z.abs().min(s.wi.z.abs()).min(wo.dot(facet).abs()).min(s.wi.dot(facet).abs()) < 0.05
}

/// `f(wo, wi) = f(wi, wo)`, and for refraction `eta_i^2` times as much (Veach 1997, section 5.2).
#[test]
fn bsdfs_are_reciprocal() {
    let mut rng = Rng::new(16);
    for _ in 0..20_000 {
        let bsdf = match random_bsdf(&mut rng, false, 0.15) {
            // A coat measures cosines by its own normal: as shading normals do, that breaks the symmetry.
            Bsdf::MetalRough(b) if b.has_tilted_coat() => continue,
            bsdf => bsdf,
        };
        let wo = rng.next_direction();
        let Some(s) = bsdf.sample(wo, rng.next_1d(), rng.next_2d()) else { continue };
        if s.delta || grazes(wo, &s) {
            continue;
        }
        let forth = bsdf.eval(wo, s.wi) / s.wi.z.abs() * s.eta * s.eta;
        let back = bsdf.eval(s.wi, wo) / wo.z.abs();
        let tolerance = rounding(0.15) * forth.max_element();
        assert!(
            (forth - back).abs().max_element() <= tolerance,
            "{bsdf:?}: {wo} and {}: {forth}, {back}",
            s.wi
        );
    }
}

#[test]
fn nothing_is_ever_non_finite_or_negative() {
    let mut rng = Rng::new(17);
    let edge_cases = [0.0f32, -0.0, 1e-30, 1e-7, -1e-7, 1e-3, 1.0, -1.0];
    let wild = |rng: &mut Rng| match rng.next_u64() as usize % 16 {
        i if i < 8 => {
            let z = edge_cases[i];
            let r = (1.0 - z * z).max(0.0).sqrt();
            if rng.next_1d() < 0.5 { Vec3::new(r, 0.0, z) } else { Vec3::new(-0.6 * r, 0.8 * r, z) }
        }
        _ => rng.next_direction(),
    };
    let sound = |v: Vec3, pdf: f32| v.is_finite() && v.min_element() >= 0.0 && pdf.is_finite() && pdf >= 0.0;
    for _ in 0..200_000 {
        let bsdf = random_bsdf(&mut rng, false, 0.0);
        let (wo, wi) = (wild(&mut rng), wild(&mut rng));
        let (value, pdf) = bsdf.eval_pdf(wo, wi);
        assert!(sound(value, pdf), "{bsdf:?}: {wo} -> {wi}: {value}, {pdf}");
        let almost_one = 1.0 - f32::EPSILON / 2.0;
        let u = [0.0, almost_one, rng.next_1d(), rng.next_1d()][rng.next_u64() as usize % 4];
        let v = [0.0, almost_one, rng.next_1d(), rng.next_1d()][rng.next_u64() as usize % 4];
        if let Some(s) = bsdf.sample(wo, rng.next_1d(), glam::Vec2::new(u, v)) {
            assert!(sound(s.weight, s.pdf) && s.pdf > 0.0, "{bsdf:?}: {wo}, {u}, {v}: {s:?}");
            assert!((s.wi.length() - 1.0).abs() < 1e-5, "{bsdf:?}: {wo}: {s:?}");
        }
    }
}

#[test]
fn delta_parts_are_flagged_and_have_no_density() {
    let mut rng = Rng::new(18);
    for (name, bsdf) in smooth_bsdfs() {
        let mut found = false;
        for _ in 0..1000 {
            let wo = rng.next_direction();
            let Some(s) = bsdf.sample(wo, rng.next_1d(), rng.next_2d()) else { continue };
            found |= s.delta;
            assert!(s.delta || !bsdf.is_delta(), "{name}");
            if bsdf.is_delta() {
                assert_eq!(bsdf.eval_pdf(wo, s.wi), (Vec3::ZERO, 0.0), "{name}");
            }
        }
        assert!(found, "{name}");
    }
}
