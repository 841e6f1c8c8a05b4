//! Every command of a protocol with its fields, units and ranges.

use ::codec::{CommandInfo, FieldInfo};
use serde_json::{Value, json};

use super::by_name::{Codec, D5, RMD, THRUSTER, range};
use crate::args::CodecChoice;
use crate::failure::Failure;
use crate::json::snake;
use crate::output::Output;
use crate::table::Table;

/// Prints the table of a codec.
pub fn run(protocol: CodecChoice, out: Output) -> Result<(), Failure> {
    let commands = match protocol {
        CodecChoice::Rmd => commands(&RMD, out),
        CodecChoice::Thruster => commands(&THRUSTER, out),
        CodecChoice::D5 => commands(&D5, out),
    }?;
    let mut list = json!({ "protocol": super::name(protocol), "commands": commands });
    if protocol == CodecChoice::D5 {
        list["registers"] = registers(out)?;
    }
    out.object(&list)
}

fn commands<R>(codec: &Codec<R>, out: Output) -> Result<Value, Failure> {
    for info in codec.commands {
        out.text(format!("{}  0x{:02X}  {}", info.name, info.code, info.section))?;
        if !info.note.is_empty() {
            out.text(format!("    {}", info.note))?;
        }
        for field in info.request {
            let step = if field.counts_per_unit == 1.0 {
                String::new()
            } else {
                format!(", step {}", short(field.lsb()))
            };
            out.text(format!("    --{:<20}  {}{step}", field.name, range(field)))?;
        }
        let names: Vec<&str> = info.reply.iter().map(|field| field.name).collect();
        if !names.is_empty() {
            out.text(format!("    reply: {}", names.join(", ")))?;
        }
    }
    let object = |info: &CommandInfo| {
        json!({
            "command": info.name,
            "code": info.code,
            "section": info.section,
            "sendable": codec.is_sendable(info),
            "request": objects(info.request),
            "reply": objects(info.reply),
            "note": info.note,
        })
    };
    Ok(codec.commands.iter().map(object).collect())
}

fn objects(fields: &[FieldInfo]) -> Value {
    let object = |field: &FieldInfo| {
        json!({
            "name": field.name,
            "unit": field.unit,
            "kind": snake(&format!("{:?}", field.kind)),
            "min": field.min,
            "max": field.max,
            "step": field.lsb(),
        })
    };
    fields.iter().map(object).collect()
}

/// The registers that `read` and `write` take.
fn registers(out: Output) -> Result<Value, Failure> {
    let mut objects = Vec::new();
    let mut table = Table::new(&[
        ">address", "register", "field", ">min", ">max", "unit", "access", "width", ">default",
    ]);
    for info in &d5::REGISTERS {
        let (min, max) = info.value_range();
        let default = info.default.map_or("-".to_owned(), |default| default.to_string());
        let (access, width) =
            (snake(&format!("{:?}", info.access)), snake(&format!("{:?}", info.width)));
        objects.push(json!({
            "register": info.register.0,
            "name": info.name,
            "field": info.field,
            "unit": info.unit,
            "min": min,
            "max": max,
            "access": access,
            "width": width,
            "default": info.default,
        }));
        let (name, field, unit) =
            (info.name.to_owned(), info.field.to_owned(), info.unit.to_owned());
        let address = format!("0x{:02X}", info.register.0);
        table.row([
            address,
            name,
            field,
            min.to_string(),
            max.to_string(),
            unit,
            access.replace('_', " "),
            width,
            default,
        ]);
    }
    out.text("")?;
    out.table(&table)?;
    Ok(Value::Array(objects))
}

/// A step with as many digits as tell something.
fn short(step: f64) -> String {
    let text = format!("{step:.6}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}
