//! Commands on pictures that are finished.

pub(crate) mod compare;
pub(crate) mod convert;
mod heat;
mod histogram;
pub(crate) mod info;
pub(crate) mod inspect;

/// `value` with so many significant digits, none of them a 0 at the end behind the point.
fn significant(value: f64, digits: i32) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    let decimals = (digits - 1 - value.abs().log10().floor() as i32).max(0) as usize;
    let text = format!("{value:.decimals$}");
    if decimals == 0 { text } else { text.trim_end_matches('0').trim_end_matches('.').to_owned() }
}
