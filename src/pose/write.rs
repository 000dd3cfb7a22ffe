//! Writes a pose stream, byte for byte the same for the same samples.

use super::{PoseFormat, PoseHeader, PoseSample};
use std::io::{self, Write};

/// Writes a header, then samples, as JSON Lines or CSV. Times are kept to 0.1 ms.
#[derive(Debug)]
pub struct PoseWriter<W> {
    out: W,
    header: PoseHeader,
    format: PoseFormat,
    decimals: usize,
    text: String,
}

impl<W: Write> PoseWriter<W> {
    /// Writes the header. `decimals` of a metre are kept: 4 is 0.1 mm.
    ///
    /// # Errors
    /// Those of `out`; a format that is not written (BVH).
    pub fn new(
        mut out: W,
        header: &PoseHeader,
        format: PoseFormat,
        decimals: usize,
    ) -> io::Result<Self> {
        match format {
            PoseFormat::Bvh => {
                return Err(io::Error::new(
                    io::ErrorKind::Unsupported,
                    "points are no skeleton: poses are written as JSON Lines or CSV",
                ));
            }
            PoseFormat::JsonLines => {
                let mut line = serde_json::json!({
                    "points": header.points, "dim": header.dim, "unit": "m",
                });
                if !header.channels.is_empty() {
                    line["channels"] = header.channels.clone().into();
                }
                // The two identifying keys go first, where a reader's eye looks for them.
                let rest = line.to_string();
                writeln!(out, "{{\"handwave\":\"poses\",\"version\":1,{}", &rest[1..])?;
            }
            PoseFormat::Csv => {
                write!(out, "t")?;
                for point in &header.points {
                    for axis in &["x", "y", "z"][..header.dim.min(3)] {
                        write!(out, ",{point}.{axis}")?;
                    }
                }
                for channel in &header.channels {
                    write!(out, ",ch.{channel}")?;
                }
                writeln!(out)?;
            }
        }
        Ok(Self {
            out,
            header: header.clone(),
            format,
            decimals,
            text: String::new(),
        })
    }

    /// Writes one sample.
    ///
    /// # Errors
    /// Those of the output.
    pub fn write(&mut self, sample: &PoseSample) -> io::Result<()> {
        let mut text = std::mem::take(&mut self.text);
        text.clear();
        match self.format {
            PoseFormat::JsonLines => self.json_line(sample, &mut text),
            PoseFormat::Csv | PoseFormat::Bvh => self.csv_line(sample, &mut text),
        }
        text.push('\n');
        let outcome = self.out.write_all(text.as_bytes());
        self.text = text;
        outcome
    }

    /// One sample as a line of JSON without its end, as [`PoseWriter::write`] writes it.
    pub fn line(&self, sample: &PoseSample) -> String {
        let mut text = String::new();
        self.json_line(sample, &mut text);
        text
    }

    fn json_line(&self, sample: &PoseSample, text: &mut String) {
        text.push_str("{\"t\":");
        number(text, sample.t, 4);
        text.push_str(",\"p\":[");
        for (index, point) in sample.points.iter().enumerate() {
            if index > 0 {
                text.push(',');
            }
            match point {
                None => text.push_str("null"),
                Some(place) => {
                    for (axis, value) in place.iter().take(self.header.dim).enumerate() {
                        text.push(if axis == 0 { '[' } else { ',' });
                        number(text, *value, self.decimals);
                    }
                    text.push(']');
                }
            }
        }
        text.push(']');
        if !sample.confidence.is_empty() {
            text.push_str(",\"c\":");
            for (index, value) in sample.confidence.iter().enumerate() {
                text.push(if index == 0 { '[' } else { ',' });
                number(text, *value, 3);
            }
            text.push(']');
        }
        let mut separator = ",\"ch\":{";
        for (name, value) in self.header.channels.iter().zip(&sample.channels) {
            if let Some(value) = value {
                text.push_str(separator);
                text.push_str(&serde_json::Value::from(name.as_str()).to_string());
                text.push(':');
                number(text, *value, 6);
                separator = ",";
            }
        }
        if separator == "," {
            text.push('}');
        }
        text.push('}');
    }

    fn csv_line(&self, sample: &PoseSample, text: &mut String) {
        number(text, sample.t, 4);
        for point in &sample.points {
            for axis in 0..self.header.dim {
                text.push(',');
                if let Some(place) = point {
                    number(text, place[axis], self.decimals);
                }
            }
        }
        for index in 0..self.header.channels.len() {
            text.push(',');
            if let Some(value) = sample.channels.get(index).copied().flatten() {
                number(text, value, 6);
            }
        }
    }

    /// Hands what is buffered to the system and returns the output.
    ///
    /// # Errors
    /// Those of the output.
    pub fn finish(mut self) -> io::Result<W> {
        self.out.flush()?;
        Ok(self.out)
    }
}

/// `value` with at most `decimals` decimals, without trailing zeros and without a negative zero.
pub(crate) fn number(text: &mut String, value: f64, decimals: usize) {
    let start = text.len();
    text.push_str(&format!("{value:.decimals$}"));
    if decimals > 0 {
        while text.ends_with('0') {
            text.pop();
        }
        if text.ends_with('.') {
            text.pop();
        }
    }
    if &text[start..] == "-0" {
        text.truncate(start);
        text.push('0');
    }
}
