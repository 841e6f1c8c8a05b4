//! Messages of a recording for people: samples in the columns of `mgw watch`, everything else as a
//! line.

use host_protocol::{AxisState, Event, FaultReading, Reading};
use serde_json::Value;

use super::read::Recorded;
use crate::json;
use crate::names::Names;
use crate::states;
use crate::words::NOTHING;

/// What a line begins with.
const TIME: &str = "      time s";

/// Prints one message after the other; keeps the widths of the columns.
#[derive(Default)]
pub struct Show {
    widths: Vec<usize>,
}

impl Show {
    /// The lines of a message.
    pub fn lines(&mut self, message: &Recorded) -> Vec<String> {
        let time = match message.time_s() {
            Some(time) => format!("{time:12.6}"),
            None => format!("{NOTHING:>12}"),
        };
        let Some(sample) = sample(&message.value) else {
            return vec![format!("{time}  {}", line(message))];
        };
        let Some(table) = states::sample(&sample, states::ALL, &Names::default()) else {
            return Vec::new();
        };
        let is_first = self.widths.is_empty();
        let mut lines = table.lines_in(&mut self.widths).into_iter();
        let headings = lines.next().filter(|_| is_first).map(|line| format!("{TIME}  {line}"));
        headings.into_iter().chain(lines.map(|line| format!("{time}  {line}"))).collect()
    }
}

/// The sample that was recorded.
fn sample(value: &Value) -> Option<Event> {
    if value["event"] != "sample" {
        return None;
    }
    let reading = |name: &str| {
        let (number, age) = (value[name]["value"].as_f64()?, value[name]["age_us"].as_u64()?);
        #[expect(clippy::cast_possible_truncation, reason = "it was one of single precision")]
        let number = number as f32;
        Some(Reading { value: number, age_us: u32::try_from(age).ok()? })
    };
    let word = |name: &str| value[name].as_u64().and_then(|word| u16::try_from(word).ok());
    let faults = word("faults_raw").map(|raw| FaultReading {
        word: raw,
        warnings: word("fault_warnings_raw").unwrap_or(0),
        age_us: value["faults_age_us"].as_u64().and_then(|age| age.try_into().ok()).unwrap_or(0),
    });
    Some(Event::Sample {
        axis: value["axis"].as_u64()?.try_into().ok()?,
        state: state(value)?,
        position_rad: reading("position_rad"),
        velocity_rad_s: reading("velocity_rad_s"),
        current_a: reading("current_a"),
        voltage_v: reading("voltage_v"),
        motor_temperature_c: reading("motor_temperature_c"),
        driver_temperature_c: reading("driver_temperature_c"),
        faults,
    })
}

fn state(value: &Value) -> Option<AxisState> {
    use AxisState::{Active, Armed, Arming, Holding, Idle, Stopping, Tripped, Unconfigured};
    let confirmed = value["stop_confirmed"] == true;
    [Unconfigured, Idle, Arming, Armed, Active, Stopping, Tripped { confirmed }, Holding]
        .into_iter()
        .find(|state| value["state"] == json::name(state))
}

/// What is no sample.
fn line(message: &Recorded) -> String {
    let value = &message.value;
    if let Some(text) = value["text"].as_str() {
        return text.to_owned();
    }
    let who = match (value["program"].as_u64(), value["by_server"] == true) {
        (Some(program), _) => format!("program {program}: "),
        (None, true) => "server: ".to_owned(),
        (None, false) => String::new(),
    };
    let name = |key: &str| value[key].as_str().unwrap_or_default().to_owned();
    match name("event").as_str() {
        "request" => format!("{who}{}{}", name("request"), fields(&value["body"])),
        "reply" => format!("{who}{} answered{}", name("request"), fields(&value["body"])),
        "refusal" => format!("{who}refused: {}", name("message")),
        "frame" => format!(
            "{}{} {}{}",
            name("kind"),
            value["bus"],
            name("frame"),
            if name("direction") == "sent" { "  sent" } else { "" }
        ),
        event => {
            let mut rest = value.clone();
            if let Some(rest) = rest.as_object_mut() {
                rest.retain(|key, _| key != "event" && key != "time_us");
            }
            format!("{event}{}", fields(&rest))
        }
    }
}

fn fields(value: &Value) -> String {
    flat(value).into_iter().map(|(name, value)| format!(" {name}={value}")).collect()
}

/// The values of an object, with the ways to them as names. Of a list of axes the number of the
/// axis is in the way, not its place.
pub fn flat(value: &Value) -> Vec<(String, String)> {
    let mut all = Vec::new();
    put(&mut all, String::new(), value);
    all
}

fn put(all: &mut Vec<(String, String)>, name: String, value: &Value) {
    let below =
        |part: &str| if name.is_empty() { part.to_owned() } else { format!("{name}.{part}") };
    match value {
        Value::Null => {}
        Value::Object(fields) => {
            fields.iter().for_each(|(key, field)| put(all, below(key), field));
        }
        Value::Array(items) if items.iter().any(Value::is_object) => {
            for (place, item) in items.iter().enumerate() {
                let axis = item["axis"].as_u64();
                put(all, below(&axis.map_or(place.to_string(), |axis| axis.to_string())), item);
            }
        }
        Value::Array(items) => {
            let items: Vec<String> = items.iter().map(plain).collect();
            all.push((name, items.join(" ")));
        }
        other => all.push((name, plain(other))),
    }
}

fn plain(value: &Value) -> String {
    value.as_str().map_or_else(|| value.to_string(), str::to_owned)
}
