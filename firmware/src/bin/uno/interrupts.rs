//! The interrupts. Each is short: while one runs, the others wait.

use crate::near::NEAR;
use crate::registers::{change, enable_interrupts, exint, usart};
use crate::serial;
use crate::shared::interrupt;
use crate::timers;
use avr_device::interrupt::free;
use phasewalk_firmware::clock;
use phasewalk_firmware::fault::Fault;

/// The interlock's loop has opened.
#[avr_device::interrupt(atmega328p)]
fn INT0() {
    // SAFETY: this is an interrupt.
    NEAR.with(unsafe { interrupt() }, |near| near.stop(Fault::Interlock));
}

/// The start input has risen.
#[avr_device::interrupt(atmega328p)]
fn INT1() {
    // SAFETY: this is an interrupt.
    NEAR.with(unsafe { interrupt() }, |near| {
        let now = clock::extend(near.overflows, timers::counter(), timers::overflow_pending());
        near.start = near.start.or(Some(now));
    });
    // One rise is enough, and a bouncing or open wire would have many.
    change!(exint().eimsk, 1 << 1, 0);
}

/// Time to arm the LED. Of the timers' interrupts this has the highest priority.
#[avr_device::interrupt(atmega328p)]
fn TIMER2_COMPA() {
    // SAFETY: this is an interrupt.
    NEAR.with(unsafe { interrupt() }, |near| near.arm_led());
}

/// EXPOSE rose.
#[avr_device::interrupt(atmega328p)]
fn TIMER1_CAPT() {
    // SAFETY: this is an interrupt.
    NEAR.with(unsafe { interrupt() }, |near| near.capture());
}

/// The laser's compare value was met.
#[avr_device::interrupt(atmega328p)]
fn TIMER1_COMPA() {
    // SAFETY: this is an interrupt.
    NEAR.with(unsafe { interrupt() }, |near| near.laser_matched());
}

/// The camera's compare value was met.
#[avr_device::interrupt(atmega328p)]
fn TIMER1_COMPB() {
    // SAFETY: this is an interrupt.
    let triggered = NEAR.with(unsafe { interrupt() }, |near| near.camera_matched());
    if triggered {
        // The LED's arming cannot wait for this. The camera's next edge is far.
        enable_interrupts();
        free(|cs| NEAR.with(cs, |near| near.await_exposure()));
    }
}

/// The clock has wrapped.
#[avr_device::interrupt(atmega328p)]
fn TIMER1_OVF() {
    // SAFETY: this is an interrupt.
    NEAR.with(unsafe { interrupt() }, |near| near.overflows = near.overflows.wrapping_add(1));
}

/// The LED's compare value was met.
#[avr_device::interrupt(atmega328p)]
fn TIMER0_COMPA() {
    // SAFETY: this is an interrupt.
    NEAR.with(unsafe { interrupt() }, |near| near.led_matched());
}

/// A byte has come.
#[avr_device::interrupt(atmega328p)]
fn USART_RX() {
    let byte = usart().udr0.read().bits();
    // SAFETY: this is an interrupt.
    serial::INWARD.with(unsafe { interrupt() }, |inward| inward.push_or_count(byte));
}

/// A byte can go.
#[avr_device::interrupt(atmega328p)]
fn USART_UDRE() {
    // SAFETY: this is an interrupt.
    serial::send(unsafe { interrupt() });
}
