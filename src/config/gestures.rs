//! The gesture files of a character: read, merged, checked against its classes, and read again when changed.

use super::channel::{self, ChannelParts};
use super::class::ClassParts;
use super::files::{FileStamp, Files};
use super::motion::neighbourhoods;
use crate::gesture::{FrontEnd, FrontEndOptions, GestureKind, GestureSet, PerformerScale};
use crate::pose::PoseHeader;

/// Gesture files and what the character needs of them.
#[derive(Clone, Debug)]
pub struct GestureFiles {
    files: Files,
    paths: Vec<String>,
    /// Text of each file as last used, or why it could not be read.
    texts: Result<Vec<String>, String>,
    /// The same as seen at the last look, when it was new.
    pending: Option<Result<Vec<String>, String>>,
    /// When each file was last changed, as of the last look.
    stamps: Vec<Option<FileStamp>>,
    /// Per class the gesture that drives it, by name, with its kind.
    wanted: Vec<Option<(String, GestureKind)>>,
    reader: Reader,
    /// Gesture names, in the order in which they are shown.
    names: Vec<String>,
}

/// How a character reads its gestures.
#[derive(Clone, Debug)]
pub(super) struct Reader {
    pub options: FrontEndOptions,
    /// Edges of the motion graph.
    pub edges: Vec<(usize, usize)>,
    pub classes: Vec<ClassParts>,
    pub channels: Vec<ChannelParts>,
    pub config_name: String,
}

/// A front end of changed gesture files.
#[derive(Debug)]
pub struct NewGestures {
    /// Trained, and without history.
    pub front: FrontEnd,
    /// Per class the index of its gesture.
    pub gesture_of_class: Vec<Option<usize>>,
}

/// A file among several that cannot be used: its place in the list, and why.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct BadFile {
    pub index: usize,
    pub problem: String,
}

/// One set of the gesture files at `paths` with the given texts. Reference and options are the first's.
pub(super) fn merged(
    files: &Files,
    paths: &[String],
    texts: &[String],
) -> Result<Option<GestureSet>, BadFile> {
    let mut merged: Option<GestureSet> = None;
    for (index, (path, text)) in paths.iter().zip(texts).enumerate() {
        let name = files.name(path);
        let bad = |problem: String| BadFile { index, problem };
        let set = GestureSet::from_toml(text, &name).map_err(|e| bad(e.to_string()))?;
        match &mut merged {
            None => merged = Some(set),
            Some(all) => {
                let together = all.merge(&set, &files.name(&paths[0]), &name);
                together.map_err(|e| bad(e.to_string()))?;
            }
        }
    }
    Ok(merged)
}

impl GestureFiles {
    /// The files of a character that was just loaded.
    pub(super) fn new(
        files: &Files,
        (paths, texts): (Vec<String>, Vec<String>),
        set: &GestureSet,
        reader: Reader,
    ) -> Self {
        let driver = |class: &ClassParts| {
            let gesture = set.gestures.get(class.gesture?)?;
            Some((gesture.name.clone(), gesture.kind))
        };
        Self {
            files: files.clone(),
            stamps: Vec::new(),
            pending: None,
            paths,
            texts: Ok(texts),
            wanted: reader.classes.iter().map(driver).collect(),
            reader,
            names: set.gestures.iter().map(|g| g.name.clone()).collect(),
        }
    }

    /// Whether they are files that somebody can change, of a character whose gestures can be exchanged: what a
    /// pose map reads belongs to its front end, so one with a map keeps its gestures.
    pub fn can_change(&self) -> bool {
        let mapped = self.reader.classes.iter().any(|class| class.map.is_some());
        matches!(self.files.place(), Files::Folder(_)) && !mapped
    }

    /// Gesture names, in the order of the estimates.
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// Reads the files again; `None` when nothing in them has changed. A change counts once two looks in a row
    /// have seen the same: whoever writes a file is then done with it.
    ///
    /// Gestures keep their order, new ones come last. `scale`: what was measured of the performer, who is still
    /// the same. Reads files and trains planes: not for the control
    /// thread.
    ///
    /// # Errors
    /// A file that cannot be read or used, a gesture that a class needs and that is gone or of another kind:
    /// what was found and what to do, told once. What was loaded before stays.
    pub fn reload(
        &mut self,
        stream: &PoseHeader,
        scale: Option<f64>,
    ) -> Result<Option<NewGestures>, String> {
        let stamps = self
            .paths
            .iter()
            .map(|path| self.files.stamp(path))
            .collect();
        if self.pending.is_none() && self.stamps == stamps {
            return Ok(None);
        }
        self.stamps = stamps;
        let read = |path: &String| self.files.read(path).map_err(|e| e.to_string());
        let texts: Result<Vec<String>, String> = self.paths.iter().map(read).collect();
        if self.texts == texts {
            self.pending = None;
            return Ok(None);
        }
        if self.pending.as_ref() != Some(&texts) {
            self.pending = Some(texts);
            return Ok(None);
        }
        self.pending = None;
        self.texts.clone_from(&texts);
        self.build(&texts?, stream, scale).map(Some)
    }

    fn build(
        &mut self,
        texts: &[String],
        stream: &PoseHeader,
        scale: Option<f64>,
    ) -> Result<NewGestures, String> {
        let set = merged(&self.files, &self.paths, texts).map_err(|bad| bad.problem)?;
        let mut set = set.ok_or("no gesture file")?;
        let place = |name: &String| self.names.iter().position(|n| n == name);
        set.gestures
            .sort_by_key(|g| place(&g.name).unwrap_or(usize::MAX));
        let gesture_of_class = (self.wanted.iter())
            .map(|wanted| {
                let Some((name, kind)) = wanted else {
                    return Ok(None);
                };
                let index = set.index_of(name).ok_or_else(|| {
                    format!("gesture `{name}` is gone, and a class needs it; define it again")
                })?;
                let found = set.gestures[index].kind;
                if found != *kind {
                    return Err(format!(
                        "gesture `{name}` is {} now, and its class needs a {} one; define it again as such",
                        found.name(),
                        kind.name()
                    ));
                }
                Ok(Some(index))
            })
            .collect::<Result<Vec<_>, String>>()?;
        let reader = &mut self.reader;
        let mut options = reader.options;
        if let Some(scale) = scale {
            options.scale = PerformerScale::Declared(scale);
        }
        for (class, gesture) in reader.classes.iter_mut().zip(&gesture_of_class) {
            class.gesture = *gesture;
        }
        let near = neighbourhoods(&reader.edges, &reader.classes, set.gestures.len());
        let front = FrontEnd::with_neighbourhoods(&set, stream, options, &near)
            .map_err(|e| e.to_string())?;
        let front = channel::bind(front, &reader.channels, &reader.config_name)
            .map_err(|e| e.to_string())?;
        self.names = set.gestures.iter().map(|g| g.name.clone()).collect();
        Ok(NewGestures {
            front,
            gesture_of_class,
        })
    }
}
