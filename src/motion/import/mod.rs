//! Motion files of other programs as takes: found by extension and content.
//!
//! Whatever a file has, a take is in metres and radians, x forward, y left, z up. Only what a file does
//! not tell is asked for ([`ImportOptions`]): unit, axes, rate.

mod amc;
mod asf;
mod axes;
mod bvh;
mod csv;
mod deepmimic;
mod error;
pub mod gltf;
mod joint_json;
mod raw;
mod text;
mod uneven;

pub use axes::{Axes, Axis};
pub use error::{ImportError, ImportFault};

use super::take::{Take, TakeBody};
use crate::body::Skeleton;
use crate::pose::bvh::LengthUnit;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Largest file that is read, bytes.
pub const MAX_BYTES: u64 = 512 << 20;
/// Joints a skeleton may have.
pub const MAX_JOINTS: usize = 1000;
/// Frames a take may have.
pub const MAX_FRAMES: usize = 1_000_000;

/// Frames times joints a take may have: what fits in memory.
const MAX_ROTATIONS: usize = 50_000_000;

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
    let (file, _) = split_selector(path);
    let bytes = check_rate(options)
        .and_then(|()| read_bytes(&file))
        .map_err(|fault| fault.in_file(&file.display().to_string()))?;
    open_bytes(path, &bytes, options)
}

/// The same of a file whose content is at hand; what it refers to is looked for beside `path`.
///
/// # Errors
/// As [`open`].
pub fn open_bytes(
    path: &Path,
    bytes: &[u8],
    options: &ImportOptions,
) -> Result<Imported, ImportError> {
    let (path, animation) = split_selector(path);
    let mut options = options.clone();
    options.animation = animation.or(options.animation);
    let file = path.display().to_string();
    read(&path, bytes, &options).map_err(|fault| fault.in_file(&file))
}

fn read(path: &Path, bytes: &[u8], options: &ImportOptions) -> Result<Imported, ImportFault> {
    check_rate(options)?;
    let name = path
        .file_stem()
        .map_or("take".into(), |s| s.to_string_lossy().into_owned());
    let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase());
    let text = || String::from_utf8_lossy(bytes);
    match Format::of(extension.as_deref(), bytes)? {
        Format::Gltf => {
            let file = gltf::GltfFile::parse(bytes, &name, path.parent(), options)?;
            Ok(Imported {
                takes: file.takes,
                warnings: file.warnings,
            })
        }
        Format::Bvh => bvh::parse(&text(), &name, options),
        Format::Amc => {
            let skeleton = amc::skeleton_beside(path, options)?;
            let bones = read_bytes(&skeleton)
                .and_then(|bytes| asf::Asf::parse(&String::from_utf8_lossy(&bytes)))
                .map_err(|fault| beside(&skeleton, &fault))?;
            amc::parse(&text(), &bones, &name, options)
        }
        Format::Json => joint_json::parse(&text(), &name, options),
        Format::Csv => {
            let skeleton = options.skeleton.as_deref().map(skeleton_of).transpose()?;
            csv::parse(&text(), &name, skeleton.as_ref(), options)
        }
    }
}

/// The formats.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
enum Format {
    Gltf,
    Bvh,
    Amc,
    Json,
    Csv,
}

impl Format {
    /// By extension, else by how the file begins: DeepMimic's JSON ends in `.txt`.
    fn of(extension: Option<&str>, bytes: &[u8]) -> Result<Self, ImportFault> {
        let head = String::from_utf8_lossy(&bytes[..bytes.len().min(4096)]);
        let head = head.trim_start_matches('\u{feff}').trim_start();
        let is_gltf = bytes.starts_with(b"glTF") || head.contains("\"asset\"");
        let found = match extension {
            Some("glb" | "gltf" | "vrm") => Some(Self::Gltf),
            Some("bvh") => Some(Self::Bvh),
            Some("amc") => Some(Self::Amc),
            Some("csv") => Some(Self::Csv),
            _ if is_gltf => Some(Self::Gltf),
            _ if head.starts_with("HIERARCHY") => Some(Self::Bvh),
            _ if head.starts_with('{') => Some(Self::Json),
            _ if head.starts_with("t,") => Some(Self::Csv),
            _ => None,
        };
        found.ok_or_else(|| {
            ImportFault::element(
                "the file",
                "no known extension and no known beginning",
                "glTF (.glb, .gltf, .vrm), BVH (.bvh), AMC with its ASF (.amc), CSV (.csv), joint-space JSON or a clip (.json, .txt)",
            )
        })
    }
}

/// The skeleton of a file: an ASF, or that of the first motion of any other.
fn skeleton_of(path: &Path) -> Result<Arc<Skeleton>, ImportFault> {
    let told = |fault: &dyn std::fmt::Display| beside(path, fault);
    let is_asf = path
        .extension()
        .is_some_and(|e| e.eq_ignore_ascii_case("asf"));
    if is_asf {
        return Err(told(&"an ASF alone; give an AMC of it"));
    }
    let imported = open(path, &ImportOptions::default()).map_err(|e| told(&e.fault))?;
    match imported.takes.first().map(|t| &t.body) {
        Some(TakeBody::Skeleton(skeleton)) => Ok(Arc::clone(skeleton)),
        _ => Err(told(&"a motion without a skeleton")),
    }
}

/// A fault of a file that belongs to the one read.
fn beside(path: &Path, fault: &dyn std::fmt::Display) -> ImportFault {
    ImportFault::element(
        "its skeleton",
        format!("{}: {fault}", path.display()),
        "a good file with the skeleton",
    )
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

/// An error where a motion has no frame, or more than is sensible.
fn check_size(frames: usize, columns: usize) -> Result<(), ImportFault> {
    if (1..=MAX_FRAMES).contains(&frames) && frames.saturating_mul(columns) <= MAX_ROTATIONS {
        return Ok(());
    }
    Err(ImportFault::element(
        "the motion",
        format!("{frames} frames of {columns} columns"),
        format!(
            "1 to {MAX_FRAMES} frames, at most {MAX_ROTATIONS} joints over all; cut it, or take a lower rate"
        ),
    ))
}
