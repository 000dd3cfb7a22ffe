//! A lost port found again, perhaps under another name: taken only if exactly our servos answer there.

use super::chain::{DynamixelChain, Link};
use super::client::{Client, ClientError, Ping};
use super::model::Model;
use crate::bus::BusError;
use std::time::Duration;

/// A servo that is still booting, or a line that is not yet quiet, gets a second chance.
const TRIES: u32 = 2;
/// Between them the line is quiet this long.
const QUIET: Duration = Duration::from_millis(10);

impl DynamixelChain {
    /// Looks for the port once. Asks servos who they are and nothing else: no torque changes, nothing moves.
    pub(super) fn find_port_again(&mut self) -> Result<(), BusError> {
        let sought = self.client.port_sought();
        let mut tried = Vec::new();
        for name in self.client.port_candidates() {
            match self.try_port(&name) {
                Ok(()) => {
                    self.begin_anew(&name);
                    return Ok(());
                }
                Err(reason) => tried.push(format!("{name}: {reason}")),
            }
        }
        // Whatever is open now is not ours to hold.
        self.client.close_port();
        let found = if tried.is_empty() {
            "there is none".to_owned()
        } else {
            tried.join("; ")
        };
        Err(BusError::NotBack {
            bus: self.options.bus.clone(),
            sought: format!("{sought} with servos {}", self.id_list()),
            found,
        })
    }

    fn id_list(&self) -> String {
        let ids = self.servos.iter().map(|servo| servo.spec.id.to_string());
        ids.collect::<Vec<_>>().join(",")
    }

    /// Opens `name` and checks who answers there; says what is wrong with it.
    fn try_port(&mut self, name: &str) -> Result<(), String> {
        let opened = self.client.reopen_port(name);
        opened.map_err(|error| error.to_string())?;
        for servo in &self.servos {
            let (id, expected) = (servo.spec.id, servo.spec.model);
            let ping = insist(&mut *self.client, id)
                .map_err(|error| format!("servo {id} is not there ({error})"))?;
            if ping.model != expected.number {
                let found = Model::by_number(ping.model).map_or("of another model", |m| m.name);
                return Err(format!("servo {id} is {found}, not {}", expected.name));
            }
        }
        let mut strangers = Vec::new();
        let asked = self.client.ping_all(&mut |ping| {
            if self.servos.iter().all(|servo| servo.spec.id != ping.id) {
                strangers.push(ping.id.to_string());
            }
        });
        asked.map_err(|error| error.to_string())?;
        if strangers.is_empty() {
            return Ok(());
        }
        Err(format!(
            "all our servos answer, but also {}: perhaps another robot's chain",
            strangers.join(", ")
        ))
    }

    /// Nothing of what was known of torque holds any more.
    fn begin_anew(&mut self, port: &str) {
        let now = self.client.now();
        if self.options.bus.starts_with("dynamixel:") {
            self.options.bus = format!("dynamixel:{port}@{}", self.client.baud());
        }
        for servo in &mut self.servos {
            // Read and not driven until it is armed again.
            servo.link = Link::Resting;
            servo.armed = false;
            servo.retry_at = now;
            servo.retry_after = Duration::ZERO;
        }
        self.was_mute = false;
        self.last_heard = now;
        self.last_cycle = None;
    }
}

fn insist(client: &mut dyn Client, id: u8) -> Result<Ping, ClientError> {
    let mut tries = 1;
    loop {
        match client.ping(id) {
            Err(ClientError::Timeout { .. }) if tries < TRIES => {
                tries += 1;
                client.settle(QUIET)?;
            }
            outcome => return outcome,
        }
    }
}
