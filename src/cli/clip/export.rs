//! `handwave clip export`: a clip, or any motion that can be imported, for other programs.

use super::source::SourceArgs;
use crate::cli::disk;
use crate::cli::{ExitStatus, Failure, say, warn};
use crate::motion::export::{robot_to_gltf, skeleton_to_gltf, to_bvh, to_csv};
use crate::motion::import::ImportOptions;
use crate::motion::import::gltf::GltfFile;
use crate::motion::take::{Take, TakeBody};
use crate::robot::RobotModel;
use clap::Args;
use std::path::{Path, PathBuf};

/// What `--help` shows after the options.
pub(super) const EXAMPLES: &str = "Examples:
  handwave clip export walk.json --out walk.bvh                     axes and unit of the original file
  handwave clip export trot.json --seconds 10 --out trot.csv        a cycle goes on and on
  handwave clip export trot.json --urdf a1.urdf --out trot.glb      links of the robot as nodes
  handwave clip export fox_walk.json --mesh fox.glb --mesh-unit cm --out walk.glb
  handwave clip export 02_01.amc --out walk.bvh                     any motion that import reads

.bvh holds skeletons. .csv is what import reads: joints in rad, or rotation vectors; metres, x
forward, y left, z up. .glb and .gltf are glTF 2.0, metres, y up, faces z.";

/// A clip and where it goes.
#[derive(Args, Debug)]
pub(super) struct ExportArgs {
    /// The clip, or another motion file.
    file: PathBuf,
    /// Where to write it: .bvh, .csv, .glb or .gltf.
    #[arg(long)]
    out: PathBuf,
    /// The robot's description, for its links in glTF.
    #[arg(long, value_name = "FILE")]
    urdf: Option<PathBuf>,
    /// A glTF whose surface the skeleton carries, of the same joints.
    #[arg(long, value_name = "FILE")]
    mesh: Option<PathBuf>,
    /// Unit of length of --mesh.
    #[arg(long, value_name = "UNIT", default_value = "m")]
    mesh_unit: crate::pose::bvh::LengthUnit,
    /// How long, seconds; a cycle is repeated as often as needed (default: once).
    #[arg(long, value_name = "S")]
    seconds: Option<f64>,
    #[command(flatten)]
    source: SourceArgs,
}

/// Longest export, seconds.
const LONGEST_S: f64 = 3600.0;

pub(super) fn run(args: &ExportArgs) -> Result<ExitStatus, Failure> {
    let mut take = args.source.read(&args.file)?;
    if let Some(seconds) = args.seconds {
        if !(seconds > 0.0 && seconds <= LONGEST_S) {
            return Err(Failure::input(format!(
                "--seconds {seconds} must be above 0 and at most {LONGEST_S}"
            )));
        }
        take = take.repeated(seconds);
        if take.duration_s() < seconds - take.dt_s {
            warn(format_args!(
                "{}: lasts {:.3} s and is no cycle; --seconds {seconds} cannot be filled",
                args.file.display(),
                take.duration_s()
            ));
        }
    }
    let bytes = encode(args, &take)?;
    disk::write(&args.out, &bytes)?;
    say(format_args!(
        "{}: {} frames over {:.3} s, {} bytes",
        args.out.display(),
        take.len(),
        take.duration_s(),
        bytes.len()
    ));
    Ok(ExitStatus::Done)
}

fn encode(args: &ExportArgs, take: &Take) -> Result<Vec<u8>, Failure> {
    let extension = args
        .out
        .extension()
        .map(|e| e.to_string_lossy().to_lowercase());
    match extension.as_deref() {
        Some("bvh") => Ok(to_bvh(take).map_err(Failure::input)?.into_bytes()),
        Some("csv") => Ok(to_csv(take).map_err(Failure::input)?.into_bytes()),
        Some(kind @ ("glb" | "gltf")) => {
            let scene = match &args.urdf {
                Some(urdf) => {
                    let in_file = |e: &dyn std::fmt::Display| {
                        Failure::input(format!("{}: {e}", urdf.display()))
                    };
                    let text = std::fs::read_to_string(urdf).map_err(|e| in_file(&e))?;
                    let model = RobotModel::from_urdf(&text).map_err(|e| in_file(&e))?;
                    robot_to_gltf(take, &model)
                }
                None => {
                    let mesh = args
                        .mesh
                        .as_deref()
                        .map(|m| mesh(args, m, take))
                        .transpose()?;
                    skeleton_to_gltf(take, mesh.as_ref().and_then(|m| m.skin.as_ref()))
                }
            };
            let scene = scene.map_err(Failure::input)?;
            Ok(match kind {
                "glb" => scene.to_glb(),
                _ => scene.to_json().into_bytes(),
            })
        }
        other => Err(Failure::input(format!(
            "--out {}: no format {:?}; allowed: .bvh, .csv, .glb, .gltf",
            args.out.display(),
            other.unwrap_or_default()
        ))),
    }
}

/// The glTF with the surface, if its joints are those of the take.
fn mesh(args: &ExportArgs, path: &Path, take: &Take) -> Result<GltfFile, Failure> {
    let bad = |problem: String| Failure::input(format!("--mesh {}: {problem}", path.display()));
    let bytes = std::fs::read(path).map_err(|e| bad(format!("cannot be read: {e}")))?;
    let options = ImportOptions {
        unit: Some(args.mesh_unit),
        ..ImportOptions::default()
    };
    let file =
        GltfFile::parse(&bytes, "mesh", path.parent(), &options).map_err(|e| bad(e.to_string()))?;
    if file.skin.is_none() {
        return Err(bad("no skinned mesh in it".into()));
    }
    let TakeBody::Skeleton(skeleton) = &take.body else {
        return Err(bad("the motion is a robot's, which has no skin".into()));
    };
    let names = |s: &crate::body::Skeleton| -> Vec<String> {
        s.joints.iter().map(|j| j.name.clone()).collect()
    };
    if names(skeleton) != names(&file.skeleton) {
        return Err(bad(format!(
            "its joints ({}) are not those of the motion ({})",
            names(&file.skeleton).join(", "),
            names(skeleton).join(", ")
        )));
    }
    Ok(file)
}
