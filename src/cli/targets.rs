//! The `--targets` file: one row of joint targets per control cycle.

use crate::body::Skeleton;
use crate::config::Character;
use crate::live::CycleRecord;
use nalgebra::{Point3, UnitQuaternion, Vector3};
use std::f64::consts::TAU;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Writes targets as CSV. The first failure is kept and reported at the end, since a full disk must
/// not stop a robot in mid-step.
pub struct TargetsFile {
    path: PathBuf,
    out: BufWriter<File>,
    failure: Option<std::io::Error>,
    avatar: Option<AvatarRow>,
}

/// What a row of an avatar is made of.
struct AvatarRow {
    skeleton: Arc<Skeleton>,
    /// Rotation vectors of the last row, by joint.
    last: Vec<Vector3<f64>>,
}

impl TargetsFile {
    /// Creates the file and writes its header.
    ///
    /// Of a robot one column per joint. Of an avatar a rotation vector per joint (in its parent's frame; the
    /// root's in the world) and the root's place in the world, metres.
    pub fn create(path: &Path, character: &Character) -> std::io::Result<Self> {
        let mut out = BufWriter::new(File::create(path)?);
        let avatar = character.body.avatar.as_ref().map(|avatar| AvatarRow {
            last: vec![Vector3::zeros(); avatar.skeleton.len()],
            skeleton: Arc::clone(&avatar.skeleton),
        });
        match &avatar {
            None => writeln!(out, "t,{}", character.joints.join(","))?,
            Some(avatar) => {
                write!(out, "t")?;
                for joint in &avatar.skeleton.joints {
                    let name = &joint.name;
                    write!(out, ",{name}.rx,{name}.ry,{name}.rz")?;
                }
                writeln!(out, ",x,y,z")?;
            }
        }
        Ok(Self {
            avatar,
            path: path.into(),
            out,
            failure: None,
        })
    }

    /// Appends the row of one cycle.
    pub fn row(&mut self, record: &CycleRecord) {
        if self.failure.is_some() {
            return;
        }
        let mut write = || -> std::io::Result<()> {
            write!(self.out, "{:.6}", record.t_s)?;
            if let Some(avatar) = &mut self.avatar {
                return avatar.write(&mut self.out, record);
            }
            for target in &record.targets {
                // Nine decimals: rounding stays invisible even in second differences.
                write!(self.out, ",{target:.9}")?;
            }
            self.out.write_all(b"\n")
        };
        self.failure = write().err();
    }

    /// Flushes; says what went wrong while writing, if anything did.
    pub fn finish(mut self) -> Result<(), String> {
        let flushed = self.out.flush().err();
        match self.failure.or(flushed) {
            Some(e) => Err(format!("{}: cannot be written: {e}", self.path.display())),
            None => Ok(()),
        }
    }
}

impl AvatarRow {
    fn write(&mut self, out: &mut impl Write, record: &CycleRecord) -> std::io::Result<()> {
        let pose = &record.targets;
        for joint in 0..self.skeleton.len() {
            let mut rotation = Skeleton::rotation(pose, joint);
            if joint == 0 {
                let heading = Vector3::z() * record.root.yaw_rad;
                rotation = UnitQuaternion::from_scaled_axis(heading) * rotation;
            }
            let vector = nearest(rotation.scaled_axis(), &self.last[joint]);
            self.last[joint] = vector;
            write!(out, ",{:.9},{:.9},{:.9}", vector.x, vector.y, vector.z)?;
        }
        let place = record.root.to_world(Point3::new(pose[0], pose[1], pose[2]));
        writeln!(out, ",{:.9},{:.9},{:.9}", place.x, place.y, place.z)
    }
}

/// The rotation vector of the same rotation that is nearest to `last`: past half a turn a column goes on
/// instead of jumping to the other side.
fn nearest(vector: Vector3<f64>, last: &Vector3<f64>) -> Vector3<f64> {
    let angle = vector.norm();
    // Without a turn there is no axis to go round.
    let axis = if angle > 1e-9 {
        vector / angle
    } else {
        return vector;
    };
    let turns = ((axis.dot(last) - angle) / TAU).round();
    axis * (angle + turns * TAU)
}
