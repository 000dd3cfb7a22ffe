//! Which of the servos that answer is the new one.

use super::find::{Found, Sweep};
use super::plan::Wanted;
use crate::bus::dynamixel::model::Model;

/// Why none of those that answer can be taken, with what to do.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ChooseError {
    /// Nobody answers.
    #[error("no servo answers. Check its power (the LED blinks once at power-up) and its cable")]
    Nobody,
    /// Servos with one id talk over each other.
    #[error(
        "several servos answer at once ({0}) and damage each other's words: they have the same id. \
         Unplug all of them but one"
    )]
    Collision(String),
    /// The id belongs to a servo that is there, and another one is new.
    #[error(
        "id {id} at {baud} baud is taken already, and {new} is new here. Unplug the one that has the id to \
         replace it, or give the new one another"
    )]
    Taken {
        /// Id that is wanted.
        id: u8,
        /// Baud rate that is wanted.
        baud: u32,
        /// The new servo.
        new: String,
    },
    /// Only servos of the chain answer.
    #[error(
        "no new servo is among those that answer: {0}. Plug the new one in, or unplug all but the one that is meant"
    )]
    NoneNew(String),
    /// Several servos are new.
    #[error("{0} servos answer that are not set up: {1}. Unplug all of them but one")]
    Several(usize, String),
}

fn list(found: &[Found]) -> String {
    let name = |f: &Found| {
        let model = Model::by_number(f.ping.model).map_or("unknown model", |model| model.name);
        format!("{model} {} at {} baud", f.ping.id, f.baud)
    };
    found.iter().map(name).collect::<Vec<_>>().join(", ")
}

/// The servo that shall become `wanted`: the only one there, or the only one that is not of the chain yet.
///
/// Of the chain is what answers at the wanted rate with an id of `crew`; without a crew whatever answers at
/// that rate. The servo that has the wanted id and rate already is taken when no other is new.
///
/// # Errors
/// Nobody, several, or servos that share an id.
pub fn choose(swept: &Sweep, wanted: &Wanted, crew: Option<&[u8]>) -> Result<Found, ChooseError> {
    if swept.collisions() {
        let noise = swept.noise.iter().map(|baud| format!("at {baud} baud"));
        let garbled = swept.found.iter().filter(|f| f.garbled);
        let garbled = garbled.map(|f| format!("id {} at {} baud", f.ping.id, f.baud));
        let places: Vec<String> = noise.chain(garbled).collect();
        return Err(ChooseError::Collision(places.join(", ")));
    }
    let has_place = |f: &&Found| f.ping.id == wanted.id && f.baud == wanted.baud;
    let in_chain =
        |f: &Found| f.baud == wanted.baud && crew.is_none_or(|crew| crew.contains(&f.ping.id));
    let holder = swept.found.iter().find(has_place);
    let new: Vec<Found> = (swept.found.iter())
        .filter(|f| !in_chain(f))
        .copied()
        .collect();
    match (swept.found.as_slice(), new.as_slice()) {
        ([], _) => Err(ChooseError::Nobody),
        // Without a crew the only one there is meant, whatever its id.
        ([only], _) if crew.is_none() => Ok(*only),
        (_, [new]) if holder.is_none() => Ok(*new),
        (_, [new]) => Err(ChooseError::Taken {
            id: wanted.id,
            baud: wanted.baud,
            new: list(&[*new]),
        }),
        (all, []) => match holder {
            Some(holder) if crew.is_some() => Ok(*holder),
            _ => Err(ChooseError::NoneNew(list(all))),
        },
        (_, several) => Err(ChooseError::Several(several.len(), list(several))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bus::dynamixel::client::Ping;

    fn found(id: u8, baud: u32) -> Found {
        Found {
            ping: Ping {
                id,
                model: 1060,
                firmware: 46,
                alert: false,
            },
            baud,
            garbled: false,
        }
    }

    fn at(servos: &[(u8, u32)]) -> Sweep {
        Sweep {
            found: servos.iter().map(|(id, baud)| found(*id, *baud)).collect(),
            ..Sweep::default()
        }
    }

    const WANTED: Wanted = Wanted {
        id: 12,
        baud: 1_000_000,
        limits: None,
        zero_here: false,
    };
    const CREW: Option<&[u8]> = Some(&[11, 12, 13]);
    const M: u32 = 1_000_000;

    #[test]
    fn what_cannot_be_told_apart_is_refused() {
        for (sweep, crew, part) in [
            (at(&[]), CREW, "no servo answers"),
            (at(&[(1, 57_600), (2, 57_600)]), CREW, "2 servos answer"),
            (at(&[(1, 57_600), (1, 115_200)]), None, "2 servos answer"),
            (
                at(&[(12, M), (1, 57_600)]),
                CREW,
                "id 12 at 1000000 baud is taken",
            ),
            (at(&[(11, M)]), CREW, "no new servo"),
            (at(&[(4, M), (5, M)]), None, "no new servo"),
            (at(&[(4, M), (5, M)]), CREW, "2 servos answer"),
        ] {
            let error = choose(&sweep, &WANTED, crew).expect_err(part).to_string();
            assert!(error.contains(part), "{part}: {error}");
        }
        let noisy = Sweep {
            noise: vec![57_600],
            ..at(&[])
        };
        let error = choose(&noisy, &WANTED, CREW)
            .expect_err("noise")
            .to_string();
        assert!(
            error.contains("same id") && error.contains("57600"),
            "{error}"
        );
        let mut twins = at(&[(1, 57_600)]);
        twins.found[0].garbled = true;
        assert!(choose(&twins, &WANTED, CREW).is_err(), "two answer to id 1");
    }

    #[test]
    fn the_new_one_is_found_among_those_of_the_chain() {
        for (servos, crew, expected) in [
            (&[(1, 57_600)][..], CREW, found(1, 57_600)),
            (&[(11, M), (1, 57_600)], CREW, found(1, 57_600)),
            // Half set up: it has its id and not yet its rate.
            (&[(11, M), (12, 57_600)], CREW, found(12, 57_600)),
            // Its place is its own: settings that differ are mended.
            (&[(11, M), (12, M), (13, M)], CREW, found(12, M)),
            // Another id at the same rate, alone: renumbered.
            (&[(4, M)], None, found(4, M)),
            (&[(4, M), (1, 57_600)], None, found(1, 57_600)),
        ] {
            let chosen = choose(&at(servos), &WANTED, crew);
            assert_eq!(chosen, Ok(expected), "{servos:?}");
        }
    }
}
