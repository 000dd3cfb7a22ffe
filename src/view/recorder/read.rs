//! A recording read again: the character, its options and the logs, as far as the file is whole.

use super::file::{FILES, FORMAT, LOG_TOPIC};
use crate::base::Time;
use crate::base::mcap::{Item, scan};
use crate::config::{self, ConfigError, Files};
use crate::live::recording::Recorded;
use crate::live::recording::replay::RecordedLog;
use crate::live::session;
use crate::pose::json::parse_header;
use serde_json::Value;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufReader;
use std::path::Path;

/// A recording, ready to be replayed.
#[derive(Debug)]
pub struct Loaded {
    /// What is to be run again.
    pub recorded: Recorded,
    /// The version of the program that recorded it.
    pub version: String,
    /// It begins where the run began. Without, it can only be looked at.
    pub whole: bool,
    /// Why it ends before its end, if it does.
    pub cut: Option<String>,
    /// Options of the run as they were recorded.
    pub run: Value,
}

/// Why a file is no recording.
#[derive(Debug, thiserror::Error)]
pub enum ReadError {
    /// It cannot be read, or is no MCAP file.
    #[error("{file}: {source}; expected is a recording made by `handwave run --record`")]
    File {
        /// The file.
        file: String,
        /// The system's reason.
        source: std::io::Error,
    },
    /// An MCAP file of others, or cut before its beginning was written.
    #[error("{file}: {problem}; expected is a recording made by `handwave run --record`")]
    Content {
        /// The file.
        file: String,
        /// What is missing or wrong.
        problem: String,
    },
    /// Its character cannot be built any more.
    #[error("{0}")]
    Config(#[from] ConfigError),
}

#[derive(Default)]
struct Collected {
    about: Option<BTreeMap<String, String>>,
    files: BTreeMap<String, Vec<u8>>,
    logs: BTreeMap<usize, RecordedLog>,
}

impl Collected {
    fn take(&mut self, item: Item<'_>) {
        match item {
            Item::Metadata("handwave", pairs) => self.about = Some(pairs.clone()),
            Item::Metadata(..) => {}
            Item::Attachment(name, bytes) => {
                if let Some(name) = name.strip_prefix(FILES) {
                    self.files.insert(name.to_owned(), bytes.to_vec());
                }
            }
            Item::Message {
                topic, about, data, ..
            } => {
                let index = topic.strip_prefix(LOG_TOPIC).and_then(|n| n.parse().ok());
                let (Some(index), Some((base, bytes))) = (index, data.split_first_chunk::<8>())
                else {
                    return;
                };
                let name = about.get("log").cloned().unwrap_or_default();
                let (_, pieces) = self.logs.entry(index).or_insert_with(|| (name, Vec::new()));
                let base = Time::from_nanos(i64::from_le_bytes(*base));
                pieces.push((base, bytes.to_vec()));
            }
        }
    }
}

/// Reads a recording.
///
/// # Errors
/// Unreadable file, another kind of file, another format version, a character that cannot be built.
pub fn read(path: &Path) -> Result<Loaded, ReadError> {
    let file = path.display().to_string();
    let mut collected = Collected::default();
    let scanned = File::open(path)
        .and_then(|input| {
            scan(BufReader::new(input), |item| {
                collected.take(item);
                true
            })
        })
        .map_err(|source| ReadError::File {
            file: file.clone(),
            source,
        })?;
    let wrong = |problem: String| ReadError::Content {
        file: file.clone(),
        problem,
    };
    let Collected {
        about, files, logs, ..
    } = collected;
    let about = about.ok_or_else(|| {
        wrong(match &scanned.cut {
            Some(cut) => format!("it ends before the recording begins ({cut})"),
            None => "an MCAP file, and none of handwave's".into(),
        })
    })?;
    let word = |key: &str| {
        let found = about.get(key).cloned();
        found.ok_or_else(|| wrong(format!("its metadata has no `{key}`")))
    };
    let format = word("format")?;
    if format != FORMAT.to_string() {
        return Err(wrong(format!(
            "format {format}, this program replays format {FORMAT} (it was recorded by version {})",
            word("version")?
        )));
    }
    let run: Value = serde_json::from_str(&word("run")?)
        .map_err(|e| wrong(format!("its options are damaged ({e})")))?;
    let header = parse_header(&word("poses")?)
        .map_err(|fault| wrong(format!("its pose header is damaged: {}", fault.found)))?
        .header;
    let text = |key: &str| run[key].as_str().map(str::to_owned);
    let missing = |key: &str| wrong(format!("its options have no `{key}`"));
    let config_name = text("config").ok_or_else(|| missing("config"))?;
    let rate_hz = run["rate_hz"].as_f64().ok_or_else(|| missing("rate_hz"))?;
    if !(10.0..=2000.0).contains(&rate_hz) {
        return Err(wrong(format!("rate_hz = {rate_hz} is not in 10..2000")));
    }
    let mut character = config::load(Files::brought(&file, files), &config_name)?;
    if let Some(scale) = text("scale") {
        character.front_options.scale = scale.parse().map_err(wrong)?;
    }
    let options = session::control_options(&character, rate_hz, run["duration_s"].as_f64());
    // A log that is missing in between stays empty, so that the others keep their places.
    let count = logs.keys().last().map_or(0, |last| last + 1);
    let count = count.min(run["logs"].as_array().map_or(0, Vec::len));
    let mut logs = logs;
    let logs = (0..count)
        .map(|index| logs.remove(&index).unwrap_or_default())
        .collect();
    Ok(Loaded {
        recorded: Recorded {
            character,
            header,
            options,
            logs,
        },
        version: word("version")?,
        whole: word("whole")? == "true",
        cut: scanned.cut,
        run,
    })
}
