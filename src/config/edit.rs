//! Changes a configuration's text where a program knows better, and leaves everything else as it was written.

use crate::bus::dynamixel::ServoSpec;
use toml_edit::{Array, DocumentMut, Item, TableLike, Value};

/// The text of a configuration with the zero, direction and range of `servos` in its joint map; comments, order and
/// all other keys stay.
///
/// # Errors
/// The text is no TOML, has no `robot.joint`, or lacks one of the joints.
pub fn with_joint_map(text: &str, servos: &[ServoSpec]) -> Result<String, String> {
    let mut document: DocumentMut = text
        .parse()
        .map_err(|e: toml_edit::TomlError| e.to_string())?;
    let joints = document
        .get_mut("robot")
        .and_then(|robot| robot.get_mut("joint"))
        .ok_or("no [robot] with a list of joints")?;
    let inline = joints.is_value();
    for servo in servos {
        let entry = entry(joints, &servo.joint)
            .ok_or_else(|| format!("robot.joint has no entry named {:?}", servo.joint))?;
        let direction = servo.direction.sign() as i64;
        let range = [servo.min_pulse, servo.max_pulse].map(i64::from);
        let values = [
            ("zero_pulse", Value::from(i64::from(servo.zero_pulse))),
            ("direction", Value::from(direction)),
            ("range_pulse", Value::Array(Array::from_iter(range))),
        ];
        for (key, value) in values {
            set(entry, key, value, inline);
        }
    }
    Ok(document.to_string())
}

/// The joint called `name`, in a list of inline tables or in `[[robot.joint]]` tables.
fn entry<'a>(joints: &'a mut Item, name: &str) -> Option<&'a mut dyn TableLike> {
    let named = |table: &dyn TableLike| table.get("name").and_then(Item::as_str) == Some(name);
    match joints {
        Item::ArrayOfTables(tables) => {
            let table = tables.iter_mut().find(|table| named(*table))?;
            Some(table)
        }
        Item::Value(Value::Array(array)) => array
            .iter_mut()
            .filter_map(Value::as_inline_table_mut)
            .find(|table| named(*table))
            .map(|table| table as &mut dyn TableLike),
        _ => None,
    }
}

/// Sets a key, with the spaces and the comment that stood around its value.
fn set(table: &mut dyn TableLike, key: &str, mut value: Value, inline: bool) {
    match table.get_mut(key).and_then(Item::as_value_mut) {
        Some(old) => {
            *value.decor_mut() = old.decor().clone();
            *old = value;
        }
        None => {
            // The space after the last value belongs to the bracket, not to the comma that follows now.
            let last = table.iter().last().map(|(name, _)| name.to_owned());
            let last = last.and_then(|name| table.get_mut(&name)?.as_value_mut());
            if let Some(decor) = last.map(Value::decor_mut)
                && let Some(space) = decor
                    .suffix()
                    .and_then(|raw| raw.as_str())
                    .map(str::to_owned)
                && inline
                && space.trim().is_empty()
            {
                decor.set_suffix("");
                value.decor_mut().set_prefix(" ");
                value.decor_mut().set_suffix(space);
            }
            table.insert(key, Item::Value(value));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bus::dynamixel::{Direction, Model};

    fn servo(joint: &str) -> ServoSpec {
        ServoSpec {
            zero_pulse: 1990,
            direction: Direction::Reverse,
            min_pulse: 300,
            max_pulse: 3800,
            ..ServoSpec::new(11, joint, Model::by_number(1060).expect("known"))
        }
    }

    #[test]
    fn only_the_joint_changes_and_comments_stay() {
        let text = "# arm\nname = \"a\"  # for people\n\n[robot]\nurdf = \"x\" # the robot\njoint = [\n  \
            { name = \"one\",  servo = 11 }, # base\n  { name = \"two\", servo = 12, zero_pulse = 7 },\n]\n\n[bus]\nbus = \"sim\"\n";
        let changed = with_joint_map(text, &[servo("one")]).expect("a good file");
        let expected = text.replace(
            "{ name = \"one\",  servo = 11 }",
            "{ name = \"one\",  servo = 11, zero_pulse = 1990, direction = -1, range_pulse = [300, 3800] }",
        );
        assert_eq!(changed, expected);
        let again = with_joint_map(&changed, &[servo("one")]).expect("a good file");
        assert_eq!(again, changed, "what is there already stays");
        let both = with_joint_map(&changed, &[servo("two")]).expect("a good file");
        assert!(
            both.contains("servo = 12, zero_pulse = 1990, direction = -1"),
            "{both}"
        );
    }

    #[test]
    fn joints_in_tables_of_their_own_change_too() {
        let text = "[robot]\nurdf = \"x\"\n\n[[robot.joint]]\nname = \"one\"\nservo = 11\ndirection = 1 # as built\n";
        let changed = with_joint_map(text, &[servo("one")]).expect("a good file");
        assert!(changed.contains("direction = -1 # as built\n"), "{changed}");
        assert!(changed.contains("zero_pulse = 1990\n"), "{changed}");
    }

    #[test]
    fn what_is_not_there_is_said() {
        for (text, part) in [
            ("[robot", "expected"),
            ("[bus]\n", "no [robot]"),
            ("[robot]\njoint = []\n", "no entry named \"one\""),
            ("[robot]\njoint = 3\n", "no entry named \"one\""),
        ] {
            let error = with_joint_map(text, &[servo("one")]).expect_err(text);
            assert!(
                error.contains(part) || part == "expected",
                "{text}: {error}"
            );
        }
    }
}
