//! Bad commands and options: the exit code, and a message that says what is allowed.

mod support;

use support::folder::Folder;
use support::program::{handwave, refused, run_virtual};

#[test]
fn bad_options() {
    refused(
        run_virtual(&["--bus", "dynamxel:/dev/ttyUSB0"]),
        2,
        &["--bus", "dynamxel", "dynamixel"],
    );
    refused(
        run_virtual(&["--bus", "dynamixel:/dev/x@fast"]),
        2,
        &["--bus", "fast"],
    );
    refused(
        run_virtual(&["--fault", "7:silnt@1s"]),
        2,
        &["--fault", "did you mean 'silent'"],
    );
    refused(
        run_virtual(&["--fault", "99:silent@1s"]),
        2,
        &["--fault", "no servo 99", "12"],
    );
    refused(
        run_virtual(&["--fault", "7:silent"]),
        2,
        &["--fault", "no time"],
    );
    refused(
        run_virtual(&["--rate", "5000"]),
        2,
        &["--rate", "5000", "10..2000"],
    );
    refused(run_virtual(&["--rate", "nan"]), 2, &["--rate", "10..2000"]);
    refused(run_virtual(&["--rate", "fast"]), 2, &["--rate", "fast"]);
    refused(
        run_virtual(&["--input", "flie:x.jsonl"]),
        2,
        &["flie", "file:PATH"],
    );
    refused(
        run_virtual(&["--targets", "/nowhere/at/all/a.csv"]),
        2,
        &["--targets", "/nowhere/at/all/a.csv"],
    );
    let virtual_run = ["run", "--headless", "--speed", "max"];
    let with = |more: &[&str]| handwave(&[&virtual_run[..], more].concat());
    refused(with(&["--duration=-1"]), 2, &["--duration"]);
    refused(with(&["--duration", "nan"]), 2, &["--duration", "above 0"]);
    refused(with(&["--input", "udp://127.0.0.1:9000"]), 2, &["udp"]);
    refused(
        with(&["--bus", "dynamixel:/dev/null@1000000"]),
        2,
        &["--speed max", "--bus sim"],
    );
    let faulty = [
        "run",
        "--headless",
        "--bus",
        "dynamixel:/dev/null@1000000",
        "--fault",
        "7:silent@1s",
    ];
    refused(handwave(&faulty), 2, &["--fault", "simulated"]);
}

#[test]
fn a_port_that_is_absent_is_a_bus_failure() {
    let folder = Folder::empty();
    let port = folder.text("no_port");
    let bus = format!("dynamixel:{port}@1000000");
    refused(handwave(&["run", "--headless", "--bus", &bus]), 3, &[&port]);
    refused(handwave(&["bus", "scan", &bus]), 3, &[&port]);
}

#[test]
fn usage() {
    refused(handwave(&["rum"]), 2, &["rum", "run"]);
    refused(
        handwave(&["run", "--headles"]),
        2,
        &["--headles", "--headless"],
    );
    refused(
        handwave(&["run", "--speed", "slow"]),
        2,
        &["slow", "real", "max"],
    );
    refused(
        handwave(&["run", "/nowhere/config.toml"]),
        2,
        &["/nowhere/config.toml"],
    );
    refused(handwave(&["run", "/nowhere"]), 2, &["/nowhere"]);
    refused(handwave(&["sim", "dynamixel"]), 2, &["--link"]);
}
