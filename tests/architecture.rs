//! The house holds: imports point downwards, only `live` knows the clock, files are short.

use std::fs;
use std::path::Path;

/// Floors of `src`: a module imports from lower floors and from its own folder only.
const FLOORS: [(&str, u8); 14] = [
    ("main", 8),
    ("cli", 7),
    ("view", 6),
    ("live", 5),
    ("config", 4),
    ("puppet", 4),
    ("sim", 3),
    ("motion", 3),
    ("gesture", 3),
    ("bus", 2),
    ("body", 2),
    ("pose", 2),
    ("robot", 1),
    ("base", 0),
];

/// Names that only `live` may use, since it owns clock, threads and signals.
const CLOCK_NAMES: [&str; 4] = ["Instant", "SystemTime", "thread::sleep", "signal_hook"];

/// Who else may use one of them, and why.
const CLOCK_EXCEPTIONS: [(&str, &str, &str); 1] = [(
    "cli/sim.rs",
    "signal_hook",
    "the simulator is no run with a stop switch: a signal ends its server, whose clock is a parameter",
)];

const LONGEST_FILE: usize = 520;

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Every source file, as its path in `src` and its text.
fn sources() -> Vec<(String, String)> {
    let src = root().join("src");
    let mut folders = vec![src.clone()];
    let mut files = Vec::new();
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(&folder).expect("a folder of src") {
            let path = entry.expect("an entry of src").path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|e| e == "rs") {
                let name = path.strip_prefix(&src).expect("below src");
                let text = fs::read_to_string(&path).expect("readable source");
                files.push((name.to_str().expect("plain name").to_owned(), text));
            }
        }
    }
    files.sort();
    assert!(files.len() > 50, "only {} source files found", files.len());
    files
}

/// The text with comments blanked; lines stay where they are.
fn code_of(text: &str) -> String {
    let lines = text.lines().map(|line| match line.find("//") {
        // Not the slashes of an address within a string.
        Some(at) if !line[..at].ends_with(':') => &line[..at],
        _ => line,
    });
    lines.collect::<Vec<_>>().join("\n")
}

/// The code without its `#[cfg(test)] mod ... { }`.
fn shipped_code_of(text: &str) -> String {
    let code = code_of(text);
    let mut kept = Vec::new();
    let mut in_tests = false;
    let lines: Vec<&str> = code.lines().collect();
    for (index, line) in lines.iter().enumerate() {
        let next = lines.get(index + 1).copied().unwrap_or_default();
        in_tests |= *line == "#[cfg(test)]" && next.starts_with("mod ") && next.ends_with('{');
        kept.push(if in_tests { "" } else { line });
        in_tests &= *line != "}";
    }
    kept.join("\n")
}

/// Module path of a source file: `sim/mod.rs` is `[sim]`, `cli/bus/scan.rs` is `[cli, bus, scan]`.
fn module_path(name: &str) -> Vec<&str> {
    let stem = name.strip_suffix(".rs").unwrap_or(name);
    stem.strip_suffix("/mod")
        .unwrap_or(stem)
        .split('/')
        .collect()
}

fn identifier(text: &str) -> &str {
    let end = text.find(|c: char| !(c.is_alphanumeric() || c == '_'));
    &text[..end.unwrap_or(text.len())]
}

/// The first names behind a path's `::`: one, or those of a group in braces.
fn heads(rest: &str) -> Vec<&str> {
    let Some(group) = rest.strip_prefix('{') else {
        return vec![identifier(rest)];
    };
    let mut names = Vec::new();
    let (mut depth, mut expected) = (1, true);
    for (at, c) in group.char_indices() {
        match c {
            '{' => depth += 1,
            '}' => depth -= 1,
            ',' if depth == 1 => expected = true,
            c if depth == 1 && expected && !c.is_whitespace() => {
                names.push(identifier(&group[at..]));
                expected = false;
            }
            _ => {}
        }
        if depth == 0 {
            break;
        }
    }
    names
}

/// What a file takes from the crate's root: (line, module).
fn imports(name: &str, text: &str) -> Vec<(usize, String)> {
    let code = code_of(text);
    let file_depth = module_path(name).len();
    let mut inline: Vec<usize> = Vec::new();
    let mut found = Vec::new();
    let mut offset = 0;
    for (index, line) in code.split_inclusive('\n').enumerate() {
        let trimmed = line.trim();
        let indent = line.len() - line.trim_start().len();
        for root in ["crate::", "handwave::"] {
            for (at, _) in line.match_indices(root) {
                let before = line[..at].chars().next_back();
                if before.is_some_and(|c| c.is_alphanumeric() || c == '_' || c == '$') {
                    continue;
                }
                let rest = &code[offset + at + root.len()..];
                found.extend(heads(rest).into_iter().map(|m| (index + 1, m.to_owned())));
            }
        }
        for (at, _) in line.match_indices("super::") {
            if line[..at].ends_with("super::") {
                continue;
            }
            let mut rest = &code[offset + at..];
            let mut up = 0;
            while let Some(next) = rest.strip_prefix("super::") {
                rest = next;
                up += 1;
            }
            if up >= file_depth + inline.len() {
                found.extend(heads(rest).into_iter().map(|m| (index + 1, m.to_owned())));
            }
        }
        if trimmed.ends_with('{') && (trimmed.starts_with("mod ") || trimmed.contains(" mod ")) {
            inline.push(indent);
        } else if trimmed == "}" && inline.last() == Some(&indent) {
            inline.pop();
        }
        offset += line.len();
    }
    found
}

fn floor(module: &str) -> Option<u8> {
    FLOORS.iter().find(|(m, _)| *m == module).map(|(_, f)| *f)
}

/// Imports of a file that go upwards, sideways or nowhere.
fn wrong_imports(name: &str, text: &str) -> Vec<String> {
    let own = module_path(name)[0];
    let Some(own_floor) = floor(own) else {
        return vec![format!("src/{name}: {own} has no floor")];
    };
    let mut wrong = Vec::new();
    for (line, module) in imports(name, text) {
        let problem = match floor(&module) {
            _ if module == own => continue,
            None => "which has no floor".to_owned(),
            Some(f) if f < own_floor => continue,
            Some(f) if f == own_floor => format!("sideways on floor {f}"),
            Some(f) => format!("upwards from floor {own_floor} to {f}"),
        };
        wrong.push(format!("src/{name}:{line}: {own} uses {module}, {problem}"));
    }
    wrong
}

/// Uses of clock, threads and signals in shipped code that belongs to `live`.
fn wrong_clocks(name: &str, text: &str) -> Vec<String> {
    if module_path(name)[0] == "live" {
        return Vec::new();
    }
    let code = shipped_code_of(text);
    let mut wrong = Vec::new();
    for (index, line) in code.lines().enumerate() {
        for word in CLOCK_NAMES {
            let excepted = CLOCK_EXCEPTIONS
                .iter()
                .any(|(file, what, _)| *file == name && *what == word);
            let used = line.match_indices(word).any(|(at, _)| {
                let before = line[..at].chars().next_back();
                let after = line[at + word.len()..].chars().next();
                let part = |c: Option<char>| c.is_some_and(|c| c.is_alphanumeric() || c == '_');
                !part(before) && !part(after)
            });
            if used && !excepted {
                wrong.push(format!("src/{name}:{}: {word} outside live", index + 1));
            }
        }
    }
    wrong
}

#[test]
fn the_import_check_sees_made_up_violations() {
    for (name, text, expected) in [
        (
            "pose/reader.rs",
            "use crate::live::RealClock;",
            "upwards from floor 2 to 5",
        ),
        ("sim/line.rs", "use crate::motion::Clip;", "sideways"),
        ("puppet.rs", "use crate::config::Character;", "sideways"),
        (
            "base/time.rs",
            "let x = crate::robot::Leg::new();",
            "base uses robot",
        ),
        (
            "bus/port.rs",
            "use crate::{\n    base::Time,\n    cli::main,\n};",
            "bus uses cli",
        ),
        (
            "bus/dynamixel/chain.rs",
            "use super::super::super::live::stop;",
            "bus uses live",
        ),
        (
            "body/mod.rs",
            "use super::puppet::Puppet;",
            "body uses puppet",
        ),
        ("pose/csv.rs", "use handwave::view::Display;", "upwards"),
        ("live/wire.rs", "use crate::gadgets::X;", "no floor"),
        (
            "gadgets/mod.rs",
            "use crate::base::Time;",
            "gadgets has no floor",
        ),
    ] {
        let wrong = wrong_imports(name, text);
        assert!(
            wrong.len() == 1 && wrong[0].contains(expected),
            "{name}: {text:?} gave {wrong:?}, expected one with {expected:?}"
        );
    }
}

#[test]
fn the_import_check_lets_honest_lines_through() {
    for (name, text) in [
        (
            "live/wire.rs",
            "use crate::sim::{self, Line};\nuse super::stop;",
        ),
        (
            "sim/table.rs",
            "mod tests {\n    use super::super::models;\n}",
        ),
        ("base/time.rs", "//! See [`crate::live`]."),
        (
            "bus/mod.rs",
            "use handwave_dynamixel::Crc;\nuse crate::bus::port;",
        ),
    ] {
        let wrong = wrong_imports(name, text);
        assert!(wrong.is_empty(), "{text:?} gave {wrong:?}");
    }
}

#[test]
fn imports_point_downwards() {
    let sources = sources();
    let all: usize = sources.iter().map(|(n, t)| imports(n, t).len()).sum();
    assert!(all > 100, "only {all} imports seen: the check is blind");
    let checked = sources.iter().filter(|(name, _)| name != "lib.rs");
    let wrong: Vec<_> = checked.flat_map(|(n, t)| wrong_imports(n, t)).collect();
    assert!(
        wrong.is_empty(),
        "{} of {all} imports:\n{}",
        wrong.len(),
        wrong.join("\n")
    );
}

#[test]
fn only_live_knows_the_clock() {
    let made_up = "fn f() {\n    std::thread::sleep(x);\n}\n#[cfg(test)]\nmod tests {\n    use std::time::Instant;\n}\n";
    assert_eq!(
        wrong_clocks("sim/line.rs", made_up),
        ["src/sim/line.rs:2: thread::sleep outside live"]
    );
    assert!(wrong_clocks("live/clock.rs", made_up).is_empty());
    let sources = sources();
    let wrong: Vec<_> = sources
        .iter()
        .flat_map(|(n, t)| wrong_clocks(n, t))
        .collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    for (file, word, why) in CLOCK_EXCEPTIONS {
        let used = sources.iter().any(|(n, t)| n == file && t.contains(word));
        assert!(
            used,
            "{file} no longer uses {word}: drop the exception ({why})"
        );
    }
}

#[test]
fn every_source_file_says_what_it_is_and_stays_short() {
    let mut wrong = Vec::new();
    for (name, text) in sources() {
        let lines = text.lines().count();
        if !text.starts_with("//! ") {
            wrong.push(format!("src/{name}: the first line is no `//!` line"));
        }
        if lines > LONGEST_FILE {
            wrong.push(format!("src/{name}: {lines} lines, over {LONGEST_FILE}"));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}
