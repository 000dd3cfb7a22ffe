//! The summary at the end of a run, for people and as JSON.

use crate::config::Character;
use crate::gesture::TrackingCounts;
use crate::live::control::Ending;
use crate::live::footing::Slides;
use crate::live::safety::{Crew, FaultKind};
use crate::live::session::Report;
use crate::live::stats::{Fault, Percentiles};
use serde_json::{Value, json};

/// The summary as one JSON object.
pub fn to_json(report: &Report, slides: Option<Slides>, character: &Character) -> Value {
    let stats = &report.stats;
    let torque = report.torque.as_ref().and_then(|t| t.as_ref().ok());
    let faults: Vec<Value> = (stats.faults.iter())
        .filter_map(|f| {
            let joint = f.joint?;
            Some(json!({
                "servo": character.servos.get(joint).map(|s| s.id), "joint": character.joints.get(joint),
                "fault": f.kind.as_str(), "from_s": f.from_s, "to_s": f.to_s,
                "measured": measured(f), "value": f.value, "limit": f.limit, "advice": f.kind.advice(),
            }))
        })
        .collect();
    let events: Vec<Value> = (stats.faults.iter())
        .filter(|f| f.joint.is_none())
        .map(|f| {
            json!({
                "event": f.kind.as_str(), "from_s": f.from_s, "to_s": f.to_s,
                "measured": measured(f), "advice": f.kind.advice(),
            })
        })
        .collect();
    let dropped: serde_json::Map<String, Value> = dropped(report)
        .map(|(reason, n)| (reason.into(), n.into()))
        .collect();
    json!({
        "ending": ending_word(&report.ending),
        "avatar": character.body.avatar.is_some(),
        "cycles": stats.cycles, "overruns": stats.overruns, "missed_cycles": stats.missed,
        "envelope_cycles": stats.held_back,
        "transitions": report.transitions.completed, "transitions_aborted": report.transitions.aborted,
        "transitions_interrupted": report.transitions.interrupted, "transitions_refused": report.transitions.refused,
        "stances": slides.map(|s| s.stances),
        "foot_slide_mm": slides.map(|s| 1e3 * s.targets_m),
        "foot_slide_measured_mm": slides.map(|s| 1e3 * s.measured_m),
        "samples": stats.samples, "samples_dropped": dropped, "samples_refused": report.refused,
        "points_rejected": report.tracking.outliers, "points_filled": report.tracking.filled,
        "sides_swapped": report.tracking.swapped, "performer_scale": report.performer_scale,
        "poses_lost_cycles": stats.poses_lost,
        "bus_errors": stats.silent + stats.damaged, "replies_missing": stats.silent,
        "damage": stats.damaged, "bus_bytes": stats.bytes,
        "faults": faults, "more_faults": stats.more_faults, "events": events,
        "pose_to_wire_us": stats.pose_to_wire.percentiles(), "bus_cycle_us": stats.exchange.percentiles(),
        "step_us": stats.step.percentiles(), "lateness_us": stats.lateness.percentiles(),
        "records_lost": report.records_lost,
        "torque_off": torque.map(|t| t.confirmed_off.clone()),
        "torque_unconfirmed": torque.map(|t| t.unconfirmed.clone()),
        "torque_error": report.torque.as_ref().and_then(|t| t.as_ref().err()).map(ToString::to_string),
    })
}

/// The summary as text.
pub fn to_text(report: &Report, slides: Option<Slides>, character: &Character) -> String {
    let stats = &report.stats;
    let line = |p: Percentiles| format!("p50 {} us, p99 {} us, max {} us", p.p50, p.p99, p.max);
    if stats.cycles == 0 {
        return format!(
            "{}: {} before the first cycle\n{}",
            character.name,
            ending_word(&report.ending),
            torque_lines(report, character)
        );
    }
    let share = |n: u64| 100.0 * n as f64 / stats.cycles.max(1) as f64;
    let mut text = format!(
        "{}: {}\n\
         cycles        {}, overruns {} ({:.2} %), bus late {} ({:.2} %)\n\
         envelope      acted in {} cycles\n\
         transitions   {}\n{}\
         poses         {} used, {} dropped{}\n\
         bus           {} replies missing, damage {} (stray bytes, wrong checksums), {:.1} MB\n\
         pose to wire  {}\n\
         bus cycle     {}\n\
         step          {}\n\
         lateness      {}\n",
        character.name,
        ending_word(&report.ending),
        stats.cycles,
        stats.overruns,
        share(stats.overruns),
        stats.missed,
        share(stats.missed),
        stats.held_back,
        transitions(report),
        standing(slides),
        stats.samples,
        report.dropped.total() + report.before_header + report.refused,
        reasons(report),
        stats.silent,
        stats.damaged,
        stats.bytes as f64 / 1e6,
        line(stats.pose_to_wire.percentiles()),
        line(stats.exchange.percentiles()),
        line(stats.step.percentiles()),
        line(stats.lateness.percentiles()),
    );
    text += &tracking_lines(report);
    text += &fault_lines(report, character);
    text += &torque_lines(report, character);
    if report.records_lost > 0 {
        text += &format!(
            "note          {} cycles are missing in view and targets: the disk or terminal was too slow\n",
            report.records_lost
        );
    }
    for note in report
        .notes
        .iter()
        .chain(report.real_time.iter().flat_map(|r| &r.notes))
    {
        text += &format!("note          {note}\n");
    }
    text
}

/// What was mended of the tracker's, when anything was, and the performer's scale, when it is not 1.
fn tracking_lines(report: &Report) -> String {
    let mended = &report.tracking;
    let mut text = String::new();
    if *mended != TrackingCounts::default() {
        text += &format!("tracker       {mended}\n");
    }
    match report.performer_scale {
        Some(1.0) => {}
        Some(scale) => text += &format!("performer     scale {scale:.3}\n"),
        None => {
            text += "performer     scale never measured: no still second with all points seen; declare it with --scale NUMBER\n";
        }
    }
    text
}

fn torque_lines(report: &Report, character: &Character) -> String {
    if character.body.avatar.is_some() {
        return "servos        none: an avatar\n".into();
    }
    let torque = match &report.torque {
        None => return "torque        stays on, as safety.on_exit says\n".into(),
        Some(Err(error)) => return format!("torque        UNKNOWN, not read back: {error}\n"),
        Some(Ok(torque)) => torque,
    };
    let mut text = format!(
        "torque        off, read back from {} of {} servos\n",
        torque.confirmed_off.len(),
        character.joints.len()
    );
    for (joint, reason) in &torque.unconfirmed {
        text += &format!("torque        NOT confirmed off: joint {joint}: {reason}\n");
    }
    text
}

/// What was measured of a fault; `None` when nothing was.
fn measured(fault: &Fault) -> Option<String> {
    let text = fault.kind.measured(fault.value, fault.limit);
    (!text.is_empty()).then_some(text)
}

/// One line per servo and kind of fault, with the first few times, what was measured and what to do; faults that
/// struck all servos at once are those of the line, not of a servo, and get one line together.
fn fault_lines(report: &Report, character: &Character) -> String {
    if character.servos.is_empty() {
        return String::new();
    }
    let stats = &report.stats;
    let ids: Vec<u8> = character.servos.iter().map(|s| s.id).collect();
    let crew = Crew {
        joints: &character.joints,
        ids: &ids,
    };
    let at_once = |fault: &Fault| {
        let same = |f: &&Fault| f.kind == fault.kind && f.from_s == fault.from_s;
        fault.joint.is_some()
            && character.joints.len() > 1
            && stats.faults.iter().filter(same).count() == character.joints.len()
    };
    let (whole, single): (Vec<&Fault>, Vec<&Fault>) = stats.faults.iter().partition(|f| at_once(f));
    let mut text = String::new();
    for kind in FaultKind::ALL {
        let of = |joint| move |f: &&&Fault| f.kind == kind && f.joint == joint;
        text += &fault_line("all servos", kind, whole.iter().filter(of(Some(0))));
        text += &fault_line("robot", kind, single.iter().filter(of(None)));
        for joint in 0..character.joints.len() {
            let own = single.iter().filter(of(Some(joint)));
            text += &fault_line(&crew.name(joint), kind, own);
        }
    }
    if stats.more_faults > 0 {
        text += &format!(
            "fault         {} more are only counted\n",
            stats.more_faults
        );
    }
    text
}

fn fault_line<'a>(
    who: &str,
    kind: FaultKind,
    faults: impl Iterator<Item = &'a &'a Fault>,
) -> String {
    const TIMES: usize = 3;
    let faults: Vec<&&Fault> = faults.collect();
    let Some(last) = faults.last() else {
        return String::new();
    };
    let times: Vec<String> = (faults.iter().take(TIMES))
        .map(|f| match f.to_s {
            Some(to) if to == f.from_s => format!("{to:.3} s"),
            Some(to) => format!("{:.3}..{to:.3} s", f.from_s),
            None => format!("{:.3} s to the end", f.from_s),
        })
        .collect();
    let more = match faults.len().saturating_sub(TIMES) {
        0 => String::new(),
        n => format!(" and {n} more times"),
    };
    let label = if kind == FaultKind::Rearmed {
        "note "
    } else {
        "fault"
    };
    let mut text = format!(
        "{label}         {who} {} {}{more}",
        kind.as_str(),
        times.join(", ")
    );
    if let Some(measured) = measured(last) {
        text += &format!(" ({measured})");
    }
    if !kind.advice().is_empty() {
        text += &format!(". {}", kind.advice());
    }
    text + "\n"
}

/// Why samples were dropped, and how many.
fn dropped(report: &Report) -> impl Iterator<Item = (&'static str, u64)> {
    let reasons = report.dropped.by_reason().into_iter();
    reasons
        .chain([("before_header", report.before_header)])
        .filter(|(_, n)| *n > 0)
}

fn reasons(report: &Report) -> String {
    let list: Vec<String> = dropped(report)
        .map(|(reason, n)| format!("{n} {reason}"))
        .collect();
    if list.is_empty() {
        String::new()
    } else {
        format!(" ({})", list.join(", "))
    }
}

fn ending_word(ending: &Ending) -> &'static str {
    match ending {
        Ending::Complete => "performance complete",
        Ending::Interrupted => "interrupted",
        Ending::SafetyStop(_) => "safety stop",
        Ending::Bus(_) => "bus failure",
    }
}

/// Transitions in words; what did not happen is not told.
fn transitions(report: &Report) -> String {
    let counts = &report.transitions;
    let mut text = format!("{} done, {} aborted", counts.completed, counts.aborted);
    for (count, word) in [
        (counts.interrupted, "interrupted"),
        (counts.refused, "refused: nothing similar"),
    ] {
        if count > 0 {
            text.push_str(&format!(", {count} {word}"));
        }
    }
    text
}

/// How well feet stood; nothing for a body without feet that are pinned.
fn standing(slides: Option<Slides>) -> String {
    slides.map_or(String::new(), |s| {
        format!(
            "feet          slid at most {:.2} mm in {} stances (servos, measured: {:.1} mm)\n",
            1e3 * s.targets_m,
            s.stances,
            1e3 * s.measured_m
        )
    })
}
