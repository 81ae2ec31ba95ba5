//! Who may come in: those with the token, at an address that no other name leads to, from our own page.
//!
//! A page of another origin can make a browser send requests here. It does not know the token; what it sends carries its
//! own origin; and a name of its own that leads to this address (DNS rebinding) shows up in the `Host` header, which must
//! be an address or `localhost`.

use std::net::IpAddr;
use std::sync::Arc;

use axum::extract::{Request, State};
use axum::http::uri::Authority;
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};

/// The secret in the address.
#[derive(Clone, PartialEq, Eq)]
pub struct Token(String);

/// A token that is too easy to guess, or that no address can hold.
#[derive(Clone, Copy, Debug, thiserror::Error)]
#[error("a token needs at least {LEAST_LENGTH} letters, digits, `-` or `_`")]
pub struct TokenError;

/// Bytes of chance in a token.
const TOKEN_BYTES: usize = 16;

/// Fewest characters of a token that was chosen by somebody.
const LEAST_LENGTH: usize = 16;

impl Token {
    /// 128 bits from the system's source of chance.
    ///
    /// # Errors
    /// When the system has none.
    pub fn random() -> Result<Self, getrandom::Error> {
        let mut bytes = [0; TOKEN_BYTES];
        getrandom::fill(&mut bytes)?;
        Ok(Self(bytes.iter().map(|byte| format!("{byte:02x}")).collect()))
    }

    /// One that was chosen, so that an address stays valid when the program is started again.
    ///
    /// # Errors
    /// When it is short, or has characters that addresses spell differently.
    pub fn chosen(text: &str) -> Result<Self, TokenError> {
        let plain = text.bytes().all(|byte| byte.is_ascii_alphanumeric() || b"-_".contains(&byte));
        if plain && text.len() >= LEAST_LENGTH { Ok(Self(text.to_owned())) } else { Err(TokenError) }
    }

    /// As it stands in the address.
    pub(crate) fn as_str(&self) -> &str {
        &self.0
    }

    /// Compares in a time that does not tell how much of it was right.
    fn matches(&self, other: &str) -> bool {
        let differing = self.0.bytes().zip(other.bytes()).fold(0, |all, (a, b)| all | (a ^ b));
        self.0.len() == other.len() && differing == 0
    }
}

impl std::fmt::Debug for Token {
    /// Not for logs.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Token(..)")
    }
}

/// Lets through what may pass, and puts on every answer what keeps other pages out of ours.
pub(crate) async fn guard(State(token): State<Arc<Token>>, request: Request, next: Next) -> Response {
    let given = request.uri().path().split('/').nth(1).unwrap_or_default();
    let mut response = match check_origin(request.headers()) {
        Err(problem) => (StatusCode::FORBIDDEN, problem).into_response(),
        Ok(()) if !token.matches(given) => (StatusCode::FORBIDDEN, NO_TOKEN).into_response(),
        Ok(()) => next.run(request).await,
    };
    for (name, value) in HEADERS {
        response.headers_mut().insert(name, HeaderValue::from_static(value));
    }
    response
}

const NO_TOKEN: &str = "The address lacks its token, or the token is of another run: use the address that \
                        `quietus` printed.\n";

/// No scripts, styles, pictures and connections but our own; no frames around us; nothing kept, nothing passed on.
const HEADERS: [(header::HeaderName, &str); 6] = [
    (
        header::CONTENT_SECURITY_POLICY,
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:; connect-src 'self'; \
         base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    ),
    (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
    (header::X_FRAME_OPTIONS, "DENY"),
    (header::REFERRER_POLICY, "no-referrer"),
    (header::CACHE_CONTROL, "no-store"),
    (header::HeaderName::from_static("cross-origin-resource-policy"), "same-origin"),
];

/// Whether `Host` is an address or `localhost`, and `Origin`, where there is one, is the same.
fn check_origin(headers: &HeaderMap) -> Result<(), &'static str> {
    let text = |name| headers.get(name).map(|value| value.to_str().unwrap_or_default());
    let host = text(header::HOST).unwrap_or_default();
    if !is_address(host) {
        return Err("Only an IP address or `localhost` may stand before the port.\n");
    }
    match text(header::ORIGIN) {
        Some(origin) if origin.strip_prefix("http://") != Some(host) => {
            Err("Pages of other origins have no business here.\n")
        }
        _ => Ok(()),
    }
}

fn is_address(host: &str) -> bool {
    let Ok(authority) = host.parse::<Authority>() else { return false };
    let name = authority.host();
    let bare = name.strip_prefix('[').and_then(|name| name.strip_suffix(']')).unwrap_or(name);
    bare.eq_ignore_ascii_case("localhost") || bare.parse::<IpAddr>().is_ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(host: &str, origin: Option<&str>) -> bool {
        let mut headers = HeaderMap::new();
        headers.insert(header::HOST, host.parse().unwrap());
        origin.map(|origin| headers.insert(header::ORIGIN, origin.parse().unwrap()));
        check_origin(&headers).is_ok()
    }

    #[test]
    fn addresses_may_come_in_and_names_may_not() {
        for host in ["127.0.0.1:8080", "localhost:1", "LOCALHOST", "[::1]:80", "192.168.0.7:9"] {
            assert!(check(host, None), "{host}");
            assert!(check(host, Some(&format!("http://{host}"))), "{host}");
            assert!(!check(host, Some("null")) && !check(host, Some("https://evil.example")), "{host}");
        }
        for host in
            ["evil.example", "localhost.evil.example:80", "127.0.0.1.evil.example", "", "a@b@c", "1.2.3"]
        {
            assert!(!check(host, None), "{host}");
        }
        assert!(!check("127.0.0.1:80", Some("http://127.0.0.1:81")));
    }

    #[test]
    fn tokens_are_long_and_match_only_themselves() {
        let token = Token::random().unwrap();
        assert_eq!(token.as_str().len(), 2 * TOKEN_BYTES);
        assert!(token.matches(token.as_str()));
        assert!(
            !token.matches(&token.as_str()[1..]) && !token.matches("") && token != Token::random().unwrap()
        );
        assert!(Token::chosen("0123456789abcdef").is_ok());
        for bad in ["", "short", "0123456789abcde/", "0123456789abcdé"] {
            assert!(Token::chosen(bad).is_err(), "{bad}");
        }
        assert_eq!(format!("{token:?}"), "Token(..)");
    }
}
