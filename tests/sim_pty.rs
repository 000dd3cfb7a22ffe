//! Simulated servos on a pseudo-terminal in real time, judged by an independent client.

use dynamixel2::instructions::SyncWriteData;
use handwave::base::Clock;
use handwave::live::RealClock;
use handwave::sim::line::SharedLine;
use handwave::sim::models::XL430_W250;
use handwave::sim::{Line, LineOptions, PtyServer};
use handwave_dynamixel::instruction::{Instruction, SyncRead};
use handwave_dynamixel::{BROADCAST_ID, fast, lists};
use std::os::fd::AsFd;
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

type Bus = dynamixel2::Bus<Vec<u8>, Vec<u8>>;

/// Real time is shared: one simulated wire at a time.
static WIRE: Mutex<()> = Mutex::new(());

/// A server in a thread, its link in a directory of its own.
struct Served {
    link: PathBuf,
    stop: Option<UnixStream>,
    thread: Option<JoinHandle<()>>,
    _directory: tempfile::TempDir,
    _alone: MutexGuard<'static, ()>,
}

impl Served {
    fn new(servos: u8, paced: bool, faults: &[&str]) -> Self {
        // A test that failed while it held the wire spoils nothing for the next.
        let alone = WIRE.lock().unwrap_or_else(PoisonError::into_inner);
        let options = LineOptions {
            paced,
            ..LineOptions::default()
        };
        let mut line =
            Line::commissioned(&XL430_W250, 1..=servos, 1_000_000, options).expect("a known rate");
        for fault in faults {
            let fault = fault.parse().expect("a good specification");
            line.inject(fault).expect("a servo of the line");
        }
        let line = SharedLine::new(line);
        let directory = tempfile::tempdir().expect("a directory");
        let link = directory.path().join("servos");
        let clock: Arc<dyn Clock> = Arc::new(RealClock::new());
        let mut server = PtyServer::open(line, clock, &link, 1_000_000).expect("a pseudo-terminal");
        let (stop, stopped) = UnixStream::pair().expect("a pair of sockets");
        let thread = std::thread::spawn(move || {
            server.serve(stopped.as_fd()).expect("served to the end");
        });
        Self {
            link,
            stop: Some(stop),
            thread: Some(thread),
            _directory: directory,
            _alone: alone,
        }
    }

    fn client(&self) -> Bus {
        self.client_at(1_000_000)
    }

    fn client_at(&self, baud: u32) -> Bus {
        let port = serial2::SerialPort::open(&self.link, baud).expect("the link opens");
        Bus::with_buffers(port, vec![0; 1024], vec![0; 1024]).expect("a bus")
    }

    fn end(&mut self) {
        self.stop = None;
        if let Some(thread) = self.thread.take() {
            thread.join().expect("the server did not panic");
        }
    }
}

impl Drop for Served {
    fn drop(&mut self) {
        self.stop = None;
    }
}

fn wait_until(what: &str, condition: impl Fn() -> bool) {
    let deadline = Instant::now() + Duration::from_secs(5);
    while !condition() {
        assert!(Instant::now() < deadline, "{what}: not within 5 s");
        std::thread::yield_now();
    }
}

/// Asks until there is an answer: a busy machine may keep the simulator from its turn for longer than
/// the client waits.
fn insist<T, E: std::fmt::Debug>(what: &str, mut ask: impl FnMut() -> Result<T, E>) -> T {
    let deadline = Instant::now() + Duration::from_secs(5);
    loop {
        match ask() {
            Ok(answer) => return answer,
            Err(error) => assert!(Instant::now() < deadline, "{what}: {error:?}"),
        }
    }
}

#[test]
fn something_else_in_the_place_of_the_link_is_left_alone() {
    let directory = tempfile::tempdir().expect("a directory");
    let link = directory.path().join("servos");
    std::fs::write(&link, "precious").expect("a file");
    let line = SharedLine::new(Line::new(LineOptions::default()));
    let clock: Arc<dyn Clock> = Arc::new(RealClock::new());
    let refused = PtyServer::open(line, clock, &link, 1_000_000).err();
    let message = refused.expect("refused").to_string();
    assert!(message.contains("no symbolic link"), "{message}");
    assert_eq!(
        std::fs::read_to_string(&link).expect("still there"),
        "precious"
    );
}

#[test]
fn an_independent_client_pings_reads_and_writes() {
    let mut served = Served::new(12, true, &[]);
    let mut bus = served.client();
    for id in [1, 7, 12] {
        let ping = insist("a ping", || bus.ping(id));
        assert_eq!((ping.motor_id, ping.data.model), (id, 1060));
    }
    insist("a scan finds all", || {
        let found = bus.scan().expect("a scan").into_iter().flatten().count();
        if found == 12 { Ok(()) } else { Err(found) }
    });
    let at = insist("a position", || bus.read_u32(3, 132));
    assert_eq!(at.data, 2048);
    insist("torque on", || bus.write_u8(3, 64, 1));
    insist("a goal", || bus.write_u32(3, 116, 2100));
    assert_eq!(insist("the goal", || bus.read_u32(3, 116)).data, 2100);
    assert!(bus.write_u8(3, 64, 9).is_err(), "out of range");
    let deadline = Instant::now() + Duration::from_secs(5);
    loop {
        let position = insist("a position", || bus.read_u32(3, 132)).data;
        if position.abs_diff(2100) < 5 {
            break;
        }
        assert!(Instant::now() < deadline, "still at {position} after 5 s");
    }
    drop(bus);
    served.end();
    assert!(!served.link.is_symlink(), "the link is removed at the end");
}

#[test]
fn an_independent_client_talks_to_twelve_at_once() {
    let served = Served::new(12, true, &[]);
    let mut bus = served.client();
    let ids: Vec<u8> = (1..=12).collect();
    let goals = ids.iter().map(|&motor_id| SyncWriteData {
        motor_id,
        data: 2000 + u32::from(motor_id),
    });
    bus.sync_write_u32(116, goals).expect("sent");
    let expected: Vec<_> = ids.iter().map(|&id| (id, 2000 + u32::from(id))).collect();
    insist("a sync read of all", || {
        let mut seen = Vec::new();
        bus.sync_read_u32_cb(&ids, 116, |answer| {
            seen.extend(answer.map(|answer| (answer.motor_id, answer.data)));
        })
        .expect("asked");
        if seen == expected { Ok(()) } else { Err(seen) }
    });
    // Its own bulk read (0.9.1) writes the entries over each other, so the entries are written here.
    let asked: [(u8, u16, u16); 3] = [(2, 116, 4), (9, 7, 1), (12, 0, 2)];
    let answers = insist("a bulk read", || {
        bus.write_instruction(0xFE, 0x92, 15, |buffer| {
            for (entry, (id, address, count)) in buffer.chunks_exact_mut(5).zip(asked) {
                entry[0] = id;
                entry[1..3].copy_from_slice(&address.to_le_bytes());
                entry[3..5].copy_from_slice(&count.to_le_bytes());
            }
        })
        .expect("sent");
        asked
            .map(|(_, _, count)| {
                let status = bus.read_status_response(count)?;
                Ok((status.packet_id(), status.parameters().to_vec()))
            })
            .into_iter()
            .collect::<Result<Vec<_>, dynamixel2::ReadError>>()
    });
    let expected = [(2, vec![0xD2, 7, 0, 0]), (9, vec![9]), (12, vec![0x24, 4])];
    assert_eq!(answers, expected);
}

#[test]
fn a_client_at_another_rate_hears_nothing_and_the_next_client_is_served() {
    let served = Served::new(1, true, &[]);
    {
        let mut wrong = served.client_at(57_600);
        assert!(wrong.ping(1).is_err(), "57,600 to a servo at 1,000,000");
    }
    for _ in 0..3 {
        let mut bus = served.client();
        insist("a new client is served", || bus.ping(1));
        // Leaves with an answer unread: it must not greet the next client.
        bus.write_instruction(1, 1, 0, |_| ()).expect("sent");
        let left = Instant::now();
        wait_until("the answer arrives", || left.elapsed().as_millis() > 5);
    }
}

#[test]
fn an_unplugged_adapter_takes_the_port_away_and_brings_it_back() {
    let served = Served::new(1, true, &["bus:unplugged@0.3s..0.6s"]);
    let mut bus = served.client();
    let _before_or_after = bus.ping(1);
    let old = std::fs::read_link(&served.link).expect("linked");
    wait_until("the link goes", || !served.link.is_symlink());
    assert!(bus.ping(1).is_err(), "the old port is dead");
    wait_until("the link comes back", || served.link.is_symlink());
    let mut bus = served.client();
    insist("the new port answers", || bus.ping(1));
    println!("after {}", old.display());
}

/// Times of `count` cycles of sync write and fast sync read with all twelve, microseconds.
fn cycle_times(link: &Path, count: usize) -> Vec<f64> {
    let port = serial2::SerialPort::open(link, 1_000_000).expect("the link opens");
    let ids: Vec<u8> = (1..=12).collect();
    let (mut goals, mut ask, mut heard) = ([0; 256], [0; 64], [0; 256]);
    let items = ids.iter().map(|id| (*id, 2048u32.to_le_bytes()));
    let goals = lists::encode_sync_write(&mut goals, 116, 4, items).expect("room");
    let ask = Instruction::FastSyncRead(SyncRead {
        address: 126,
        length: 10,
        ids: &ids,
    })
    .encode(BROADCAST_ID, &mut ask)
    .expect("room")
    .to_vec();
    let mut times = Vec::with_capacity(count);
    for _ in 0..count {
        let start = Instant::now();
        port.write_all(goals).expect("sent");
        port.write_all(&ask).expect("sent");
        let mut got = 0;
        while got < 176 {
            got += port.read(&mut heard[got..]).expect("an answer in time");
        }
        times.push(start.elapsed().as_secs_f64() * 1e6);
        assert_eq!(fast::find_prefix(&heard[..got], 168), Some(0));
    }
    times.sort_by(f64::total_cmp);
    times
}

#[test]
fn a_paced_cycle_takes_the_time_of_its_bytes_and_an_unpaced_one_less() {
    let served = Served::new(12, true, &[]);
    let times = cycle_times(&served.link, 200);
    let (min, p50) = (times[0], times[100]);
    println!(
        "paced: min {min:.0} us, p50 {p50:.0} us, p99 {:.0} us",
        times[198]
    );
    assert!(min >= 2759.0, "{min:.0} us, the bytes alone take 2760 us");
    // Generous, as other work may share the machine; alone it is 2760 us and some 50 us.
    assert!(p50 < 4000.0, "p50 {p50:.0} us");
    drop(served);
    let served = Served::new(12, false, &[]);
    let times = cycle_times(&served.link, 200);
    let p50 = times[100];
    println!("unpaced: min {:.0} us, p50 {p50:.0} us", times[0]);
    assert!(p50 < 2760.0, "p50 {p50:.0} us");
}
