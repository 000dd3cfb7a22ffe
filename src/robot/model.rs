//! A robot read from a URDF and checked: tree, joints, limits.

use super::tip::{MeshShape, shapes};
use nalgebra::{Isometry3, Point3, Translation3, Unit, UnitQuaternion, Vector3};
use std::collections::HashMap;

/// What a joint may do, in radians and seconds (metres for prismatic joints).
#[derive(Copy, Clone, Debug, PartialEq)]
pub struct JointLimits {
    /// Lowest position.
    pub lower: f64,
    /// Highest position.
    pub upper: f64,
    /// Highest speed, rad/s.
    pub velocity: f64,
}

/// How a joint moves.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
pub enum JointKind {
    /// Does not move.
    Fixed,
    /// Turns about its axis.
    Revolute,
    /// Slides along its axis.
    Prismatic,
}

/// One joint of the tree.
#[derive(Clone, Debug)]
pub struct Joint {
    /// Name as in the URDF.
    pub name: String,
    /// How it moves.
    pub kind: JointKind,
    /// Index of the parent link.
    pub parent: usize,
    /// Index of the child link.
    pub child: usize,
    /// Pose of the joint frame in the parent link's frame, at position zero.
    pub origin: Isometry3<f64>,
    /// Axis in the joint frame.
    pub axis: Unit<Vector3<f64>>,
    /// Limits; present on every joint that moves.
    pub limits: Option<JointLimits>,
    /// Set on a joint that has no drive of its own.
    pub mimic: Option<Mimic>,
}

/// A joint that follows another: position = multiplier * other + offset.
#[derive(Copy, Clone, Debug, PartialEq)]
pub struct Mimic {
    /// The joint it follows, as an index into the joints.
    pub joint: usize,
    /// See above.
    pub multiplier: f64,
    /// See above, rad (m for prismatic joints).
    pub offset: f64,
}

/// A robot: links in a tree of joints.
#[derive(Clone, Debug)]
pub struct RobotModel {
    /// Name as in the URDF.
    pub name: String,
    /// Link names.
    pub links: Vec<String>,
    /// All joints, in the order of the URDF.
    pub joints: Vec<Joint>,
    /// Indices into `joints` of those that move by a drive of their own, in the order of the URDF.
    pub actuated: Vec<usize>,
    /// Index of the root link.
    pub root: usize,
    /// Per link the joint above it; `None` for the root.
    pub parent_joint: Vec<Option<usize>>,
    /// Per link the far end of its shape (box, cylinder, sphere; meshes by
    /// [`RobotModel::read_mesh_tips`]) from its origin, in its frame; `None` without a shape.
    pub tips: Vec<Option<Point3<f64>>>,
    pub(super) meshes: Vec<MeshShape>,
    /// What is odd but not wrong, for the reader.
    pub warnings: Vec<String>,
    /// Joints from the root outwards.
    pub(super) order: Vec<super::kinematics::OrderedJoint>,
}

/// Why a URDF cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum ModelError {
    /// Not a URDF.
    #[error("not a readable URDF: {0}")]
    Parse(String),
    /// A joint names a link that is not there.
    #[error(
        "joint {joint}: link {link} is not defined; declare <link name=\"{link}\"/> or correct the name"
    )]
    UnknownLink {
        /// Joint name.
        joint: String,
        /// The link it names.
        link: String,
    },
    /// The links do not form one tree.
    #[error("the links do not form one tree: {0}")]
    NotATree(String),
    /// A number or limit of a joint is unusable.
    #[error("joint {joint}: {problem}")]
    Joint {
        /// Joint name.
        joint: String,
        /// What was found and what is allowed.
        problem: String,
    },
}

/// Beyond this a limit is a placeholder, not a servo's: 100 turns a second.
pub const ABSURD_VELOCITY_RAD_S: f64 = 628.0;

impl RobotModel {
    /// Reads a URDF and checks what the format leaves open: one tree, known links, finite numbers,
    /// usable axes and limits.
    pub fn from_urdf(text: &str) -> Result<Self, ModelError> {
        if has_macros(text) {
            return Err(ModelError::Parse(
                "this is a xacro; expand it first: `xacro FILE.xacro > robot.urdf`".into(),
            ));
        }
        let urdf = urdf_rs::read_from_string(text).map_err(|e| ModelError::Parse(e.to_string()))?;
        let links: Vec<String> = urdf.links.iter().map(|l| l.name.clone()).collect();
        let index: HashMap<&str, usize> = links
            .iter()
            .enumerate()
            .map(|(i, name)| (name.as_str(), i))
            .collect();
        if index.len() != links.len() {
            return Err(ModelError::NotATree("two links have the same name".into()));
        }
        let mut warnings = Vec::new();
        let mut joints = Vec::with_capacity(urdf.joints.len());
        let mut parent_joint = vec![None; links.len()];
        for (j, joint) in urdf.joints.iter().enumerate() {
            let find = |link: &str| {
                index
                    .get(link)
                    .copied()
                    .ok_or_else(|| ModelError::UnknownLink {
                        joint: joint.name.clone(),
                        link: link.into(),
                    })
            };
            let parent = find(&joint.parent.link)?;
            let child = find(&joint.child.link)?;
            if let Some(other) = parent_joint[child] {
                let other: &Joint = &joints[other];
                return Err(ModelError::NotATree(format!(
                    "link {} hangs on two joints, {} and {}",
                    links[child], other.name, joint.name
                )));
            }
            parent_joint[child] = Some(j);
            joints.push(convert_joint(joint, parent, child, &mut warnings)?);
        }
        let roots: Vec<usize> = (0..links.len())
            .filter(|l| parent_joint[*l].is_none())
            .collect();
        let root = match roots.as_slice() {
            [root] => *root,
            [] => {
                return Err(ModelError::NotATree(
                    "every link has a parent: a loop".into(),
                ));
            }
            several => {
                let names: Vec<&str> = several.iter().map(|l| links[*l].as_str()).collect();
                return Err(ModelError::NotATree(format!(
                    "{} links have no parent: {}",
                    several.len(),
                    names.join(", ")
                )));
            }
        };
        // With one root and one parent per other link, a loop would be unreachable from the root.
        for link in 0..links.len() {
            let mut at = link;
            for _ in 0..=links.len() {
                match parent_joint[at] {
                    Some(j) => at = joints[j].parent,
                    None => break,
                }
            }
            if at != root {
                return Err(ModelError::NotATree(format!(
                    "link {} lies on a loop",
                    links[link]
                )));
            }
        }
        for (j, joint) in urdf.joints.iter().enumerate() {
            if let Some(mimic) = &joint.mimic {
                let of = urdf.joints.iter().position(|o| o.name == mimic.joint);
                joints[j].mimic = Some(convert_mimic(joint, mimic, of, &urdf.joints)?);
            }
        }
        let actuated: Vec<usize> = (0..joints.len())
            .filter(|j| joints[*j].kind != JointKind::Fixed && joints[*j].mimic.is_none())
            .collect();
        let (tips, meshes) = shapes(&urdf);
        let names: std::collections::HashSet<&str> =
            joints.iter().map(|j| j.name.as_str()).collect();
        if names.len() != joints.len() {
            return Err(ModelError::NotATree("two joints have the same name".into()));
        }
        let order = super::kinematics::outwards(&joints, &parent_joint, &actuated);
        Ok(Self {
            order,
            name: urdf.name,
            links,
            joints,
            actuated,
            root,
            parent_joint,
            tips,
            meshes,
            warnings,
        })
    }

    /// Names of the joints that move, in the order of the URDF: the order of every joint vector.
    pub fn joint_names(&self) -> Vec<String> {
        self.actuated
            .iter()
            .map(|j| self.joints[*j].name.clone())
            .collect()
    }

    /// Limits of the joints that move, in the same order.
    pub fn limits(&self) -> Vec<JointLimits> {
        self.actuated
            .iter()
            .map(|j| {
                self.joints[*j]
                    .limits
                    .expect("every moving joint was given limits when the model was read")
            })
            .collect()
    }

    /// What drives joint `joint`: the joint with the drive, and multiplier and offset of its position.
    pub fn driver(&self, joint: usize) -> (usize, f64, f64) {
        match self.joints[joint].mimic {
            Some(m) => (m.joint, m.multiplier, m.offset),
            None => (joint, 1.0, 0.0),
        }
    }

    /// Index of a link by name.
    pub fn link(&self, name: &str) -> Option<usize> {
        self.links.iter().position(|l| l == name)
    }

    /// Position of joint `joint` among those that move.
    pub fn actuated_index(&self, joint: usize) -> Option<usize> {
        self.actuated.iter().position(|j| *j == joint)
    }
}

/// Whether elements of xacro are in the text, comments aside.
fn has_macros(text: &str) -> bool {
    let mut rest = text;
    while let Some(at) = rest.find("<xacro:") {
        match rest.find("<!--") {
            Some(comment) if comment < at => match rest[comment..].find("-->") {
                Some(end) => rest = &rest[comment + end..],
                None => return false,
            },
            _ => return true,
        }
    }
    false
}

fn convert_joint(
    joint: &urdf_rs::Joint,
    parent: usize,
    child: usize,
    warnings: &mut Vec<String>,
) -> Result<Joint, ModelError> {
    let bad = |problem: String| ModelError::Joint {
        joint: joint.name.clone(),
        problem,
    };
    let xyz = joint.origin.xyz.0;
    let rpy = joint.origin.rpy.0;
    if xyz.iter().chain(&rpy).any(|v| !v.is_finite()) {
        return Err(bad("its origin holds a number that is not finite".into()));
    }
    use urdf_rs::JointType;
    let kind = match joint.joint_type {
        JointType::Fixed => JointKind::Fixed,
        JointType::Revolute | JointType::Continuous => JointKind::Revolute,
        JointType::Prismatic => JointKind::Prismatic,
        _ => {
            return Err(bad(
                "only fixed, revolute, continuous and prismatic joints are supported".into(),
            ));
        }
    };
    let axis = Vector3::from(joint.axis.xyz.0);
    let axis = if kind == JointKind::Fixed {
        Vector3::x_axis()
    } else {
        Unit::try_new(axis, 1e-6)
            .filter(|a| a.iter().all(|v| v.is_finite()))
            .ok_or_else(|| bad(format!("axis {:?} has no direction", joint.axis.xyz.0)))?
    };
    let limits = match kind {
        JointKind::Fixed => None,
        _ => {
            let limit = &joint.limit;
            let (lower, upper) = if joint.joint_type == JointType::Continuous {
                (f64::NEG_INFINITY, f64::INFINITY)
            } else {
                (limit.lower, limit.upper)
            };
            // Written so that NaN fails.
            if !(lower < upper) {
                return Err(bad(format!(
                    "limits {lower}..{upper} leave no room to move; give <limit lower=.. upper=..> with lower below upper"
                )));
            }
            if !(limit.velocity > 0.0) {
                return Err(bad(format!(
                    "velocity limit {} must be above zero (rad/s)",
                    limit.velocity
                )));
            }
            if limit.velocity > ABSURD_VELOCITY_RAD_S {
                warnings.push(format!(
                    "joint {}: velocity limit {} rad/s looks like a placeholder",
                    joint.name, limit.velocity
                ));
            }
            Some(JointLimits {
                lower,
                upper,
                velocity: limit.velocity,
            })
        }
    };
    Ok(Joint {
        name: joint.name.clone(),
        kind,
        parent,
        child,
        origin: Isometry3::from_parts(
            Translation3::from(Vector3::from(xyz)),
            UnitQuaternion::from_euler_angles(rpy[0], rpy[1], rpy[2]),
        ),
        axis,
        limits,
        mimic: None,
    })
}

fn convert_mimic(
    joint: &urdf_rs::Joint,
    mimic: &urdf_rs::Mimic,
    of: Option<usize>,
    all: &[urdf_rs::Joint],
) -> Result<Mimic, ModelError> {
    let bad = |problem: String| ModelError::Joint {
        joint: joint.name.clone(),
        problem,
    };
    let of = of.ok_or_else(|| bad(format!("mimics {}, which is not a joint", mimic.joint)))?;
    if all[of].mimic.is_some() || all[of].joint_type == urdf_rs::JointType::Fixed {
        return Err(bad(format!(
            "mimics {}, which is fixed or mimics another; name the joint that has the drive",
            mimic.joint
        )));
    }
    let (multiplier, offset) = (mimic.multiplier.unwrap_or(1.0), mimic.offset.unwrap_or(0.0));
    if !(multiplier.is_finite() && offset.is_finite()) {
        return Err(bad("its mimic numbers are not finite".into()));
    }
    Ok(Mimic {
        joint: of,
        multiplier,
        offset,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn arm(joint: &str) -> String {
        format!(r#"<robot name="arm"><link name="base"/><link name="tip"/>{joint}</robot>"#)
    }

    fn error_of(text: &str) -> String {
        RobotModel::from_urdf(text)
            .expect_err("this URDF is wrong on purpose")
            .to_string()
    }

    #[test]
    fn every_wrong_joint_is_named_with_what_is_allowed() {
        let no_limit = arm(
            r#"<joint name="j" type="revolute"><parent link="base"/><child link="tip"/><axis xyz="0 0 1"/></joint>"#,
        );
        let message = error_of(&no_limit);
        assert!(
            message.contains("joint j") && message.contains("lower"),
            "{message}"
        );
        let no_axis = arm(
            r#"<joint name="j" type="revolute"><parent link="base"/><child link="tip"/><axis xyz="0 0 0"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint>"#,
        );
        assert!(
            error_of(&no_axis).contains("axis"),
            "{}",
            error_of(&no_axis)
        );
        let nan = arm(
            r#"<joint name="j" type="fixed"><origin xyz="nan 0 0" rpy="0 0 0"/><parent link="base"/><child link="tip"/></joint>"#,
        );
        assert!(error_of(&nan).contains("not finite"), "{}", error_of(&nan));
        let stranger =
            arm(r#"<joint name="j" type="fixed"><parent link="bass"/><child link="tip"/></joint>"#);
        assert!(
            error_of(&stranger).contains("bass"),
            "{}",
            error_of(&stranger)
        );
        assert!(error_of("not xml").contains("URDF"));
        let macros = r#"<robot name="r"><xacro:leg name="a"/></robot>"#;
        assert!(error_of(macros).contains("expand it first"));
        assert!(!has_macros("<robot><!-- <xacro:leg/> --></robot>"));
    }

    #[test]
    fn a_joint_that_mimics_moves_with_its_driver_and_needs_no_drive() {
        let text = |mimic: &str| {
            format!(
                r#"<robot name="r"><link name="base"/><link name="a"/><link name="b"/>
                <joint name="j" type="revolute"><parent link="base"/><child link="a"/><axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
                <joint name="k" type="revolute"><origin xyz="1 0 0"/><parent link="a"/><child link="b"/><axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="1" velocity="1"/>{mimic}</joint></robot>"#
            )
        };
        let model =
            RobotModel::from_urdf(&text(r#"<mimic joint="j" multiplier="-2" offset="0.1"/>"#))
                .expect("a mimic joint");
        assert_eq!(model.joint_names(), ["j"]);
        let turned = model.link_pose(2, &[0.3]).rotation.angle();
        assert!(
            (turned - 0.2).abs() < 1e-12,
            "0.3 - 0.6 + 0.1, found {turned}"
        );
        let message = error_of(&text(r#"<mimic joint="k"/>"#));
        assert!(message.contains("mimics k"), "{message}");
        let message = error_of(&text(r#"<mimic joint="q"/>"#));
        assert!(message.contains("mimics q"), "{message}");
    }

    #[test]
    fn loops_and_forests_are_refused() {
        let two_roots = r#"<robot name="r"><link name="a"/><link name="b"/></robot>"#;
        assert!(
            error_of(two_roots).contains("no parent"),
            "{}",
            error_of(two_roots)
        );
        let ring = r#"<robot name="r"><link name="a"/><link name="b"/><link name="c"/>
            <joint name="j" type="fixed"><parent link="b"/><child link="c"/></joint>
            <joint name="k" type="fixed"><parent link="c"/><child link="b"/></joint></robot>"#;
        assert!(error_of(ring).contains("loop"), "{}", error_of(ring));
    }
}
