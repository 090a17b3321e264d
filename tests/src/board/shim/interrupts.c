/*
 * Interrupts: flags and masks in the registers, served by priority.
 *
 * Entry takes 4 cycles, 8 from sleep. An instruction that sets I, and RETI, is followed by one more
 * instruction first. A flag that is set by the end of an instruction is served after it.
 */
#include "board.h"
#include <string.h>

/* The bits of one timer's flags, in order of its vectors. */
static uint32_t timer_bits(const struct board *b, unsigned index, unsigned first) {
    uint8_t set = b->avr->data[TIFR0 + index] & b->avr->data[TIMSK0 + index];
    uint32_t bits = (uint32_t)((set >> 1 & 1) | (set >> 2 & 1) << 1 | (set & 1) << 2);
    return bits << first;
}

/* Low level on INT0 or INT1, where the mode asks for it. */
static uint8_t low_levels(const struct board *b) {
    uint8_t control = b->avr->data[EICRA], low = 0;
    for (unsigned i = 0; i < 2; i++)
        if ((control >> 2 * i & 3) == 0 && !b->level[2 + i])
            low |= (uint8_t)(1u << i);
    return low;
}

static uint32_t external_bits(const struct board *b) {
    const uint8_t *data = b->avr->data;
    uint32_t edges = (uint32_t)((data[EIFR] | low_levels(b)) & data[EIMSK] & 3);
    uint32_t pins = (uint32_t)(data[PCIFR] & data[PCICR] & 7);
    return edges << V_INT0 | pins << V_PCINT0;
}

static uint32_t serial_bits(const struct board *b) {
    uint8_t set = b->avr->data[UCSR0A] & b->avr->data[UCSR0B];
    return (uint32_t)(set >> 7 & 1) << V_USART_RX | (uint32_t)(set >> 5 & 1) << V_USART_UDRE |
           (uint32_t)(set >> 6 & 1) << V_USART_TX;
}

/* All that are flagged and enabled. */
static uint32_t flagged(const struct board *b) {
    const uint8_t *data = b->avr->data;
    uint32_t bits = external_bits(b) | serial_bits(b);
    bits |= timer_bits(b, 0, V_T0_COMPA) | timer_bits(b, 1, V_T1_COMPA) | timer_bits(b, 2, V_T2_COMPA);
    bits |= (uint32_t)(data[TIFR0 + 1] & data[TIMSK0 + 1] & 0x20) >> 5 << V_T1_CAPT;
    bits |= (uint32_t)((data[WDTCSR] & 0xc0) == 0xc0) << V_WDT;
    return bits;
}

/* To be called after every change of a flag or a mask. */
void interrupts_refresh(struct board *b, uint64_t cycle) {
    uint32_t now = flagged(b);
    for (uint32_t fresh = now & ~b->pending; fresh; fresh &= fresh - 1)
        b->raised[__builtin_ctz(fresh)] = cycle;
    b->pending = now;
    if (now)
        end_batch(b);
}

/* The cause of a level has come anew: a next byte, room for a next byte. */
void interrupts_renew(struct board *b, unsigned vector, uint64_t cycle) {
    b->raised[vector] = cycle;
}

/* Serving a vector clears its flag, if it is not one of a level. */
static void acknowledge(struct board *b, unsigned vector) {
    uint8_t *data = b->avr->data;
    switch (vector) {
    case V_INT0: case V_INT1: data[EIFR] &= (uint8_t)~(1u << (vector - V_INT0)); break;
    case V_PCINT0: case V_PCINT1: case V_PCINT2:
        data[PCIFR] &= (uint8_t)~(1u << (vector - V_PCINT0)); break;
    case V_WDT:
        data[WDTCSR] &= (uint8_t)~0x80;
        if (data[WDTCSR] & 8)
            data[WDTCSR] &= (uint8_t)~0x40; /* the next time-out resets */
        break;
    case V_T1_CAPT: data[TIFR0 + 1] &= (uint8_t)~0x20; break;
    case V_T0_COMPA: case V_T0_COMPB: data[TIFR0] &= (uint8_t)~(2u << (vector - V_T0_COMPA)); break;
    case V_T1_COMPA: case V_T1_COMPB: data[TIFR0 + 1] &= (uint8_t)~(2u << (vector - V_T1_COMPA)); break;
    case V_T2_COMPA: case V_T2_COMPB: data[TIFR0 + 2] &= (uint8_t)~(2u << (vector - V_T2_COMPA)); break;
    case V_T0_OVF: data[TIFR0] &= (uint8_t)~1; break;
    case V_T1_OVF: data[TIFR0 + 1] &= (uint8_t)~1; break;
    case V_T2_OVF: data[TIFR0 + 2] &= (uint8_t)~1; break;
    case V_USART_TX: data[UCSR0A] &= (uint8_t)~0x40; break;
    default: break;
    }
}

/* A cleared flag can be set again by an event that did not matter before. */
static void timers_plan_again(struct board *b) {
    for (unsigned i = 0; i < 3; i++)
        timer_plan(&b->timer[i], b->avr->cycle);
}

/* Enter the vector of highest priority. `wake_cycles` are 4 if the core slept. */
bool interrupts_serve(struct board *b, unsigned wake_cycles) {
    avr_t *avr = b->avr;
    if (!avr->sreg[S_I] || !b->pending)
        return false;
    unsigned vector = (unsigned)__builtin_ctz(b->pending), cost = 4 + wake_cycles;
    acknowledge(b, vector);
    timers_plan_again(b);
    uint64_t latency = avr->cycle + cost - b->raised[vector];
    if (latency > b->latency[vector])
        b->latency[vector] = latency;
    b->entries[vector]++;
    _avr_push_addr(avr, avr->pc);
    avr->sreg[S_I] = 0;
    avr->interrupt_state = 0;
    avr->pc = vector * avr->vector_size;
    avr->cycle += cost;
    b->depth++;
    interrupts_renew(b, vector, avr->cycle);
    interrupts_refresh(b, avr->cycle);
    return true;
}

static void returned(avr_irq_t *irq, uint32_t value, void *param) {
    struct board *b = param;
    (void)irq, (void)value;
    if (b->depth > 0)
        b->depth--;
}

/* Masks of interrupts. */
static void mask_written(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param) {
    struct board *b = param;
    uint64_t done = access_cycle(avr) + 1;
    synchronise(b, done);
    avr->data[address] = value;
    interrupts_refresh(b, done);
    end_batch(b);
}

/* Flags of pins: what is written as one is cleared. */
static void flags_written(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param) {
    struct board *b = param;
    uint64_t done = access_cycle(avr) + 1;
    synchronise(b, done - 1);
    avr->data[address] &= (uint8_t)~written_flags(avr, value);
    interrupts_refresh(b, done);
    end_batch(b);
}

/* The stack pointer is watched where both its bytes are valid: `_avr_sp_set` writes the high byte
 * last, a program's OUT writes the low byte last. */
static void stack_low_written(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param) {
    struct board *b = param;
    avr->data[address] = value;
    uint16_t pointer = (uint16_t)(value | avr->data[SPH] << 8);
    if ((avr->flash[avr->pc + 1] & 0xf8) == 0xb8 && pointer < b->stack_low)
        b->stack_low = pointer;
}

static void stack_high_written(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param) {
    struct board *b = param;
    avr->data[address] = value;
    uint16_t pointer = (uint16_t)(avr->data[SPL] | value << 8);
    if (pointer < b->stack_low && (avr->flash[avr->pc + 1] & 0xf8) != 0xb8)
        b->stack_low = pointer;
}

void interrupts_attach(struct board *b) {
    for (unsigned i = 0; i < 3; i++)
        on_write(b, TIMSK0 + i, mask_written);
    on_write(b, EIMSK, mask_written);
    on_write(b, EICRA, mask_written);
    on_write(b, PCICR, mask_written);
    on_write(b, EIFR, flags_written);
    on_write(b, PCIFR, flags_written);
    on_write(b, SPL, stack_low_written);
    on_write(b, SPH, stack_high_written);
    avr_irq_register_notify(b->avr->interrupts.irq + AVR_INT_IRQ_RUNNING, returned, b);
}

void interrupts_reset(struct board *b) {
    b->pending = 0;
    b->depth = 0;
    b->shadow = false;
}
