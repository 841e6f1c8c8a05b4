//! The faults that a user of a served world types.

use host_protocol::BootReason;

use crate::bus::BusFault;
use crate::motors::Injection;
use crate::world::World;

/// What can be typed.
const HELP: &str = "\
e-stop press, e-stop release    the button at the e-stop input
bus BUS cut|short|mend          the cable of a bus
motor N FAULT [off]             a fault of the motor of axis N, or its end; see below
motor N faults WORD             its fault word, as 0x0002; 0 takes the cause away
motor N dialect DIALECT         what an RMD speaks, as v4_4
motor N power off|on            its supply: without it the motor coasts and hears nothing
power off, power on             the board's supply; it forgets what was not saved
reset                           the board's reset button; what it remembers stays";

/// Does to the world what a line says, and returns that in words.
///
/// # Errors
/// The line makes no sense, or asks for `help`; the text says what there is.
pub fn apply(world: &mut World, line: &str) -> Result<String, String> {
    let words: Vec<&str> = line.split_whitespace().collect();
    match words.as_slice() {
        ["e-stop", "press"] => world.set_e_stop_input(true),
        ["e-stop", "release"] => world.set_e_stop_input(false),
        ["bus", bus, what] => {
            let fault = match *what {
                "cut" => BusFault::Cut,
                "short" => BusFault::Short,
                "mend" => BusFault::None,
                _ => return Err(unknown(line)),
            };
            let bus = bus.parse().map_err(|_| format!("`{bus}` is not the number of a bus"))?;
            if !world.set_bus_fault(bus, fault) {
                return Err(format!("there is no bus {bus}"));
            }
        }
        ["motor", motor, rest @ ..] => {
            let index = motor.parse().ok().filter(|index| *index < world.motors().len());
            let index = index.ok_or_else(|| format!("there is no motor {motor}"))?;
            of_motor(world, index, rest).ok_or_else(|| unknown(line))?;
        }
        ["power", "off"] => world.hang(),
        ["power", "on"] => world.reset(BootReason::PowerOn, ""),
        ["reset"] => world.reset(BootReason::Pin, ""),
        ["help"] => return Err(there_are()),
        _ => return Err(unknown(line)),
    }
    Ok(words.join(" "))
}

fn of_motor(world: &mut World, motor: usize, words: &[&str]) -> Option<()> {
    let injection = match words {
        ["faults", word] => Injection::FaultBits(match word.strip_prefix("0x") {
            Some(digits) => u16::from_str_radix(digits, 16).ok()?,
            None => word.parse().ok()?,
        }),
        ["dialect", name] => {
            let mut known = (0u8..).zip(rmd::Dialect::ALL).skip(1);
            let (number, _) = known.find(|(_, dialect)| dialect.name() == *name)?;
            Injection::RmdDialect(number)
        }
        ["power", state @ ("off" | "on")] => {
            world.power_cycle(motor);
            Injection::Unplugged(*state == "off")
        }
        [name] => Injection::switch(name, true)?,
        [name, state @ ("off" | "on")] => Injection::switch(name, *state == "on")?,
        _ => return None,
    };
    world.inject(motor, injection);
    Some(())
}

fn unknown(line: &str) -> String {
    format!("`{line}` is no fault. There are:\n{}", there_are())
}

fn there_are() -> String {
    format!("{HELP}\nFAULT: {}", Injection::SWITCHES.join(", "))
}
