//! Test: the vendor's model files against our tables, row by row and unit by unit.

use super::{Effort, Model};
use std::f64::consts::TAU;

const NUMBERS: &str = include_str!("tables/dynamixel.model");

/// The vendor's files and our names.
const FILES: [(&str, &str, &str); 13] = [
    ("mx_28.model", "mx-28-2", include_str!("tables/mx_28.model")),
    ("mx_64.model", "mx-64-2", include_str!("tables/mx_64.model")),
    (
        "mx_106.model",
        "mx-106-2",
        include_str!("tables/mx_106.model"),
    ),
    (
        "ph42_020_s300.model",
        "ph42-020-s300",
        include_str!("tables/ph42_020_s300.model"),
    ),
    (
        "xc330_m288.model",
        "xc330-m288",
        include_str!("tables/xc330_m288.model"),
    ),
    (
        "xc330_t288.model",
        "xc330-t288",
        include_str!("tables/xc330_t288.model"),
    ),
    (
        "xh430_w350.model",
        "xh430-w350",
        include_str!("tables/xh430_w350.model"),
    ),
    (
        "xl330_m077.model",
        "xl330-m077",
        include_str!("tables/xl330_m077.model"),
    ),
    (
        "xl330_m288.model",
        "xl330-m288",
        include_str!("tables/xl330_m288.model"),
    ),
    (
        "xl430_w250.model",
        "xl430-w250",
        include_str!("tables/xl430_w250.model"),
    ),
    (
        "xm430_w210.model",
        "xm430-w210",
        include_str!("tables/xm430_w210.model"),
    ),
    (
        "xm430_w350.model",
        "xm430-w350",
        include_str!("tables/xm430_w350.model"),
    ),
    (
        "xm540_w270.model",
        "xm540-w270",
        include_str!("tables/xm540_w270.model"),
    ),
];

/// The rows of a section, split at tabs, without its heading.
fn section<'a>(text: &'a str, name: &str) -> Vec<Vec<&'a str>> {
    let lines = text.lines().map(str::trim_end);
    let inside = lines.skip_while(|line| *line != format!("[{name}]"));
    inside
        .skip(2)
        .take_while(|line| !line.starts_with('['))
        .filter(|line| !line.is_empty())
        .map(|line| line.split('\t').collect())
        .collect()
}

/// Our name of a register from the vendor's.
fn our_name(vendor: &str) -> String {
    match vendor {
        "Secondary(Shadow) ID" | "Secondary ID" => "secondary_id".into(),
        other => other.to_lowercase().replace(' ', "_"),
    }
}

#[test]
fn every_row_of_the_vendors_files_is_in_our_tables() {
    for (file, name, text) in FILES {
        let model = Model::by_name(name).expect("a known model");
        let number = NUMBERS.lines().find(|line| line.ends_with(file));
        let number = number.and_then(|line| line.split('\t').next());
        assert_eq!(number, Some(model.number.to_string().as_str()), "{file}");
        let rows = section(text, "control table");
        assert!(rows.len() > 50, "{file}: {} rows", rows.len());
        for row in rows {
            let [address, size, vendor] = row[..] else {
                panic!("{file}: {row:?}")
            };
            let (address, size): (u16, u8) = (
                address.parse().expect("a number"),
                size.parse().expect("a number"),
            );
            let ours = our_name(vendor);
            if ours.starts_with("indirect") {
                // Names of the vendor's own use of the slots; firmware before 52.
                let mut blocks = model.indirect(46);
                let known = blocks.any(|block| match size {
                    1 => block.slot(address).is_some(),
                    _ => block.covers(address),
                });
                assert!(known, "{file}: {vendor} at {address} is no slot");
                continue;
            }
            let register = model.register(&ours);
            let register = register.unwrap_or_else(|| panic!("{file}: {ours} is missing"));
            assert_eq!(
                (register.address, register.size),
                (address, size),
                "{file}: {ours}"
            );
        }
    }
}

#[test]
fn units_are_those_of_the_vendors_files() {
    for (file, name, text) in FILES {
        let model = Model::by_name(name).expect("a known model");
        for row in section(text, "unit info") {
            let value: f64 = row[1].parse().expect("a number");
            let (ours, unit) = match row[0] {
                "Present Velocity" | "Goal Velocity" => (model.velocity_unit_rad_s, "rad/s"),
                "Present Position" | "Goal Position" => {
                    // The offset is where the vendor puts zero: the middle of the turn.
                    let offset: f64 = row[4].parse().expect("a number");
                    let ours = f64::from(model.centre_pulse) * model.pulse_rad();
                    assert!((ours + offset).abs() < 1e-6, "{file}: centre {ours} rad");
                    (TAU / model.pulses_per_turn, "rad")
                }
                "Present Input Voltage" => (0.1, "V"),
                "Present Current" | "Goal Current" => {
                    // Raw in the files, or a torque where they trust a torque constant; the e-Manual has ampere.
                    assert_eq!(model.effort, Effort::Current, "{file}");
                    continue;
                }
                other => panic!("{file}: {other} has a unit that is not looked at"),
            };
            assert_eq!(row[2], unit, "{file}: {}", row[0]);
            // The files and the e-Manual round differently: 0.229 rev/min is 0.0239808 rad/s.
            assert!(
                (ours / value - 1.0).abs() < 1e-3,
                "{file}: one count of {} is {ours} here, {value} there",
                row[0]
            );
        }
    }
}
