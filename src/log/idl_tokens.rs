//! The words and signs of an OMG IDL text, one after another.
//!
//! OMG IDL 4.2 section 7.2, and the lines that a log puts between the definitions.

/// What a line between two definitions begins with.
const SEPARATOR: &str = "===";

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Token<'t> {
    /// A keyword or a name, with the scopes before it: `a::b::C`.
    Word(&'t str),
    Number(&'t str),
    /// A string or a character.
    Quoted,
    Sign(char),
    /// The lines between two definitions.
    Section,
    End,
}

/// Cuts the text into tokens. A copy of it looks ahead.
#[derive(Clone, Copy)]
pub struct Lexer<'t> {
    rest: &'t str,
    /// Where the last token began.
    line: usize,
    line_now: usize,
}

impl Token<'_> {
    /// How an error names it.
    pub fn said(self) -> String {
        match self {
            Token::Word(text) | Token::Number(text) => format!("`{text}`"),
            Token::Quoted => "a quoted text".to_string(),
            Token::Sign(sign) => format!("`{sign}`"),
            Token::Section => "the next definition".to_string(),
            Token::End => "the end".to_string(),
        }
    }
}

impl<'t> Lexer<'t> {
    pub fn new(text: &'t str) -> Self {
        Lexer { rest: text, line: 1, line_now: 1 }
    }

    /// The line where the last token began.
    pub fn line(&self) -> usize {
        self.line
    }

    /// The next token; comments and lines for the preprocessor are none. What has no end reaches
    /// to the end of the text.
    pub fn next_token(&mut self) -> Token<'t> {
        self.skip_blank();
        self.line = self.line_now;
        let rest = self.rest;
        let Some(first) = rest.chars().next() else { return Token::End };
        let is_word = |c: char| c.is_ascii_alphanumeric() || c == '_';
        if self.skip_section() {
            return Token::Section;
        }
        if first.is_ascii_digit() {
            let end = rest.find(|c| !is_word(c) && c != '.').unwrap_or(rest.len());
            return Token::Number(self.take(end));
        }
        if is_word(first) || rest.starts_with("::") {
            let mut end = 0;
            loop {
                let behind = &rest[end..];
                end += match behind.strip_prefix("::") {
                    Some(_) => 2,
                    None => match behind.find(|c| !is_word(c)).unwrap_or(behind.len()) {
                        0 => break,
                        len => len,
                    },
                };
            }
            return Token::Word(self.take(end));
        }
        if first == '"' || first == '\'' {
            let mut is_escaped = false;
            let end = rest[1..].find(|c| {
                let is_end = c == first && !is_escaped;
                is_escaped = c == '\\' && !is_escaped;
                is_end
            });
            self.take(end.map_or(rest.len(), |end| end + 2));
            return Token::Quoted;
        }
        // A run of `=` that separates nothing is one sign, or each of them would look to its end.
        let run = rest.len() - rest.trim_start_matches('=').len();
        self.take(run.max(first.len_utf8()));
        Token::Sign(first)
    }

    pub fn peek(mut self) -> Token<'t> {
        self.next_token()
    }

    fn take(&mut self, bytes: usize) -> &'t str {
        let (taken, rest) = self.rest.split_at(bytes);
        self.line_now += taken.bytes().filter(|byte| *byte == b'\n').count();
        self.rest = rest;
        taken
    }

    /// Blanks, comments and lines for the preprocessor.
    fn skip_blank(&mut self) {
        loop {
            let blank = self.rest.len() - self.rest.trim_start().len();
            self.take(blank);
            let end = if self.rest.starts_with("//") || self.rest.starts_with('#') {
                self.rest.find('\n')
            } else if self.rest.starts_with("/*") {
                self.rest[2..].find("*/").map(|end| end + 4)
            } else {
                return;
            };
            self.take(end.unwrap_or(self.rest.len()));
        }
    }

    /// A line of `=`, and the line behind it where that names what follows.
    fn skip_section(&mut self) -> bool {
        let behind = self.rest.trim_start_matches('=');
        let line = |text: &'t str| text.find('\n').map_or(text.len(), |end| end + 1);
        let blank = behind.len() - behind.trim_start_matches([' ', '\t', '\r']).len();
        let is_separator = self.rest.starts_with(SEPARATOR)
            && matches!(behind[blank..].bytes().next(), None | Some(b'\n'));
        if is_separator {
            self.take(line(self.rest));
            if self.rest.trim_start().starts_with("IDL:") {
                self.skip_blank();
                self.take(line(self.rest));
            }
        }
        is_separator
    }
}
