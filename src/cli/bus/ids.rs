//! Lists of servo ids as users write them: `3`, `1,3,5`, `1-12`, `1-6,20`.

use handwave_dynamixel::MAX_ID;
use std::str::FromStr;

/// Servo ids in ascending order, each once; at least one.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct IdList(Vec<u8>);

impl IdList {
    /// The ids.
    pub fn iter(&self) -> impl Iterator<Item = u8> + '_ {
        self.0.iter().copied()
    }
}

impl FromStr for IdList {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let mut ids = Vec::new();
        for part in text.split(',') {
            let (first, last) = part.split_once('-').unwrap_or((part, part));
            let (first, last) = (id(first)?, id(last)?);
            if first > last {
                return Err(format!("'{part}' runs backwards, write {last}-{first}"));
            }
            ids.extend(first..=last);
        }
        ids.sort_unstable();
        ids.dedup();
        Ok(IdList(ids))
    }
}

fn id(text: &str) -> Result<u8, String> {
    text.trim()
        .parse()
        .ok()
        .filter(|&id| id <= MAX_ID)
        .ok_or_else(|| format!("'{text}' is no servo id, ids are 0 to {MAX_ID}, lists like 1-6,20"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_users_write() {
        for (text, expected) in [
            ("3", vec![3]),
            ("1,3,5", vec![1, 3, 5]),
            ("1-4", vec![1, 2, 3, 4]),
            ("5-6, 1,5", vec![1, 5, 6]),
            ("252", vec![252]),
        ] {
            assert_eq!(text.parse(), Ok(IdList(expected)), "{text}");
        }
        for text in ["", "a", "253", "1-", "4-1", "-1", "1,,2"] {
            assert!(text.parse::<IdList>().is_err(), "'{text}' was taken");
        }
    }
}
