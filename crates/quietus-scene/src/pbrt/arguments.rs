//! What stands behind a directive's word: strings, numbers and matrices.

use glam::{DAffine3, DMat4, DVec3};

use super::fault::{Fault, Place, Result};
use super::lexer::{Lexer, Token};
use super::params::number;

/// The next token; there must be one.
pub(super) fn required<'a>(word: &str, lexer: &mut Lexer<'a>) -> Result<(Token<'a>, Place)> {
    let place = lexer.place();
    lexer.next()?.ok_or_else(|| Fault::syntax(place, format!("the file ends inside {word}")))
}

/// A string in quotation marks.
pub(super) fn string(word: &str, lexer: &mut Lexer<'_>) -> Result<String> {
    match required(word, lexer)? {
        (Token::Quoted(text), _) => Ok(text.into_owned()),
        (other, at) => {
            let message = format!("{} after {word}, expected a string in quotation marks", other.describe());
            Err(Fault::syntax(at, message))
        }
    }
}

/// Numbers without brackets.
pub(super) fn numbers<const N: usize>(word: &str, lexer: &mut Lexer<'_>) -> Result<[f64; N]> {
    let mut values = [0.0; N];
    for value in &mut values {
        let (token, at) = required(word, lexer)?;
        let found = match token {
            Token::Word(text) => number(text).and_then(|_| text.parse().ok()),
            _ => None,
        };
        *value = found.ok_or_else(|| {
            let message = format!("{} in {word}, expected {N} numbers", token.describe());
            Fault::syntax(at, message)
        })?;
    }
    Ok(values)
}

/// Three points.
pub(super) fn points([a, b, c, d, e, f, g, h, i]: [f64; 9]) -> [DVec3; 3] {
    [DVec3::new(a, b, c), DVec3::new(d, e, f), DVec3::new(g, h, i)]
}

/// Sixteen numbers, column by column, in brackets or not.
pub(super) fn matrix(word: &str, place: Place, lexer: &mut Lexer<'_>) -> Result<DAffine3> {
    let bracketed = matches!(lexer.peek()?, Some(Token::Open));
    if bracketed {
        lexer.next()?;
    }
    let values = numbers::<16>(word, lexer)?;
    if bracketed && !matches!(required(word, lexer)?.0, Token::Close) {
        return Err(Fault::syntax(place, format!("{word} expects 16 numbers and a closing bracket")));
    }
    let mut matrix = DMat4::from_cols_array(&values);
    let last = matrix.row(3);
    // Programs that write matrices leave a last digit here.
    let flat = last.truncate().abs().max_element() <= ROUNDING * last.w.abs();
    if !flat || last.w == 0.0 {
        return Err(Fault::unsupported(
            place,
            format!("{word} with perspective, expected 0 0 0 1 as last row"),
        ));
    }
    matrix *= 1.0 / last.w;
    Ok(DAffine3::from_mat4(matrix))
}

/// What is no perspective but the rounding of single precision.
const ROUNDING: f64 = 1e-6;
