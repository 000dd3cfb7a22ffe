//! Errors of a configuration: file, line, key, what was found, what is allowed.

use crate::base::suggest::nearest;
use std::fmt;
use std::ops::Range;

/// Something in a configuration (or a file it names) that cannot be used.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ConfigError {
    /// The file.
    pub file: String,
    /// Line in it, from 1.
    pub line: Option<usize>,
    /// The key, with its table, such as `robot.joint.servo`.
    pub key: String,
    /// What was found, what is allowed and what to do.
    pub problem: String,
}

impl fmt::Display for ConfigError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.file)?;
        if let Some(line) = self.line {
            write!(f, ":{line}")?;
        }
        if !self.key.is_empty() {
            write!(f, ": {}", self.key)?;
        }
        write!(f, ": {}", self.problem)
    }
}

impl std::error::Error for ConfigError {}

/// Makes errors that point into the text of one file.
#[derive(Copy, Clone, Debug)]
pub struct Pointer<'a> {
    /// Name for messages.
    pub file: &'a str,
    /// The whole text.
    pub text: &'a str,
}

impl Pointer<'_> {
    /// An error at `span` of the text.
    pub fn at(&self, span: Range<usize>, key: &str, problem: impl fmt::Display) -> ConfigError {
        ConfigError {
            file: self.file.into(),
            line: Some(self.line_of(span.start)),
            key: key.into(),
            problem: problem.to_string(),
        }
    }

    /// An error about `key` (its last part is looked for in the text, from the table's name on).
    pub fn key(&self, key: &str, problem: impl fmt::Display) -> ConfigError {
        ConfigError {
            file: self.file.into(),
            line: self.find(key).map(|offset| self.line_of(offset)),
            key: key.into(),
            problem: problem.to_string(),
        }
    }

    /// The error of the TOML parser, with the nearest allowed key where a key is unknown.
    pub fn toml(&self, error: &toml::de::Error) -> ConfigError {
        let message = error.message();
        let quoted: Vec<&str> = message.split('`').skip(1).step_by(2).collect();
        let mut key = String::new();
        let mut problem = message.to_string();
        let unknown =
            message.starts_with("unknown field") || message.starts_with("unknown variant");
        if let (true, Some((found, allowed))) = (unknown, quoted.split_first()) {
            key = (*found).to_string();
            let what = if message.starts_with("unknown field") {
                "unknown key"
            } else {
                "unknown value"
            };
            problem = format!("{what} {found:?}");
            if let Some(near) = nearest(found, allowed.iter().copied()) {
                problem += &format!("; did you mean {near:?}?");
            }
            problem += &format!(" Allowed here: {}", allowed.join(", "));
        }
        ConfigError {
            file: self.file.into(),
            line: error.span().map(|s| self.line_of(s.start)),
            key,
            problem,
        }
    }

    /// Line of a byte offset, from 1.
    pub fn line_of(&self, offset: usize) -> usize {
        let end = offset.min(self.text.len());
        self.text.as_bytes()[..end]
            .iter()
            .filter(|b| **b == b'\n')
            .count()
            + 1
    }

    fn find(&self, key: &str) -> Option<usize> {
        let (table, leaf) = key.rsplit_once('.').unwrap_or(("", key));
        let start = if table.is_empty() {
            0
        } else {
            self.text.find(&format!("[{table}]"))?
        };
        let mut offset = start;
        for line in self.text[start..].split_inclusive('\n') {
            let trimmed = line.trim_start();
            if trimmed
                .strip_prefix(leaf)
                .is_some_and(|rest| rest.trim_start().starts_with('='))
            {
                return Some(offset);
            }
            offset += line.len();
        }
        (start > 0).then_some(start)
    }
}
