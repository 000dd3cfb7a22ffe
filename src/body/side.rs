//! Left and right in the names of joints, as files of many origins write them.

/// A side of the body.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
pub enum Side {
    /// The body's own left, +y.
    Left,
    /// The body's own right, -y.
    Right,
}

/// Codes of four-legged robots: the letter at the given place is the side.
const CODES: [(&str, usize); 10] = [
    ("fl", 1),
    ("fr", 1),
    ("rl", 1),
    ("rr", 1),
    ("hl", 1),
    ("hr", 1),
    ("lf", 0),
    ("rf", 0),
    ("lh", 0),
    ("rh", 0),
];

/// What follows a bare l or r at the start of a name (`lfemur`).
const BONES: [&str; 22] = [
    "hip", "femur", "tibia", "foot", "toe", "clavicle", "humerus", "radius", "wrist", "hand",
    "finger", "thumb", "shoulder", "shldr", "elbow", "knee", "ankle", "arm", "leg", "collar",
    "thigh", "shin",
];

/// Where the side is written in `name`: byte range and side.
fn find(name: &str) -> Option<(std::ops::Range<usize>, Side)> {
    // ASCII only: lengths stay the same.
    let lower = name.to_ascii_lowercase();
    for (word, side) in [("left", Side::Left), ("right", Side::Right)] {
        if let Some(at) = lower.find(word) {
            return Some((at..at + word.len(), side));
        }
    }
    let side_of = |at: usize| match lower.as_bytes().get(at) {
        Some(b'l') => Some((at..at + 1, Side::Left)),
        Some(b'r') => Some((at..at + 1, Side::Right)),
        _ => None,
    };
    let mut start = 0;
    for token in lower.split(|c: char| !c.is_alphabetic()) {
        if token == "l" || token == "r" {
            return side_of(start);
        }
        if let Some((_, place)) = CODES.iter().find(|(code, _)| *code == token) {
            return side_of(start + place);
        }
        // What splits is one character, of whatever length.
        start += token.len();
        start += lower[start..].chars().next().map_or(0, char::len_utf8);
    }
    let rest = lower.get(1..)?;
    if BONES.iter().any(|bone| rest.starts_with(bone)) {
        return side_of(0);
    }
    None
}

impl Side {
    /// The side that `name` tells: `left`, `Foot_L`, `lfemur`, `FL_hip_joint`; `None` where it tells none.
    pub fn of(name: &str) -> Option<Self> {
        find(name).map(|(_, side)| side)
    }
}

/// The name of the same joint on the other side; `None` where the name tells no side.
pub fn other_side(name: &str) -> Option<String> {
    let (range, side) = find(name)?;
    let written = &name[range.clone()];
    let word = match (side, written.len()) {
        (Side::Left, 1) => "r",
        (Side::Right, 1) => "l",
        (Side::Left, _) => "right",
        (Side::Right, _) => "left",
    };
    let mut word = word.to_string();
    if written.chars().all(|c| c.is_ascii_uppercase()) {
        word = word.to_ascii_uppercase();
    } else if written.starts_with(|c: char| c.is_ascii_uppercase()) {
        word[..1].make_ascii_uppercase();
    }
    Some(format!(
        "{}{word}{}",
        &name[..range.start],
        &name[range.end..]
    ))
}

/// For each of `names` the index of its mirror image: its partner on the other side, itself where there
/// is none.
///
/// Some exporters number the joints (`b_LeftLeg01_015`): a number behind the last underscore is ignored
/// where the whole name finds no partner.
pub fn mirrored<S: AsRef<str>>(names: &[S]) -> Vec<usize> {
    let unnumbered = |name: &str| match name.rsplit_once('_') {
        Some((head, tail)) if !tail.is_empty() && tail.bytes().all(|b| b.is_ascii_digit()) => {
            head.to_string()
        }
        _ => name.to_string(),
    };
    let partner = |i: usize| -> Option<usize> {
        let other = other_side(names[i].as_ref())?;
        let exact = names.iter().position(|n| n.as_ref() == other);
        exact.or_else(|| {
            let other = unnumbered(&other);
            let mut found =
                (0..names.len()).filter(|j| *j != i && unnumbered(names[*j].as_ref()) == other);
            let first = found.next();
            found.next().is_none().then_some(first)?
        })
    };
    let partners: Vec<Option<usize>> = (0..names.len()).map(partner).collect();
    // Only mutual ones count.
    (0..names.len())
        .map(|i| partners[i].filter(|j| partners[*j] == Some(i)).unwrap_or(i))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn sides_are_read_as_many_tools_write_them() {
        for (left, right) in [
            ("left_hip", "right_hip"),
            ("b_LeftUpperArm", "b_RightUpperArm"),
            ("Foot_L", "Foot_R"),
            ("upperarm.l", "upperarm.r"),
            ("lfemur", "rfemur"),
            ("FL_hip_joint", "FR_hip_joint"),
            ("RL_calf", "RR_calf"),
            ("LF_HAA", "RF_HAA"),
            ("hl_knee", "hr_knee"),
            ("leg_1_L", "leg_1_R"),
        ] {
            assert_eq!(Side::of(left), Some(Side::Left), "{left}");
            assert_eq!(other_side(left).as_deref(), Some(right));
            assert_eq!(other_side(right).as_deref(), Some(left));
        }
        for none in [
            "",
            "root",
            "lowerback",
            "Hips",
            "tail_01",
            "r\u{e9}gion",
            "\u{e9}_x",
        ] {
            assert_eq!(Side::of(none), None, "{none}");
        }
    }

    #[test]
    fn numbered_names_find_their_partners_and_lone_ones_stay_themselves() {
        let names = ["hips", "a_LeftLeg_015", "a_RightLeg_022", "LeftHorn"];
        assert_eq!(mirrored(&names), [0, 2, 1, 3]);
    }

    proptest! {
        #[test]
        fn the_other_side_of_the_other_side_is_the_name(name in "[A-Za-z_.0-9\u{e9}]{0,12}") {
            if let Some(other) = other_side(&name)
                && let Some(back) = other_side(&other)
            {
                // A mixed spelling (`lEFT`) comes back in one of the usual ones.
                prop_assert_eq!(back.to_lowercase(), name.to_lowercase());
            }
        }
    }
}
