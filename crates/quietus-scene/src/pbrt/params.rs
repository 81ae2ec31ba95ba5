//! Lists of parameters: `"float radius" [ 2 ]`, and looking them up with the types they must have.
//!
//! Whoever reads a list asks for every parameter it knows, so that [`Params::finish`] can tell which ones nobody
//! knows, and what they may have been meant to be.

use std::cell::{Cell, RefCell};
use std::rc::Rc;

use glam::{Vec2, Vec3};

use super::fault::{Context, Fault, Place, Result, unknown};
use super::lexer::{Lexer, Token};
use super::spectrum::ColorSpace;

/// Types of parameters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Bool,
    Float,
    Integer,
    Point2,
    Vector2,
    Point3,
    Vector3,
    Normal,
    String,
    Texture,
    Rgb,
    Spectrum,
    Blackbody,
}

impl Kind {
    const ALL: [(&'static str, Kind); 13] = [
        ("bool", Kind::Bool),
        ("float", Kind::Float),
        ("integer", Kind::Integer),
        ("point2", Kind::Point2),
        ("vector2", Kind::Vector2),
        ("point3", Kind::Point3),
        ("vector3", Kind::Vector3),
        ("normal", Kind::Normal),
        ("string", Kind::String),
        ("texture", Kind::Texture),
        ("rgb", Kind::Rgb),
        ("spectrum", Kind::Spectrum),
        ("blackbody", Kind::Blackbody),
    ];

    fn name(self) -> &'static str {
        Self::ALL[self as usize].0
    }
}

/// What a list may hold.
#[derive(Debug)]
pub(super) enum Values {
    Numbers(Vec<f32>),
    Integers(Vec<i32>),
    Strings(Vec<Box<str>>),
    Bools(Vec<bool>),
}

impl Values {
    fn len(&self) -> usize {
        match self {
            Values::Numbers(values) => values.len(),
            Values::Integers(values) => values.len(),
            Values::Strings(values) => values.len(),
            Values::Bools(values) => values.len(),
        }
    }
}

/// One parameter.
#[derive(Debug)]
pub(super) struct Param {
    pub kind: Kind,
    pub name: Box<str>,
    pub place: Place,
    pub values: Values,
    /// In which its `rgb` is meant.
    pub space: ColorSpace,
    used: Cell<bool>,
}

impl Param {
    /// Its numbers, if it has some.
    pub(super) fn numbers(&self) -> &[f32] {
        match &self.values {
            Values::Numbers(numbers) => numbers,
            _ => &[],
        }
    }

    fn count(&self, expected: usize) -> Result<()> {
        let found = self.values.len();
        if found == expected {
            return Ok(());
        }
        let (kind, name) = (self.kind.name(), &self.name);
        let message = format!("\"{kind} {name}\" has {found} values, expected {expected}");
        Err(Fault::invalid(self.place, message))
    }
}

/// Reads the parameters that follow a directive.
pub(super) fn parse(lexer: &mut Lexer<'_>, context: &Context, space: ColorSpace) -> Result<Vec<Param>> {
    let mut list: Vec<Param> = Vec::new();
    loop {
        match lexer.peek()?.map(|token| matches!(token, Token::Quoted(_))) {
            Some(true) => {}
            Some(false) => break,
            None if lexer.leave() => continue,
            None => break,
        }
        let Some((Token::Quoted(declaration), place)) = lexer.next()? else { break };
        let param = parameter(&declaration, place, lexer, space)?;
        if let Some(earlier) = list.iter_mut().find(|other| other.name == param.name) {
            context.warn(place, format!("\"{}\" is given twice; the last one counts", param.name));
            *earlier = param;
        } else {
            list.push(param);
        }
    }
    Ok(list)
}

fn parameter(declaration: &str, place: Place, lexer: &mut Lexer<'_>, space: ColorSpace) -> Result<Param> {
    let mut words = declaration.split_ascii_whitespace();
    let (Some(kind), Some(name), None) = (words.next(), words.next(), words.next()) else {
        let message =
            format!("\"{declaration}\" is no parameter, expected its type and name, as in \"float radius\"");
        return Err(Fault::syntax(place, message));
    };
    let Some((_, kind)) = Kind::ALL.iter().find(|(word, _)| *word == kind) else {
        return Err(Fault::invalid(place, unknown("parameter type", kind, &Kind::ALL.map(|(name, _)| name))));
    };
    let values = values(*kind, name, place, lexer)?;
    Ok(Param { kind: *kind, name: name.into(), place, values, space, used: Cell::new(false) })
}

fn values(kind: Kind, name: &str, place: Place, lexer: &mut Lexer<'_>) -> Result<Values> {
    let missing = || Fault::syntax(place, format!("\"{} {name}\" has no value", kind.name()));
    let bracketed = matches!(lexer.peek()?, Some(Token::Open));
    if bracketed {
        lexer.next()?;
    }
    let first = lexer.peek()?.ok_or_else(missing)?;
    let mut values = match (kind, first) {
        (Kind::String | Kind::Texture, _) | (Kind::Spectrum, Token::Quoted(_)) => Values::Strings(Vec::new()),
        (Kind::Bool, _) => Values::Bools(Vec::new()),
        (Kind::Integer, _) => Values::Integers(Vec::new()),
        _ => Values::Numbers(Vec::new()),
    };
    loop {
        let (token, at) = lexer.next()?.ok_or_else(missing)?;
        if bracketed && token == Token::Close {
            break;
        }
        push(&mut values, &token, at, kind, name)?;
        if !bracketed {
            break;
        }
    }
    if values.len() == 0 {
        return Err(missing());
    }
    Ok(values)
}

fn push(values: &mut Values, token: &Token<'_>, at: Place, kind: Kind, name: &str) -> Result<()> {
    let expected = |what: &str| {
        let found = token.describe();
        Fault::syntax(at, format!("{found} in \"{} {name}\", expected {what}", kind.name()))
    };
    match values {
        Values::Numbers(numbers) => match token {
            Token::Word(word) => numbers.push(number(word).ok_or_else(|| expected("a number"))?),
            _ => return Err(expected("a number")),
        },
        Values::Integers(integers) => match token {
            Token::Word(word) => integers.push(word.parse().map_err(|_| expected("an integer of 32 bits"))?),
            _ => return Err(expected("an integer")),
        },
        Values::Strings(strings) => match token {
            Token::Quoted(text) => strings.push(text.as_ref().into()),
            _ => return Err(expected("a string in quotation marks")),
        },
        Values::Bools(bools) => match token {
            Token::Word("true") => bools.push(true),
            Token::Word("false") => bools.push(false),
            Token::Quoted(text) if text == "true" || text == "false" => bools.push(text == "true"),
            _ => return Err(expected("true or false")),
        },
    }
    Ok(())
}

/// A finite number.
pub(super) fn number(word: &str) -> Option<f32> {
    word.parse().ok().filter(|value: &f32| value.is_finite())
}

/// The parameters of one directive, and those that `Attribute` gives to all of its kind.
#[derive(Debug)]
pub(super) struct Params {
    /// What they belong to, as messages call it: `shape "sphere"`.
    pub owner: String,
    /// Where its directive stands.
    pub place: Place,
    list: Vec<Param>,
    inherited: Vec<Rc<Vec<Param>>>,
    asked: RefCell<Vec<&'static str>>,
}

impl Params {
    /// `inherited` count where `list` is silent, later ones first.
    pub(super) fn new(owner: String, place: Place, list: Vec<Param>, inherited: Vec<Rc<Vec<Param>>>) -> Self {
        Self { owner, place, list, inherited, asked: RefCell::default() }
    }

    /// Parameter `name`, which must have one of `kinds`.
    pub(super) fn find(&self, name: &'static str, kinds: &[Kind]) -> Result<Option<&Param>> {
        self.asked.borrow_mut().push(name);
        let own = self.list.iter().find(|param| &*param.name == name);
        let inherited =
            || self.inherited.iter().rev().flat_map(|list| list.iter()).find(|p| &*p.name == name);
        let Some(param) = own.or_else(inherited) else { return Ok(None) };
        param.used.set(true);
        if kinds.contains(&param.kind) {
            return Ok(Some(param));
        }
        let types: Vec<_> = kinds.iter().map(|kind| kind.name()).collect();
        let message = format!(
            "\"{name}\" of {} has type {}, expected {}",
            self.owner,
            param.kind.name(),
            types.join(" or ")
        );
        Err(Fault::invalid(param.place, message))
    }

    /// Whether `name` is given, whatever its type.
    pub(super) fn has(&self, name: &str) -> bool {
        let inherited = self.inherited.iter().flat_map(|list| list.iter());
        self.list.iter().chain(inherited).any(|param| &*param.name == name)
    }

    /// Where `name` is given; else where the directive stands.
    pub(super) fn place_of(&self, name: &str) -> Place {
        self.list.iter().find(|param| &*param.name == name).map_or(self.place, |param| param.place)
    }

    /// Refuses what nobody asked for.
    pub(super) fn finish(&self) -> Result<()> {
        let Some(param) = self.list.iter().find(|param| !param.used.get()) else { return Ok(()) };
        let what = format!("parameter of {}:", self.owner);
        Err(Fault::invalid(param.place, unknown(&what, &param.name, &self.asked.borrow())))
    }

    /// Takes note of parameters that only steer what this renderer does in its own way.
    pub(super) fn ignore(&self, names: &[&'static str]) {
        self.asked.borrow_mut().extend(names);
        self.list.iter().filter(|param| names.contains(&&*param.name)).for_each(|param| param.used.set(true));
    }

    /// A number, if it is given.
    pub(super) fn float_option(&self, name: &'static str) -> Result<Option<f32>> {
        let Some(param) = self.find(name, &[Kind::Float])? else { return Ok(None) };
        param.count(1)?;
        Ok(param.numbers().first().copied())
    }

    /// A number.
    pub(super) fn float(&self, name: &'static str, default: f32) -> Result<f32> {
        Ok(self.float_option(name)?.unwrap_or(default))
    }

    /// A number for which `sound` holds; `expected` says so in words.
    pub(super) fn float_where(
        &self,
        name: &'static str,
        default: f32,
        sound: impl Fn(f32) -> bool,
        expected: &str,
    ) -> Result<f32> {
        let value = self.float(name, default)?;
        if sound(value) {
            return Ok(value);
        }
        let message = format!("\"{name}\" of {} is {value}, expected {expected}", self.owner);
        Err(Fault::invalid(self.place_of(name), message))
    }

    /// Numbers; none where they are not given.
    pub(super) fn floats(&self, name: &'static str) -> Result<&[f32]> {
        Ok(self.find(name, &[Kind::Float])?.map_or(&[], Param::numbers))
    }

    /// An integer, if it is given.
    pub(super) fn integer_option(&self, name: &'static str) -> Result<Option<i32>> {
        let Some(param) = self.find(name, &[Kind::Integer])? else { return Ok(None) };
        param.count(1)?;
        match &param.values {
            Values::Integers(values) => Ok(values.first().copied()),
            _ => Ok(None),
        }
    }

    /// An integer of at least `least`, if it is given.
    pub(super) fn integer_from(&self, name: &'static str, least: i32) -> Result<Option<u32>> {
        let Some(value) = self.integer_option(name)? else { return Ok(None) };
        if value >= least {
            return Ok(Some(value as u32));
        }
        let message = format!("\"{name}\" of {} is {value}, expected at least {least}", self.owner);
        Err(Fault::invalid(self.place_of(name), message))
    }

    /// Integers; none where they are not given.
    pub(super) fn integers(&self, name: &'static str) -> Result<&[i32]> {
        match self.find(name, &[Kind::Integer])?.map(|param| &param.values) {
            Some(Values::Integers(values)) => Ok(values),
            _ => Ok(&[]),
        }
    }

    /// A truth value.
    pub(super) fn boolean(&self, name: &'static str, default: bool) -> Result<bool> {
        let Some(param) = self.find(name, &[Kind::Bool])? else { return Ok(default) };
        param.count(1)?;
        match &param.values {
            Values::Bools(values) => Ok(values.first().copied().unwrap_or(default)),
            _ => Ok(default),
        }
    }

    /// A text, if it is given.
    pub(super) fn string(&self, name: &'static str) -> Result<Option<&str>> {
        let Some(param) = self.find(name, &[Kind::String])? else { return Ok(None) };
        param.count(1)?;
        match &param.values {
            Values::Strings(values) => Ok(values.first().map(|text| &**text)),
            _ => Ok(None),
        }
    }

    /// One of `known`, the first of them by default.
    pub(super) fn choice(&self, name: &'static str, known: &[&'static str]) -> Result<&'static str> {
        let Some(text) = self.string(name)? else { return Ok(known[0]) };
        known.iter().find(|word| **word == text).copied().ok_or_else(|| {
            Fault::invalid(self.place_of(name), unknown(&format!("{name} of {}", self.owner), text, known))
        })
    }

    /// Texts; none where they are not given.
    pub(super) fn strings(&self, name: &'static str) -> Result<&[Box<str>]> {
        match self.find(name, &[Kind::String])?.map(|param| &param.values) {
            Some(Values::Strings(values)) => Ok(values),
            _ => Ok(&[]),
        }
    }

    fn tuples<const N: usize>(&self, name: &'static str, kind: Kind) -> Result<Vec<[f32; N]>> {
        let Some(param) = self.find(name, &[kind])? else { return Ok(Vec::new()) };
        let (tuples, rest) = param.numbers().as_chunks::<N>();
        if rest.is_empty() {
            return Ok(tuples.to_vec());
        }
        let count = param.numbers().len();
        let message = format!("\"{} {name}\" has {count} values, expected a multiple of {N}", kind.name());
        Err(Fault::invalid(param.place, message))
    }

    /// Points or vectors in three dimensions; none where they are not given.
    pub(super) fn vec3s(&self, name: &'static str, kind: Kind) -> Result<Vec<Vec3>> {
        Ok(self.tuples(name, kind)?.into_iter().map(Vec3::from_array).collect())
    }

    /// Points in two dimensions; none where they are not given.
    pub(super) fn vec2s(&self, name: &'static str) -> Result<Vec<Vec2>> {
        Ok(self.tuples(name, Kind::Point2)?.into_iter().map(Vec2::from_array).collect())
    }

    /// A point or vector.
    pub(super) fn vec3(&self, name: &'static str, kind: Kind, default: Vec3) -> Result<Vec3> {
        let Some(param) = self.find(name, &[kind])? else { return Ok(default) };
        param.count(3)?;
        Ok(Vec3::from_slice(param.numbers()))
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    fn params(text: &str) -> Result<Params> {
        let mut lexer = Lexer::new(text.as_bytes(), 0);
        let place = lexer.place();
        let context = Context::new(Path::new("test.pbrt"));
        let list = parse(&mut lexer, &context, ColorSpace::Srgb)?;
        Ok(Params::new("shape \"sphere\"".to_owned(), place, list, Vec::new()))
    }

    fn sound(text: &str) -> Params {
        params(text).expect(text)
    }

    #[test]
    fn every_kind_of_value() {
        let params = sound(
            "\"float radius\" 2 \"integer count\" [3] \"bool a\" true \"bool b\" [ false ] \"bool c\" \"true\"
             \"string name\" \"x y\" \"point3 P\" [ 1 2 3 4 5 6 ] \"point2 uv\" [ .5 -1e-1 ] \"normal N\" [0 0 1]
             \"string list\" [ \"a\" \"b\" ]",
        );
        assert_eq!(params.float("radius", 0.0).expect("sound"), 2.0);
        assert_eq!(params.integer_option("count").expect("sound"), Some(3));
        for (name, value) in [("a", true), ("b", false), ("c", true)] {
            assert_eq!(params.boolean(name, !value).expect("sound"), value);
        }
        assert_eq!(params.string("name").expect("sound"), Some("x y"));
        assert_eq!(params.vec3s("P", Kind::Point3).expect("sound").len(), 2);
        assert_eq!(params.vec2s("uv").expect("sound"), [Vec2::new(0.5, -0.1)]);
        assert_eq!(params.vec3("N", Kind::Normal, Vec3::ZERO).expect("sound"), Vec3::Z);
        assert_eq!(params.strings("list").expect("sound").len(), 2);
        params.finish().expect("all were asked for");
        assert_eq!(params.float("absent", 7.0).expect("a default"), 7.0);
    }

    #[test]
    fn what_nobody_asks_for_is_refused() {
        let params = sound("\"float radius\" 1 \"float raduis\" 2");
        params.float("radius", 1.0).expect("sound");
        assert!(params.finish().is_err());
        let params = sound("\"float a\" 1");
        params.ignore(&["a"]);
        params.finish().expect("known and ignored");
    }

    #[test]
    fn types_and_counts_are_checked() {
        for (text, read) in [
            ("\"integer radius\" 1", "a type"),
            ("\"float radius\" [1 2]", "a count"),
            ("\"string radius\" \"1\"", "a string"),
        ] {
            assert!(sound(text).float("radius", 1.0).is_err(), "{read}");
        }
        assert!(sound("\"point3 P\" [1 2 3 4]").vec3s("P", Kind::Point3).is_err());
        assert!(sound("\"integer n\" -1").integer_from("n", 0).is_err());
        assert!(sound("\"string s\" \"c\"").choice("s", &["a", "b"]).is_err());
    }

    #[test]
    fn broken_lists_are_refused() {
        for text in [
            "\"float\" 1",
            "\"float a b\" 1",
            "\"flaot a\" 1",
            "\"float a\"",
            "\"float a\" []",
            "\"float a\" [1",
            "\"float a\" [[1]]",
            "\"float a\" x",
            "\"float a\" nan",
            "\"float a\" inf",
            "\"float a\" 1e99",
            "\"integer a\" 1.5",
            "\"integer a\" 3000000000",
            "\"bool a\" 1",
            "\"string a\" b",
            "\"spectrum a\" [\"x\" 1]",
            "\"spectrum a\" [1 \"x\"]",
        ] {
            assert!(params(text).is_err(), "{text}");
        }
    }

    #[test]
    fn attributes_count_where_the_list_is_silent() {
        let inherited = sound("\"float a\" 1 \"float b\" 2").list;
        let own = sound("\"float b\" 3").list;
        let params = Params::new(String::new(), sound("").place, own, vec![Rc::new(inherited)]);
        assert_eq!(params.float("a", 0.0).expect("inherited"), 1.0);
        assert_eq!(params.float("b", 0.0).expect("its own"), 3.0);
        params.finish().expect("inherited ones need not be used");
    }
}
