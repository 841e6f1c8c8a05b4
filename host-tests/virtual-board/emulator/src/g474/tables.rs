//! The peripherals of the STM32G474 with their registers, from the metadata of stm32-metapac:
//! addresses, fields, interrupts, clock enables, resets and DMA requests. The metadata has no reset
//! values; those that matter stand in [`super`].

use std::sync::OnceLock;

use rigless::soc::{
    Access, FieldSpec, Gate, Peripheral, ReadAction, RegisterSpec, Width, WriteModify, find_field,
    find_row,
};
use stm32_metapac::metadata::ir::{Array, BitOffset, BlockItem, BlockItemInner, Field, IR};
use stm32_metapac::metadata::{self, METADATA, PeripheralRccRegister};

use crate::row::Row;

/// The block of addresses that a peripheral has at most.
const BLOCK_BYTES: u64 = 0x400;
/// Peripherals whose metadata describes memory, not registers.
const MEMORIES: [&str; 6] = ["FDCANRAM1", "FDCANRAM2", "FDCANRAM3", "USBRAM", "UID", "VREFINTCAL"];

/// Every peripheral, by address.
pub fn peripherals() -> &'static [Peripheral] {
    static PERIPHERALS: OnceLock<Vec<Peripheral>> = OnceLock::new();
    PERIPHERALS.get_or_init(|| {
        let mut all: Vec<_> = described().map(peripheral).collect();
        all.sort_by_key(|peripheral| peripheral.base);
        let bases: Vec<u64> = all.iter().skip(1).map(|next| next.base).chain([u64::MAX]).collect();
        for (peripheral, next) in all.iter_mut().zip(bases) {
            peripheral.size = BLOCK_BYTES.min(next - peripheral.base);
        }
        all
    })
}

/// One of them.
///
/// # Panics
///
/// If the part has none of that name: a defect of this crate.
pub fn named(name: &str) -> &'static Peripheral {
    let found = peripherals().iter().find(|peripheral| peripheral.name == name);
    found.unwrap_or_else(|| panic!("the STM32G474 has no {name}"))
}

/// The row of a register.
///
/// # Panics
///
/// If the table has none of that name: a defect of this crate.
pub fn row(table: &'static [RegisterSpec], register: &str) -> Row {
    Row(find_row(table, register).unwrap_or_else(|| panic!("no register {register}")))
}

/// A field of a register.
///
/// # Panics
///
/// If there is none of that name: a defect of this crate.
pub fn field(table: &'static [RegisterSpec], register: &str, field: &str) -> &'static FieldSpec {
    find_field(table, register, field).unwrap_or_else(|| panic!("no field {field} in {register}"))
}

/// The bit that lets a peripheral's registers answer, of those that have one.
pub fn enables() -> impl Iterator<Item = (&'static str, Gate)> {
    switches(|rcc| rcc.enable.as_ref())
}

/// The bit that holds a peripheral in reset, of those that have one.
pub fn resets() -> impl Iterator<Item = (&'static str, Gate)> {
    switches(|rcc| rcc.reset.as_ref())
}

fn switches(
    of: impl Fn(&'static metadata::PeripheralRcc) -> Option<&'static PeripheralRccRegister>,
) -> impl Iterator<Item = (&'static str, Gate)> {
    described().filter_map(move |peripheral| {
        let bit = of(peripheral.rcc.as_ref()?)?;
        Some((peripheral.name, Gate::by("RCC", upper(bit.register), upper(bit.field))))
    })
}

/// The input of the request multiplexer that a signal of a peripheral has, such as `("USART3",
/// "RX")`.
pub fn dma_request(peripheral: &str, signal: &str) -> Option<usize> {
    let described = described().find(|described| described.name == peripheral)?;
    let request = described.dma_channels.iter().find(|request| request.signal == signal)?;
    usize::try_from(request.request?).ok()
}

fn described() -> impl Iterator<Item = &'static metadata::Peripheral> {
    METADATA
        .peripherals
        .iter()
        .filter(|peripheral| peripheral.registers.is_some() && !MEMORIES.contains(&peripheral.name))
}

fn peripheral(described: &metadata::Peripheral) -> Peripheral {
    let registers = described.registers.as_ref().expect("only those with registers");
    let mut rows = Vec::new();
    append(registers.ir, registers.block, "", 0, &mut rows);
    rows.sort_by_key(|row| row.offset);
    let mut interrupts: Vec<u16> =
        described.interrupts.iter().map(|of| number(of.interrupt)).collect();
    interrupts.sort_unstable();
    interrupts.dedup();
    Peripheral {
        name: described.name,
        base: described.address,
        size: BLOCK_BYTES,
        interrupts: interrupts.leak(),
        registers: rows.leak(),
    }
}

fn number(interrupt: &str) -> u16 {
    let found = METADATA.interrupts.iter().find(|known| known.name == interrupt);
    found.and_then(|known| u16::try_from(known.number).ok()).expect("an interrupt of the part")
}

/// The registers of a block and of those it is made of.
fn append(ir: &'static IR, block: &str, prefix: &str, offset: u32, rows: &mut Vec<RegisterSpec>) {
    let Some(block) = ir.blocks.iter().find(|known| known.name.eq_ignore_ascii_case(block)) else {
        return;
    };
    if let Some(extended) = block.extends {
        append(ir, extended, prefix, offset, rows);
    }
    for item in block.items {
        for (place, at) in places(item.array.as_ref()) {
            let name = format!("{prefix}{}{place}", item.name.to_uppercase());
            append_item(ir, item, name, offset + item.byte_offset + at, rows);
        }
    }
}

fn append_item(
    ir: &'static IR,
    item: &BlockItem,
    name: String,
    offset: u32,
    rows: &mut Vec<RegisterSpec>,
) {
    match &item.inner {
        BlockItemInner::Block(inner) => append(ir, inner.block, &format!("{name}_"), offset, rows),
        BlockItemInner::Register(register) => {
            let access = match register.access {
                stm32_metapac::metadata::ir::Access::ReadWrite => Access::ReadWrite,
                stm32_metapac::metadata::ir::Access::Read => Access::ReadOnly,
                stm32_metapac::metadata::ir::Access::Write => Access::WriteOnly,
            };
            rows.push(RegisterSpec {
                name: String::leak(name),
                offset,
                width: match register.bit_size {
                    8 => Width::W8,
                    16 => Width::W16,
                    _ => Width::W32,
                },
                reset: 0,
                access,
                read: ReadAction::None,
                write: WriteModify::None,
                fields: fields(ir, register.fieldset, access).leak(),
            });
        }
    }
}

/// The names of an array's elements, and how far each lies from the first.
fn places(array: Option<&Array>) -> Vec<(String, u32)> {
    match array {
        None => vec![(String::new(), 0)],
        Some(Array::Regular(array)) => {
            (0..array.len).map(|n| (n.to_string(), n * array.stride)).collect()
        }
        Some(Array::Cursed(array)) => {
            (0..).zip(array.offsets).map(|(n, at): (u32, _)| (n.to_string(), *at)).collect()
        }
    }
}

fn fields(ir: &'static IR, fieldset: Option<&str>, access: Access) -> Vec<FieldSpec> {
    let Some(set) = fieldset.and_then(|name| ir.fieldsets.iter().find(|known| known.name == name))
    else {
        return Vec::new();
    };
    let mut all = fields(ir, set.extends, access);
    all.extend(set.fields.iter().flat_map(|field| specs(field, access)));
    all.sort_by_key(|field| field.bit);
    all
}

fn specs(field: &Field, access: Access) -> Vec<FieldSpec> {
    let narrow = |number: u32| u8::try_from(number).expect("a bit of a register");
    let mut all = Vec::new();
    for (place, at) in places(field.array.as_ref()) {
        let name: &'static str = String::leak(format!("{}{place}", field.name.to_uppercase()));
        match &field.bit_offset {
            BitOffset::Regular(bit) => {
                all.push(FieldSpec::new(
                    name,
                    narrow(bit.offset + at),
                    narrow(field.bit_size),
                    access,
                ));
            }
            BitOffset::Cursed(bits) => all.extend(bits.ranges.iter().map(|range| {
                FieldSpec::new(
                    name,
                    narrow(range.start() + at),
                    narrow(range.end() - range.start() + 1),
                    access,
                )
            })),
        }
    }
    all
}

fn upper(name: &str) -> &'static str {
    String::leak(name.to_uppercase())
}
