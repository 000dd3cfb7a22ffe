//! What the servos are to become, from the options and the configuration.

use super::SetupArgs;
use crate::bus::address::parse_baud;
use crate::bus::dynamixel::setup::Wanted;
use crate::bus::dynamixel::{Model, ServoSpec};
use crate::cli::Failure;
use crate::cli::bus::crew;
use handwave_dynamixel::baud::RATES;

/// One servo's place in the plan: what it is to become, and for what.
pub(super) struct Post {
    /// `joint1 (servo 11)` or `servo 3`.
    pub name: String,
    pub model: Option<&'static Model>,
    pub wanted: Wanted,
}

/// What the servos are to become.
pub(super) fn posts(args: &SetupArgs, baud: u32) -> Result<Vec<Post>, Failure> {
    if args.undo.is_some() {
        return Ok(Vec::new());
    }
    let Some(config) = &args.config else {
        let id = args.id.unwrap_or(1);
        return Ok(vec![Post {
            name: format!("servo {id}"),
            model: None,
            wanted: Wanted {
                id,
                baud,
                limits: args.limits,
                zero_here: args.zero_here,
            },
        }]);
    };
    let character = crew::character(config)?;
    let known = |name: &String| character.servos.iter().any(|s| s.joint == *name);
    if let Some(unknown) = args.joint.iter().find(|name| !known(name)) {
        return Err(Failure::input(format_args!(
            "--joint {unknown}: {} has no such joint. Joints: {}",
            config.display(),
            character.joints.join(", ")
        )));
    }
    let post = |spec: &ServoSpec| Post {
        name: format!("{} (servo {})", spec.joint, spec.id),
        model: Some(spec.model),
        wanted: Wanted {
            id: spec.id,
            baud,
            limits: Some((spec.min_pulse, spec.max_pulse)),
            zero_here: args.zero_here,
        },
    };
    Ok(character.servos.iter().map(post).collect())
}

/// Reads a range of pulses, such as 1024-3072.
pub(super) fn parse_limits(text: &str) -> Result<(i32, i32), String> {
    let parsed = text
        .split_once('-')
        .and_then(|(min, max)| Some((min.trim().parse().ok()?, max.trim().parse().ok()?)));
    parsed
        .filter(|(min, max)| min < max)
        .ok_or_else(|| format!("'{text}' is no range of pulses such as 1024-3072"))
}

/// Reads the rates at which to look: all, likely ones first, or a list.
pub(super) fn parse_rates(text: &str, target: u32) -> Result<Vec<u32>, Failure> {
    let mut rates = match text {
        // Where it is most likely first.
        "all" => [&[target, 57_600][..], &RATES].concat(),
        list => list
            .split(',')
            .map(|rate| parse_baud(rate.trim()))
            .collect::<Result<_, _>>()?,
    };
    let mut seen = Vec::new();
    rates.retain(|rate| {
        !seen.contains(rate) && {
            seen.push(*rate);
            true
        }
    });
    Ok(rates)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rates_to_look_at_come_once_and_likely_ones_first() {
        let all = parse_rates("all", 1_000_000).expect("a good list");
        assert_eq!((all[0], all[1], all.len()), (1_000_000, 57_600, 8));
        assert_eq!(
            parse_rates("57600, 115200", 1).expect("a good list"),
            [57_600, 115_200]
        );
        assert!(parse_rates("fast", 1).is_err());
    }

    #[test]
    fn limits_as_users_write_them() {
        assert_eq!(parse_limits("1024-3072"), Ok((1024, 3072)));
        for wrong in ["", "1024", "3072-1024", "a-b"] {
            assert!(parse_limits(wrong).is_err(), "'{wrong}' was taken");
        }
    }
}
