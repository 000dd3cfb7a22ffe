//! Motion files made and read again.

use handwave::body::Skeleton;
use handwave::motion::import::{ImportOptions, open};
use handwave::motion::take::{Take, TakeBody};
use nalgebra::{Isometry3, Point3};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// The bundled fox.
pub fn fox() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/avatars/fox.glb")
}

/// Lengths are in centimetres.
pub fn centimetres() -> ImportOptions {
    ImportOptions {
        unit: Some("cm".parse().expect("a unit")),
        ..ImportOptions::default()
    }
}

/// The skeleton of a take.
pub fn skeleton(take: &Take) -> &Arc<Skeleton> {
    match &take.body {
        TakeBody::Skeleton(skeleton) => skeleton,
        other => panic!("no skeleton but {other:?}"),
    }
}

/// Places of all joints in the world at frame `k`.
pub fn places(take: &Take, k: usize) -> Vec<Point3<f64>> {
    let skeleton = skeleton(take);
    let mut frames = vec![Isometry3::identity(); skeleton.len()];
    skeleton.frames(&take.poses[k], &mut frames);
    let at = |f: &Isometry3<f64>| take.roots[k].to_world(Point3::from(f.translation.vector));
    frames.iter().map(at).collect()
}

/// Writes `text` to a file of that name and reads it as a motion.
pub fn through_file(name: &str, bytes: &[u8], options: &ImportOptions) -> Take {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join(name);
    std::fs::write(&path, bytes).expect("written");
    open(&path, options).expect("readable").takes.remove(0)
}

/// Legs below hips that travel, below a root that does not.
pub const TINY_BVH: &str = "HIERARCHY
ROOT World
{
  OFFSET 0 0 0
  CHANNELS 3 Zrotation Xrotation Yrotation
  JOINT Hips
  {
    OFFSET 0 90 0
    CHANNELS 6 Xposition Yposition Zposition Yrotation Xrotation Zrotation
    JOINT Leg_L
    {
      OFFSET 10 -5 0
      CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
      End Site
      {
        OFFSET 0 -80 5
      }
    }
    JOINT Leg_R
    {
      OFFSET -10 -5 0
      CHANNELS 3 Zrotation Xrotation Yrotation
      End Site
      {
        OFFSET 0 -80 5
      }
    }
  }
}
MOTION
Frames: 3
Frame Time: 0.1
0 0 0   0 90 0   0 0 0   10 -5 0 0 30 0   0 -30 0
0 0 0   5 91 20  45 0 0  10 -5 0 0 90 0   0 0 10
0 0 0   10 90 40 90 10 5  10 -5 0 0 0 20   90 0 0
";
