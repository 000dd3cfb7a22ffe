//! Registers of Protocol 1.0 in terms of the X series', and back.

use super::view::{TABLE_BYTES, View, needed, write};
use super::{COUNTERPARTS, WINDOW, counterpart};
use crate::bus::dynamixel::model::{MODELS, Mode, Model, Protocol, Sign, address};
use proptest::prelude::*;

fn ax() -> &'static Model {
    Model::by_name("AX-12A").expect("a known model")
}

/// An AX-12A with what the manual has at power-up, at 1 Mbaud, standing at 700 and turning clockwise under load.
fn table() -> [u8; 50] {
    let mut own = [0; 50];
    own[..19].copy_from_slice(&[
        12, 0, 24, 1, 1, 250, 0, 0, 0xFF, 3, 0, 70, 60, 140, 0xFF, 3, 2, 36, 36,
    ]);
    own[24] = 1;
    own[30..48].copy_from_slice(&[
        0xBC, 2, 0, 1, 0xFF, 3, 0xBC, 2, 100, 4, 50, 4, 119, 41, 0, 0, 1, 0,
    ]);
    own
}

fn shown(own: &[u8], conditions: u8, begin: u16, length: usize) -> Vec<u8> {
    let mut out = vec![0xAA; length];
    let view = View {
        begin: 0,
        bytes: own,
        conditions,
    };
    view.show(begin, &mut out);
    out
}

#[test]
fn what_an_ax_servo_cannot_do_is_refused_and_what_it_is_anyway_is_left_out() {
    let mut out = [0; TABLE_BYTES];
    for (what, begin, data) in [
        ("a watchdog", address::BUS_WATCHDOG, &[5][..]),
        ("velocity mode", address::OPERATING_MODE, &[1][..]),
        (
            "an acceleration",
            address::PROFILE_ACCELERATION,
            &[9, 0, 0, 0][..],
        ),
        ("a homing offset", address::HOMING_OFFSET, &[1, 0, 0, 0][..]),
        ("half a goal", address::GOAL_POSITION + 1, &[1][..]),
        ("a rate of no code", address::BAUD_RATE, &[7][..]),
    ] {
        assert_eq!(write(begin, data, &mut out), None, "{what}");
    }
    for (what, begin, data) in [
        ("no watchdog", address::BUS_WATCHDOG, &[0][..]),
        ("position mode", address::OPERATING_MODE, &[3][..]),
        ("no offset", address::HOMING_OFFSET, &[0, 0, 0, 0][..]),
    ] {
        let written = write(begin, data, &mut out);
        assert_eq!(written.map(|(_, count)| count), Some(0), "{what}");
    }
}

#[test]
fn what_the_chain_reads_is_what_the_servo_s_own_registers_say() {
    let own = table();
    assert_eq!(needed(address::PRESENT_STATE, 10), 36..42);
    // Load -50 of 1023, speed -100 of 0.111 rev/min, position 700.
    let state = shown(&own, 0, address::PRESENT_STATE, 10);
    assert_eq!(state, [0xCE, 0xFF, 0x9C, 0xFF, 0xFF, 0xFF, 0xBC, 2, 0, 0]);
    assert_eq!(needed(address::MAX_POSITION_LIMIT, 8), 6..10);
    assert_eq!(
        shown(&own, 0, address::MAX_POSITION_LIMIT, 8),
        [0xFF, 3, 0, 0, 0, 0, 0, 0]
    );
    // Return delay, drive mode (a goal turns torque on), operating mode.
    assert_eq!(needed(address::RETURN_DELAY_TIME, 3), 5..10);
    assert_eq!(shown(&own, 0, address::RETURN_DELAY_TIME, 3), [250, 8, 3]);
    assert_eq!(
        shown(&own, 0, address::TEMPERATURE_LIMIT, 7),
        [70, 140, 0, 60, 0, 0xFF, 3]
    );
    assert_eq!(
        shown(&own, 0, address::PRESENT_INPUT_VOLTAGE, 3),
        [119, 0, 41]
    );
    assert_eq!(
        shown(&own, 0, address::BAUD_RATE, 1),
        [3],
        "1 Mbaud is code 3 there"
    );
    assert_eq!(
        needed(address::HARDWARE_ERROR_STATUS, 1),
        0..0,
        "it stands in every answer"
    );
    assert_eq!(
        shown(&[], 0b10_0100, address::HARDWARE_ERROR_STATUS, 1),
        [0b10_0100]
    );
    let mut wheel = own;
    wheel[6..10].fill(0);
    assert_eq!(
        shown(&wheel, 0, address::OPERATING_MODE, 1),
        [Mode::Velocity.number()]
    );
}

#[test]
fn what_the_chain_writes_is_written_to_the_servo_s_own_registers() {
    let mut out = [0; TABLE_BYTES];
    assert_eq!(
        write(address::GOAL_POSITION, &700u32.to_le_bytes(), &mut out),
        Some((30, 2))
    );
    assert_eq!(out[..2], [0xBC, 2]);
    let profile = [0, 0, 0, 0, 100, 0, 0, 0];
    assert_eq!(
        write(address::PROFILE_ACCELERATION, &profile, &mut out),
        Some((32, 2))
    );
    assert_eq!(out[..2], [100, 0]);
    assert_eq!(write(address::BAUD_RATE, &[1], &mut out), Some((4, 1)));
    assert_eq!(out[0], 34, "57,600 baud");
    let limits = [0xE8, 3, 0, 0, 24, 0, 0, 0];
    assert_eq!(
        write(address::MAX_POSITION_LIMIT, &limits, &mut out),
        Some((6, 4))
    );
    assert_eq!(out[..4], [24, 0, 0xE8, 3], "the least comes first");
}

#[test]
fn every_model_has_the_counterparts_where_they_are_said_to_be() {
    let one: Vec<_> = MODELS
        .iter()
        .filter(|model| model.protocol == Protocol::One)
        .collect();
    assert_eq!(one.len(), 7);
    for model in one {
        for entry in &COUNTERPARTS {
            let register = model
                .register_at(entry.own.into())
                .unwrap_or_else(|| panic!("{}: {}", model.name, entry.own));
            assert_eq!(
                (register.size, register.sign),
                (entry.own_size, entry.sign),
                "{}: {}",
                model.name,
                register.name
            );
            assert_eq!(
                model.register_like(entry.x_series),
                Some(register),
                "{}",
                model.name
            );
        }
        assert!(
            model
                .registers
                .is_sorted_by_key(|register| register.address),
            "{}",
            model.name
        );
        assert_eq!(
            model.layout.at(address::PRESENT_STATE),
            WINDOW + address::PRESENT_STATE
        );
    }
    assert_eq!(counterpart(address::BUS_WATCHDOG), None);
    assert_eq!(ax().goal_range(Mode::Position), (0, 1023));
    let turn = f64::from(1023) * ax().pulse_rad();
    assert!(
        (turn.to_degrees() - 300.0).abs() < 1e-9,
        "0 to 1023 are {} degrees",
        turn.to_degrees()
    );
}

#[test]
fn signs_of_speed_and_load_stand_in_bit_10() {
    let load = ax().register("present_load").expect("a register");
    assert_eq!(load.sign, Sign::Bit10);
    for (bytes, value) in [
        ([0, 0], 0),
        ([0xFF, 3], 1023),
        ([1, 4], -1),
        ([0xFF, 7], -1023),
        ([0, 4], 0),
    ] {
        assert_eq!(load.decode(&bytes), value, "{bytes:02X?}");
        if bytes != [0, 4] {
            assert_eq!(load.encode(value)[..2], bytes, "{value}");
        }
    }
}

proptest! {
    #[test]
    fn no_range_makes_anything_panic(
        begin: u16, length in 0usize..200, own in proptest::collection::vec(any::<u8>(), 0..120), from: u8,
        data in proptest::collection::vec(any::<u8>(), 0..200),
    ) {
        let wanted = needed(begin, length);
        prop_assert!(wanted.len() <= TABLE_BYTES);
        let mut out = vec![0; length];
        View { begin: from, bytes: &own, conditions: 0 }.show(begin, &mut out);
        let mut bytes = [0; TABLE_BYTES];
        if let Some((first, count)) = write(begin, &data, &mut bytes) {
            prop_assert!(usize::from(first) + count <= TABLE_BYTES);
        }
    }

    #[test]
    fn goals_come_back_as_they_were_written(goal in 0u16..1024) {
        let mut out = [0; TABLE_BYTES];
        let (first, count) = write(address::GOAL_POSITION, &u32::from(goal).to_le_bytes(), &mut out).expect("a goal");
        let mut own = [0; 50];
        own[usize::from(first)..usize::from(first) + count].copy_from_slice(&out[..count]);
        let back = shown(&own, 0, address::GOAL_POSITION, 4);
        prop_assert_eq!(back, u32::from(goal).to_le_bytes());
    }
}
