//! `handwave bus read` and `handwave bus write`: registers by name or address.

use super::{IdList, open, say};
use crate::base::suggest;
use crate::bus::BusAddress;
use crate::bus::dynamixel::model::{Access, Layout, Sign, address};
use crate::bus::dynamixel::{Client, Model, Register};
use crate::cli::{ExitStatus, Failure};
use clap::Args;
use serde_json::json;
use std::io::Write;

/// Read registers.
#[derive(Args, Debug)]
#[command(after_help = "\
Examples:
  handwave bus read dynamixel:/dev/ttyUSB0 1-12 present_position
  handwave bus read dynamixel:/dev/ttyUSB0 3 all --json
  handwave bus read dynamixel:/dev/ttyUSB0 3 132:4")]
pub struct ReadArgs {
    /// The bus, such as dynamixel:/dev/ttyUSB0@1000000.
    #[arg(value_name = "BUS")]
    bus: BusAddress,
    /// Servo ids, such as 3, 1,3,5 or 1-12.
    #[arg(value_name = "IDS")]
    ids: IdList,
    /// Register by name (such as torque_enable), `all`, or ADDRESS[:LEN] with LEN 1, 2 or 4.
    #[arg(value_name = "ITEM")]
    item: String,
    /// One JSON object a line.
    #[arg(long)]
    json: bool,
}

/// Write a register, and read it back. Turning torque on first makes the present position the goal.
#[derive(Args, Debug)]
#[command(after_help = "\
Examples:
  handwave bus write dynamixel:/dev/ttyUSB0 1-12 return_delay_time 0
  handwave bus write dynamixel:/dev/ttyUSB0 3 torque_enable 0
  handwave bus write dynamixel:/dev/ttyUSB0 3 65:1 1
  handwave bus write dynamixel:/dev/ttyUSB0 3 goal_position 2100 --later    then `bus action`")]
pub struct WriteArgs {
    /// The bus, such as dynamixel:/dev/ttyUSB0@1000000.
    #[arg(value_name = "BUS")]
    bus: BusAddress,
    /// Servo ids, such as 3, 1,3,5 or 1-12.
    #[arg(value_name = "IDS")]
    ids: IdList,
    /// Register by name (such as torque_enable), or ADDRESS[:LEN] with LEN 1, 2 or 4.
    #[arg(value_name = "ITEM")]
    item: String,
    /// Whole number, also as 0x10.
    #[arg(value_name = "VALUE", allow_hyphen_values = true, value_parser = parse_value)]
    value: i64,
    /// The servo holds the write until `handwave bus action`.
    #[arg(long)]
    later: bool,
}

pub fn read(args: &ReadArgs, out: &mut dyn Write) -> Result<ExitStatus, Failure> {
    let mut client = open(&args.bus)?;
    let mut heading = !args.json;
    for id in args.ids.iter() {
        let found = Servo::ask(&mut *client, id)?;
        let registers = match args.item.as_str() {
            "all" => found.model()?.registers.to_vec(),
            item => vec![found.register(item)?],
        };
        for register in &registers {
            let value = read_value(&mut *client, id, register)?;
            if heading {
                say(
                    out,
                    "  id  address  register                       value  unit",
                )?;
                heading = false;
            }
            if args.json {
                let row = json!({
                    "id": id,
                    "address": register.address,
                    "register": register.name,
                    "value": value,
                    "unit": register.unit,
                });
                say(out, row)?;
            } else {
                let line = format!(
                    "{id:>4}  {:>7}  {:<24}  {value:>10}  {}",
                    register.address, register.name, register.unit
                );
                say(out, line.trim_end())?;
            }
        }
    }
    Ok(ExitStatus::Done)
}

pub fn write(args: &WriteArgs, out: &mut dyn Write) -> Result<ExitStatus, Failure> {
    let mut client = open(&args.bus)?;
    // All servos are looked at before the first is written.
    let mut plan = Vec::new();
    for id in args.ids.iter() {
        let servo = Servo::ask(&mut *client, id)?;
        let register = servo.register(&args.item)?;
        check_write(&mut *client, &args.bus, &servo, &register, args.value)?;
        plan.push((id, servo.layout(), register));
    }
    for (id, layout, register) in plan {
        if register.name == "torque_enable" && args.value == 1 {
            hold_position(&mut *client, id, layout)?;
        }
        let bytes = register.encode(args.value);
        if args.later {
            client.reg_write(id, register.address, &bytes[..usize::from(register.size)])?;
            say(
                out,
                format_args!(
                    "servo {id}: {} = {} held until the action",
                    register.name, args.value
                ),
            )?;
            continue;
        }
        client.write(id, register.address, &bytes[..usize::from(register.size)])?;
        if matches!(register.name, "id" | "baud_rate") {
            // From now on it answers elsewhere.
            say(
                out,
                format_args!("servo {id}: {} = {} written", register.name, args.value),
            )?;
            continue;
        }
        let value = read_value(&mut *client, id, &register)?;
        if value != args.value {
            return Err(Failure::bus(format_args!(
                "servo {id}: {} reads {value} after writing {}",
                register.name, args.value
            )));
        }
        say(out, format_args!("servo {id}: {} = {value}", register.name))?;
    }
    Ok(ExitStatus::Done)
}

/// Refuses what the servo would refuse, with the reason.
fn check_write(
    client: &mut dyn Client,
    bus: &BusAddress,
    servo: &Servo,
    register: &Register,
    value: i64,
) -> Result<(), Failure> {
    let (id, layout) = (servo.id, servo.layout());
    let name = register.name;
    if register.access == Access::Read {
        return Err(Failure::input(format_args!("{name} is read-only")));
    }
    if !(register.min..=register.max).contains(&value) {
        return Err(Failure::input(format_args!(
            "{name} takes {} to {}, not {value}",
            register.min, register.max
        )));
    }
    if layout.is_eeprom(register.address) {
        let mut torque = [0];
        client.read(id, layout.at(address::TORQUE_ENABLE), &mut torque)?;
        if torque != [0] {
            return Err(Failure::bus(format_args!(
                "servo {id} has its torque on, and {name} can be written only while it is off. \
                 Mind what it holds up, then `handwave bus write {bus} {id} torque_enable 0`"
            )));
        }
    }
    Ok(())
}

/// Makes the present position the goal, so that torque does not start a motion.
fn hold_position(client: &mut dyn Client, id: u8, layout: Layout) -> Result<(), Failure> {
    let mut position = [0; 4];
    client.read(id, layout.at(address::PRESENT_POSITION), &mut position)?;
    // In modes without a goal position it is refused, and nothing is lost.
    match client.write(id, layout.at(address::GOAL_POSITION), &position) {
        Ok(_) | Err(crate::bus::dynamixel::ClientError::Refused { .. }) => Ok(()),
        Err(error) => Err(error.into()),
    }
}

fn read_value(client: &mut dyn Client, id: u8, register: &Register) -> Result<i64, Failure> {
    let mut bytes = [0; 4];
    // Sizes are 1, 2 or 4.
    let bytes = &mut bytes[..usize::from(register.size)];
    client.read(id, register.address, bytes)?;
    Ok(register.decode(bytes))
}

/// A servo and its model, if that is known.
struct Servo {
    id: u8,
    number: u16,
    model: Option<&'static Model>,
}

impl Servo {
    fn ask(client: &mut dyn Client, id: u8) -> Result<Self, Failure> {
        let ping = client.ping(id)?;
        Ok(Servo {
            id,
            number: ping.model,
            model: Model::by_number(ping.model),
        })
    }

    /// Where its registers lie; those of an unknown model as on X series servos.
    fn layout(&self) -> Layout {
        self.model.map_or(Layout::X, |model| model.layout)
    }

    fn model(&self) -> Result<&'static Model, Failure> {
        self.model.ok_or_else(|| {
            Failure::input(format_args!(
                "servo {} has model number {}, whose registers this build does not know by name. \
                 Use ADDRESS:LEN, such as 132:4",
                self.id, self.number
            ))
        })
    }

    /// The register meant by `item`: a name, or an address with or without length.
    fn register(&self, item: &str) -> Result<Register, Failure> {
        if item.starts_with(|first: char| first.is_ascii_digit()) {
            return self.register_at(item);
        }
        let model = self.model()?;
        model.register(item).copied().ok_or_else(|| {
            let names = model.registers.iter().map(|register| register.name);
            let hint = suggest::nearest(item, names).map_or_else(
                || "`all` lists its registers with `bus read`".to_owned(),
                |name| format!("did you mean {name}?"),
            );
            Failure::input(format_args!(
                "{} has no register '{item}'; {hint}",
                model.name
            ))
        })
    }

    fn register_at(&self, item: &str) -> Result<Register, Failure> {
        let wrong = || {
            Failure::input(format_args!(
                "'{item}' is no ADDRESS[:LEN]; write for example 64 or 132:4 (LEN 1, 2 or 4)"
            ))
        };
        let (place, size) = match item.split_once(':') {
            None => (item, None),
            Some((place, size)) => (place, Some(size.parse::<u8>().map_err(|_| wrong())?)),
        };
        let address: u16 = place.parse().map_err(|_| wrong())?;
        let known = self.model.and_then(|model| model.register_at(address));
        match (known, size) {
            (Some(register), None) => Ok(*register),
            (Some(register), Some(size)) if size == register.size => Ok(*register),
            (None, None) => Err(Failure::input(format_args!(
                "no register is known to begin at {address}; say how long it is, such as {address}:1"
            ))),
            (_, Some(size @ (1 | 2 | 4))) => Ok(Register {
                name: "",
                address,
                size,
                access: Access::ReadWrite,
                min: 0,
                max: (1 << (8 * u32::from(size))) - 1,
                unit: "",
                sign: Sign::TwosComplement,
            }),
            (_, Some(_)) => Err(wrong()),
        }
    }
}

fn parse_value(text: &str) -> Result<i64, String> {
    let parsed = match text.strip_prefix("0x") {
        Some(hex) => i64::from_str_radix(hex, 16),
        None => text.parse(),
    };
    parsed.map_err(|_| format!("'{text}' is not a whole number, such as 1, -5 or 0x10"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn servo() -> Servo {
        Servo {
            id: 1,
            number: 1060,
            model: Model::by_number(1060),
        }
    }

    #[test]
    fn registers_by_name_and_address() {
        for (item, expected) in [
            ("torque_enable", ("torque_enable", 64, 1)),
            ("64", ("torque_enable", 64, 1)),
            ("132:4", ("present_position", 132, 4)),
            ("126:2", ("present_load", 126, 2)),
            ("224:1", ("", 224, 1)),
            ("132:2", ("", 132, 2)),
        ] {
            let register = servo().register(item).expect(item);
            assert_eq!(
                (register.name, register.address, register.size),
                expected,
                "{item}"
            );
        }
    }

    #[test]
    fn a_wrong_item_is_explained() {
        for (item, part) in [
            ("torque_enabel", "did you mean torque_enable?"),
            ("colour", "lists its registers"),
            ("224", "say how long it is"),
            ("132:3", "is no ADDRESS[:LEN]"),
            ("1x", "is no ADDRESS[:LEN]"),
            ("99999:1", "is no ADDRESS[:LEN]"),
        ] {
            let failure = servo().register(item).expect_err(item);
            assert!(
                failure.message.contains(part),
                "'{item}' says: {}",
                failure.message
            );
            assert_eq!(failure.status, ExitStatus::BadInput, "{item}");
        }
    }

    #[test]
    fn values_as_users_write_them() {
        assert_eq!(parse_value("-5"), Ok(-5));
        assert_eq!(parse_value("0x10"), Ok(16));
        assert!(parse_value("ten").is_err());
    }
}
