//! Copies of memory, which the compiler asks for where it moves what is long.
//!
//! Those of compiler-builtins copy a word at a time where both ends are aligned, and less where they
//! are not. Each frame and each request is moved a few times: these take a third of the
//! instructions.

use core::arch::global_asm;

// r0: to, r1: from, both aligned to words; r2: bytes (Run-time ABI for the Arm Architecture,
// memory copying: nothing is returned).
global_asm!(
    ".section .text.__aeabi_memcpy4, \"ax\"",
    ".global __aeabi_memcpy4",
    ".global __aeabi_memcpy8",
    ".type __aeabi_memcpy4, %function",
    ".type __aeabi_memcpy8, %function",
    ".thumb_func",
    "__aeabi_memcpy4:",
    ".thumb_func",
    "__aeabi_memcpy8:",
    "push {{r4, r5, r6, lr}}",
    "subs r2, #16",
    "blo 2f",
    "1: ldmia r1!, {{r3, r4, r5, r6}}",
    "stmia r0!, {{r3, r4, r5, r6}}",
    "subs r2, #16",
    "bhs 1b",
    // Bit 3 says whether two words are left, bit 2 whether one is: what is below zero has the same.
    "2: lsls r3, r2, #29",
    "itt cs",
    "ldmiacs r1!, {{r5, r6}}",
    "stmiacs r0!, {{r5, r6}}",
    "itt mi",
    "ldrmi r5, [r1], #4",
    "strmi r5, [r0], #4",
    "ands r2, #3",
    "beq 4f",
    "3: ldrb r3, [r1], #1",
    "strb r3, [r0], #1",
    "subs r2, #1",
    "bne 3b",
    "4: pop {{r4, r5, r6, pc}}",
    ".size __aeabi_memcpy4, . - __aeabi_memcpy4",
    ".size __aeabi_memcpy8, . - __aeabi_memcpy8",
);

// The same with ends that need not be aligned: single loads and stores may be so on these
// processors, in normal memory (ARMv7-M Architecture Reference Manual, A3.2.1).
global_asm!(
    ".section .text.__aeabi_memcpy, \"ax\"",
    ".global __aeabi_memcpy",
    ".type __aeabi_memcpy, %function",
    ".thumb_func",
    "__aeabi_memcpy:",
    "subs r2, #4",
    "blo 2f",
    "1: ldr r3, [r1], #4",
    "str r3, [r0], #4",
    "subs r2, #4",
    "bhs 1b",
    "2: lsls r2, r2, #31",
    "itt cs",
    "ldrhcs r3, [r1], #2",
    "strhcs r3, [r0], #2",
    "itt mi",
    "ldrbmi r3, [r1]",
    "strbmi r3, [r0]",
    "bx lr",
    ".size __aeabi_memcpy, . - __aeabi_memcpy",
);
