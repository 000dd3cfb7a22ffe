//! A take as a table, in the columns that [`super::super::import`] reads: SI units, our axes.

use super::{ExportError, body_in_world, check_frames, root_in_world};
use crate::body::Skeleton;
use crate::motion::take::{Take, TakeBody};
use std::fmt::Write;

/// The text of a CSV file of `take`: `t,<joint>,...` of a robot, with `x,y,z,roll,pitch,yaw` of its root
/// link in the world if it walks; `t,x,y,z,<joint>.rx,...` of a skeleton. Nine decimals.
///
/// # Errors
/// A take without frames.
pub fn to_csv(take: &Take) -> Result<String, ExportError> {
    check_frames(take)?;
    let mut text = String::from("t");
    match &take.body {
        TakeBody::Joints(names) => names.iter().for_each(|n| column(&mut text, n, "")),
        TakeBody::Floating(names) => {
            names.iter().for_each(|n| column(&mut text, n, ""));
            text.push_str(",x,y,z,roll,pitch,yaw");
        }
        TakeBody::Skeleton(skeleton) => {
            text.push_str(",x,y,z");
            for joint in &skeleton.joints {
                for axis in [".rx", ".ry", ".rz"] {
                    column(&mut text, &joint.name, axis);
                }
            }
        }
    }
    text.push('\n');
    for (k, (pose, root)) in take.poses.iter().zip(&take.roots).enumerate() {
        let _ = write!(text, "{:.9}", take.dt_s * k as f64);
        let mut put = |v: f64| {
            // No minus before a zero.
            let _ = write!(text, ",{:.9}", (v * 1e9).round() / 1e9 + 0.0);
        };
        match &take.body {
            TakeBody::Joints(_) => pose.iter().for_each(|v| put(*v)),
            TakeBody::Floating(names) => {
                let (joints, body) = pose.split_at(names.len());
                joints.iter().for_each(|v| put(*v));
                let (place, turn) = body_in_world(body, root);
                place.iter().chain(&turn).for_each(|v| put(*v));
            }
            TakeBody::Skeleton(skeleton) => {
                let world = root_in_world(pose, root);
                world.translation.vector.iter().for_each(|v| put(*v));
                for joint in 0..skeleton.len() {
                    let turn = match joint {
                        0 => world.rotation,
                        _ => Skeleton::rotation(pose, joint),
                    };
                    turn.scaled_axis().iter().for_each(|v| put(*v));
                }
            }
        }
        text.push('\n');
    }
    Ok(text)
}

/// Adds a column's name; what would end a cell becomes an underscore.
fn column(text: &mut String, name: &str, suffix: &str) {
    text.push(',');
    text.extend(name.chars().map(|c| match c {
        ',' | '"' | '\n' | '\r' => '_',
        c => c,
    }));
    text.push_str(suffix);
}
