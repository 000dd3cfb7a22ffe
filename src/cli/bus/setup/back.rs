//! `handwave bus setup --undo`: puts back what stood in a servo before.

use super::Bench;
use crate::bus::dynamixel::Model;
use crate::bus::dynamixel::setup::work::locate;
use crate::bus::dynamixel::setup::{UndoFile, restore};
use crate::cli::Failure;
use crate::cli::bus::say;
use std::io::Write;

impl Bench<'_> {
    /// Puts back what the undo file says.
    pub(super) fn undo(&mut self, file: &UndoFile, out: &mut dyn Write) -> Result<(), Failure> {
        let mut groups = file.groups().map_err(Failure::input)?;
        if let Some(id) = self.args.id {
            groups.retain(|group| group.place().id == id);
        }
        let ids: Vec<String> = groups.iter().map(|g| g.place().id.to_string()).collect();
        let group = match groups.as_slice() {
            [group] => group,
            [] => {
                return Err(Failure::input(
                    "there is nothing in this file that could be undone",
                ));
            }
            _ => {
                return Err(Failure::input(format_args!(
                    "this file has changes of several servos, now {}. One at a time: --id N, and only that servo plugged in",
                    ids.join(", ")
                )));
            }
        };
        let id = group.place().id;
        let found = locate(&mut *self.client, group)?;
        let Some(place) = found else {
            return Err(Failure::bus(format_args!(
                "servo {id} ({}) does not answer at {}, nor where it was before. Plug it in",
                group.model,
                group.place()
            )));
        };
        let model = Model::by_name(&group.model)
            .ok_or_else(|| Failure::input(format_args!("unknown model {}", group.model)))?;
        say(out, format_args!("  {} is {place}; back to:", group.model))?;
        for entry in group.entries.iter().rev() {
            say(
                out,
                format_args!("    {:<22} {:>7}", entry.register, entry.old),
            )?;
        }
        if !self.ask.confirm(out, "  Write these?", true)? {
            return Err(Failure::input("nothing was written"));
        }
        match restore(&mut *self.client, place, model, group) {
            Ok((count, place)) => {
                file.note_undone(id).map_err(Failure::bus)?;
                say(
                    out,
                    format_args!("  {count} registers put back and read: the servo is {place}"),
                )
            }
            Err(halt) => Err(Failure::bus(format_args!(
                "{}. The servo is {}; {} registers are put back. The same command goes on from there",
                halt.reason, halt.place, halt.done
            ))),
        }
    }
}
