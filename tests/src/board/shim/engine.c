/* The engine: instructions in batches up to the next event, events in order of their cycles. */
#include "board.h"
#include "shim.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* ---- events ---------------------------------------------------------------------------------- */

static uint64_t least(uint64_t a, uint64_t b) { return a < b ? a : b; }

static uint64_t next_event(const struct board *b) {
    uint64_t next = least(b->timer[0].next, least(b->timer[1].next, b->timer[2].next));
    next = least(next, least(b->transmitted_at, b->receive_at));
    next = least(next, b->watchdog_at);
    if (b->plan_done < b->plan.count)
        next = least(next, b->plan.items[b->plan_done].cycle);
    return next;
}

static void fire(struct board *b, uint64_t cycle) {
    for (unsigned i = 0; i < 3; i++)
        if (b->timer[i].next == cycle)
            timer_fire(&b->timer[i], cycle);
    if (b->plan_done < b->plan.count && b->plan.items[b->plan_done].cycle <= cycle)
        pins_planned(b, cycle);
    if (b->transmitted_at == cycle)
        serial_transmitted(b, cycle);
    if (b->receive_at == cycle)
        serial_received(b, cycle);
    if (b->watchdog_at <= cycle)
        watchdog_expired(b, cycle);
}

/* Let all happen that is due up to and with a cycle. */
void synchronise(struct board *b, uint64_t cycle) {
    for (uint64_t next; !b->reset_due && (next = next_event(b)) <= cycle;)
        fire(b, next);
}

/* ---- reset ----------------------------------------------------------------------------------- */

void request_reset(struct board *b, uint8_t cause, uint64_t cycle) {
    if (b->reset_due)
        return;
    b->reset_due = cause;
    b->reset_at = cycle;
    end_batch(b);
}

static void reset(struct board *b) {
    avr_t *avr = b->avr;
    uint8_t cause = b->reset_due, kept = avr->data[MCUSR];
    uint64_t cycle = b->reset_at;
    b->reset_due = 0;
    avr_reset(avr);
    avr->data[MCUSR] = cause == CAUSE_POWER_ON ? cause : kept | cause;
    interrupts_reset(b);
    pins_reset(b, cycle);
    timers_reset(b, cycle);
    serial_reset(b, cycle);
    watchdog_reset(b, cycle, cause == CAUSE_WATCHDOG);
    interrupts_refresh(b, cycle);
    b->resets++;
}

/* ---- instructions ---------------------------------------------------------------------------- */

/* simavr's own modules (memory of the EEPROM, converter) keep their timers. */
static uint64_t next_module(const avr_t *avr) {
    return avr->cycle_timers.timer ? avr->cycle_timers.timer->when : NEVER;
}

/* Execute instructions for about so many cycles, less if something intervenes. */
static void run_batch(struct board *b, uint64_t cycles) {
    avr_t *avr = b->avr;
    avr->run_cycle_count = b->shadow ? 1 : cycles;
    avr->interrupt_state = 0;
    avr_flashaddr_t next = avr_run_one(avr);
    b->shadow = avr->interrupt_state < 0;
    avr->pc = next;
    if (avr->state == cpu_Sleeping && !(avr->data[SMCR] & 1))
        avr->state = cpu_Running;
}

/* Asleep until an event brings an interrupt. */
static void sleep_until(struct board *b, uint64_t cycle) {
    avr_t *avr = b->avr;
    if (cycle > avr->cycle)
        avr->cycle = cycle;
    synchronise(b, avr->cycle);
}

static bool serve(struct board *b) {
    avr_t *avr = b->avr;
    bool asleep = avr->state == cpu_Sleeping;
    if (!b->pending || !avr->sreg[S_I] || (b->shadow && !asleep))
        return false;
    if (asleep)
        avr->state = cpu_Running;
    return interrupts_serve(b, asleep ? 4 : 0);
}

/* An interrupt of one of simavr's own modules. */
static void serve_module(struct board *b) {
    avr_t *avr = b->avr;
    avr_flashaddr_t before = avr->pc;
    if (b->pending || b->shadow || !avr->sreg[S_I] || !avr_has_pending_interrupts(avr))
        return;
    avr->interrupt_state = 1;
    avr_service_interrupts(avr);
    if (avr->pc != before) {
        b->depth++;
        avr->cycle += 4;
    }
}

static bool alive(const struct board *b) {
    return b->avr->state == cpu_Running || b->avr->state == cpu_Sleeping;
}

static void step(struct board *b, uint64_t until) {
    avr_t *avr = b->avr;
    synchronise(b, avr->cycle);
    if (b->reset_due) {
        reset(b);
        return;
    }
    if (next_module(avr) <= avr->cycle)
        avr_cycle_timer_process(avr);
    serve_module(b);
    if (serve(b) || avr->cycle >= until)
        return;
    uint64_t next = least(until, least(next_event(b), next_module(avr)));
    if (avr->state == cpu_Sleeping)
        sleep_until(b, next);
    else
        run_batch(b, next > avr->cycle ? next - avr->cycle : 1);
}

/* ---- what Rust calls ------------------------------------------------------------------------- */

/* simavr's complaints: the first is kept, and an invalid instruction stops the core. */
static void complain(avr_t *avr, int level, const char *format, va_list arguments) {
    if (level > LOG_ERROR || !avr || !avr->custom.data)
        return;
    struct board *b = avr->custom.data;
    if (!b->message[0])
        vsnprintf(b->message, sizeof b->message, format, arguments);
    if (strstr(format, "Invalid Opcode"))
        avr->state = cpu_Crashed;
}

struct board *board_new(const uint8_t *flash, size_t size) {
    avr_global_logger_set(complain);
    avr_t *avr = avr_make_mcu_by_name("atmega328p");
    struct board *b = calloc(1, sizeof *b);
    if (!avr || !b)
        return NULL;
    b->avr = avr;
    avr_init(avr);
    avr->custom.data = b;
    avr->frequency = 16000000;
    if (size > avr->flashend + 1u)
        size = avr->flashend + 1u;
    memcpy(avr->flash, flash, size);
    pins_attach(b);
    timers_attach(b);
    serial_attach(b);
    interrupts_attach(b);
    watchdog_attach(b);
    board_reset(b, CAUSE_POWER_ON);
    b->resets = 0;
    return b;
}

void board_free(struct board *b) {
    avr_terminate(b->avr);
    free(b->edges.items);
    free(b->plan.items);
    free(b->line.items);
    free(b->sent.items);
    free(b->avr);
    free(b);
}

/* At power-on the memory holds nothing in particular: a pattern that is not zero. */
void board_reset(struct board *b, uint8_t cause) {
    if (cause == CAUSE_POWER_ON)
        memset(b->avr->data + 0x100, 0xa5, b->avr->ramend + 1u - 0x100);
    request_reset(b, cause, b->avr->cycle);
    reset(b);
    if (cause == CAUSE_POWER_ON)
        b->stack_low = b->avr->ramend;
}

bool board_run(struct board *b, uint64_t until) {
    while (b->avr->cycle < until && alive(b))
        step(b, until);
    synchronise(b, b->avr->cycle);
    if (b->reset_due)
        reset(b);
    return alive(b);
}

/* Exactly one instruction, or one interrupt entry. */
bool board_step(struct board *b) { return board_run(b, b->avr->cycle + 1); }

uint64_t board_cycle(const struct board *b) { return b->avr->cycle; }
bool board_alive(const struct board *b) { return alive(b); }
bool board_asleep(const struct board *b) { return b->avr->state == cpu_Sleeping; }
uint64_t board_resets(const struct board *b) { return b->resets; }
const char *board_message(const struct board *b) { return b->message; }
uint32_t board_pc(const struct board *b) { return b->avr->pc; }
void board_set_pc(struct board *b, uint32_t pc) { b->avr->pc = pc; }
int board_depth(const struct board *b) { return b->depth; }
bool board_interrupts_on(const struct board *b) { return b->avr->sreg[S_I]; }
uint16_t board_stack_low(const struct board *b) { return b->stack_low; }
uint64_t board_latency(const struct board *b, unsigned vector) { return b->latency[vector]; }
uint64_t board_entries(const struct board *b, unsigned vector) { return b->entries[vector]; }

void board_set_interrupts(struct board *b, bool on) { b->avr->sreg[S_I] = on; }

void board_forget_latency(struct board *b) {
    memset(b->latency, 0, sizeof b->latency);
    memset(b->entries, 0, sizeof b->entries);
}

void board_set_watchdog_hz(struct board *b, double hz) {
    b->watchdog_hz = hz;
    watchdog_plan(b);
}

/* ---- memory ---------------------------------------------------------------------------------- */

uint8_t board_peek(struct board *b, uint16_t address) {
    avr_t *avr = b->avr;
    if (address == TCNT0 || address == TCNT2)
        return (uint8_t)timer_count(&b->timer[address == TCNT2 ? 2 : 0], avr->cycle);
    if (address == TCNT1L || address == TCNT1L + 1)
        return (uint8_t)(timer_count(&b->timer[1], avr->cycle) >> 8 * (address - TCNT1L));
    if (address == ICR1L || address == ICR1L + 1)
        return (uint8_t)(b->timer[1].capture >> 8 * (address - ICR1L));
    if (address == R_SREG)
        READ_SREG_INTO(avr, avr->data[R_SREG]);
    return address <= avr->ramend ? avr->data[address] : 0;
}

void board_poke(struct board *b, uint16_t address, uint8_t value) {
    if (address <= b->avr->ramend)
        b->avr->data[address] = value;
    interrupts_refresh(b, b->avr->cycle);
}

uint8_t board_flash(const struct board *b, uint32_t address) {
    return address <= b->avr->flashend ? b->avr->flash[address] : 0xff;
}

void board_set_flash(struct board *b, uint32_t address, uint8_t value) {
    if (address <= b->avr->flashend)
        b->avr->flash[address] = value;
}

/* ---- wires ----------------------------------------------------------------------------------- */

static void rewire(struct board *b) {
    pins_update(b, b->avr->cycle);
    interrupts_refresh(b, b->avr->cycle);
}

void board_drive(struct board *b, unsigned pin, int level) {
    b->driven[pin] = (int8_t)level;
    rewire(b);
}

void board_stick(struct board *b, unsigned pin, int level) {
    b->stuck[pin] = (int8_t)level;
    rewire(b);
}

void board_connect(struct board *b, int from, unsigned to) {
    b->source[to] = (int8_t)from;
    rewire(b);
}

/* A change to come, kept in order of the cycles. */
void board_drive_at(struct board *b, uint64_t cycle, unsigned pin, int level) {
    struct pin_change change = {cycle, (uint8_t)pin, (int8_t)level};
    LIST_PUSH(b->plan, change);
    for (size_t i = b->plan.count - 1; i > b->plan_done && b->plan.items[i - 1].cycle > cycle; i--) {
        b->plan.items[i] = b->plan.items[i - 1];
        b->plan.items[i - 1] = change;
    }
}

bool board_level(const struct board *b, unsigned pin) { return b->level[pin]; }

size_t board_edges(const struct board *b, const struct edge **edges) {
    *edges = b->edges.items;
    return b->edges.count;
}

void board_forget_edges(struct board *b) { b->edges.count = 0; }

/* ---- serial line ----------------------------------------------------------------------------- */

static void forget_received(struct board *b) {
    size_t left = b->line.count - b->line_done;
    if (b->line_done < 4096)
        return;
    memmove(b->line.items, b->line.items + b->line_done, left);
    b->line.count = left;
    b->line_done = 0;
}

void board_send(struct board *b, const uint8_t *bytes, size_t count) {
    forget_received(b);
    for (size_t i = 0; i < count; i++)
        LIST_PUSH(b->line, bytes[i]);
    serial_listen(b, b->avr->cycle);
}

size_t board_unsent(const struct board *b) { return b->line.count - b->line_done; }
uint64_t board_overruns(const struct board *b) { return b->overruns; }
uint64_t board_cycles_per_byte(const struct board *b) { return serial_cycles_per_byte(b); }

size_t board_sent(const struct board *b, const struct byte_sent **sent) {
    *sent = b->sent.items;
    return b->sent.count;
}

void board_forget_sent(struct board *b) { b->sent.count = 0; }
