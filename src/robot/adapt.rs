//! A URDF brought to what servos can do: limits, and links for feet that have none.

use super::Leg;
use super::model::{ModelError, RobotModel};
use urdf_rs::JointType;

/// The text of a URDF with the limits of `model`, and with a foot link for every leg that ends in a
/// mere point of a link; and what was changed. Nothing changed: the text as it was.
///
/// `text`: what `model` was read from. Where limits change, elements that a URDF reader does not know
/// are lost.
pub fn adapted_urdf(
    text: &str,
    model: &RobotModel,
    legs: &[Leg],
) -> Result<(String, Vec<String>), ModelError> {
    let parse = |e: urdf_rs::UrdfError| ModelError::Parse(e.to_string());
    let mut urdf = urdf_rs::read_from_string(text).map_err(parse)?;
    let mut changes = Vec::new();
    for joint in &mut urdf.joints {
        let known = model.joints.iter().find(|j| j.name == joint.name);
        let Some(limits) = known.and_then(|j| j.limits) else {
            continue;
        };
        let wanted = (limits.lower, limits.upper, limits.velocity);
        if joint.joint_type == JointType::Continuous {
            if limits.lower.is_finite() {
                joint.joint_type = JointType::Revolute;
            } else {
                (joint.limit.lower, joint.limit.upper) = (limits.lower, limits.upper);
            }
        }
        let found = (joint.limit.lower, joint.limit.upper, joint.limit.velocity);
        if found != wanted {
            changes.push(format!(
                "joint {}: {:.3}..{:.3} rad, {:.2} rad/s",
                joint.name, wanted.0, wanted.1, wanted.2
            ));
            (joint.limit.lower, joint.limit.upper, joint.limit.velocity) = wanted;
        }
    }
    let mut text = if changes.is_empty() {
        text.to_string()
    } else {
        let body = urdf_rs::write_to_string(&urdf).map_err(parse)?;
        format!("<?xml version=\"1.0\"?>\n{body}\n")
    };
    for leg in legs.iter().filter(|l| l.tip.coords.norm() > 0.0) {
        let end = text
            .rfind("</robot>")
            .ok_or_else(|| ModelError::Parse("no </robot> at its end".into()))?;
        let name = format!("{}_foot", leg.name);
        let (x, y, z) = (leg.tip.x, leg.tip.y, leg.tip.z);
        let shank = &model.links[leg.foot];
        text.insert_str(
            end,
            &format!(
                "  <link name=\"{name}\"/>\n  <joint name=\"{name}_fixed\" type=\"fixed\">\
                 <parent link=\"{shank}\"/><child link=\"{name}\"/>\
                 <origin xyz=\"{x:.6} {y:.6} {z:.6}\"/></joint>\n"
            ),
        );
        changes.push(format!("link {name} added"));
    }
    Ok((text, changes))
}
