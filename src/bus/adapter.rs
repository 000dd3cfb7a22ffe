//! What the system knows of the adapter behind a serial port: its USB identity, where it may have come
//! back, how long it keeps bytes back.

use serialport::SerialPortType;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Where the system describes its terminals.
const TTY_CLASS: &str = "/sys/class/tty";
/// Waiting for bytes longer than this, an adapter is worth a word.
const SHORT: Duration = Duration::from_millis(1);

/// How a USB adapter is recognised.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct UsbIdentity {
    vendor: u16,
    product: u16,
    serial: Option<String>,
}

/// How a port is recognised after it was lost.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Identity {
    /// As it was opened.
    path: PathBuf,
    usb: Option<UsbIdentity>,
}

impl Identity {
    /// That of the port `path`, which is open now.
    pub fn of(path: &str) -> Self {
        let device = fs::canonicalize(path).unwrap_or_else(|_| path.into());
        let usb = usb_ports()
            .into_iter()
            .find(|(name, _)| Path::new(name) == device);
        Identity {
            path: path.into(),
            usb: usb.map(|(_, usb)| usb),
        }
    }

    /// What is looked for, for messages.
    pub fn sought(&self) -> String {
        match &self.usb {
            Some(UsbIdentity {
                serial: Some(serial),
                ..
            }) => format!("a USB adapter with serial number {serial}"),
            Some(usb) => format!("a USB adapter {:04x}:{:04x}", usb.vendor, usb.product),
            None => format!("{}*", stem(&self.path).display()),
        }
    }

    /// Ports that may be this one, the likeliest first.
    pub fn candidates(&self) -> Vec<String> {
        let mut names = Vec::new();
        let mut add = |name: String| {
            if !names.contains(&name) {
                names.push(name);
            }
        };
        match &self.usb {
            // A link such as one in /dev/serial/by-id says more than its target.
            Some(_) if fs::symlink_metadata(&self.path).is_ok_and(|found| found.is_symlink()) => {
                add(self.path.display().to_string());
            }
            Some(usb) => usb_ports()
                .into_iter()
                .filter(|(_, found)| found == usb)
                .for_each(|(name, _)| add(name)),
            None => {
                if self.path.exists() {
                    add(self.path.display().to_string());
                }
                alike(&self.path).into_iter().for_each(add);
            }
        }
        names
    }
}

/// Serial ports behind USB, with their identities.
fn usb_ports() -> Vec<(String, UsbIdentity)> {
    // Where there is no such folder, the crate would panic.
    if !Path::new(TTY_CLASS).is_dir() {
        return Vec::new();
    }
    let ports = serialport::available_ports().unwrap_or_default();
    ports
        .into_iter()
        .filter_map(|port| match port.port_type {
            SerialPortType::UsbPort(usb) => Some((
                port.port_name,
                UsbIdentity {
                    vendor: usb.vid,
                    product: usb.pid,
                    serial: usb.serial_number,
                },
            )),
            _ => None,
        })
        .collect()
}

/// A name without the number at its end: `/dev/ttyUSB0` and `/dev/ttyUSB1` have one stem.
fn stem(path: &Path) -> PathBuf {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let stem = name.trim_end_matches(|last: char| last.is_ascii_digit());
    path.with_file_name(stem)
}

/// Character devices, or links to such, beside `path` with the same stem, in order.
fn alike(path: &Path) -> Vec<String> {
    let stem = stem(path);
    let begin = stem.file_name().unwrap_or_default().to_string_lossy();
    let folder = path.parent().unwrap_or(Path::new("/"));
    if begin.is_empty() {
        return Vec::new();
    }
    let mut found: Vec<String> = fs::read_dir(folder)
        .into_iter()
        .flatten()
        .flatten()
        .filter(|entry| entry.file_name().to_string_lossy().starts_with(&*begin))
        .map(|entry| entry.path())
        .filter(|path| is_device(path))
        .map(|path| path.display().to_string())
        .collect();
    found.sort();
    found
}

fn is_device(path: &Path) -> bool {
    use std::os::unix::fs::FileTypeExt;
    fs::metadata(path).is_ok_and(|found| found.file_type().is_char_device())
}

/// The file of the latency timer of the adapter behind `path`, where it has one.
fn latency_file(class: &Path, path: &str) -> Option<PathBuf> {
    // The device may be named by a link, such as one in /dev/serial/by-id.
    let device = fs::canonicalize(path).ok()?;
    let file = class.join(device.file_name()?).join("device/latency_timer");
    file.exists().then_some(file)
}

/// Sets the latency timer of an FTDI-class adapter to 1 ms if allowed, and says what it is then.
pub(super) fn lower_latency_timer(path: &str) -> Option<Duration> {
    lower(&latency_file(Path::new(TTY_CLASS), path)?)
}

fn lower(timer: &Path) -> Option<Duration> {
    let read = || fs::read_to_string(timer).ok()?.trim().parse().ok();
    let millis: u64 = read()?;
    if millis > 1 && fs::write(timer, "1").is_ok() {
        return read().map(Duration::from_millis);
    }
    Some(Duration::from_millis(millis))
}

/// What to tell about a latency timer that stays above 1 ms, with the commands that lower it.
pub(super) fn latency_note(path: &str, timer: Option<Duration>) -> Option<String> {
    let timer = timer.filter(|timer| *timer > SHORT)?;
    let device = fs::canonicalize(path).unwrap_or_else(|_| path.into());
    let name = device.file_name().unwrap_or_default().to_string_lossy();
    Some(format!(
        "the USB adapter of {path} keeps answers back for up to {} ms (latency timer), which leaves about {:.0} \
         cycles a second. Set it to 1: `echo 1 | sudo tee {TTY_CLASS}/{name}/device/latency_timer` (or `setserial \
         {path} low_latency`); for good, in /etc/udev/rules.d/99-latency.rules: ACTION==\"add\", \
         SUBSYSTEM==\"usb-serial\", DRIVER==\"ftdi_sio\", ATTR{{latency_timer}}=\"1\"",
        timer.as_millis(),
        1.0 / (timer.as_secs_f64() + 0.002)
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_port_is_looked_for_under_names_of_its_stem() {
        assert_eq!(stem(Path::new("/dev/ttyUSB12")), Path::new("/dev/ttyUSB"));
        assert_eq!(stem(Path::new("/tmp/servos")), Path::new("/tmp/servos"));
        assert_eq!(
            alike(Path::new("/dev/nul")),
            ["/dev/null"],
            "devices of the stem"
        );
        let folder = tempfile::tempdir().expect("a folder");
        let link = |name| {
            let path = folder.path().join(name);
            std::os::unix::fs::symlink("/dev/null", &path).expect("a link");
            path.display().to_string()
        };
        let (one, two) = (link("servos1"), link("servos2"));
        link("other");
        fs::write(folder.path().join("servos.txt"), "").expect("a file");
        let identity = Identity::of(&folder.path().join("servos").display().to_string());
        assert_eq!(identity.candidates(), [one, two]);
        assert!(
            identity.sought().ends_with("/servos*"),
            "{}",
            identity.sought()
        );
    }

    #[test]
    fn a_usb_port_is_looked_for_by_its_serial_number() {
        let identity = Identity {
            path: "/dev/ttyUSB0".into(),
            usb: Some(UsbIdentity {
                vendor: 0x0403,
                product: 0x6014,
                serial: Some("FT6S4DSP".into()),
            }),
        };
        assert_eq!(
            identity.sought(),
            "a USB adapter with serial number FT6S4DSP"
        );
        assert!(
            identity.candidates().is_empty(),
            "{:?}: another adapter was taken for it",
            identity.candidates()
        );
    }

    #[test]
    fn a_latency_timer_is_set_to_one_or_reported_with_the_command() {
        let folder = tempfile::tempdir().expect("a folder");
        let timer = folder.path().join("latency_timer");
        fs::write(&timer, "16\n").expect("a file");
        assert_eq!(lower(&timer), Some(SHORT), "it may be written");
        assert_eq!(fs::read_to_string(&timer).expect("the file"), "1");
        fs::write(&timer, "?").expect("a file");
        assert_eq!(lower(&timer), None, "no number");
        assert_eq!(
            latency_note("/dev/ttyUSB0", Some(SHORT)),
            None,
            "nothing to tell"
        );
        let note = latency_note("/dev/ttyUSB0", Some(Duration::from_millis(16)));
        let note = note.expect("16 ms are worth a word");
        for part in [
            "up to 16 ms",
            "about 56 cycles a second",
            "sudo tee /sys/class/tty/ttyUSB0/device/latency_timer",
            "ATTR{latency_timer}=\"1\"",
        ] {
            assert!(note.contains(part), "{part} is not in: {note}");
        }
    }
}
