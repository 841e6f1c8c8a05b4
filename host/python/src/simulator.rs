//! A simulated gateway with its motors in this process: in virtual time, which passes while calls
//! wait, or in real time behind a TCP port.

use std::io;
use std::net::TcpListener;
use std::process;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use host_protocol::Protocol;
use mgw_client::Transport;
use mgw_sim::{BOARD, MotorWiring, Server, SharedWorld, SimTransport, Wiring, World, put_fault};
use pyo3::exceptions::{PyOSError, PyRuntimeError};
use pyo3::prelude::*;
use serde_json::{Value, json};

use crate::json::to_python;
use crate::problem::usage;
use crate::session::{Session, seconds};

/// Longest pause of a served world.
const TURN: Duration = Duration::from_micros(200);
/// Virtual time between two looks at Python's signals.
const STEP: Duration = Duration::from_millis(500);
/// Where the listener of a simulation in real time is.
const LOOPBACK: &str = "127.0.0.1:0";

/// What is done with a world on its own thread.
type Task = Box<dyn FnOnce(&mut World) + Send>;

/// Bus, protocol, node and, where it is not the usual one, bitrate of a motor.
type Wired = (u8, String, u8, Option<u32>);

enum Time {
    /// It passes when somebody waits.
    Virtual { world: Arc<Mutex<World>>, links: Arc<Mutex<Vec<bool>>> },
    /// It passes by itself.
    Real {
        port: String,
        tasks: Sender<Task>,
        ends: Arc<AtomicBool>,
        thread: Option<JoinHandle<()>>,
    },
}

/// A simulated gateway.
#[pyclass(frozen, module = "motor_gateway._native")]
pub struct Simulation {
    time: Time,
    process: u32,
}

/// A host link of a virtual world, free again when the session ends.
struct Lease {
    transport: SimTransport<Arc<Mutex<World>>>,
    link: u8,
    links: Arc<Mutex<Vec<bool>>>,
}

impl Drop for Lease {
    fn drop(&mut self) {
        let mut links = self.links.lock().unwrap_or_else(PoisonError::into_inner);
        links.get_mut(usize::from(self.link)).into_iter().for_each(|taken| *taken = false);
    }
}

impl Transport for Lease {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.transport.send(bytes)
    }

    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize> {
        self.transport.receive(buffer, timeout)
    }

    fn now(&self) -> Duration {
        self.transport.now()
    }

    fn sleep(&mut self, duration: Duration) {
        self.transport.sleep(duration);
    }

    fn reconnect(&mut self) -> io::Result<()> {
        self.transport.reconnect()
    }

    fn set_baud(&mut self, baud: u32) -> io::Result<()> {
        self.transport.set_baud(baud)
    }
}

#[pymethods]
impl Simulation {
    /// Without `motors` it has four.
    #[new]
    fn new(motors: Option<Vec<Wired>>, real_time: bool, seed: u64) -> PyResult<Self> {
        let mut wiring = match motors {
            None => Wiring::four_motors(),
            Some(motors) => wired(motors)?,
        };
        wiring.seed = seed;
        let world = World::try_new(wiring).map_err(|error| usage(&error.to_string()))?;
        let time = if real_time { serve(world)? } else { share(world) };
        Ok(Self { time, process: process::id() })
    }

    /// The name of its port, in real time.
    #[getter]
    fn port(&self) -> Option<&str> {
        match &self.time {
            Time::Virtual { .. } => None,
            Time::Real { port, .. } => Some(port),
        }
    }

    /// A session with it.
    fn connect(&self, py: Python<'_>) -> PyResult<Session> {
        self.check_process()?;
        let transport: Box<dyn Transport + Send> = match &self.time {
            Time::Real { port, .. } => {
                mgw_client::open(port).map_err(|error| PyOSError::new_err(error.to_string()))?
            }
            Time::Virtual { world, links } => {
                let mut taken = links.lock().unwrap_or_else(PoisonError::into_inner);
                let free = taken.iter().position(|taken| !taken).ok_or_else(|| {
                    let text = "all host links of the simulation are taken; close a session first";
                    PyRuntimeError::new_err(text)
                })?;
                taken[free] = true;
                let link = u8::try_from(free).unwrap_or(u8::MAX);
                world.with(|world| world.host_reset(link));
                let transport = SimTransport::new(world.clone(), link);
                Box::new(Lease { transport, link, links: links.clone() })
            }
        };
        Session::open(py, transport)
    }

    /// Lets virtual time pass in which no host says anything.
    fn advance(&self, py: Python<'_>, duration_s: f64) -> PyResult<()> {
        self.check_process()?;
        let Time::Virtual { world, .. } = &self.time else {
            let text = "real time passes by itself; advance() is for virtual time";
            return Err(PyRuntimeError::new_err(text));
        };
        let mut left = seconds(duration_s)?;
        while !left.is_zero() {
            let step = left.min(STEP);
            py.detach(|| world.with(|world| world.run_for(step)));
            left -= step;
            py.check_signals()?;
        }
        Ok(())
    }

    /// Time since it began, s.
    fn now(&self, py: Python<'_>) -> PyResult<f64> {
        let now_us = self.with(py, |world| world.now().as_micros())?;
        Ok(Duration::from_micros(now_us).as_secs_f64())
    }

    /// Does what a line typed into `mgw sim` does, and returns that in words.
    fn fault(&self, py: Python<'_>, line: String) -> PyResult<String> {
        let done = self.with(py, move |world| put_fault(world, &line))?;
        done.map_err(|text| usage(&text))
    }

    /// What the motors do and have logged, without the gateway.
    fn motors<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let motors = self.with(py, |world| {
            let log = |motor: &mgw_sim::Motor| -> Value {
                let entries = motor.log().entries();
                entries.map(|entry| json!([entry.time_us, entry.what.to_string()])).collect()
            };
            let motor = |motor: &mgw_sim::Motor| {
                json!({
                    "bus": motor.bus(), "protocol": motor.protocol().name(), "node": motor.node(),
                    "velocity_rad_s": motor.speed_rad_s(), "position_rad": motor.position_rad(),
                    "current_a": motor.current_a(), "faults_raw": motor.fault_word(),
                    "log": log(motor),
                })
            };
            world.motors().iter().map(motor).collect::<Value>()
        })?;
        to_python(py, &motors)
    }
}

impl Simulation {
    fn with<R: Send + 'static>(
        &self,
        py: Python<'_>,
        act: impl FnOnce(&mut World) -> R + Send + 'static,
    ) -> PyResult<R> {
        self.check_process()?;
        match &self.time {
            Time::Virtual { world, .. } => Ok(py.detach(|| world.with(act))),
            Time::Real { tasks, .. } => {
                let (done, result) = channel();
                let task: Task = Box::new(move |world| drop(done.send(act(world))));
                let sent = tasks.send(task).is_ok();
                let result = py.detach(move || sent.then(|| result.recv().ok()).flatten());
                result.ok_or_else(|| PyRuntimeError::new_err("the simulation has ended"))
            }
        }
    }

    fn check_process(&self) -> PyResult<()> {
        if self.process == process::id() {
            return Ok(());
        }
        let text = "this simulation belongs to the process that made it; make one after a fork";
        Err(PyRuntimeError::new_err(text))
    }
}

impl Drop for Simulation {
    fn drop(&mut self) {
        let Time::Real { ends, thread, .. } = &mut self.time else { return };
        ends.store(true, Ordering::Release);
        // After a fork there is no such thread here.
        if self.process == process::id() {
            let _ = thread.take().map(JoinHandle::join);
        } else {
            std::mem::forget(thread.take());
        }
    }
}

fn wired(motors: Vec<Wired>) -> PyResult<Wiring> {
    let mut wiring = Wiring::on(&BOARD);
    for (bus, protocol, node, bitrate) in motors {
        let known = Protocol::from_name(&protocol).ok_or_else(|| {
            let names: Vec<&str> = Protocol::ALL.iter().map(|known| known.name()).collect();
            let text = format!("`{protocol}` is no protocol; there are {}", names.join(", "));
            usage(&text)
        })?;
        wiring = wiring.with(bus, known, node);
        if let (Some(MotorWiring { bitrate: usual, .. }), Some(bitrate)) =
            (wiring.motors.last_mut(), bitrate)
        {
            *usual = bitrate;
        }
    }
    Ok(wiring)
}

fn share(world: World) -> Time {
    let links = vec![false; usize::from(world.host_links())];
    Time::Virtual { world: Arc::new(Mutex::new(world)), links: Arc::new(Mutex::new(links)) }
}

fn serve(world: World) -> PyResult<Time> {
    let listener = TcpListener::bind(LOOPBACK)?;
    let port = format!("tcp:{}", listener.local_addr()?);
    let mut server = Server::new(listener, world)?;
    let (tasks, to_do) = channel::<Task>();
    let ends = Arc::new(AtomicBool::new(false));
    let over = ends.clone();
    let thread = thread::Builder::new().name("mgw simulation".to_owned()).spawn(move || {
        let start = Instant::now();
        while !over.load(Ordering::Acquire) {
            // Without its listener nobody can come any more; those who are there go on.
            let _ = server.turn(start.elapsed(), &mut |_| {});
            to_do.try_iter().for_each(|task| task(server.world()));
            thread::sleep(TURN);
        }
    })?;
    Ok(Time::Real { port, tasks, ends, thread: Some(thread) })
}
