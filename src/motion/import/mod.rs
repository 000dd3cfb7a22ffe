//! Motion files of other programs as takes: found by extension and content.
//!
//! Whatever a file has, a take is in metres and radians, x forward, y left, z up. Only what a file does
//! not tell is asked for ([`ImportOptions`]): unit, axes, rate.

mod axes;
mod error;
pub mod gltf;
mod raw;

pub use axes::{Axes, Axis};
pub use error::{ImportError, ImportFault};

use super::take::Take;
use crate::pose::bvh::LengthUnit;
use std::path::{Path, PathBuf};

/// Largest file that is read, bytes.
pub const MAX_BYTES: u64 = 512 << 20;
/// Joints a skeleton may have.
pub const MAX_JOINTS: usize = 1000;
/// Frames a take may have.
pub const MAX_FRAMES: usize = 1_000_000;

/// What a file does not tell, or tells wrongly.
#[derive(Clone, Debug, Default)]
pub struct ImportOptions {
    /// Which axis of the file points up; the format's own by default.
    pub up: Option<Axis>,
    /// Which axis the body at rest faces; found by default.
    pub forward: Option<Axis>,
    /// Unit of length; the format's own by default.
    pub unit: Option<LengthUnit>,
    /// Frames per second: of AMC files (120), and at which keys (glTF, 60) are sampled.
    pub rate_hz: Option<f64>,
    /// Which animation of the file; all by default.
    pub animation: Option<String>,
    /// File that holds the skeleton: ASF of an AMC, any skeleton of a CSV.
    pub skeleton: Option<PathBuf>,
    /// Names of the joints of joint-space JSON.
    pub joints: Option<Vec<String>>,
    /// Author, recording, licence.
    pub origin: String,
}

/// What a file held.
#[derive(Clone, Debug)]
pub struct Imported {
    /// Its motions.
    pub takes: Vec<Take>,
    /// What was guessed or left out, for the reader.
    pub warnings: Vec<String>,
}

/// Reads the motions of `path`, which may end in `#NAME` to select one animation.
///
/// # Errors
/// A file that cannot be read, is of no known kind, or has a fault, with its place.
pub fn open(path: &Path, options: &ImportOptions) -> Result<Imported, ImportError> {
    let (path, animation) = split_selector(path);
    let mut options = options.clone();
    options.animation = animation.or(options.animation);
    let file = path.display().to_string();
    read(&path, &options).map_err(|fault| fault.in_file(&file))
}

fn read(path: &Path, options: &ImportOptions) -> Result<Imported, ImportFault> {
    check_rate(options)?;
    let bytes = read_bytes(path)?;
    let name = path
        .file_stem()
        .map_or("take".into(), |s| s.to_string_lossy().into_owned());
    let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase());
    match extension.as_deref() {
        Some("glb" | "gltf" | "vrm") => {
            let file = gltf::GltfFile::parse(&bytes, &name, path.parent(), options)?;
            Ok(Imported {
                takes: file.takes,
                warnings: file.warnings,
            })
        }
        _ => Err(ImportFault::element(
            "the file",
            "a name without a known extension",
            "glTF (.glb, .gltf, .vrm)",
        )),
    }
}

fn check_rate(options: &ImportOptions) -> Result<(), ImportFault> {
    match options.rate_hz {
        Some(rate) if !(1.0..=10_000.0).contains(&rate) => Err(ImportFault::element(
            "the rate",
            format!("{rate} Hz"),
            "1 to 10000 Hz",
        )),
        _ => Ok(()),
    }
}

/// The whole file, if it is not too large.
fn read_bytes(path: &Path) -> Result<Vec<u8>, ImportFault> {
    use std::io::Read;
    let mut bytes = Vec::new();
    let file = std::fs::File::open(path)?;
    file.take(MAX_BYTES + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > MAX_BYTES {
        return Err(ImportFault::element(
            "the file",
            format!("over {MAX_BYTES} bytes"),
            "shorter files; cut it in parts",
        ));
    }
    Ok(bytes)
}

/// `file.glb#Walk` as file and animation; a file that has this very name comes first.
fn split_selector(path: &Path) -> (PathBuf, Option<String>) {
    let text = path.to_string_lossy();
    match text.rsplit_once('#') {
        Some((file, animation)) if !path.exists() => (file.into(), Some(animation.to_owned())),
        _ => (path.into(), None),
    }
}

/// An error where a motion has more frames than is sensible, or none.
fn check_frames(count: usize) -> Result<(), ImportFault> {
    if (1..=MAX_FRAMES).contains(&count) {
        return Ok(());
    }
    Err(ImportFault::element(
        "the motion",
        format!("{count} frames"),
        format!("1 to {MAX_FRAMES} frames; cut it, or take a lower rate"),
    ))
}
