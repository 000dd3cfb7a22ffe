//! Reads an MCAP file record by record, as far as it is whole: one that was cut gives what is before the cut.

use mcap::records::Record;
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};
use std::collections::BTreeMap;
use std::io::Read;

/// A record longer than this is a damaged length, not a record.
const LONGEST_RECORD: usize = 256 << 20;

/// What is in a file, in its order.
#[derive(Debug)]
pub enum Item<'a> {
    /// Named pairs of words.
    Metadata(&'a str, &'a BTreeMap<String, String>),
    /// A file brought along.
    Attachment(&'a str, &'a [u8]),
    /// A message.
    Message {
        /// Topic of its channel.
        topic: &'a str,
        /// Pairs of words that its channel carries.
        about: &'a BTreeMap<String, String>,
        /// Its time, nanoseconds.
        log_time_ns: u64,
        /// Its content.
        data: &'a [u8],
    },
}

/// How far a file could be read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Scan {
    /// Why it ends before its end, if it does.
    pub cut: Option<String>,
}

/// Shows everything that is whole in `input` to `each`, which may break off by giving false.
///
/// # Errors
/// The input cannot be read, or is no MCAP file at all.
pub fn scan(mut input: impl Read, mut each: impl FnMut(Item<'_>) -> bool) -> std::io::Result<Scan> {
    let mut magic = [0; mcap::MAGIC.len()];
    let mut have = 0;
    while have < magic.len() {
        match input.read(&mut magic[have..])? {
            0 => break,
            count => have += count,
        }
    }
    if magic[..] != mcap::MAGIC[..] {
        return Err(std::io::Error::new(
            std::io::ErrorKind::InvalidData,
            "it does not begin like an MCAP file",
        ));
    }
    let options = LinearReaderOptions::default()
        .with_skip_start_magic(true)
        .with_skip_end_magic(true)
        .with_prevalidate_chunk_crcs(true)
        .with_record_length_limit(LONGEST_RECORD);
    let mut reader = LinearReader::new_with_options(options);
    let mut channels: BTreeMap<u16, mcap::records::Channel> = BTreeMap::new();
    let mut finished = false;
    let cut = loop {
        let event = match reader.next_event() {
            None => break None,
            Some(Err(error)) => break Some(error.to_string()),
            Some(Ok(event)) => event,
        };
        match event {
            LinearReadEvent::ReadRequest(need) => {
                let count = input.read(reader.insert(need))?;
                reader.notify_read(count);
            }
            LinearReadEvent::Record { opcode, data } => {
                let goes_on = match mcap::parse_record(opcode, data) {
                    Err(error) => break Some(error.to_string()),
                    Ok(Record::DataEnd(_)) => {
                        finished = true;
                        false
                    }
                    Ok(Record::Channel(channel)) => {
                        channels.insert(channel.id, channel);
                        true
                    }
                    Ok(Record::Metadata(m)) => each(Item::Metadata(&m.name, &m.metadata)),
                    Ok(Record::Attachment { header, data, .. }) => {
                        each(Item::Attachment(&header.name, &data))
                    }
                    Ok(Record::Message { header, data }) => {
                        match channels.get(&header.channel_id) {
                            Some(channel) => each(Item::Message {
                                topic: &channel.topic,
                                about: &channel.metadata,
                                log_time_ns: header.log_time,
                                data: &data,
                            }),
                            None => true,
                        }
                    }
                    Ok(_) => true,
                };
                if !goes_on {
                    return Ok(Scan { cut: None });
                }
            }
        }
    };
    let cut = cut.or_else(|| (!finished).then(|| "it was cut".into()));
    Ok(Scan { cut })
}
