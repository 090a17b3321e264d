/*
 * Timers 0, 1 and 2.
 *
 * The count is computed from the cycle when it is needed. An event is planned only where it changes
 * something: a flag that is clear, or an output that will move. A match sets its flag, and moves its
 * output, at the clock that takes the count from OCRnx to OCRnx + 1; an overflow at the clock that
 * takes it to zero.
 *
 * - The latch of an output is changed by a match (or a force) alone, as its COM bits then say. The
 *   pin shows it while COM is not 0, and the port's bit otherwise.
 * - A write of the count suppresses a match at the next clock.
 * - A flag set at the very clock at which the program clears it stays set.
 * - TSM holds the prescaler; a timer at clk/1 does not use it and runs on.
 * - Capture takes the count of the cycle in which the pin changes. The hardware's synchroniser adds
 *   2.5 to 3.5 cycles, and its noise canceller 4.
 * - External clocks, the asynchronous clock of timer 2 and the power reduction register are left
 *   out: the first two leave a timer stopped.
 */
#include "board.h"
#include <string.h>

static const uint16_t CONTROL[3] = {TCCR0A, TCCR1A, TCCR2A};
static const uint16_t DIVIDER[3][8] = {
    {0, 1, 8, 64, 256, 1024, 0, 0},
    {0, 1, 8, 64, 256, 1024, 0, 0},
    {0, 1, 8, 32, 64, 128, 256, 1024},
};
static const uint8_t OUTPUT[3][2] = {{6, 5}, {9, 10}, {11, 3}};

static uint8_t *flags(struct timer *t) { return &t->board->avr->data[TIFR0 + t->index]; }
static uint8_t control_a(const struct timer *t) { return t->board->avr->data[CONTROL[t->index]]; }
static uint8_t control_b(const struct timer *t) { return t->board->avr->data[CONTROL[t->index] + 1]; }
static unsigned com(const struct timer *t, unsigned x) { return control_a(t) >> (6 - 2 * x) & 3; }
static bool pwm(const struct timer *t) { return t->shape >= SHAPE_FAST_PWM; }

/* ---- counting ------------------------------------------------------------------------------- */

static bool running(const struct timer *t) {
    return t->divider == 1 || (t->divider && !t->board->prescaler_held[t->index == 2]);
}

static uint64_t zero(const struct timer *t) { return t->board->prescaler_zero[t->index == 2]; }

/* Clocks of the timer after cycle `from`, up to and with cycle `to`. */
static uint64_t clocks(const struct timer *t, uint64_t from, uint64_t to) {
    if (!running(t))
        return 0;
    return (to - zero(t)) / t->divider - (from - zero(t)) / t->divider;
}

/* The cycle of the `n`th clock after the cycle up to which was counted. */
static uint64_t cycle_of(const struct timer *t, uint64_t n) {
    if (n == NEVER || !running(t))
        return NEVER;
    return zero(t) + ((t->at - zero(t)) / t->divider + n) * t->divider;
}

static uint64_t period(const struct timer *t) {
    if (t->shape != SHAPE_PHASE_CORRECT)
        return (uint64_t)t->top + 1;
    return t->top ? 2 * (uint64_t)t->top : 1;
}

static uint32_t stepped(const struct timer *t, uint64_t n) {
    uint64_t lap = period(t), to_wrap;
    if (t->shape == SHAPE_PHASE_CORRECT || t->position <= t->top)
        return (uint32_t)((t->position + n) % lap);
    to_wrap = t->max + 1 - t->position;
    return n < to_wrap ? (uint32_t)(t->position + n) : (uint32_t)((n - to_wrap) % lap);
}

static void advance(struct timer *t, uint64_t cycle) {
    uint64_t n = clocks(t, t->at, cycle);
    if (n) {
        t->position = stepped(t, n);
        t->blocked = false;
    }
    t->at = cycle;
}

static uint16_t count_at(const struct timer *t, uint32_t position) {
    bool down = t->shape == SHAPE_PHASE_CORRECT && position > t->top;
    return (uint16_t)(down ? 2 * t->top - position : position);
}

/* The count during a cycle. */
uint16_t timer_count(struct timer *t, uint64_t cycle) {
    return count_at(t, stepped(t, clocks(t, t->at, cycle)));
}

/* ---- what will happen ------------------------------------------------------------------------ */

/* Clocks until the position `value` is left. */
static uint64_t clocks_to_leave(const struct timer *t, uint32_t value) {
    uint64_t lap = period(t), to_wrap = (uint64_t)t->max + 1 - t->position;
    if (t->shape == SHAPE_PHASE_CORRECT || t->position <= t->top) {
        if (value >= lap)
            return NEVER;
        uint64_t n = (value + lap - t->position % lap) % lap + 1;
        return n == 1 && t->blocked ? n + lap : n;
    }
    if (value > t->position || (value == t->position && !t->blocked))
        return value - t->position + 1;
    return value <= t->top ? to_wrap + value + 1 : NEVER;
}

static uint64_t clocks_to_match(const struct timer *t, unsigned x) {
    uint32_t value = t->compare[x];
    uint64_t up = clocks_to_leave(t, value), down;
    if (t->shape != SHAPE_PHASE_CORRECT)
        return up;
    if (value > t->top)
        return NEVER;
    down = clocks_to_leave(t, value ? 2 * t->top - value : 0);
    return up < down ? up : down;
}

/* Clocks until the count goes to zero other than by a write. */
static uint64_t clocks_to_bottom(const struct timer *t) {
    if (t->shape == SHAPE_PHASE_CORRECT)
        return period(t) - t->position;
    return (t->position <= t->top ? t->top : t->max) + (uint64_t)1 - t->position;
}

static bool bottom_overflows(const struct timer *t) {
    return t->shape != SHAPE_CTC || t->position > t->top || t->top == t->max;
}

/* The level which a match gives to an output, or -1 for none. */
static int matched_level(const struct timer *t, unsigned x) {
    bool down = t->shape == SHAPE_PHASE_CORRECT && t->position >= t->top;
    switch (com(t, x)) {
    case 1: return !t->latch[x];
    case 2: return down;
    case 3: return !down;
    default: return -1;
    }
}

static bool match_matters(const struct timer *t, unsigned x) {
    int level = matched_level(t, x);
    if (!(t->board->avr->data[TIFR0 + t->index] & 2u << x))
        return true;
    return pwm(t) ? level >= 0 : level >= 0 && level != t->latch[x];
}

static bool bottom_matters(const struct timer *t) {
    if (pwm(t))
        return true;
    return bottom_overflows(t) && !(t->board->avr->data[TIFR0 + t->index] & 1);
}

static uint64_t soonest(const struct timer *t) {
    uint64_t best = NEVER;
    for (unsigned x = 0; x < 2; x++) {
        uint64_t n = match_matters(t, x) ? clocks_to_match(t, x) : NEVER;
        best = n < best ? n : best;
    }
    uint64_t n = bottom_matters(t) ? clocks_to_bottom(t) : NEVER;
    return n < best ? n : best;
}

/* To be called after every change, at `cycle`, of what the timer does. */
void timer_plan(struct timer *t, uint64_t cycle) {
    advance(t, cycle);
    t->next = cycle_of(t, soonest(t));
}

/* ---- what happens ---------------------------------------------------------------------------- */

static void set_latch(struct timer *t, unsigned x, int level, uint64_t cycle) {
    if (level < 0 || t->latch[x] == level)
        return;
    t->latch[x] = (uint8_t)level;
    pin_update(t->board, OUTPUT[t->index][x], cycle);
}

/* Buffered compare values are taken over, and fast PWM starts its pulses, at the bottom. */
static void bottom(struct timer *t, uint64_t cycle) {
    if (!pwm(t))
        return;
    for (unsigned x = 0; x < 2; x++) {
        t->compare[x] = t->buffer[x];
        if (t->shape == SHAPE_FAST_PWM && com(t, x) >= 2)
            set_latch(t, x, com(t, x) == 2, cycle);
    }
}

/* The event planned for this cycle. */
void timer_fire(struct timer *t, uint64_t cycle) {
    uint64_t n = soonest(t);
    bool at_bottom = clocks_to_bottom(t) == n, overflow = at_bottom && bottom_overflows(t);
    int level[2];
    for (unsigned x = 0; x < 2; x++) {
        bool match = clocks_to_match(t, x) == n;
        struct timer before = *t;
        before.position = stepped(t, n - 1);
        level[x] = match ? matched_level(&before, x) : -1;
        *flags(t) |= (uint8_t)(match ? 2u << x : 0);
    }
    *flags(t) |= overflow;
    advance(t, cycle);
    for (unsigned x = 0; x < 2; x++)
        set_latch(t, x, level[x], cycle);
    if (at_bottom)
        bottom(t, cycle);
    timer_plan(t, cycle);
    interrupts_refresh(t->board, cycle);
}

/* ICP1 has changed. */
void timer_capture(struct board *b, uint64_t cycle, bool rising) {
    struct timer *t = &b->timer[1];
    if (rising != (control_b(t) >> 6 & 1) || ((control_b(t) & 0x18) == 0x18 && !(control_a(t) & 1)))
        return;
    t->capture = timer_count(t, cycle);
    *flags(t) |= 0x20;
    interrupts_refresh(b, cycle);
}

/* The level of the latch that is connected to a pin, or -1. */
int timer_output(struct board *b, unsigned pin) {
    for (unsigned i = 0; i < 3; i++)
        for (unsigned x = 0; x < 2; x++)
            if (OUTPUT[i][x] == pin && com(&b->timer[i], x))
                return b->timer[i].latch[x];
    return -1;
}

/* ---- registers ------------------------------------------------------------------------------- */

static struct timer *timer_of(struct board *b, unsigned address) {
    if (address >= TCCR2A)
        return &b->timer[2];
    return &b->timer[address >= TCCR1A ? 1 : 0];
}

/* Outside PWM a compare value is in use as soon as it is written. */
static void set_shape(struct timer *t, enum shape shape) {
    if (shape != t->shape)
        t->position = count_at(t, t->position);
    t->shape = shape;
    if (!pwm(t))
        memcpy(t->compare, t->buffer, sizeof t->compare);
}

static void set_mode_8(struct timer *t) {
    unsigned wgm = (control_a(t) & 3u) | (control_b(t) >> 1 & 4u);
    static const uint8_t shape[8] = {SHAPE_NORMAL, SHAPE_PHASE_CORRECT, SHAPE_CTC, SHAPE_FAST_PWM,
                                     SHAPE_NORMAL, SHAPE_PHASE_CORRECT, SHAPE_NORMAL, SHAPE_FAST_PWM};
    set_shape(t, shape[wgm]);
    t->max = 0xff;
    t->top = wgm == 2 || wgm == 5 || wgm == 7 ? t->compare[0] : 0xff;
}

static enum shape shape_16(unsigned wgm) {
    if (wgm == 0 || wgm == 13)
        return SHAPE_NORMAL;
    if (wgm == 4 || wgm == 12)
        return SHAPE_CTC;
    return wgm & 4 ? SHAPE_FAST_PWM : SHAPE_PHASE_CORRECT;
}

static uint32_t top_16(const struct timer *t, unsigned wgm) {
    static const uint16_t top[8] = {0xffff, 0xff, 0x1ff, 0x3ff, 0, 0xff, 0x1ff, 0x3ff};
    if (wgm == 13)
        return 0xffff;
    if (wgm < 8)
        return wgm == 4 ? t->compare[0] : top[wgm];
    return wgm & 1 ? t->compare[0] : t->capture;
}

static void set_mode_16(struct timer *t) {
    unsigned wgm = (control_a(t) & 3u) | (control_b(t) >> 1 & 12u);
    set_shape(t, shape_16(wgm));
    t->max = 0xffff;
    t->top = top_16(t, wgm);
}

/* The mode, the clock and the top as the registers now say. */
static void configure(struct timer *t, uint64_t cycle) {
    if (t->index == 1)
        set_mode_16(t);
    else
        set_mode_8(t);
    t->divider = DIVIDER[t->index][control_b(t) & 7];
    if (t->index == 2 && t->board->avr->data[ASSR] & 0x20)
        t->divider = 0;
    timer_plan(t, cycle);
}

/* A strobe of a force bit acts like a match, without its flag. */
static void force(struct timer *t, unsigned bits, uint64_t cycle) {
    for (unsigned x = 0; x < 2; x++)
        if (bits & 0x80u >> x && !pwm(t))
            set_latch(t, x, matched_level(t, x), cycle);
}

/* Bring everything up to the end of the write in execution. */
static uint64_t begin_write(struct board *b, struct timer *t) {
    uint64_t done = access_cycle(b->avr) + 1;
    synchronise(b, done);
    advance(t, done);
    return done;
}

static void end_write(struct board *b, struct timer *t, uint64_t done) {
    configure(t, done);
    interrupts_refresh(b, done);
    end_batch(b);
}

static void control_written(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param) {
    struct board *b = param;
    struct timer *t = timer_of(b, address);
    uint64_t done = begin_write(b, t);
    unsigned offset = address - CONTROL[t->index];
    bool forces = offset == (t->index == 1 ? 2 : 1);
    avr->data[address] = forces ? value & 0x3f : value;
    configure(t, done);
    if (forces)
        force(t, value, done);
    for (unsigned x = 0; x < 2; x++)
        pin_update(b, OUTPUT[t->index][x], done);
    end_write(b, t, done);
}

/* The value of a 16-bit write is complete with its low byte; the high byte waits in TEMP. */
static uint16_t whole(const struct board *b, const struct timer *t, uint8_t low) {
    return (uint16_t)(t->index == 1 ? b->temporary << 8 | low : low);
}

static void temporary_written(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param) {
    (void)avr, (void)address;
    ((struct board *)param)->temporary = value;
}

static void count_written(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param) {
    struct board *b = param;
    struct timer *t = timer_of(b, address);
    uint64_t done = begin_write(b, t);
    (void)avr;
    t->position = whole(b, t, value);
    t->blocked = true;
    end_write(b, t, done);
}

static void compare_written(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param) {
    struct board *b = param;
    struct timer *t = timer_of(b, address);
    uint64_t done = begin_write(b, t);
    unsigned x = t->index == 1 ? (address - OCR1AL) / 2 : address - (t->index ? OCR2A : OCR0A);
    t->buffer[x] = whole(b, t, value);
    avr->data[address] = value;
    if (t->index == 1)
        avr->data[address + 1] = b->temporary;
    end_write(b, t, done);
}

/* ICR1 can be written where it is the top. */
static void capture_written(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param) {
    struct board *b = param;
    struct timer *t = &b->timer[1];
    uint64_t done = begin_write(b, t);
    (void)avr, (void)address;
    unsigned wgm = (control_a(t) & 3u) | (control_b(t) >> 1 & 12u);
    if (wgm == 8 || wgm == 10 || wgm == 12 || wgm == 14)
        t->capture = whole(b, t, value);
    end_write(b, t, done);
}

static uint8_t count_read(avr_t *avr, avr_io_addr_t address, void *param) {
    struct board *b = param;
    struct timer *t = timer_of(b, address);
    uint64_t cycle = access_cycle(avr);
    synchronise(b, cycle);
    uint16_t count = timer_count(t, cycle);
    if (t->index == 1)
        b->temporary = (uint8_t)(count >> 8);
    return (uint8_t)count;
}

static uint8_t temporary_read(avr_t *avr, avr_io_addr_t address, void *param) {
    (void)avr, (void)address;
    return ((struct board *)param)->temporary;
}

static uint8_t capture_read(avr_t *avr, avr_io_addr_t address, void *param) {
    struct board *b = param;
    (void)address;
    synchronise(b, access_cycle(avr));
    b->temporary = (uint8_t)(b->timer[1].capture >> 8);
    return (uint8_t)b->timer[1].capture;
}

static uint8_t flags_read(avr_t *avr, avr_io_addr_t address, void *param) {
    synchronise(param, access_cycle(avr));
    return avr->data[address];
}

/* What is written as one is cleared, and nothing else. */
static void flags_written(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param) {
    struct board *b = param;
    uint64_t done = access_cycle(avr) + 1;
    synchronise(b, done - 1);
    avr->data[address] &= (uint8_t)~written_flags(avr, value);
    timer_plan(&b->timer[address - TIFR0], done - 1);
    interrupts_refresh(b, done);
    end_batch(b);
}

/* GTCCR: PSRSYNC (bit 0) and PSRASY (bit 1) reset the prescalers; TSM (bit 7) holds them so. */
static void prescalers_written(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param) {
    struct board *b = param;
    uint64_t done = access_cycle(avr) + 1;
    synchronise(b, done);
    for (unsigned i = 0; i < 3; i++)
        advance(&b->timer[i], done);
    for (unsigned i = 0; i < 2; i++) {
        bool reset = value >> i & 1;
        if (reset || b->prescaler_held[i])
            b->prescaler_zero[i] = done;
        b->prescaler_held[i] = reset && value & 0x80;
    }
    avr->data[address] = value & 0x80 ? value & 0x83 : 0;
    for (unsigned i = 0; i < 3; i++)
        timer_plan(&b->timer[i], done);
    end_batch(b);
}

static void attach_8(struct board *b, unsigned control, unsigned count, unsigned compare) {
    on_write(b, control, control_written);
    on_write(b, control + 1, control_written);
    on_write(b, count, count_written);
    on_read(b, count, count_read);
    on_write(b, compare, compare_written);
    on_write(b, compare + 1, compare_written);
}

static void attach_16(struct board *b) {
    static const uint8_t high[] = {TCNT1L + 1, ICR1L + 1, OCR1AL + 1, OCR1AL + 3};
    for (unsigned i = 0; i < 3; i++)
        on_write(b, TCCR1A + i, control_written);
    for (unsigned i = 0; i < sizeof high; i++)
        on_write(b, high[i], temporary_written);
    on_write(b, TCNT1L, count_written);
    on_write(b, ICR1L, capture_written);
    on_write(b, OCR1AL, compare_written);
    on_write(b, OCR1AL + 2, compare_written);
    on_read(b, TCNT1L, count_read);
    on_read(b, TCNT1L + 1, temporary_read);
    on_read(b, ICR1L, capture_read);
    on_read(b, ICR1L + 1, temporary_read);
}

void timers_attach(struct board *b) {
    attach_8(b, TCCR0A, TCNT0, OCR0A);
    attach_16(b);
    attach_8(b, TCCR2A, TCNT2, OCR2A);
    on_write(b, GTCCR, prescalers_written);
    for (unsigned i = 0; i < 3; i++) {
        on_write(b, TIFR0 + i, flags_written);
        on_read(b, TIFR0 + i, flags_read);
    }
}

void timers_reset(struct board *b, uint64_t cycle) {
    b->temporary = 0;
    for (unsigned i = 0; i < 2; i++) {
        b->prescaler_zero[i] = cycle;
        b->prescaler_held[i] = false;
    }
    for (unsigned i = 0; i < 3; i++) {
        struct timer *t = &b->timer[i];
        memset(t, 0, sizeof *t);
        t->board = b;
        t->index = (uint8_t)i;
        t->at = cycle;
        *flags(t) = 0;
        configure(t, cycle);
    }
}
