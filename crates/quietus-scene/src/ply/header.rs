//! The header of a PLY file: its format, and the elements with their properties.

use std::path::Path;

use crate::error::{ErrorKind, SceneError};

/// How the numbers after the header are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Format {
    Text,
    LittleEndian,
    BigEndian,
}

/// Types of numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Number {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Number {
    fn named(name: &str) -> Option<Self> {
        Some(match name {
            "char" | "int8" => Self::I8,
            "uchar" | "uint8" => Self::U8,
            "short" | "int16" => Self::I16,
            "ushort" | "uint16" => Self::U16,
            "int" | "int32" => Self::I32,
            "uint" | "uint32" => Self::U32,
            "float" | "float32" => Self::F32,
            "double" | "float64" => Self::F64,
            _ => return None,
        })
    }

    /// In bytes.
    pub(super) const fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }

    pub(super) const fn is_integer(self) -> bool {
        !matches!(self, Self::F32 | Self::F64)
    }
}

/// A property of an element.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Property {
    pub name: String,
    /// The type of the value, or of the values of a list.
    pub number: Number,
    /// The type of a list's length.
    pub list: Option<Number>,
}

impl Property {
    pub(super) fn is_scalar(&self, name: &str) -> bool {
        self.list.is_none() && self.name == name
    }
}

/// An element: a table of as many rows as `count`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Element {
    pub name: String,
    pub count: u64,
    pub properties: Vec<Property>,
}

impl Element {
    /// Fewest bytes that a binary row takes: lists may be empty.
    pub(super) fn least_row(&self) -> usize {
        self.properties.iter().map(|property| property.list.unwrap_or(property.number).size()).sum()
    }

    pub(super) fn has_lists(&self) -> bool {
        self.properties.iter().any(|property| property.list.is_some())
    }
}

/// What a file holds.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Header {
    pub format: Format,
    pub elements: Vec<Element>,
}

/// Longest header: programs write comments, but not books.
const MAX_BYTES: usize = 1 << 20;

/// Reads the header of `bytes`, and says where it ends.
pub(super) fn read(path: &Path, bytes: &[u8]) -> Result<(Header, usize), SceneError> {
    let fail =
        |line: usize, message: String| SceneError::new(ErrorKind::Syntax, path, line.to_string(), message);
    let mut format = None;
    let mut elements: Vec<Element> = Vec::new();
    let mut at = 0;
    for number in 1.. {
        let rest = &bytes[at..bytes.len().min(MAX_BYTES)];
        let Some(length) = rest.iter().position(|&byte| byte == b'\n') else {
            let message =
                if number == 1 { "expected the line \"ply\"" } else { "the header has no end_header" };
            return Err(fail(number, message.to_owned()));
        };
        at += length + 1;
        let line = String::from_utf8_lossy(&rest[..length]);
        let words: Vec<&str> = line.split_ascii_whitespace().collect();
        match words[..] {
            ["ply"] if number == 1 => {}
            _ if number == 1 => return Err(fail(1, "expected the line \"ply\"".to_owned())),
            ["format", name, "1.0"] => {
                format = Some(named_format(name).map_err(|message| fail(number, message))?)
            }
            ["element", name, count] => {
                let count =
                    count.parse().map_err(|_| fail(number, format!("{count}, expected a number of rows")))?;
                elements.push(Element { name: name.to_owned(), count, properties: Vec::new() });
            }
            ["property", ref words @ ..] => {
                let property = property(words).map_err(|message| fail(number, message))?;
                let element = elements.last_mut();
                let element =
                    element.ok_or_else(|| fail(number, "a property before any element".to_owned()))?;
                element.properties.push(property);
            }
            ["end_header"] => break,
            ["comment" | "obj_info", ..] | [] => {}
            _ => return Err(fail(number, format!("unknown line \"{line}\""))),
        }
    }
    let format = format.ok_or_else(|| fail(2, "the header names no format".to_owned()))?;
    Ok((Header { format, elements }, at))
}

fn named_format(name: &str) -> Result<Format, String> {
    match name {
        "ascii" => Ok(Format::Text),
        "binary_little_endian" => Ok(Format::LittleEndian),
        "binary_big_endian" => Ok(Format::BigEndian),
        _ => Err(format!("format {name}, expected ascii, binary_little_endian or binary_big_endian")),
    }
}

fn property(words: &[&str]) -> Result<Property, String> {
    let number = |name: &str| Number::named(name).ok_or_else(|| format!("{name} is no type of number"));
    match *words {
        ["list", length, value, name] => {
            let length = number(length)?;
            if !length.is_integer() {
                return Err("the length of a list is a float, expected an integer".to_owned());
            }
            Ok(Property { name: name.to_owned(), number: number(value)?, list: Some(length) })
        }
        [value, name] => Ok(Property { name: name.to_owned(), number: number(value)?, list: None }),
        _ => Err("expected \"property TYPE NAME\" or \"property list TYPE TYPE NAME\"".to_owned()),
    }
}
