//! Bytes of a glTF file: the parts of a GLB, buffers in data URIs or beside the file, accessors.
//!
//! Every range is checked before it is read: files come from anywhere.

use super::super::error::ImportFault;
use gltf::accessor::DataType;
use gltf::buffer::Source;
use std::path::Path;

/// The JSON of a `.gltf` or `.glb`, and the binary chunk of the latter.
pub(super) fn split(bytes: &[u8]) -> Result<(&[u8], Option<&[u8]>), ImportFault> {
    if !bytes.starts_with(b"glTF") {
        return Ok((bytes, None));
    }
    let cut = |what: &str| ImportFault::element(what, "the end of the file", "the whole GLB");
    let word = |at: usize| {
        let four = bytes.get(at..at + 4)?;
        Some(u32::from_le_bytes(four.try_into().ok()?) as usize)
    };
    let version = word(4).ok_or_else(|| cut("header"))?;
    if version != 2 {
        return Err(ImportFault::element(
            "header",
            format!("GLB version {version}"),
            "version 2",
        ));
    }
    let chunk = |at: usize, kind: &[u8]| -> Option<&[u8]> {
        let length = word(at)?;
        let start = at.checked_add(8)?;
        let found = bytes.get(at + 4..start)?;
        (found == kind).then_some(())?;
        bytes.get(start..start.checked_add(length)?)
    };
    let json = chunk(12, b"JSON").ok_or_else(|| cut("JSON chunk"))?;
    let next = 12 + 8 + json.len().next_multiple_of(4);
    if next >= bytes.len() {
        return Ok((json, None));
    }
    let binary = chunk(next, b"BIN\0").ok_or_else(|| cut("BIN chunk"))?;
    Ok((json, Some(binary)))
}

/// The buffers of a document, all in memory.
pub(super) struct Buffers(Vec<Vec<u8>>);

impl Buffers {
    /// Loads every buffer; files only from the folder of the document.
    pub fn load(
        document: &gltf::Document,
        binary: Option<&[u8]>,
        folder: Option<&Path>,
    ) -> Result<Self, ImportFault> {
        let mut all = Vec::new();
        for buffer in document.buffers() {
            let place = format!("buffer {}", buffer.index());
            let data = match buffer.source() {
                Source::Bin => binary.unwrap_or_default().to_vec(),
                Source::Uri(uri) => match uri.strip_prefix("data:") {
                    Some(data) => data_uri(data).ok_or_else(|| {
                        ImportFault::element(&place, "a data URI", "base64 after a comma")
                    })?,
                    None => beside(uri, &place, folder)?,
                },
            };
            if data.len() < buffer.length() {
                return Err(ImportFault::element(
                    place,
                    format!("{} bytes", data.len()),
                    format!(
                        "{} as byteLength says; the file is cut off",
                        buffer.length()
                    ),
                ));
            }
            all.push(data);
        }
        Ok(Self(all))
    }

    /// The numbers of an accessor, `width` a row; integers of normalised accessors scaled to 0..1 or -1..1.
    pub fn numbers(
        &self,
        accessor: &gltf::Accessor<'_>,
        width: usize,
    ) -> Result<Vec<f64>, ImportFault> {
        let place = format!("accessor {}", accessor.index());
        let wrong = |found: String, allowed: &str| ImportFault::element(&place, found, allowed);
        let components = accessor.dimensions().multiplicity();
        if components != width {
            return Err(wrong(
                format!("{components} numbers an element"),
                &format!("{width}"),
            ));
        }
        if accessor.sparse().is_some() {
            return Err(wrong(
                "sparse values".into(),
                "full ones; export without sparse accessors",
            ));
        }
        let Some(view) = accessor.view() else {
            return Err(wrong("no bufferView".into(), "values in a bufferView"));
        };
        let size = accessor.data_type().size();
        let row = size * width;
        let stride = view.stride().unwrap_or(row);
        let count = accessor.count();
        let range = || {
            let data = self.0.get(view.buffer().index())?;
            let data = data.get(view.offset()..view.offset().checked_add(view.length())?)?;
            let last = stride.checked_mul(count.checked_sub(1)?)?;
            let end = accessor.offset().checked_add(last)?.checked_add(row)?;
            (stride >= row).then_some(())?;
            data.get(accessor.offset()..end)
        };
        let data = range().ok_or_else(|| {
            wrong(
                format!("{count} elements outside of its buffer"),
                "at least one element, all within the bufferView",
            )
        })?;
        let normalised = accessor.normalized();
        let scale = |v: f64, top: f64| if normalised { (v / top).max(-1.0) } else { v };
        let mut numbers = Vec::with_capacity(count * width);
        for element in 0..count {
            for i in 0..width {
                let at = element * stride + i * size;
                let b = &data[at..at + size];
                let value = match (accessor.data_type(), b) {
                    (DataType::F32, &[a, b, c, d]) => f64::from(f32::from_le_bytes([a, b, c, d])),
                    (DataType::U32, &[a, b, c, d]) => f64::from(u32::from_le_bytes([a, b, c, d])),
                    (DataType::U16, &[a, b]) => scale(u16::from_le_bytes([a, b]).into(), 65535.0),
                    (DataType::I16, &[a, b]) => scale(i16::from_le_bytes([a, b]).into(), 32767.0),
                    (DataType::U8, &[a]) => scale(a.into(), 255.0),
                    (DataType::I8, &[a]) => scale(i8::from_le_bytes([a]).into(), 127.0),
                    // `b` is as long as the type's size, so that this arm is never taken.
                    _ => 0.0,
                };
                if !value.is_finite() {
                    return Err(wrong(
                        format!("{value} in element {element}"),
                        "finite numbers",
                    ));
                }
                numbers.push(value);
            }
        }
        Ok(numbers)
    }
}

/// A buffer file in the folder of the document.
fn beside(uri: &str, place: &str, folder: Option<&Path>) -> Result<Vec<u8>, ImportFault> {
    let name = uri.replace("%20", " ");
    let path = Path::new(&name);
    let plain = path
        .components()
        .all(|c| matches!(c, std::path::Component::Normal(_)));
    match folder {
        Some(folder) if plain && !name.contains(':') => {
            super::super::read_bytes(&folder.join(path)).map_err(|fault| match fault {
                ImportFault::Read(error) => ImportFault::element(
                    place,
                    format!("{uri:?}, which cannot be read ({error})"),
                    "the file that belongs to the glTF, in its folder",
                ),
                other => other,
            })
        }
        _ => Err(ImportFault::element(
            place,
            format!("URI {uri:?}"),
            "a file in the folder of the glTF, or a data URI",
        )),
    }
}

/// The bytes of `MEDIATYPE;base64,DATA`.
fn data_uri(data: &str) -> Option<Vec<u8>> {
    let (kind, text) = data.split_once(',')?;
    kind.ends_with(";base64").then_some(())?;
    let text = text.trim_end_matches('=');
    let mut bytes = Vec::with_capacity(text.len() / 4 * 3);
    let (mut bits, mut held) = (0_u32, 0);
    for c in text.bytes() {
        let value = match c {
            b'A'..=b'Z' => c - b'A',
            b'a'..=b'z' => c - b'a' + 26,
            b'0'..=b'9' => c - b'0' + 52,
            b'+' | b'-' => 62,
            b'/' | b'_' => 63,
            b'\r' | b'\n' => continue,
            _ => return None,
        };
        bits = (bits << 6) | u32::from(value);
        held += 6;
        if held >= 8 {
            held -= 8;
            bytes.push((bits >> held) as u8);
            bits &= (1 << held) - 1;
        }
    }
    Some(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn data_uris_are_decoded_and_other_text_is_refused() {
        let decoded = data_uri("application/octet-stream;base64,aGFuZHdhdmU=");
        assert_eq!(decoded.as_deref(), Some(&b"handwave"[..]));
        assert_eq!(data_uri("text/plain,hello"), None);
        assert_eq!(data_uri("x;base64,a*b"), None);
    }

    #[test]
    fn a_cut_glb_says_which_part_is_missing() {
        for cut in 4..19 {
            let mut glb = b"glTF\x02\0\0\0\x20\0\0\0\x04\0\0\0JSON{}  ".to_vec();
            assert!(split(&glb).is_ok_and(|(json, _)| json == b"{}  "));
            glb.truncate(cut);
            let message = split(&glb).expect_err("cut off").to_string();
            assert!(message.contains("the end of the file"), "{cut}: {message}");
        }
    }
}
