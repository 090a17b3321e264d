/*
 * The watchdog: 2048 << WDP periods of its own oscillator, nominally 128 kHz.
 *
 * WDE and WDP change only within 4 cycles of a write of WDCE and WDE together; WDE stays set while
 * WDRF is. A change of WDP does not restart the count; WDR does.
 */
#include "board.h"

enum { WDIF = 0x80, WDIE = 0x40, WDCE = 0x10, WDE = 0x08, WDP = 0x27, WDRF = 0x08 };

static uint64_t timeout(const struct board *b) {
    uint8_t value = b->avr->data[WDTCSR];
    unsigned exponent = (value & 7u) | (value >> 2 & 8u);
    double periods = (double)(2048ul << (exponent < 9 ? exponent : 9));
    return (uint64_t)(periods * b->avr->frequency / b->watchdog_hz + 0.5);
}

/* To be called after every change. */
void watchdog_plan(struct board *b) {
    bool on = b->avr->data[WDTCSR] & (WDE | WDIE);
    b->watchdog_at = on ? b->watchdog_start + timeout(b) : NEVER;
}

void watchdog_expired(struct board *b, uint64_t cycle) {
    uint8_t *value = &b->avr->data[WDTCSR];
    b->watchdog_start = cycle;
    if (!(*value & WDIE))
        request_reset(b, CAUSE_WATCHDOG, cycle);
    else
        *value |= WDIF;
    watchdog_plan(b);
    interrupts_refresh(b, cycle);
}

static void written(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param) {
    struct board *b = param;
    uint64_t done = access_cycle(avr) + 1;
    synchronise(b, done);
    uint8_t old = avr->data[address];
    bool open = access_cycle(avr) < b->watchdog_change_until, was_on = old & (WDE | WDIE);
    uint8_t now = (uint8_t)((old & (WDIF & ~value)) | (value & WDIE));
    now |= open ? value & (WDE | WDP) : (old & (WDE | WDP)) | (value & WDE);
    if (avr->data[MCUSR] & WDRF)
        now |= WDE;
    if ((value & (WDCE | WDE)) == (WDCE | WDE))
        b->watchdog_change_until = done + 4;
    else
        b->watchdog_change_until = 0;
    avr->data[address] = now;
    if (!was_on)
        b->watchdog_start = done;
    watchdog_plan(b);
    interrupts_refresh(b, done);
    end_batch(b);
}

static uint8_t control_read(avr_t *avr, avr_io_addr_t address, void *param) {
    struct board *b = param;
    synchronise(b, access_cycle(avr));
    bool open = access_cycle(avr) < b->watchdog_change_until;
    return (uint8_t)((avr->data[address] & ~WDCE) | (open ? WDCE : 0));
}

/* The WDR instruction. */
static int restarted(avr_io_t *io, uint32_t request, void *param) {
    struct board *b = (struct board *)((char *)io - offsetof(struct board, io));
    (void)param;
    if (request != AVR_IOCTL_WATCHDOG_RESET)
        return -1;
    synchronise(b, b->avr->cycle);
    b->watchdog_start = b->avr->cycle + 1;
    watchdog_plan(b);
    end_batch(b);
    return 0;
}

void watchdog_attach(struct board *b) {
    b->watchdog_hz = 128000;
    b->io.kind = "board";
    b->io.ioctl = restarted;
    avr_register_io(b->avr, &b->io);
    on_write(b, WDTCSR, written);
    on_read(b, WDTCSR, control_read);
}

/* A watchdog that has reset the board runs on at its shortest time-out. */
void watchdog_reset(struct board *b, uint64_t cycle, bool expired) {
    b->avr->data[WDTCSR] = expired ? WDE : 0;
    b->watchdog_start = cycle;
    b->watchdog_change_until = 0;
    watchdog_plan(b);
}
