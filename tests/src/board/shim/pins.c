/*
 * Pins and the wires on them.
 *
 * The level of a wire, by precedence: a fault that holds it; the board's own output (the latch of a
 * timer, or the port's bit); what is driven from outside; the pin at the other end of a jumper; the
 * pull-up; and low, as the wiring's pull-downs make it. A program reads the level of the cycle
 * before the one in which it reads, as the pin synchroniser does. INT0, INT1, pin-change interrupts
 * and the input capture act in the cycle of the edge itself.
 */
#include "board.h"
#include <string.h>

static const uint8_t INPUT[3] = {PIND, PINB, PINC};

static unsigned port_of(unsigned pin) { return pin < 8 ? 0 : pin < 14 ? 1 : 2; }
static unsigned bit_of(unsigned pin) { return pin < 8 ? pin : pin < 14 ? pin - 8 : pin - 14; }

static bool bit(const struct board *b, unsigned pin, unsigned offset) {
    return b->avr->data[INPUT[port_of(pin)] + offset] >> bit_of(pin) & 1;
}

static bool is_output(const struct board *b, unsigned pin) { return bit(b, pin, 1); }

static uint8_t own_level(struct board *b, unsigned pin) {
    int latch = timer_output(b, pin);
    return latch < 0 ? bit(b, pin, 2) : (uint8_t)latch;
}

static uint8_t wire(struct board *b, unsigned pin) {
    if (b->stuck[pin] != FLOATING)
        return (uint8_t)b->stuck[pin];
    if (is_output(b, pin))
        return own_level(b, pin);
    if (b->driven[pin] != FLOATING)
        return (uint8_t)b->driven[pin];
    if (b->source[pin] != FLOATING)
        return b->level[b->source[pin]];
    return bit(b, pin, 2) && !(b->avr->data[MCUCR] & 0x10);
}

/* INT0 is D2, INT1 is D3. */
static void external_interrupt(struct board *b, unsigned pin, uint8_t level) {
    unsigned mode = b->avr->data[EICRA] >> 2 * (pin - 2) & 3;
    if (mode == 1 || (mode == 2 && !level) || (mode == 3 && level))
        b->avr->data[EIFR] |= (uint8_t)(1u << (pin - 2));
}

static void pin_change_interrupt(struct board *b, unsigned pin) {
    static const uint8_t group[3] = {2, 0, 1};
    unsigned g = group[port_of(pin)];
    if (b->avr->data[PCMSK0 + g] >> bit_of(pin) & 1)
        b->avr->data[PCIFR] |= (uint8_t)(1u << g);
}

static void heard(struct board *b, unsigned pin, uint8_t level, uint64_t cycle) {
    if (pin == 2 || pin == 3)
        external_interrupt(b, pin, level);
    pin_change_interrupt(b, pin);
    if (pin == 8)
        timer_capture(b, cycle, level);
    interrupts_refresh(b, cycle);
}

/* The levels of a port, bit by bit. */
static uint8_t port_levels(const struct board *b, unsigned port) {
    static const uint8_t first[3] = {0, 8, 14}, count[3] = {8, 6, 6};
    uint8_t levels = 0;
    for (unsigned i = 0; i < count[port]; i++)
        levels |= (uint8_t)(b->level[first[port] + i] << i);
    return levels;
}

static void change(struct board *b, unsigned pin, uint8_t level, uint64_t cycle) {
    unsigned port = port_of(pin);
    if (b->changed[port] != cycle) {
        b->sampled[port] = port_levels(b, port);
        b->changed[port] = cycle;
    }
    b->level[pin] = level;
    LIST_PUSH(b->edges, ((struct edge){cycle, (uint8_t)pin, level}));
    heard(b, pin, level, cycle);
}

/* Work out the level of a wire again, and of those at the other ends of its jumpers. */
void pin_update(struct board *b, unsigned pin, uint64_t cycle) {
    if (b->reset_due)
        return;
    uint8_t level = wire(b, pin);
    if (level == b->level[pin])
        return;
    change(b, pin, level, cycle);
    for (unsigned other = 0; other < PINS; other++)
        if (b->source[other] == (int)pin && other != pin)
            pin_update(b, other, cycle);
}

void pins_update(struct board *b, uint64_t cycle) {
    for (unsigned pin = 0; pin < PINS; pin++)
        pin_update(b, pin, cycle);
}

/* External changes planned up to this cycle. */
void pins_planned(struct board *b, uint64_t cycle) {
    while (b->plan_done < b->plan.count && b->plan.items[b->plan_done].cycle <= cycle) {
        struct pin_change change = b->plan.items[b->plan_done++];
        b->driven[change.pin] = change.level;
        pin_update(b, change.pin, change.cycle);
    }
    if (b->plan_done == b->plan.count)
        b->plan_done = b->plan.count = 0;
}

static unsigned port_at(unsigned address) {
    return address >= PIND ? 0 : address >= PINC ? 2 : 1;
}

static uint8_t levels_read(avr_t *avr, avr_io_addr_t address, void *param) {
    struct board *b = param;
    uint64_t cycle = access_cycle(avr);
    unsigned port = port_at(address);
    synchronise(b, cycle);
    return b->changed[port] >= cycle ? b->sampled[port] : port_levels(b, port);
}

static void set_register(struct board *b, unsigned address, uint8_t value) {
    uint64_t done = access_cycle(b->avr) + 1;
    static const uint8_t first[4] = {0, 8, 14, PINS};
    unsigned port = port_at(address);
    synchronise(b, done);
    b->avr->data[address] = value;
    for (unsigned pin = first[port]; pin < first[port + 1]; pin++)
        pin_update(b, pin, done);
    end_batch(b);
}

static void register_written(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param) {
    (void)avr;
    set_register(param, address, value);
}

/* A one that is written to PINx toggles the port's bit. */
static void toggled(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param) {
    set_register(param, address + 2u, avr->data[address + 2] ^ written_flags(avr, value));
}

static void pull_ups_written(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param) {
    struct board *b = param;
    avr->data[address] = value;
    pins_update(b, access_cycle(avr) + 1);
}

void pins_attach(struct board *b) {
    for (unsigned port = 0; port < 3; port++) {
        on_read(b, INPUT[port], levels_read);
        on_write(b, INPUT[port], toggled);
        on_write(b, INPUT[port] + 1u, register_written);
        on_write(b, INPUT[port] + 2u, register_written);
    }
    on_write(b, MCUCR, pull_ups_written);
    memset(b->driven, FLOATING, sizeof b->driven);
    memset(b->stuck, FLOATING, sizeof b->stuck);
    memset(b->source, FLOATING, sizeof b->source);
}

/* All pins are inputs without pull-ups. */
void pins_reset(struct board *b, uint64_t cycle) {
    pins_update(b, cycle);
    for (unsigned port = 0; port < 3; port++) {
        b->avr->data[EIFR] = b->avr->data[PCIFR] = 0;
        b->sampled[port] = port_levels(b, port);
        b->changed[port] = 0;
    }
}
