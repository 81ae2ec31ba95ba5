//! Values of flags: what is read, and what is said of the rest.

use std::fmt::Display;
use std::net::IpAddr;
use std::num::NonZeroUsize;
use std::ops::RangeInclusive;
use std::str::FromStr;
use std::time::Duration;

use quietus_film::Window;
use quietus_render::noise::Aov;

/// Reads a whole number in `range`.
pub(crate) fn within<T>(range: RangeInclusive<T>) -> impl Fn(&str) -> Result<T, String> + Clone + Send + Sync
where
    T: FromStr + PartialOrd + Display + Clone + Send + Sync,
{
    move |text| {
        let number = text.parse().ok().filter(|number| range.contains(number));
        number.ok_or_else(|| format!("expected a whole number from {} to {}", range.start(), range.end()))
    }
}

pub(crate) fn parse_size(text: &str) -> Result<[u32; 2], String> {
    let parsed = text.split_once(['x', 'X']).and_then(|(w, h)| Some([w.parse().ok()?, h.parse().ok()?]));
    parsed.ok_or_else(|| "expected width and height in pixels, such as 1280x720".to_owned())
}

pub(crate) fn parse_window(text: &str) -> Result<Window, String> {
    let numbers: Option<Vec<u32>> = text.split(',').map(|n| n.trim().parse().ok()).collect();
    match numbers.as_deref() {
        Some(&[x0, y0, x1, y1]) => Ok(Window { x0, y0, x1, y1 }),
        _ => Err("expected four whole numbers x0,y0,x1,y1, such as 100,50,300,200".to_owned()),
    }
}

pub(crate) fn parse_frames(text: &str) -> Result<[u32; 2], String> {
    let frames = text.split_once('-').and_then(|(a, b)| Some([a.parse().ok()?, b.parse().ok()?]));
    let sound = frames.filter(|[first, last]| first <= last);
    sound.ok_or_else(|| "expected the first and the last frame, such as 1-48".to_owned())
}

pub(crate) fn parse_fps(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(fps) if (1e-3..=1e6).contains(&fps) => Ok(fps),
        _ => Err("expected frames per second, such as 24 or 29.97".to_owned()),
    }
}

pub(crate) fn parse_share(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(share) if (0.0..=1.0).contains(&share) => Ok(share),
        _ => Err("expected a number from 0 to 1, such as 0.5".to_owned()),
    }
}

pub(crate) fn parse_error(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(error) if error.is_finite() && error > 0.0 => Ok(error),
        _ => Err("expected a number above 0, such as 0.002".to_owned()),
    }
}

/// As a share.
pub(crate) fn parse_noise(text: &str) -> Result<f64, String> {
    let percent = text.strip_suffix('%').unwrap_or(text).trim_end().parse::<f64>();
    match percent {
        Ok(percent) if percent > 0.0 && percent <= 100.0 => Ok(percent / 100.0),
        _ => Err("expected percent of white, above 0 and up to 100, such as 1% or 0.5%".to_owned()),
    }
}

/// As a share.
pub(crate) fn parse_aov_noise(text: &str) -> Result<(Aov, f64), String> {
    let names = || Aov::ALL.map(Aov::name).join(", ");
    let parts = text.split_once('=');
    let aov = parts.and_then(|(name, _)| Aov::ALL.into_iter().find(|aov| aov.name() == name.trim()));
    match aov.zip(parts) {
        Some((aov, (_, noise))) => Ok((aov, parse_noise(noise.trim())?)),
        None => Err(format!("expected one of {} and its noise, such as normal=2%", names())),
    }
}

pub(crate) fn parse_factor(text: &str) -> Result<f32, String> {
    match text.parse::<f32>() {
        Ok(factor) if factor.is_finite() && factor > 0.0 => Ok(factor),
        _ => Err("expected a number above 0, such as 0.5".to_owned()),
    }
}

pub(crate) fn parse_stops(text: &str) -> Result<f32, String> {
    match text.parse::<f32>() {
        Ok(stops) if stops.abs() <= 64.0 => Ok(stops),
        _ => Err("expected a number of stops from -64 to 64, such as -1.5".to_owned()),
    }
}

pub(crate) fn parse_limit(text: &str) -> Result<f32, String> {
    match text.parse::<f32>() {
        Ok(limit) if limit > 0.0 => Ok(limit),
        _ => Err("expected a number above 0, or inf".to_owned()),
    }
}

pub(crate) fn parse_time(text: &str) -> Result<Duration, String> {
    let seconds = text.parse::<f64>().ok().and_then(|s| Duration::try_from_secs_f64(s).ok());
    match seconds.or_else(|| humantime::parse_duration(text).ok()) {
        Some(time) if !time.is_zero() => Ok(time),
        _ => Err("expected a time above 0, such as 90s, 5m or \"1h 30m\"".to_owned()),
    }
}

pub(crate) fn parse_ip(text: &str) -> Result<IpAddr, String> {
    text.parse().map_err(|_| "expected an IP address, such as 127.0.0.1 or ::1".to_owned())
}

/// More threads than this only cost memory on any machine there is.
const MOST_THREADS: usize = 1024;

pub(crate) fn parse_threads(text: &str) -> Result<NonZeroUsize, String> {
    let threads = text.parse().ok().filter(|threads: &NonZeroUsize| threads.get() <= MOST_THREADS);
    threads.ok_or_else(|| format!("expected a number of threads from 1 to {MOST_THREADS}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_read_or_refused() {
        assert_eq!(parse_size("1280x720"), Ok([1280, 720]));
        for bad in ["1280", "1280x", "x", "-1x4", "1.5x2", "1x2x3", "99999999999x1"] {
            assert!(parse_size(bad).is_err(), "{bad}");
        }
        assert_eq!(parse_window("1,2, 3,4"), Ok(Window { x0: 1, y0: 2, x1: 3, y1: 4 }));
        for bad in ["1,2,3", "1,2,3,4,5", "a,2,3,4", "-1,2,3,4", ""] {
            assert!(parse_window(bad).is_err(), "{bad}");
        }
        for bad in ["nan", "NaN", "inf", "0", "-1", "x", ""] {
            assert!(parse_error(bad).is_err(), "{bad}");
        }
        for bad in ["nan", "0", "-1", "x", ""] {
            assert!(parse_factor(bad).is_err() && parse_limit(bad).is_err(), "{bad}");
        }
        assert_eq!(["1%", "1 %", "1"].map(parse_noise), [const { Ok(0.01) }; 3]);
        for bad in ["0", "-1%", "101%", "nan", "%", "1%%", ""] {
            assert!(parse_noise(bad).is_err(), "{bad}");
        }
        assert_eq!(parse_aov_noise("normal=2%"), Ok((Aov::Normal, 0.02)));
        for bad in ["normal", "depth=1%", "alpha=0", "=1", ""] {
            assert!(parse_aov_noise(bad).is_err(), "{bad}");
        }
        assert!(parse_factor("inf").is_err() && parse_limit("inf") == Ok(f32::INFINITY));
        assert_eq!(parse_time("90"), Ok(Duration::from_secs(90)));
        assert_eq!(parse_time("1m 30s"), Ok(Duration::from_secs(90)));
        assert_eq!(parse_time("0.5"), Ok(Duration::from_millis(500)));
        for bad in ["0", "-3", "nan", "inf", "1e300", "soon", "0s"] {
            assert!(parse_time(bad).is_err(), "{bad}");
        }
        assert!(parse_threads("0").is_err() && parse_threads("1025").is_err() && parse_threads("4").is_ok());
    }
}
