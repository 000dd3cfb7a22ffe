//! Acclaim skeletons (.asf), as the CMU motion capture database has them.
//!
//! A bone is a joint at its parent's end, named after the bone; tips of bones without children become
//! joints `NAME_end`. `L = C M C^-1`: the joint's angles turn about axes that are themselves turned by
//! the bone's `axis`; at rest everything is in the axes of the world.

use super::MAX_JOINTS;
use super::error::ImportFault;
use super::raw::RawJoint;
use super::text::{fault, lines, number, shown};
use crate::pose::LineFault;
use nalgebra::{UnitQuaternion, Vector3};

/// One number of a frame: along or about an axis (0 is x), or a stretch that is not used.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
pub(super) enum Dof {
    Along(usize),
    About(usize),
    Length,
}

impl Dof {
    fn of(word: &str) -> Option<Self> {
        let axis = |c: &str| ["x", "y", "z"].iter().position(|a| *a == c);
        let word = word.to_lowercase();
        match word.split_at_checked(1) {
            Some(("r", a)) => axis(a).map(Self::About),
            Some(("t", a)) => axis(a).map(Self::Along),
            Some(("l", "")) => Some(Self::Length),
            _ => None,
        }
    }
}

/// A bone: what its joint can do.
#[derive(Clone, Debug)]
pub(super) struct Bone {
    pub name: String,
    pub dofs: Vec<Dof>,
    /// Rotation of the axes its angles turn about.
    pub axes: UnitQuaternion<f64>,
    /// To its end, file units.
    end: Vector3<f64>,
    /// Lowest and highest value per angle, as in the file.
    pub limits: Vec<(f64, f64)>,
    line: usize,
}

/// An ASF file.
#[derive(Clone, Debug)]
pub(super) struct Asf {
    /// The root, then the bones in the order of the file.
    pub bones: Vec<Bone>,
    /// Metres in one unit of length.
    pub unit_m: f64,
    /// Whether angles are in degrees.
    pub degrees: bool,
    /// Where the root stands at rest, file units.
    pub position: Vector3<f64>,
    parents: Vec<Option<usize>>,
}

/// The rotation by three angles about the axes in `order`, the first one first.
fn by_order(order: &str, angles: [f64; 3], line: usize) -> Result<UnitQuaternion<f64>, LineFault> {
    let mut turn = UnitQuaternion::identity();
    let axes = order.to_lowercase();
    let mut letters = axes.chars();
    for angle in angles {
        let axis = match letters.next() {
            Some('x') => Vector3::x_axis(),
            Some('y') => Vector3::y_axis(),
            Some('z') => Vector3::z_axis(),
            _ => return Err(fault(line, shown(order), "an order of axes such as XYZ")),
        };
        turn = UnitQuaternion::from_axis_angle(&axis, angle) * turn;
    }
    Ok(turn)
}

/// The words of a line as three numbers.
fn three(line: usize, words: &[&str], what: &str) -> Result<[f64; 3], LineFault> {
    let [x, y, z, ..] = words else {
        return Err(fault(
            line,
            format!("{} numbers", words.len()),
            format!("three numbers for {what}"),
        ));
    };
    Ok([
        number(line, x, what)?,
        number(line, y, what)?,
        number(line, z, what)?,
    ])
}

impl Asf {
    /// Reads the text of an ASF file.
    pub fn parse(text: &str) -> Result<Self, ImportFault> {
        let mut reader = Reader::default();
        let mut section = String::new();
        let mut last = 1;
        for (line, text) in lines(text) {
            last = line;
            if let Some(head) = text.strip_prefix(':') {
                section = head
                    .split_whitespace()
                    .next()
                    .unwrap_or_default()
                    .to_lowercase();
                continue;
            }
            let words: Vec<&str> = text.split_whitespace().collect();
            match section.as_str() {
                "units" => reader.units(line, &words)?,
                "root" => reader.root(line, &words)?,
                "bonedata" => reader.bone(line, &words)?,
                "hierarchy" => reader.hierarchy(line, &words)?,
                _ => {}
            }
        }
        Ok(reader.finish(last)?)
    }

    /// The joints with tips, parents first, file axes and units; and the bone of each, `None` for tips.
    pub fn joints(&self) -> (Vec<RawJoint>, Vec<Option<usize>>) {
        let (mut joints, mut bones) = (Vec::new(), Vec::new());
        let mut index = vec![0; self.bones.len()];
        let mut open = vec![0];
        while let Some(b) = open.pop() {
            let bone = &self.bones[b];
            index[b] = joints.len();
            let parent = self.parents[b];
            joints.push(RawJoint {
                name: bone.name.clone(),
                parent: parent.map(|p| index[p]),
                offset: parent.map_or_else(Vector3::zeros, |p| self.bones[p].end),
                rest: UnitQuaternion::identity(),
            });
            bones.push(Some(b));
            let children = (0..self.bones.len()).filter(|c| self.parents[*c] == Some(b));
            let children: Vec<usize> = children.collect();
            if children.is_empty() && bone.end.norm() > 0.0 {
                joints.push(RawJoint {
                    name: format!("{}_end", bone.name),
                    parent: Some(index[b]),
                    offset: bone.end,
                    rest: UnitQuaternion::identity(),
                });
                bones.push(None);
            }
            open.extend(children.into_iter().rev());
        }
        (joints, bones)
    }
}

/// What is read so far.
struct Reader {
    length: f64,
    degrees: bool,
    root: Bone,
    root_order: String,
    orientation: ([f64; 3], usize),
    position: Vector3<f64>,
    bones: Vec<Bone>,
    /// The bone between `begin` and `end`: direction, length, axis.
    open: Option<(Bone, Vector3<f64>, f64)>,
    parents: Vec<Option<usize>>,
    in_limits: bool,
}

impl Default for Reader {
    fn default() -> Self {
        Self {
            length: 1.0,
            degrees: true,
            root: Bone {
                name: "root".into(),
                dofs: Vec::new(),
                axes: UnitQuaternion::identity(),
                end: Vector3::zeros(),
                limits: Vec::new(),
                line: 1,
            },
            root_order: "XYZ".into(),
            orientation: ([0.0; 3], 1),
            position: Vector3::zeros(),
            bones: Vec::new(),
            open: None,
            parents: Vec::new(),
            in_limits: false,
        }
    }
}

impl Reader {
    fn radians(&self, angles: [f64; 3]) -> [f64; 3] {
        angles.map(|a| if self.degrees { a.to_radians() } else { a })
    }

    fn units(&mut self, line: usize, words: &[&str]) -> Result<(), LineFault> {
        match words {
            ["length", value, ..] => {
                self.length = number(line, value, "length")?;
                if !(1e-6..1e6).contains(&self.length) {
                    return Err(fault(line, shown(value), "a length from 1e-6 to 1e6"));
                }
            }
            ["angle", value, ..] => {
                self.degrees = match *value {
                    "deg" => true,
                    "rad" => false,
                    other => return Err(fault(line, shown(other), "deg or rad")),
                };
            }
            _ => {}
        }
        Ok(())
    }

    fn dofs(line: usize, words: &[&str]) -> Result<Vec<Dof>, LineFault> {
        let one = |w: &&str| {
            Dof::of(w).ok_or_else(|| fault(line, shown(w), "rx, ry, rz, tx, ty, tz or l"))
        };
        words.iter().map(one).collect()
    }

    fn root(&mut self, line: usize, words: &[&str]) -> Result<(), LineFault> {
        match words {
            ["order", dofs @ ..] => self.root.dofs = Self::dofs(line, dofs)?,
            ["axis", order, ..] => self.root_order = (*order).to_owned(),
            ["position", rest @ ..] => {
                self.position = three(line, rest, "the root's position")?.into();
            }
            ["orientation", rest @ ..] => {
                self.orientation = (three(line, rest, "the root's orientation")?, line);
            }
            _ => {}
        }
        Ok(())
    }

    fn bone(&mut self, line: usize, words: &[&str]) -> Result<(), LineFault> {
        if words == ["begin"] {
            if self.open.is_some() {
                return Err(fault(line, "begin inside of a bone", "end first"));
            }
            let bone = Bone {
                name: String::new(),
                line,
                ..Self::default().root
            };
            self.open = Some((bone, Vector3::zeros(), 0.0));
            self.in_limits = false;
            return Ok(());
        }
        let degrees = self.degrees;
        let Some((bone, direction, length)) = &mut self.open else {
            return Err(fault(line, shown(words[0]), "begin"));
        };
        match words {
            ["end"] => {
                let norm = direction.norm();
                bone.end = if norm > 1e-9 {
                    *direction * (*length / norm)
                } else {
                    Vector3::zeros()
                };
                if bone.name.is_empty() {
                    return Err(fault(line, "a bone without name", "name NAME"));
                }
                let taken = |b: &Bone| b.name == bone.name;
                if bone.name == "root" || self.bones.iter().any(taken) {
                    return Err(fault(
                        line,
                        format!("bone {} twice", bone.name),
                        "other names",
                    ));
                }
                if self.bones.len() >= MAX_JOINTS / 2 {
                    return Err(fault(
                        line,
                        format!("over {} bones", MAX_JOINTS / 2),
                        "fewer bones",
                    ));
                }
                self.bones.extend(self.open.take().map(|(bone, ..)| bone));
            }
            ["name", name, ..] => bone.name = name.replace([',', '"'], "_"),
            ["direction", rest @ ..] => *direction = three(line, rest, "direction")?.into(),
            ["length", value, ..] => *length = number(line, value, "length")?,
            ["axis", a, b, c, order, ..] => {
                let angles = three(line, &[a, b, c], "axis")?;
                let angles = angles.map(|a| if degrees { a.to_radians() } else { a });
                bone.axes = by_order(order, angles, line)?;
            }
            ["dof", dofs @ ..] => bone.dofs = Self::dofs(line, dofs)?,
            ["limits", rest @ ..] => {
                self.in_limits = true;
                bone.limits.extend(limit(line, rest)?);
            }
            rest if self.in_limits && rest[0].starts_with('(') => {
                bone.limits.extend(limit(line, rest)?)
            }
            _ => {}
        }
        Ok(())
    }

    fn hierarchy(&mut self, line: usize, words: &[&str]) -> Result<(), LineFault> {
        let index = |name: &str| match name {
            "root" => Ok(0),
            name => (self.bones.iter().position(|b| b.name == name))
                .map(|i| i + 1)
                .ok_or_else(|| fault(line, format!("bone {}", shown(name)), "a bone of bonedata")),
        };
        self.parents.resize(self.bones.len() + 1, None);
        let [parent, children @ ..] = words else {
            return Ok(());
        };
        if matches!(*parent, "begin" | "end") {
            return Ok(());
        }
        let parent = index(parent)?;
        for child in children {
            let child = index(child)?;
            if child == 0 || self.parents[child].is_some() {
                return Err(fault(
                    line,
                    format!("another parent of {}", words[1]),
                    "one parent for each bone",
                ));
            }
            self.parents[child] = Some(parent);
        }
        Ok(())
    }

    fn finish(mut self, last: usize) -> Result<Asf, LineFault> {
        if self.open.is_some() {
            return Err(fault(last, "the end of the file inside of a bone", "end"));
        }
        if self.bones.is_empty() {
            return Err(fault(last, "no bone", "a section :bonedata"));
        }
        if self.root.dofs.is_empty() {
            return Err(fault(
                last,
                "no order of the root",
                "order TX TY TZ RX RY RZ under :root",
            ));
        }
        let (angles, line) = self.orientation;
        self.root.axes = by_order(&self.root_order, self.radians(angles), line)?;
        self.parents.resize(self.bones.len() + 1, None);
        let mut bones = vec![self.root];
        bones.append(&mut self.bones);
        for (i, bone) in bones.iter().enumerate().skip(1) {
            // Following parents as often as there are bones must end at the root.
            let mut at = Some(i);
            for _ in 0..bones.len() {
                at = at.and_then(|at| if at == 0 { Some(0) } else { self.parents[at] });
            }
            if at != Some(0) {
                return Err(fault(
                    bone.line,
                    format!("bone {} that hangs on nothing", bone.name),
                    "a way to the root in :hierarchy",
                ));
            }
        }
        Ok(Asf {
            bones,
            unit_m: 0.0254 / self.length,
            degrees: self.degrees,
            position: self.position,
            parents: self.parents,
        })
    }
}

/// `(low high)`, if the line is one.
fn limit(line: usize, words: &[&str]) -> Result<Option<(f64, f64)>, LineFault> {
    let text = words.join(" ").replace(['(', ')'], " ");
    let mut numbers = text.split_whitespace();
    let mut next = || match numbers.next() {
        Some("-inf") => Ok(f64::NEG_INFINITY),
        Some("inf") => Ok(f64::INFINITY),
        Some(word) => number(line, word, "a limit"),
        None => Err(fault(line, shown(&text), "(low high)")),
    };
    let (low, high) = (next()?, next()?);
    Ok((low <= high).then_some((low, high)))
}
