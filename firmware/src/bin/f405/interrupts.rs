//! The interrupts, and the pass that one of them makes. Each but the pass is short.

use crate::board::Stm32;
use crate::chip::PROCESSOR_HZ;
use crate::near::NEAR;
use crate::registers::{change, exti, set};
use crate::shared::Shared;
use crate::{pins, serial, timers};
use cortex_m::peripheral::scb::SystemHandler;
use cortex_m::peripheral::syst::SystClkSource;
use cortex_m::peripheral::{NVIC, Peripherals};
use cortex_m_rt::exception;
use phasewalk_firmware::device::Device;
use phasewalk_firmware::fault::Fault;
use stm32f4::stm32f405::{Interrupt, interrupt};

/// Passes per second.
const PASSES_HZ: u32 = 10_000;

/// The board's program, until the first pass takes it.
static PROGRAM: Shared<Option<Device<Stm32>>> = Shared::new(None);

// Urgent ones first; the four high bits count.
const EDGES: u8 = 0x00;
const LINE: u8 = 0x40;
const PASS: u8 = 0xF0;

/// From here on the program runs, beside the solver.
pub fn start(board: Stm32) {
    let program = Device::new(board);
    PROGRAM.with(|place| *place = Some(program));
    let Some(mut core) = Peripherals::take() else { return };
    // SAFETY: no section of ours relies on priorities, only on interrupts being disabled.
    unsafe {
        for (interrupt, priority) in [
            (Interrupt::PVD, EDGES),
            (Interrupt::TIM2, EDGES),
            (Interrupt::EXTI0, EDGES),
            (Interrupt::EXTI3, EDGES),
            (Interrupt::USART6, LINE),
        ] {
            core.NVIC.set_priority(interrupt, priority);
            NVIC::unmask(interrupt);
        }
        core.SCB.set_priority(SystemHandler::SysTick, PASS);
    }
    core.SYST.set_clock_source(SystClkSource::Core);
    core.SYST.set_reload(PROCESSOR_HZ / PASSES_HZ - 1);
    core.SYST.clear_current();
    core.SYST.enable_counter();
    core.SYST.enable_interrupt();
}

/// One pass of the main loop.
#[exception]
fn SysTick() {
    static mut DEVICE: Option<Device<Stm32>> = None;
    let begin = timers::counter();
    if DEVICE.is_none() {
        *DEVICE = PROGRAM.with(Option::take);
    }
    NEAR.with(|near| near.passes = near.passes.wrapping_add(1));
    if let Some(device) = DEVICE {
        device.pass();
    }
    let took = timers::counter().wrapping_sub(begin);
    NEAR.with(|near| near.in_passes = near.in_passes.wrapping_add(took));
}

/// A compare value was met, or EXPOSE rose.
#[interrupt]
fn TIM2() {
    NEAR.with(|near| {
        near.matches();
        near.captured();
    });
}

/// The interlock's loop has opened.
#[interrupt]
fn EXTI0() {
    NEAR.with(|near| {
        near.stop(Fault::Interlock);
        // Once is enough; noise on the loop would leave no time for anything else.
        change!(exti().imr(), pins::INTERLOCK, 0);
    });
    set!(exti().pr(), pins::INTERLOCK);
}

/// The start input has risen.
#[interrupt]
fn EXTI3() {
    set!(exti().pr(), pins::START);
    NEAR.with(|near| near.started());
}

/// A byte has come.
#[interrupt]
fn USART6() {
    serial::receive();
}
