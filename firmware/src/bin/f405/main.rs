//! Trigger board on an STM32F405 (Cortex-M4F at 168 MHz), with the solver on line.
//!
//! **Not with a subject.** Its timing has been shown on emulators only, never measured on hardware.
//!
//! ```text
//! interrupts   TIM2, EXTI: edges are armed and read back, the loop opens     highest priority
//!              USART6: a byte has come
//! SysTick      every 100 us one pass of the main loop (Device)               lowest priority
//! main         the on-line solver, in the time that is left
//! ```
//!
//! | pin | use | made by |
//! |---|---|---|
//! | PA0 TIM2_CH1 | laser | TIM2, 32 bits at 84 MHz |
//! | PA1 TIM2_CH2 | camera | TIM2 |
//! | PA2 TIM2_CH3 | stimulus LED | TIM2 |
//! | PA3 TIM2_CH4 | camera EXPOSE, captured | TIM2 |
//! | PA6 TIM3_CH1 | frame clock, while the camera's trigger is high | TIM3, gated by TIM2 |
//! | PC0 EXTI0 | interlock loop: low = closed | |
//! | PC1 | far end of the loop in "pulsed" mode | pass |
//! | PC2 | camera READY: high = ready | |
//! | PC3 EXTI3 | start input | |
//! | PC4 | dynamic enable | pass |
//! | PC5 | phase line: high = beyond the limit | pass |
//! | PC6, PC7 USART6 | serial line, 250,000 baud | |
//!
//! ```text
//! main.rs       start, solver's loop
//! board.rs      the Board: what a pass asks
//! near.rs       state shared with the interrupts: near edges, edges made
//! interrupts.rs the interrupts, each a few lines
//! timers.rs     TIM2 and TIM3: counter, registers of the outputs, frame clock
//! solver.rs     speckles from the passes to the solver, phases back
//! number.rs     what it calculates with
//! serial.rs     USART6
//! pins.rs       the simple pins as embedded-hal sees them
//! chip.rs       which chip this is, its clocks, watchdog, cause of the reset
//! reset.rs      the first instructions after reset
//! crash.rs      what no program expects
//! memory.rs     stack, hash of the program memory
//! log.rs        defmt's logger, through RTT
//! registers.rs  access to the registers
//! shared.rs     variables shared with interrupts
//! ```
#![no_std]
#![no_main]

mod board;
mod chip;
mod crash;
mod interrupts;
mod log;
mod memory;
mod near;
#[cfg(not(feature = "plain-f32"))]
mod number;
mod pins;
mod registers;
mod reset;
mod serial;
mod shared;
mod solver;
mod timers;

#[cortex_m_rt::entry]
fn main() -> ! {
    #[cfg(feature = "panic-on-purpose")]
    panic_on_purpose();
    let chip = chip::start();
    interrupts::start(board::Stm32::start(chip));
    solver::run(!chip.real)
}

/// With this the image must not link: the check of the check.
#[cfg(feature = "panic-on-purpose")]
fn panic_on_purpose() {
    let speckles = [0_u8; phasewalk_core::online::SPECKLES];
    defmt::info!("{=u8}", speckles[serial::overrun() as usize]);
}

/// Nothing here can panic: the linker finds this function only when the image has no code that does.
#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    unsafe extern "C" {
        fn the_image_has_code_that_can_panic() -> !;
    }
    // SAFETY: it is nowhere, so what calls it is never linked.
    unsafe { the_image_has_code_that_can_panic() }
}
