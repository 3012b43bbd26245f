//! The secret in the address of a view. A request without it gets nothing, because other users of
//! the machine can connect as well.

use std::io::Read;

/// Number of random bytes.
const BYTES: usize = 16;

/// A random word that every request must contain.
pub(crate) struct Token(String);

impl Token {
    /// Draws a token.
    pub(crate) fn draw() -> std::io::Result<Self> {
        let mut bytes = [0; BYTES];
        std::fs::File::open("/dev/urandom")?.read_exact(&mut bytes)?;
        Ok(Self(bytes.iter().map(|byte| format!("{byte:02x}")).collect()))
    }

    /// The token as a query of an address.
    pub(crate) fn query(&self) -> String {
        format!("?token={}", self.0)
    }

    /// Whether the query of a request contains it. The time that this takes does not depend on how much of it is right.
    pub(crate) fn is_in(&self, query: &str) -> bool {
        let given = query.split('&').find_map(|part| part.strip_prefix("token=")).unwrap_or_default().as_bytes();
        let differences = self.0.bytes().zip(given).fold(0, |all, (own, given)| all | (own ^ given));
        given.len() == self.0.len() && differences == 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_whole_token_is_accepted() {
        let token = Token::draw().unwrap();
        let query = token.query();
        let query = query.trim_start_matches('?');
        assert!(token.is_in(query) && token.is_in(&format!("a=b&{query}")));
        for wrong in ["", "token=", &query[..query.len() - 1], &format!("{query}0"), &query.replace("token", "other")] {
            assert!(!token.is_in(wrong), "{wrong}");
        }
        assert_ne!(query, Token::draw().unwrap().query().trim_start_matches('?'));
    }
}
