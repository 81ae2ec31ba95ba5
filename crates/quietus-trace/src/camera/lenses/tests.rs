//! Lenses against closed forms, and pupils against the whole of the last surface.

use super::*;
use crate::desc::LensSurface;
use crate::testing::{Mean, Rng, Suite};
use crate::warp;

/// A thin lens of a focal length of 0.1 by the lensmaker's formula, with its stop just behind, `place` before the film.
fn thin(place: f32, stop: f32) -> Lenses {
    let surface = |at: f32, curvature: f32, rim: f32, index: f32| LensSurface {
        place: place + at,
        curvature,
        rim,
        index,
    };
    let surfaces =
        vec![surface(2e-5, 0.1, 0.05, 1.5), surface(1e-5, -0.1, 0.05, 1.0), surface(0.0, 0.0, stop, 1.0)];
    Lenses { surfaces, film_height: 0.03, film_radius: 0.025, aperture: None }
}

/// Two lenses with a stop between them, whose rims take light from the corners.
fn pair(aperture: Option<Aperture>) -> Lenses {
    let surface =
        |place: f32, curvature: f32, rim: f32, index: f32| LensSurface { place, curvature, rim, index };
    let surfaces = vec![
        surface(0.092, 0.06, 0.0095, 1.6),
        surface(0.087, -0.3, 0.0095, 1.0),
        surface(0.067, 0.0, 0.009, 1.0),
        surface(0.06, -0.08, 0.010, 1.7),
        surface(0.057, -0.04, 0.012, 1.0),
    ];
    Lenses { surfaces, film_height: 0.024, film_radius: 0.0216, aperture }
}

fn system(lenses: &Lenses) -> LensSystem {
    LensSystem::new(lenses, 240.0).expect("lenses that see")
}

/// Rays through the middle of a thin lens go straight on, and those from the middle of the film meet in the point that is
/// sharp, but for spherical aberration: that grows with the third power of the height in the lens, and higher ones.
#[test]
fn rays_meet_where_the_picture_is_sharp() {
    // 1 / 0.125 + 1 / 0.5 = 1 / 0.1.
    let (image, object, thickness) = (0.125, 0.5, 2e-5);
    let system = system(&thin(image, 0.02));
    let at_object = |offset: Vec2, lens: Vec2| {
        let (origin, direction, weight) = system.ray(offset, lens).expect("a ray within the opening");
        assert!(direction.z < 0.0 && (direction.length() - 1.0).abs() < 1e-5 && weight > 0.0);
        (origin + direction * ((-image - object - origin.z) / direction.z)).truncate()
    };
    for offset in [Vec2::new(30.0, 20.0), Vec2::new(-80.0, 0.0), Vec2::new(0.0, -100.0)] {
        let expected = offset * system.pixel * (object / image);
        // Where the pupil's middle is found is known to a step of the grid, and the lens has a thickness.
        let step = 2.0 * REACH * 0.02 / FINE as f32;
        let found = at_object(offset, Vec2::ZERO);
        assert!(
            found.distance(expected) < 2.0 * step + thickness / image * expected.length(),
            "{offset} {found}"
        );
    }
    let [whole, half] = [0.8, 0.4].map(|height| at_object(Vec2::ZERO, Vec2::new(height, 0.0)).length());
    assert!(whole > 7.9 * half && whole < 0.02, "{whole} {half}");
}

/// The weights are the irradiance: cos^4 over the opening, seen from the middle of the film.
#[test]
fn a_thin_lens_is_as_bright_as_its_opening_is_large() {
    let (place, stop) = (0.125, 0.01);
    let system = system(&thin(place, stop));
    let mut rng = Rng::new(5);
    let weights = Mean::of(200_000, || {
        let lens = warp::disk(rng.next_2d());
        f64::from(system.ray(Vec2::ZERO, lens).map_or(0.0, |(.., weight)| weight))
    });
    // pi sin^2 of the angle under which the opening is seen; the last surface is the stop itself.
    let sine2 = f64::from(stop * stop) / f64::from(stop * stop + place * place);
    Suite::new(1).judge(weights.p_equals(std::f64::consts::PI * sine2), "irradiance");
}

/// Ellipses lose no light that comes through the last surface at all.
#[test]
fn pupils_hold_all_that_is_seen() {
    let system = system(&pair(None));
    let suite_size = 4;
    let mut suite = Suite::new(suite_size);
    let rear = system.surfaces[0];
    let reach = REACH * rear.rim;
    for (i, offset) in [Vec2::ZERO, Vec2::new(80.0, 0.0), Vec2::new(-90.0, 60.0), Vec2::new(-150.0, -120.0)]
        .into_iter()
        .enumerate()
    {
        let mut rng = Rng::new(i as u64);
        let pupil = Mean::of(100_000, || {
            let ray = system.ray(offset, warp::disk(rng.next_2d()));
            f64::from(ray.map_or(0.0, |(.., weight)| weight))
        });
        let film = -offset * system.pixel;
        let whole = Mean::of(400_000, || {
            let target = reach * (2.0 * rng.next_2d() - 1.0);
            let direction = (target - film).extend(rear.place).normalize();
            let seen = system.trace(film.extend(0.0), direction).is_some();
            let area = 4.0 * reach * reach;
            if seen { f64::from(direction.z.powi(4) * area / (rear.place * rear.place)) } else { 0.0 }
        });
        assert!(pupil.mean() > 0.0, "{offset}");
        assert!(pupil.variance() < whole.variance(), "ellipses are there to save noise");
        suite.judge(pupil.p_same(&whole), offset);
    }
}

/// Stops that the first grid misses are found by the second.
#[test]
fn small_openings_are_found() {
    let mut lenses = pair(None);
    let wide = system(&lenses).pupils[0].half.x;
    lenses.surfaces[2].rim /= 40.0;
    let narrow = system(&lenses).pupils[0].half.x;
    assert!(narrow < wide / 20.0, "{narrow} of {wide}");
}

/// The corners of the picture are darker than the middle: rims cut what they see.
#[test]
fn rims_take_light_from_the_corners() {
    let system = system(&pair(None));
    let area = |pupil: &Pupil| pupil.half.x * pupil.half.y;
    assert!(area(&system.pupils[PUPILS - 1]) < 0.8 * area(&system.pupils[0]));
}

/// Only the upper right quarter of the stop is open: nothing comes through the rest.
#[test]
fn pictures_of_openings_let_through_what_they_show() {
    let mask = Aperture { size: [2, 2], weights: vec![0.0, 4.0, 0.0, 0.0] };
    let texel = |place| look_up(&mask, place);
    assert_eq!(texel(Vec2::new(0.5, 0.5)), 4.0);
    assert_eq!(texel(Vec2::new(0.5, -0.5)), 0.0);
    assert_eq!(texel(Vec2::new(-0.5, 0.5)), 0.0);
    assert_eq!(texel(Vec2::new(0.0, 0.5)), 2.0);
    assert_eq!(texel(Vec2::new(1.1, 0.5)), 0.0);
    let system = system(&pair(Some(mask)));
    let stop = system.surfaces[2];
    assert_eq!(stop.curvature, 0.0);
    let mut rng = Rng::new(1);
    let passes = |direction: Vec2| system.trace(Vec3::ZERO, direction.extend(1.0).normalize()).is_some();
    for _ in 0..1000 {
        let direction = 0.1 * (2.0 * rng.next_2d() - 1.0);
        // From the middle of the film the stop is seen upright. Between texels light comes from half a texel around.
        let open = direction.min_element() > 0.0;
        let dark = direction.min_element() < -0.1;
        assert!(!(dark && passes(direction)), "{direction}");
        assert!(!open || direction.length() > 0.09 || passes(direction), "{direction}");
    }
}

#[test]
fn lenses_that_make_no_sense_are_refused() {
    let refused = |change: &dyn Fn(&mut Lenses)| {
        let mut lenses = pair(None);
        change(&mut lenses);
        LensSystem::new(&lenses, 10.0).is_none()
    };
    assert!(!refused(&|_| {}));
    assert!(refused(&|lenses| lenses.surfaces.clear()));
    assert!(refused(&|lenses| lenses.surfaces.reverse()));
    assert!(refused(&|lenses| lenses.surfaces[1].rim = 0.0));
    assert!(refused(&|lenses| lenses.surfaces[1].index = f32::NAN));
    assert!(refused(&|lenses| lenses.surfaces[4].place = 0.0));
    assert!(refused(&|lenses| lenses.film_height = 0.0));
    assert!(refused(&|lenses| lenses.aperture = Some(Aperture { size: [2, 2], weights: vec![1.0] })));
    assert!(refused(&|lenses| lenses.aperture = Some(Aperture { size: [1, 1], weights: vec![0.0] })));
}
