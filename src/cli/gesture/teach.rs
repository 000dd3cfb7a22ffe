//! `handwave gesture define --input`: a gesture taught live, or from a recording played as if it were.

use super::define::{DefineArgs, put};
use super::report;
use crate::base::{Clock, VirtualClock};
use crate::cli::run::Speed;
use crate::cli::{ExitStatus, Failure, warn};
use crate::gesture::{
    FrontEndOptions, GestureKind, GestureSet, TeachError, TeachOptions, TeachPhase, TeachView,
    Teacher, confusion_of,
};
use crate::live::feed::{Feed, ReaderFeed, read_ahead};
use crate::live::keys::Keys;
use crate::live::source;
use crate::live::teach::{Lesson, Taught, teach};
use crate::live::{RealClock, StopSwitch};
use std::io::{IsTerminal, Write};

/// A source as the gesture file tells it: without the folders of one person's machine.
fn shown(input: &str) -> String {
    let path = input.strip_prefix("file:").map(std::path::Path::new);
    let name = path.and_then(std::path::Path::file_name);
    name.map_or_else(|| input.into(), |name| name.to_string_lossy().into_owned())
}

/// Width of the red-to-green bar.
const BAR: usize = 20;

/// Runs the live form of `define`.
pub(super) fn run(args: &DefineArgs, input: &str) -> Result<ExitStatus, Failure> {
    let live = source::is_live(input);
    let fast = args.speed == Speed::Max;
    if live && fast {
        return Err(Failure::input(format!(
            "--speed max takes time from a recording; {input} is live: leave --speed out"
        )));
    }
    for (key, value) in [
        ("start-after", args.start_after),
        ("count-down", Some(args.count_down)),
    ] {
        if let Some(value) = value
            && !(0.0..=60.0).contains(&value)
        {
            return Err(Failure::input(format!(
                "--{key} {value}: allowed: 0 to 60 seconds"
            )));
        }
    }
    if !(1.0..=100.0).contains(&args.longest) {
        return Err(Failure::input(format!(
            "--longest {}: allowed: 1 to 100 seconds",
            args.longest
        )));
    }
    let stop = StopSwitch::new();
    stop.on_signals()
        .map_err(|e| Failure::input(format!("cannot listen for signals: {e}")))?;
    let mut opened = source::open_any(input, &source::working_folder(), &stop)?;
    let first = opened.first_sample()?;
    if let Some(assumption) = opened.reader.assumption() {
        warn(format_args!("{assumption}"));
    }
    let header = opened.reader.header().clone();
    let set = args.set(&header)?;
    let mark_channel = args
        .mark_channel
        .as_ref()
        .map(|name| {
            header.channels.iter().position(|c| c == name).ok_or_else(|| {
                Failure::input(format!(
                    "--mark-channel {name}: the stream has the channels: {}; its header must name the button's channel",
                    header.channels.join(", ")
                ))
            })
        })
        .transpose()?;
    let keys = if fast || input.ends_with('-') {
        None
    } else {
        Keys::open()
    };
    let hands_free = args.start_after.is_some();
    if !hands_free && mark_channel.is_none() && keys.is_none() {
        return Err(Failure::input(
            "nobody can mark the start: there are no keys without a terminal (and in virtual time); use --start-after SECONDS or --mark-channel NAME",
        ));
    }
    let options = TeachOptions {
        name: args.name.clone(),
        source: format!("{}, taught", shown(input)),
        kind: args.kind.into(),
        count_down_s: args.start_after.unwrap_or(args.count_down),
        hands_free,
        longest_s: args.longest,
    };
    let mut teacher = Teacher::new(&set, &header, options)
        .map_err(|e| Failure::input(format!("{input}: {e}")))?;
    let mut screen = Screen::new(&set, args, keys.is_some());
    // Hands-free nobody is at the keys: what was shown is taken, or the reason why not is said.
    let asks = keys.is_some() && !hands_free;
    let mut lesson = |feed: &mut dyn Feed, clock: &dyn Clock, keys: Option<Keys>| {
        let lesson = Lesson {
            teacher: &mut teacher,
            feed,
            clock,
            stop: &stop,
            mark_channel,
            keys,
            asks,
        };
        teach(lesson, &mut |teacher, view| screen.show(teacher, view))
    };
    let (taught, dropped) = if fast {
        let mut feed = ReaderFeed::new(opened.reader, first);
        let taught = lesson(&mut feed, &VirtualClock::new(), None);
        (taught, Some(feed.finish()))
    } else {
        let (mut feed, reading) = read_ahead(opened.reader, first, live)
            .map_err(|e| Failure::input(format!("cannot start a thread: {e}")))?;
        let taught = lesson(&mut feed, &RealClock::new(), keys);
        drop(feed);
        if let Some(live) = &opened.live {
            live.close();
        }
        let joined = opened.live.is_some() || reading.is_finished();
        (taught, joined.then(|| reading.join().unwrap_or_default()))
    };
    screen.close();
    if let Some((counts, error)) = dropped {
        let before_header = opened.live.map_or(0, |live| live.before_header());
        if counts.total() + before_header > 0 {
            warn(format_args!(
                "dropped samples: {counts}, {before_header} before the header"
            ));
        }
        if let (Some(error), false) = (error, matches!(taught, Taught::Accepted(_))) {
            return Err(Failure::input(error));
        }
    }
    match taught {
        Taught::Interrupted => Ok(ExitStatus::Interrupted),
        Taught::Failed(TeachError::Cancelled) => {
            warn(format_args!("{}", TeachError::Cancelled));
            Ok(ExitStatus::Interrupted)
        }
        Taught::Failed(error) => Err(Failure::input(error)),
        Taught::Accepted(definition) => {
            let mut with = set;
            with.put(definition.gesture.clone());
            let quality = report::Quality::of(&with, &definition).map_err(Failure::input)?;
            quality.say(args.json);
            if !quality.works() && !args.force {
                return Err(Failure::input(format!(
                    "{}: not written, since it cannot work as it is; show it again, or --force",
                    args.into.display()
                )));
            }
            put(args, with, args.json)
        }
    }
}

/// One updating line on a terminal, a line per change elsewhere; on standard error.
struct Screen {
    names: Vec<String>,
    set: GestureSet,
    kind: GestureKind,
    /// What begins it.
    begin: &'static str,
    updates: bool,
    colour: bool,
    asks: bool,
    last: String,
    judged: bool,
}

impl Screen {
    fn new(set: &GestureSet, args: &DefineArgs, keys: bool) -> Self {
        let updates = std::io::stderr().is_terminal();
        Self {
            names: set.gestures.iter().map(|g| g.name.clone()).collect(),
            set: set.clone(),
            kind: args.kind.into(),
            begin: match (keys, &args.mark_channel) {
                _ if args.start_after.is_some() => {
                    "waiting for a pose in which every point is seen"
                }
                (true, _) => "space begins, q leaves",
                (false, _) => "the button begins",
            },
            updates,
            colour: updates && std::env::var_os("NO_COLOR").is_none(),
            asks: keys && args.start_after.is_none(),
            last: String::new(),
            judged: false,
        }
    }

    fn show(&mut self, teacher: &Teacher, view: &TeachView) {
        let text = self.text(view);
        if self.updates {
            let line = format!("{text}  {}", self.guidance(view));
            if line != self.last {
                let mut err = std::io::stderr();
                // Nobody looks on: no reason to stop.
                let _ = write!(err, "\r\x1b[K{line}");
                let _ = err.flush();
                self.last = line;
            }
        } else if text != self.last {
            let novelty = match view.phase {
                TeachPhase::Recording if view.moved && !self.names.is_empty() => {
                    format!("  ({:.0} % new)", 100.0 * view.movement)
                }
                _ => String::new(),
            };
            warn(format_args!("{text}{novelty}"));
            self.last = text;
        }
        match (view.phase, teacher.outcome()) {
            (TeachPhase::Done, Some(Ok(definition))) if self.asks && !self.judged => {
                self.judged = true;
                self.break_line();
                let mut with = self.set.clone();
                with.put(definition.gesture.clone());
                let verdict = with.index_of(&definition.gesture.name).and_then(|index| {
                    let played = confusion_of(&with, FrontEndOptions::default(), index).ok()?;
                    played.verdicts().into_iter().nth(index)
                });
                if let Some(verdict) = verdict {
                    warn(format_args!("{}", verdict.words));
                }
            }
            (TeachPhase::Failed, Some(Err(error))) if self.asks && !self.judged => {
                self.judged = true;
                self.break_line();
                warn(format_args!("{error}"));
            }
            (TeachPhase::Done | TeachPhase::Failed, _) => {}
            _ => self.judged = false,
        }
    }

    /// What is happening. Whole seconds where lines are printed one below the other.
    fn text(&self, view: &TeachView) -> String {
        match view.phase {
            TeachPhase::Waiting => self.begin.into(),
            TeachPhase::CountDown if self.updates => format!("begin in {:.1} s", view.left_s),
            TeachPhase::CountDown => format!("begin in {:.0} s", view.left_s.ceil()),
            TeachPhase::Recording => {
                let doing = match (view.moved, self.kind) {
                    (false, _) => "recording: begin now".to_owned(),
                    (true, GestureKind::NonCyclic) => {
                        "recording: go to the extreme and stay".into()
                    }
                    (true, GestureKind::Cyclic) => match view.period {
                        Some(p) if self.updates => format!(
                            "recording: go on, period {:.2} s ({:.2})",
                            p.period_s, p.periodicity
                        ),
                        _ => "recording: go on".into(),
                    },
                };
                if self.updates {
                    format!("{doing}  {:.1} s", view.recorded_s)
                } else {
                    doing
                }
            }
            TeachPhase::Done if self.asks => "taught: space keeps it, r once more, q leaves".into(),
            TeachPhase::Done => "taught".into(),
            TeachPhase::Failed if self.asks => "not taught: space once more, q leaves".into(),
            TeachPhase::Failed => "not taught".into(),
            TeachPhase::Cancelled => "cancelled".into(),
        }
    }

    /// The bar from red (known, confusable) to green (new).
    fn guidance(&self, view: &TeachView) -> String {
        if self.names.is_empty() || view.pose.is_none() {
            return String::new();
        }
        let full = (view.movement * BAR as f64).round() as usize;
        let bar = format!("{}{}", "#".repeat(full), "-".repeat(BAR - full.min(BAR)));
        let near = view
            .pose
            .and_then(|p| p.nearest)
            .map_or(String::new(), |n| format!(" near `{}`", self.names[n]));
        let label = format!("{:3.0} % new{near}", 100.0 * view.movement);
        if self.colour {
            // In steps of the bar, so that the line is not drawn again for nothing.
            let green = (255 * full.min(BAR) / BAR) as u8;
            format!("\x1b[38;2;{};{green};0m[{bar}]\x1b[0m {label}", 255 - green)
        } else {
            format!("[{bar}] {label}")
        }
    }

    fn break_line(&mut self) {
        if self.updates && !self.last.is_empty() {
            warn(format_args!(""));
            self.last.clear();
        }
    }

    fn close(&mut self) {
        self.break_line();
    }
}
