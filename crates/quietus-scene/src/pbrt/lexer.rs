//! The words of pbrt's language, one at a time: bare words and numbers, quoted strings, brackets. `#` starts a
//! comment that ends with the line.

use std::borrow::Cow;

use super::fault::{Fault, Place, Result};

/// One word.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Token<'a> {
    /// A directive, a number, `true` or `false`.
    Word(&'a str),
    /// What stands between quotation marks, its escapes replaced.
    Quoted(Cow<'a, str>),
    /// `[`
    Open,
    /// `]`
    Close,
}

impl Token<'_> {
    /// How messages call it.
    pub(super) fn describe(&self) -> String {
        // Enough to recognise it.
        const LONGEST: usize = 40;
        let cut = |text: &str| match text.char_indices().nth(LONGEST) {
            Some((end, _)) => format!("{}...", &text[..end]),
            None => text.to_owned(),
        };
        match self {
            Token::Word(word) => cut(word),
            Token::Quoted(text) => format!("\"{}\"", cut(text)),
            Token::Open => "[".to_owned(),
            Token::Close => "]".to_owned(),
        }
    }
}

/// Hands out the tokens of a text, borrowed from it.
#[derive(Clone, Debug)]
pub(super) struct Lexer<'a> {
    text: &'a [u8],
    at: usize,
    file: u32,
    line: u32,
    /// Where the line starts.
    line_start: usize,
    peeked: Option<(Token<'a>, Place)>,
    /// The text that includes this one, after the name of this one.
    outer: Option<Box<Lexer<'a>>>,
    /// How many texts have been left for the one that includes them.
    left: usize,
}

/// A place to go on from, in the text that is `left` texts further out.
#[derive(Clone, Copy, Debug)]
pub(super) struct Mark {
    left: usize,
    at: usize,
    line: u32,
    line_start: usize,
}

const fn ends_word(byte: u8) -> bool {
    matches!(byte, b' ' | b'\t' | b'\n' | b'\r' | b'"' | b'[' | b']' | b'#')
}

impl<'a> Lexer<'a> {
    /// Starts at the beginning of `text`, the content of file number `file`.
    pub(super) fn new(text: &'a [u8], file: u32) -> Self {
        // Some editors begin files with a byte order mark.
        let at = if text.starts_with(b"\xef\xbb\xbf") { 3 } else { 0 };
        Self { text, at, file, line: 1, line_start: 0, peeked: None, outer: None, left: 0 }
    }

    /// Starts a text that `outer` includes. A list of parameters at its end goes on there, as in pbrt, for which
    /// included files are one text with what includes them.
    pub(super) fn within<'b: 'a>(text: &'a [u8], file: u32, outer: &Lexer<'b>) -> Self {
        Self { outer: Some(Box::new(outer.clone())), ..Self::new(text, file) }
    }

    /// At the end of an included text: goes on in the one that includes it. False where there is none.
    pub(super) fn leave(&mut self) -> bool {
        let Some(outer) = self.outer.take() else { return false };
        *self = Self { left: self.left + 1, ..*outer };
        true
    }

    /// Where this has got to outside of the text it started in, if it has left it.
    pub(super) fn mark(&self) -> Option<Mark> {
        let at = match &self.peeked {
            // No token goes over the end of its line.
            Some((_, place)) => self.line_start + place.column as usize - 1,
            None => self.at,
        };
        let Self { left, line, line_start, .. } = *self;
        (left > 0).then_some(Mark { left, at, line, line_start })
    }

    /// Goes on where an included text has got to.
    pub(super) fn resume(&mut self, Mark { left, at, line, line_start }: Mark) {
        for _ in 1..left {
            self.leave();
        }
        (self.at, self.line, self.line_start, self.peeked) = (at, line, line_start, None);
    }

    /// The place of the next token, or the end.
    pub(super) fn place(&mut self) -> Place {
        if let Some((_, place)) = &self.peeked {
            return *place;
        }
        self.skip();
        self.here()
    }

    /// The next token, without taking it; `None` at the end.
    pub(super) fn peek(&mut self) -> Result<Option<&Token<'a>>> {
        if self.peeked.is_none() {
            self.peeked = self.read()?;
        }
        Ok(self.peeked.as_ref().map(|(token, _)| token))
    }

    /// Takes the next token; `None` at the end.
    pub(super) fn next(&mut self) -> Result<Option<(Token<'a>, Place)>> {
        match self.peeked.take() {
            Some(token) => Ok(Some(token)),
            None => self.read(),
        }
    }

    fn here(&self) -> Place {
        Place { file: self.file, line: self.line, column: (self.at - self.line_start) as u32 + 1 }
    }

    /// Moves to the next token.
    fn skip(&mut self) {
        while let Some(&byte) = self.text.get(self.at) {
            match byte {
                b'\n' => {
                    self.at += 1;
                    self.line += 1;
                    self.line_start = self.at;
                }
                b' ' | b'\t' | b'\r' => self.at += 1,
                b'#' => {
                    let rest = &self.text[self.at..];
                    self.at += rest.iter().position(|&b| b == b'\n').unwrap_or(rest.len());
                }
                _ => return,
            }
        }
    }

    fn read(&mut self) -> Result<Option<(Token<'a>, Place)>> {
        self.skip();
        let place = self.here();
        let Some(&byte) = self.text.get(self.at) else { return Ok(None) };
        let token = match byte {
            b'[' => self.bracket(Token::Open),
            b']' => self.bracket(Token::Close),
            b'"' => self.quoted(place)?,
            _ => {
                let rest = &self.text[self.at..];
                let length = rest.iter().position(|&b| ends_word(b)).unwrap_or(rest.len());
                self.at += length;
                Token::Word(utf8(&rest[..length], place)?)
            }
        };
        Ok(Some((token, place)))
    }

    fn bracket(&mut self, token: Token<'a>) -> Token<'a> {
        self.at += 1;
        token
    }

    fn quoted(&mut self, place: Place) -> Result<Token<'a>> {
        let start = self.at + 1;
        let rest = &self.text[start..];
        let stop = rest.iter().position(|&b| matches!(b, b'"' | b'\\' | b'\n'));
        match stop.map(|stop| (stop, rest[stop])) {
            Some((length, b'"')) => {
                self.at = start + length + 1;
                Ok(Token::Quoted(Cow::Borrowed(utf8(&rest[..length], place)?)))
            }
            Some((_, b'\\')) => self.escaped(start, place),
            _ => Err(Fault::syntax(place, "the string has no closing quotation mark on its line")),
        }
    }

    /// A string with escapes in it.
    fn escaped(&mut self, start: usize, place: Place) -> Result<Token<'a>> {
        let mut text = Vec::new();
        let mut bytes = self.text[start..].iter().enumerate();
        while let Some((at, &byte)) = bytes.next() {
            match byte {
                b'"' => {
                    self.at = start + at + 1;
                    return Ok(Token::Quoted(Cow::Owned(utf8(&text, place)?.to_owned())));
                }
                b'\n' => break,
                b'\\' => text.push(match bytes.next().map(|(_, &escape)| escape) {
                    Some(b'b') => 8,
                    Some(b'f') => 12,
                    Some(b'n') => b'\n',
                    Some(b'r') => b'\r',
                    Some(b't') => b'\t',
                    Some(same @ (b'\\' | b'\'' | b'"')) => same,
                    _ => {
                        let place = Place { column: place.column + 1 + at as u32, ..place };
                        let message = "unknown escape, expected \\b \\f \\n \\r \\t \\\\ \\' or \\\"";
                        return Err(Fault::syntax(place, message));
                    }
                }),
                _ => text.push(byte),
            }
        }
        Err(Fault::syntax(place, "the string has no closing quotation mark on its line"))
    }
}

fn utf8(bytes: &[u8], place: Place) -> Result<&str> {
    std::str::from_utf8(bytes).map_err(|_| Fault::syntax(place, "the text is not UTF-8"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tokens(text: &str) -> Vec<(String, u32, u32)> {
        let mut lexer = Lexer::new(text.as_bytes(), 0);
        let mut all = Vec::new();
        while let Some((token, place)) = lexer.next().expect("a sound text") {
            all.push((token.describe(), place.line, place.column));
        }
        all
    }

    fn words(text: &str) -> Vec<String> {
        tokens(text).into_iter().map(|(token, ..)| token).collect()
    }

    #[test]
    fn words_strings_and_brackets_with_their_places() {
        let found = tokens("Shape \"sphere\"\n  \"float radius\" [ -1.5e3 ]");
        let expected = [
            ("Shape", 1, 1),
            ("\"sphere\"", 1, 7),
            ("\"float radius\"", 2, 3),
            ("[", 2, 18),
            ("-1.5e3", 2, 20),
            ("]", 2, 27),
        ];
        assert_eq!(found, expected.map(|(token, line, column)| (token.to_owned(), line, column)));
    }

    #[test]
    fn brackets_and_quotes_end_words() {
        assert_eq!(
            words("[0 1 2]\"a\"[b]c#d\ne"),
            ["[", "0", "1", "2", "]", "\"a\"", "[", "b", "]", "c", "e"]
        );
    }

    #[test]
    fn comments_byte_order_marks_and_line_ends() {
        assert_eq!(words("\u{feff}# nothing\r\na\r\n# \"open\nb # [\n"), ["a", "b"]);
        assert_eq!(words(""), [""; 0]);
        assert_eq!(words("#"), [""; 0]);
    }

    #[test]
    fn escapes_are_replaced() {
        let mut lexer = Lexer::new(br#""a\"b\\c\td" x"#, 0);
        let (token, _) = lexer.next().expect("sound").expect("a token");
        assert_eq!(token, Token::Quoted(Cow::Owned("a\"b\\c\td".to_owned())));
        assert_eq!(lexer.next().expect("sound").expect("a token").0, Token::Word("x"));
    }

    #[test]
    fn peeking_takes_nothing() {
        let mut lexer = Lexer::new(b" a b", 3);
        assert_eq!(lexer.peek().expect("sound"), Some(&Token::Word("a")));
        assert_eq!(lexer.place(), Place { file: 3, line: 1, column: 2 });
        assert_eq!(lexer.next().expect("sound").map(|(token, _)| token), Some(Token::Word("a")));
        assert_eq!(lexer.place(), Place { file: 3, line: 1, column: 4 });
    }

    #[test]
    fn broken_strings_are_refused() {
        for text in ["\"open", "\"open\n\"", "\"a\\", "\"a\\q\"", "\"a\\n", "\"\\t\n\"", "\"\u{80}"] {
            assert!(Lexer::new(text.as_bytes(), 0).next().is_err(), "{text}");
        }
        assert!(Lexer::new(b"\"\xff\"", 0).next().is_err());
        assert!(Lexer::new(b"a\xff", 0).next().is_err());
    }
}
