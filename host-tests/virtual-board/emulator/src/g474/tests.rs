use rigless::soc::{Layout, RegisterSpec};

use super::*;

/// The bits of a register that some field names.
fn bits(register: &RegisterSpec) -> u64 {
    register.fields.iter().fold(0, |bits, field| bits | field.mask())
}

/// The registers of which an emulator's table has not every bit that the metadata has: what the
/// firmware writes there may be lost.
fn lost(instance: &str) -> Vec<String> {
    let borrowed = borrowed_table(instance).expect("a borrowed table");
    let missing = tables::named(instance).registers.iter().filter_map(|described| {
        let found = borrowed.iter().filter(|row| row.offset == described.offset);
        let known = found.map(bits).reduce(|all, bits| all | bits);
        let missing = bits(described) & !known.unwrap_or(0);
        (missing != 0 || known.is_none()).then(|| format!("{} {missing:#x}", described.name))
    });
    missing.collect()
}

#[test]
fn the_borrowed_tables_have_the_bits_of_the_metadata() {
    assert_eq!(lost("GPIOA"), [""; 0]);
    assert_eq!(lost("IWDG"), [""; 0]);
    assert_eq!(lost("RNG"), [""; 0]);
    assert_eq!(lost("USART1"), [""; 0]);
    assert_eq!(lost("LPUART1"), [""; 0]);
    assert_eq!(lost("TIM2"), [""; 0]);
}

#[test]
fn peripherals_lie_where_the_reference_manual_has_them() {
    let base = |name| tables::named(name).base;
    assert_eq!(
        [base("RCC"), base("FDCAN2"), base("DMAMUX1")],
        [0x4002_1000, 0x4000_6800, 0x4002_0800]
    );
    assert_eq!(tables::named("FDCAN1").interrupts, [21, 22]);
    assert_eq!(tables::named("DMA1").interrupts, [11, 12, 13, 14, 15, 16, 17, 96]);
    assert_eq!(tables::dma_request("USART3", "RX"), Some(28));
    let ccr = tables::row(tables::named(multiplexer::NAME).registers, "CCR0");
    assert_eq!(ccr.index(), 0, "the channels' registers come first");
}
