//! Curves: Bezier curves and B-splines of degree 2 and 3, cut into cubic Bezier segments.

use glam::Vec3;
use quietus_trace::desc::{CurveKind, CurveSegment, Curves};

use super::fault::{Context, Fault, Result};
use super::params::{Kind, Params};

/// Reads a curve; `None` where it has no width.
pub(super) fn read(params: &Params, context: &Context) -> Result<Option<Curves>> {
    let degree = match params.integer_option("degree")?.unwrap_or(3) {
        2 => 2,
        3 => 3,
        other => {
            let message = format!("\"degree\" of a curve is {other}, expected 2 or 3");
            return Err(Fault::invalid(params.place_of("degree"), message));
        }
    };
    let bezier = params.choice("basis", &["bezier", "bspline"])? == "bezier";
    let points = params.vec3s("P", Kind::Point3)?;
    let count = segment_count(params, points.len(), degree, bezier)?;
    let kind = match params.choice("type", &["flat", "cylinder", "ribbon"])? {
        "flat" => CurveKind::Flat,
        "cylinder" => CurveKind::Cylinder,
        _ => CurveKind::Ribbon,
    };
    let normals = normals(params, context, kind, count)?;
    let width = params.float("width", 1.0)?;
    let widths = [params.float("width0", width)?, params.float("width1", width)?];
    if widths.iter().any(|width| *width < 0.0) {
        return Err(Fault::invalid(params.place, "the curve has a width below 0"));
    }
    // Segments are split as the hierarchy over them needs it.
    params.ignore(&["splitdepth"]);
    if widths == [0.0; 2] {
        return Ok(None);
    }
    let segments = (0..count).map(|i| {
        let first = if bezier { i * degree } else { i };
        let points = &points[first..=first + degree];
        let width = |end: usize| widths[0] + (widths[1] - widths[0]) * (i + end) as f32 / count as f32;
        CurveSegment {
            points: cubic_bezier(points, bezier),
            widths: [width(0), width(1)],
            u_range: [0.0, 1.0],
            normals: if normals.is_empty() { [Vec3::ZERO; 2] } else { [normals[i], normals[i + 1]] },
        }
    });
    Ok(Some(Curves { kind, segments: segments.collect() }))
}

fn segment_count(params: &Params, points: usize, degree: usize, bezier: bool) -> Result<usize> {
    let refuse = |expected: String| {
        let message = format!("a curve of {points} points, expected {expected}");
        Err(Fault::invalid(params.place_of("P"), message))
    };
    if bezier {
        // Each segment after the first starts where the last one ended.
        if points <= degree || !(points - 1).is_multiple_of(degree) {
            return refuse(format!("{} and then multiples of {degree} more", degree + 1));
        }
        Ok((points - 1) / degree)
    } else if points <= degree {
        refuse(format!("at least {}", degree + 1))
    } else {
        Ok(points - degree)
    }
}

fn normals(params: &Params, context: &Context, kind: CurveKind, segments: usize) -> Result<Vec<Vec3>> {
    let normals = params.vec3s("N", Kind::Normal)?;
    if kind != CurveKind::Ribbon {
        if !normals.is_empty() {
            context.warn(params.place_of("N"), "normals \"N\" of curves are only used for ribbons");
        }
        return Ok(Vec::new());
    }
    if normals.len() != segments + 1 {
        let message = format!(
            "a ribbon of {segments} segments has {} normals, expected {}",
            normals.len(),
            segments + 1
        );
        return Err(Fault::invalid(params.place_of("N"), message));
    }
    let unit = normals.iter().map(|normal| normal.try_normalize());
    unit.collect::<Option<Vec<_>>>()
        .ok_or_else(|| Fault::invalid(params.place_of("N"), "a normal of a ribbon has length 0"))
}

/// The cubic Bezier segment of 3 or 4 control points of either basis.
fn cubic_bezier(points: &[Vec3], bezier: bool) -> [Vec3; 4] {
    match (points, bezier) {
        (&[a, b, c, d], true) => [a, b, c, d],
        // The de Boor points of a cubic uniform B-spline, by knot insertion.
        (&[a, b, c, d], false) => {
            let (ab, bc1, bc2, cd) =
                (a.lerp(b, 2.0 / 3.0), b.lerp(c, 1.0 / 3.0), b.lerp(c, 2.0 / 3.0), c.lerp(d, 1.0 / 3.0));
            [ab.midpoint(bc1), bc1, bc2, bc2.midpoint(cd)]
        }
        (&[a, b, c], true) => elevate(a, b, c),
        (&[a, b, c], false) => elevate(a.midpoint(b), b, b.midpoint(c)),
        _ => unreachable!("a curve of degree 2 or 3 has 3 or 4 control points"),
    }
}

/// A quadratic Bezier curve as a cubic one.
fn elevate(a: Vec3, b: Vec3, c: Vec3) -> [Vec3; 4] {
    [a, a.lerp(b, 2.0 / 3.0), c.lerp(b, 2.0 / 3.0), c]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bezier_at([a, b, c, d]: [Vec3; 4], t: f32) -> Vec3 {
        let s = 1.0 - t;
        s * s * s * a + 3.0 * s * s * t * b + 3.0 * s * t * t * c + t * t * t * d
    }

    const POINTS: [Vec3; 4] =
        [Vec3::ZERO, Vec3::new(1.0, 2.0, 0.0), Vec3::new(3.0, -1.0, 1.0), Vec3::new(4.0, 1.0, 5.0)];

    /// The basis functions of uniform B-splines, as any textbook has them.
    #[test]
    fn splines_become_the_same_curves() {
        for i in 0..=8 {
            let t = i as f32 / 8.0;
            let s = 1.0 - t;
            let [a, b, c, d] = POINTS;
            let cubic = (s * s * s * a
                + (3.0 * t * t * t - 6.0 * t * t + 4.0) * b
                + (-3.0 * t * t * t + 3.0 * t * t + 3.0 * t + 1.0) * c
                + t * t * t * d)
                / 6.0;
            let quadratic = 0.5 * (s * s * a + (-2.0 * t * t + 2.0 * t + 1.0) * b + t * t * c);
            let plain = s * s * a + 2.0 * s * t * b + t * t * c;
            for (expected, points, bezier) in
                [(cubic, &POINTS[..], false), (quadratic, &POINTS[..3], false), (plain, &POINTS[..3], true)]
            {
                let found = bezier_at(cubic_bezier(points, bezier), t);
                assert!((found - expected).length() < 1e-5, "{found} {expected}");
            }
        }
    }
}
