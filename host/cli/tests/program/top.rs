//! `mgw top` in a pseudo terminal, a simulated gateway at another one. What went over the buses is
//! what the simulator says.

use std::fs::File;
use std::io::{Read, Write};
use std::process::{Child, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, TryRecvError, channel};
use std::sync::{Arc, Mutex};
use std::time::Instant;

use host_protocol::Setpoint;
use mgw_client::Client;
use mgw_sim::SimTransport;
use nix::fcntl::{FcntlArg, FdFlag, fcntl};
use nix::pty::{Winsize, openpty};
use nix::sys::signal::{self, Signal};
use nix::sys::termios::{SetArg, Termios, tcgetattr, tcsetattr};
use nix::sys::wait::{WaitPidFlag, WaitStatus, waitpid};
use nix::unistd::Pid;
use serialport::TTYPort;

use crate::device::{Device, LINK, LOOK_EVERY, OTHER_LINK, read, simulated};
use crate::support::{LIMIT, Process, Sim, command, mgw};

const WIDTH: u16 = 80;
/// High enough for the events of four axes that are told at once.
const HEIGHT: u16 = 40;

/// RMD V3.6 §2.16
const RMD_STOP: &str = "0 141#8100000000000000";

/// What the other end of the device is asked for.
enum Ask {
    /// Another host moves axis 0, and says nothing more.
    Move,
    /// From now on the program hears nothing more of the gateway, or hears it again.
    Mute(bool),
    /// It hears nothing more from the answer to its next stop on.
    MuteBehindStop,
    /// The frames that have been on the buses since the last time.
    Frames(Sender<Vec<String>>),
}

/// The frames that have been on the buses since the last time.
fn frames(device: &Device<Ask, ()>) -> Vec<String> {
    let (told, heard) = channel();
    device.ask(Ask::Frames(told));
    heard.recv_timeout(LIMIT).expect("it runs")
}

fn serve(mut device: TTYPort, asked: &Receiver<Ask>) {
    let world = simulated(&[]);
    let (begin, start) = (world.borrow().now(), Instant::now());
    let (mut frames, mut mute, mut mute_behind_stop) = (Vec::new(), false, false);
    loop {
        match asked.try_recv() {
            Ok(Ask::Move) => {
                let mut client = Client::connect(SimTransport::new(world.clone(), OTHER_LINK))
                    .expect("it answers");
                let epoch = client.arm(0).expect("it arms").epoch;
                let setpoint = Setpoint::Velocity { velocity_rad_s: 2.0 };
                let ttl = client.axis_ttl(0).expect("it has one") / 2;
                client.set(0, epoch, setpoint, ttl).expect("it moves");
            }
            Ok(Ask::Mute(is_mute)) => mute = is_mute,
            Ok(Ask::MuteBehindStop) => mute_behind_stop = true,
            Ok(Ask::Frames(told)) => told.send(std::mem::take(&mut frames)).expect("it waits"),
            Err(TryRecvError::Empty) => {}
            Err(TryRecvError::Disconnected) => return,
        }
        let bytes = read(&mut device);
        let elapsed = u64::try_from(start.elapsed().as_micros()).expect("not so long");
        let mut world = world.borrow_mut();
        world.host_send(LINK, &bytes);
        world.run_until(begin + gateway::Duration::from_micros(elapsed));
        let answers = world.host_receive(LINK);
        if !mute {
            device.write_all(&answers).expect("it is read");
        }
        let begin = frames.len();
        frames.extend(world.trace().iter().map(|entry| format!("{} {}", entry.bus, entry.wire)));
        if mute_behind_stop && frames[begin..].iter().any(|frame: &String| frame == RMD_STOP) {
            (mute, mute_behind_stop) = (true, false);
        }
    }
}

/// What a terminal shows of what is written to it: text, and where the cursor is put.
struct Shown {
    rows: Vec<Vec<char>>,
    row: usize,
    column: usize,
    /// The beginning of an escape sequence that goes on.
    escape: Option<String>,
    /// Bytes of a character that goes on.
    partial: Vec<u8>,
    /// Everything.
    raw: Vec<u8>,
}

impl Shown {
    fn new() -> Self {
        let rows = vec![vec![' '; usize::from(WIDTH)]; usize::from(HEIGHT)];
        Self { rows, row: 0, column: 0, escape: None, partial: Vec::new(), raw: Vec::new() }
    }

    fn take(&mut self, bytes: &[u8]) {
        self.raw.extend(bytes);
        self.partial.extend(bytes);
        let text = match std::str::from_utf8(&self.partial) {
            Ok(text) => text.to_owned(),
            Err(error) => String::from_utf8_lossy(&self.partial[..error.valid_up_to()]).into(),
        };
        self.partial.drain(..text.len());
        text.chars().for_each(|character| self.put(character));
    }

    fn put(&mut self, character: char) {
        match (&mut self.escape, character) {
            (None, '\u{1b}') => self.escape = Some(String::new()),
            (None, '\r') => self.column = 0,
            (None, '\n') => self.row += 1,
            (None, character) => {
                let cell = self.rows.get_mut(self.row).and_then(|row| row.get_mut(self.column));
                // What is printed after the screen is given back stands elsewhere.
                if let Some(cell) = cell {
                    *cell = character;
                }
                self.column += 1;
            }
            (Some(escape), character) => {
                escape.push(character);
                let is_end = character.is_ascii_alphabetic() || character == '~';
                if is_end && let Some(sequence) = self.escape.take() {
                    self.obey(&sequence);
                }
            }
        }
    }

    fn obey(&mut self, sequence: &str) {
        let Some(inner) = sequence.strip_prefix('[') else { return };
        if let Some(place) = inner.strip_suffix('H') {
            let mut numbers = place.split(';').map(|text| text.parse::<usize>().unwrap_or(1));
            self.row = numbers.next().unwrap_or(1) - 1;
            self.column = numbers.next().unwrap_or(1) - 1;
        } else if inner == "2J" {
            self.rows.iter_mut().flatten().for_each(|cell| *cell = ' ');
        }
    }

    fn text(&self) -> String {
        let lines = self.rows.iter().map(|row| row.iter().collect::<String>());
        lines.map(|line| line.trim_end().to_owned()).collect::<Vec<_>>().join("\n")
    }
}

/// `mgw top` in a terminal of its own.
struct Top {
    keys: File,
    /// The program's side, to see how the terminal is set.
    terminal: File,
    before: Termios,
    shown: Arc<Mutex<Shown>>,
    /// Nobody reads the screen any more.
    hung_up: Arc<AtomicBool>,
    program: Child,
}

impl Top {
    fn start(port: &str) -> Self {
        let size = Winsize { ws_row: HEIGHT, ws_col: WIDTH, ws_xpixel: 0, ws_ypixel: 0 };
        let pty = openpty(Some(&size), None).expect("a pseudo terminal");
        // Or the program kept its own terminal from going away.
        fcntl(&pty.master, FcntlArg::F_SETFD(FdFlag::FD_CLOEXEC)).expect("it is open");
        let terminal = File::from(pty.slave);
        let before = tcgetattr(&terminal).expect("it is a terminal");
        let side = || Stdio::from(terminal.try_clone().expect("once more"));
        let mut command = command(&["--port", port, "top"]);
        command.env("TERM", "xterm").env("NO_COLOR", "1");
        command.stdin(side()).stdout(side()).stderr(side());
        let program = command.spawn().expect("it starts");
        let keys = File::from(pty.master);
        let mut output = keys.try_clone().expect("once more");
        let shown = Arc::new(Mutex::new(Shown::new()));
        let screen = shown.clone();
        let hung_up = Arc::new(AtomicBool::new(false));
        let ends = hung_up.clone();
        std::thread::spawn(move || {
            let mut buffer = [0; 4096];
            while !ends.load(Ordering::Relaxed)
                && let Ok(count @ 1..) = output.read(&mut buffer)
            {
                screen.lock().expect("nobody panicked").take(&buffer[..count]);
            }
        });
        Self { keys, terminal, before, shown, hung_up, program }
    }

    /// One that shows an axis. A gateway that this machine holds up is not there to it.
    fn ready(port: &str) -> Self {
        let end = Instant::now() + LIMIT;
        loop {
            let mut top = Self::start(port);
            let has_ended = |top: &mut Self| top.program.try_wait().expect("it was started");
            while has_ended(&mut top).is_none() {
                if top.screen().contains(">   0") {
                    return top;
                }
                assert!(Instant::now() < end, "never the axes:\n{}", top.screen());
                std::thread::sleep(LOOK_EVERY);
            }
            let screen = top.screen();
            assert!(screen.contains("no gateway answered") && Instant::now() < end, "{screen}");
        }
    }

    /// Presses a key until the screen is so: it may say that this machine has held something up.
    fn press_until(&mut self, keys: &str, what: &str, is: impl Fn(&str) -> bool) -> String {
        let end = Instant::now() + LIMIT;
        loop {
            self.press(keys);
            let again = Instant::now() + LIMIT / 6;
            while Instant::now() < again {
                let screen = self.screen();
                if is(&screen) {
                    return screen;
                }
                assert!(Instant::now() < end, "never {what}:\n{screen}");
                std::thread::sleep(LOOK_EVERY);
            }
        }
    }

    fn press(&mut self, key: &str) {
        self.keys.write_all(key.as_bytes()).expect("it is read");
    }

    fn screen(&self) -> String {
        self.shown.lock().expect("nobody panicked").text()
    }

    /// Until the screen is so; it.
    fn wait_for(&self, what: &str, is: impl Fn(&str) -> bool) -> String {
        let end = Instant::now() + LIMIT;
        loop {
            let screen = self.screen();
            if is(&screen) {
                return screen;
            }
            assert!(Instant::now() < end, "never {what}:\n{screen}");
            std::thread::sleep(LOOK_EVERY);
        }
    }

    /// Its terminal goes away, as a window that is closed; the exit code.
    fn hang_up(mut self) -> Option<i32> {
        self.hung_up.store(true, Ordering::Relaxed);
        self.keys = File::open("/dev/null").expect("it is there");
        self.exit_code()
    }

    fn exit_code(&mut self) -> Option<i32> {
        let end = Instant::now() + LIMIT;
        loop {
            if let Some(status) = self.program.try_wait().expect("it was started") {
                return status.code();
            }
            assert!(Instant::now() < end, "it does not end:\n{}", self.screen());
            std::thread::sleep(LOOK_EVERY);
        }
    }

    /// The exit code; the terminal is as it was before.
    fn end(mut self) -> Option<i32> {
        let code = self.exit_code();
        let end = Instant::now() + LIMIT;
        assert_eq!(tcgetattr(&self.terminal).expect("it is a terminal"), self.before);
        let left = "\u{1b}[?1049l";
        let is_left = |top: &Self| {
            let shown = top.shown.lock().expect("nobody panicked");
            let raw = String::from_utf8_lossy(&shown.raw).into_owned();
            raw.rfind(left).is_some_and(|at| raw[at..].contains("\u{1b}[?25h"))
        };
        while !is_left(&self) {
            assert!(Instant::now() < end, "the terminal is not given back");
            std::thread::sleep(LOOK_EVERY);
        }
        code
    }
}

fn is_all_confirmed(screen: &str) -> bool {
    (0..4).all(|axis| screen.contains(&format!("axis {axis}: stop confirmed, ")))
}

impl Drop for Top {
    fn drop(&mut self) {
        let _ = self.program.kill();
        let _ = self.program.wait();
    }
}

#[test]
fn it_ends_without_a_panic_when_its_terminal_goes_away() {
    let device = Device::open(serve);
    let top = Top::ready(&device.name);
    let code = top.hang_up();
    assert!(matches!(code, Some(0 | 1)), "{code:?}");
}

#[test]
fn an_axis_that_trips_is_shown_and_the_stop_key_stops_everything() {
    let device = Device::open(serve);
    let mut top = Top::start(&device.name);
    top.wait_for("all axes", |screen| {
        [">   0", "    1", "    2", "    3"].iter().all(|axis| screen.contains(axis))
            && screen.contains("bit/s")
    });
    // Without a key it only asks.
    let sent = frames(&device);
    let stops = |frames: &[String]| {
        frames.iter().filter(|frame| frame.contains("141#81") || frame.contains("141#A2")).count()
    };
    assert_eq!(stops(&sent), 0, "{sent:?}");
    device.ask(Ask::Move);
    let screen = top.wait_for("tripped", |screen| {
        screen.contains("TRIPPED") && screen.contains("      stop confirmed: ")
    });
    assert!(
        screen.contains("[E-setpoint-expired]") || screen.contains("[E-host-silent]"),
        "{screen}"
    );
    // The other host has gone, which ends its authority.
    top.wait_for("nobody in command", |screen| screen.contains("command: nobody"));
    // Its trip is cleared after a yes, and not without.
    top.press("c");
    top.wait_for("asked", |screen| screen.contains("clear the trip of axis 0? It stays disarmed"));
    top.press("n");
    top.wait_for("not asked", |screen| !screen.contains("clear the trip"));
    assert!(top.screen().contains("TRIPPED"), "{}", top.screen());
    top.press_until("cy", "cleared", |screen| {
        screen.contains("axis 0 is cleared") && !screen.contains("TRIPPED")
    });
    frames(&device);
    top.press_until(" ", "confirmed", is_all_confirmed);
    // RMD V3.6 §2.16 on CAN and on RS485, the thruster's TC 0, the D5's speed 0.
    let sent = frames(&device);
    for stop in [
        RMD_STOP,
        "0 30B#5443000000000000",
        "1 00B#D50B050320000033",
        "2 3E0108810000000000000032A5",
    ] {
        assert!(sent.iter().any(|frame| frame == stop), "{stop}: {sent:?}");
    }
    top.press("q");
    assert_eq!(top.end(), Some(0));
}

#[test]
fn the_stop_key_waits_for_no_answer() {
    let device = Device::open(serve);
    let mut top = Top::ready(&device.name);
    device.ask(Ask::Mute(true));
    frames(&device);
    // Whatever it has asked stays unanswered.
    top.press(" ");
    let end = Instant::now() + LIMIT;
    let mut sent = Vec::new();
    while !sent.iter().any(|frame| frame == RMD_STOP) {
        assert!(Instant::now() < end, "no stop: {sent:?}\n{}", top.screen());
        sent.extend(frames(&device));
        std::thread::sleep(LOOK_EVERY);
    }
    top.wait_for("kept", |screen| screen.contains("the stop is sent again until it is answered"));
    device.ask(Ask::Mute(false));
    top.wait_for("confirmed", is_all_confirmed);
    top.press("q");
    assert_eq!(top.end(), Some(0));
}

/// The stop is answered, and what is asked next is not, for longer than an answer takes.
#[test]
fn what_a_stop_came_to_is_asked_until_a_slow_gateway_answers() {
    let device = Device::open(serve);
    let mut top = Top::ready(&device.name);
    device.ask(Ask::MuteBehindStop);
    top.press(" ");
    top.wait_for("slow", |screen| screen.contains("what the stop came to is asked again"));
    device.ask(Ask::Mute(false));
    top.wait_for("confirmed", is_all_confirmed);
    top.press("q");
    assert_eq!(top.end(), Some(0));
}

#[test]
fn a_signal_ends_it_and_gives_the_terminal_back() {
    let device = Device::open(serve);
    for signal in [Signal::SIGTERM, Signal::SIGINT, Signal::SIGHUP] {
        let top = Top::ready(&device.name);
        signal::kill(Pid::from_raw(top.program.id().cast_signed()), signal).expect("it runs");
        assert_eq!(top.end(), Some(0), "{signal}");
    }
    let mut top = Top::ready(&device.name);
    top.press("\u{3}");
    assert_eq!(top.end(), Some(0), "Ctrl-C as a key");
}

#[test]
fn after_a_suspension_the_terminal_is_taken_again_and_the_stop_key_stops() {
    let device = Device::open(serve);
    for suspended in [Signal::SIGTSTP, Signal::SIGSTOP] {
        let mut top = Top::ready(&device.name);
        let raw = tcgetattr(&top.terminal).expect("it is a terminal");
        let id = Pid::from_raw(top.program.id().cast_signed());
        signal::kill(id, suspended).expect("it runs");
        let flags = WaitPidFlag::WUNTRACED;
        let stopped = waitpid(id, Some(flags)).expect("it is a child");
        assert!(matches!(stopped, WaitStatus::Stopped(..)), "{stopped:?}");
        // As a shell leaves it.
        tcsetattr(&top.terminal, SetArg::TCSANOW, &top.before).expect("it is a terminal");
        signal::kill(id, Signal::SIGCONT).expect("it is there");
        let end = Instant::now() + LIMIT;
        while tcgetattr(&top.terminal).expect("it is a terminal") != raw {
            assert!(Instant::now() < end, "{suspended}: keys wait for Enter");
            std::thread::sleep(LOOK_EVERY);
        }
        frames(&device);
        top.press_until(" ", "confirmed", is_all_confirmed);
        top.press("q");
        assert_eq!(top.end(), Some(0));
    }
}

#[test]
fn a_gateway_that_is_gone_is_connected_to_again_and_a_stop_asked_for_meanwhile_goes_out() {
    let mut sim = Sim::start();
    let mut top = Top::ready(&sim.port);
    sim.process.kill();
    top.wait_for("lost", |screen| screen.contains("NOT CONNECTED, connecting again: "));
    top.press(" ");
    top.wait_for("kept", |screen| screen.contains("the stop is sent again until it is answered"));
    let address = sim.port.strip_prefix("tcp:").expect("a TCP port");
    let _again = Process::start(&["sim", "--listen", address]);
    top.wait_for("confirmed", |screen| {
        is_all_confirmed(screen)
            && screen.contains("mgw: connected again")
            && !screen.contains("NOT CONNECTED")
    });
    top.press("q");
    assert_eq!(top.end(), Some(0));
}

#[test]
fn a_stop_that_nobody_confirmed_is_the_end_of_it_too() {
    let mut sim = Sim::start();
    let mut top = Top::ready(&sim.port);
    sim.process.kill();
    top.press(" ");
    top.wait_for("kept", |screen| screen.contains("the stop is sent again until it is answered"));
    top.press("q");
    // As of `mgw stop`: it was written and not answered, or could not be written.
    let code = top.end();
    assert!(matches!(code, Some(1 | 3)), "{code:?}");
}

#[test]
fn where_there_is_no_terminal_it_says_what_to_use_instead() {
    let text = mgw(&["top"]).failure(2);
    assert!(text.contains("standard output is none; `mgw watch` prints"), "{text}");
    let text = mgw(&["--json", "top"]).failure(2);
    assert!(text.contains("has no JSON") && text.contains("`mgw state`"), "{text}");
}
