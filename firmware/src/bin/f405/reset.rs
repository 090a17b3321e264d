//! The first instructions after reset.

// Before memory is initialised: the outputs of light (PA0, PA1, PA2, PA6) and those of port C (PC1,
// PC4, PC5) become plain outputs, low. cortex-m-rt calls `__pre_init` first.
core::arch::global_asm!(
    ".section .text.__pre_init,\"ax\"",
    ".global __pre_init",
    ".type __pre_init,%function",
    ".thumb_func",
    "__pre_init:",
    "ldr r0, =0x40023830", // RCC_AHB1ENR
    "ldr r1, [r0]",
    "orr r1, r1, #5", // GPIOA, GPIOC
    "str r1, [r0]",
    "ldr r1, [r0]",        // awake before they are used
    "ldr r0, =0x40020000", // GPIOA
    "ldr r1, =0x00470000",
    "str r1, [r0, #0x18]", // BSRR
    "ldr r1, [r0]",        // MODER
    "ldr r2, =0x0000303f",
    "bic r1, r1, r2",
    "ldr r2, =0x00001015",
    "orr r1, r1, r2",
    "str r1, [r0]",
    "ldr r0, =0x40020800", // GPIOC
    "ldr r1, =0x00320000",
    "str r1, [r0, #0x18]",
    "ldr r1, [r0]",
    "ldr r2, =0x00000f0c",
    "bic r1, r1, r2",
    "ldr r2, =0x00000504",
    "orr r1, r1, r2",
    "str r1, [r0]",
    "bx lr",
    ".ltorg",
    ".text",
);
