//! Gesture files that are shared: one gesture taken from another file, several files made one set.

use super::{Gesture, GestureSet};

/// What people want to know about a gesture file that was given to them. All optional.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct About {
    /// Who performed and defined the gestures.
    pub author: Option<String>,
    /// Under which terms they may be used, such as `CC-BY-4.0`.
    pub licence: Option<String>,
    /// Anything else.
    pub note: Option<String>,
}

/// Why gestures of two files cannot be put together.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum LibraryError {
    /// Dimension 2 against 3.
    #[error(
        "{from} is {found}-dimensional, {into} {expected}-dimensional; gestures of one set come from one kind of tracker"
    )]
    Dimension {
        /// The file that is added.
        from: String,
        /// The file it is added to.
        into: String,
        /// Dimension of the first.
        found: usize,
        /// Dimension of the second.
        expected: usize,
    },
    /// Other points.
    #[error(
        "{from} and {into} track different points:{} use files of one kind of tracker, or define the gestures again",
        difference(only_from, only_into)
    )]
    Points {
        /// The file that is added.
        from: String,
        /// The file it is added to.
        into: String,
        /// Points of the first only.
        only_from: Vec<String>,
        /// Points of the second only.
        only_into: Vec<String>,
    },
    /// Two gestures of one name.
    #[error(
        "{from} and {into} both define a gesture `{name}`; give one another name with `handwave gesture copy --as NAME`, or remove one with `handwave gesture remove`"
    )]
    Twice {
        /// The file that is added.
        from: String,
        /// The file it is added to.
        into: String,
        /// The name.
        name: String,
    },
    /// No gesture of that name.
    #[error("{from} has no gesture `{name}`{hint} Gestures: {}", names.join(", "))]
    Unknown {
        /// The file that was looked in.
        from: String,
        /// The name.
        name: String,
        /// A name that is near.
        hint: String,
        /// All names there are.
        names: Vec<String>,
    },
}

fn difference(only_from: &[String], only_into: &[String]) -> String {
    let part = |which: &str, points: &[String]| match points {
        [] => String::new(),
        points => format!(" only the {which} has {};", points.join(", ")),
    };
    part("first", only_from) + &part("second", only_into)
}

impl GestureSet {
    /// The gesture called `name`; `file` is this set's name in messages.
    ///
    /// # Errors
    /// There is none.
    pub fn named(&self, name: &str, file: &str) -> Result<&Gesture, LibraryError> {
        self.gestures
            .iter()
            .find(|gesture| gesture.name == name)
            .ok_or_else(|| {
                let names = || self.gestures.iter().map(|g| g.name.as_str());
                LibraryError::Unknown {
                    from: file.into(),
                    name: name.into(),
                    hint: crate::base::suggest::hint(name, names()),
                    names: names().map(String::from).collect(),
                }
            })
    }

    /// A gesture of `other` with its points in the order of this set; `into` and `from` are the two sets'
    /// names in messages.
    ///
    /// Frames keep their global motion, so the other set's reference does not matter.
    ///
    /// # Errors
    /// Other points, another dimension.
    pub fn adopt(
        &self,
        other: &GestureSet,
        gesture: &Gesture,
        into: &str,
        from: &str,
    ) -> Result<Gesture, LibraryError> {
        if self.header.dim != other.header.dim {
            return Err(LibraryError::Dimension {
                from: from.into(),
                into: into.into(),
                found: other.header.dim,
                expected: self.header.dim,
            });
        }
        let (mine, theirs) = (&self.header.points, &other.header.points);
        let only = |these: &[String], those: &[String]| -> Vec<String> {
            these
                .iter()
                .filter(|p| !those.contains(p))
                .cloned()
                .collect()
        };
        let (only_from, only_into) = (only(theirs, mine), only(mine, theirs));
        if !only_from.is_empty() || !only_into.is_empty() {
            return Err(LibraryError::Points {
                from: from.into(),
                into: into.into(),
                only_from,
                only_into,
            });
        }
        let columns: Vec<usize> = mine
            .iter()
            .filter_map(|point| theirs.iter().position(|p| p == point))
            .collect();
        let ordered = |frame: &Vec<[f64; 3]>| columns.iter().map(|c| frame[*c]).collect();
        Ok(Gesture {
            frames: gesture.frames.iter().map(ordered).collect(),
            ..gesture.clone()
        })
    }

    /// Adds all gestures of `other`; `into` and `from` are the two sets' names in messages. Reference, global
    /// motion and options stay this set's.
    ///
    /// # Errors
    /// Other points, another dimension, a name that both have.
    pub fn merge(
        &mut self,
        other: &GestureSet,
        into: &str,
        from: &str,
    ) -> Result<(), LibraryError> {
        for gesture in &other.gestures {
            if self.index_of(&gesture.name).is_some() {
                return Err(LibraryError::Twice {
                    from: from.into(),
                    into: into.into(),
                    name: gesture.name.clone(),
                });
            }
            let gesture = self.adopt(other, gesture, into, from)?;
            self.gestures.push(gesture);
        }
        Ok(())
    }
}
