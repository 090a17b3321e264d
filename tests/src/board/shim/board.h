/*
 * An Arduino Uno: simavr's processor core with peripherals of its own.
 *
 * simavr 1.6 executes the instructions, and counts their cycles, as the data sheet says. Its timers,
 * pins, serial port, watchdog and interrupt entry do not keep the data sheet's times, so they are
 * written here a second time and simavr's are left without work.
 *
 * Time is the number of the processor's clock cycle since power-on. What happens "at" cycle n
 * happens at the clock edge that begins cycle n. An instruction that begins at cycle n reads data
 * during cycle n (IN, SBIC, SBIS) or n + 1 (all others); what it writes holds from the end of that
 * cycle on.
 */
#ifndef PHASEWALK_BOARD_H
#define PHASEWALK_BOARD_H

#include <simavr/avr_watchdog.h>
#include <simavr/sim_avr.h>
#include <simavr/sim_core.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define NEVER UINT64_MAX

/* Registers of the ATmega328P, data addresses. */
enum {
    PINB = 0x23, PINC = 0x26, PIND = 0x29, /* DDR and PORT follow at + 1 and + 2 */
    TIFR0 = 0x35, PCIFR = 0x3b, EIFR = 0x3c, EIMSK = 0x3d, GTCCR = 0x43,
    TCCR0A = 0x44, TCNT0 = 0x46, OCR0A = 0x47,
    SMCR = 0x53, MCUSR = 0x54, MCUCR = 0x55, SPL = 0x5d, SPH = 0x5e, WDTCSR = 0x60,
    PCICR = 0x68, EICRA = 0x69, PCMSK0 = 0x6b, TIMSK0 = 0x6e,
    TCCR1A = 0x80, TCNT1L = 0x84, ICR1L = 0x86, OCR1AL = 0x88,
    TCCR2A = 0xb0, TCNT2 = 0xb2, OCR2A = 0xb3, ASSR = 0xb6,
    UCSR0A = 0xc0, UCSR0B = 0xc1, UCSR0C = 0xc2, UBRR0L = 0xc4, UBRR0H = 0xc5, UDR0 = 0xc6,
};

/* Interrupt vectors, by priority. */
enum {
    V_INT0 = 1, V_INT1, V_PCINT0, V_PCINT1, V_PCINT2, V_WDT,
    V_T2_COMPA, V_T2_COMPB, V_T2_OVF, V_T1_CAPT, V_T1_COMPA, V_T1_COMPB, V_T1_OVF,
    V_T0_COMPA, V_T0_COMPB, V_T0_OVF, V_SPI, V_USART_RX, V_USART_UDRE, V_USART_TX,
    VECTORS = 26,
};

/* Bits of MCUSR: causes of a reset. */
enum { CAUSE_POWER_ON = 1, CAUSE_EXTERNAL = 2, CAUSE_BROWN_OUT = 4, CAUSE_WATCHDOG = 8 };

/* Arduino's pins: D0 to D13, then A0 to A5. */
#define PINS 20
#define FLOATING (-1)

/* A change of the level on a wire, or (pin 0xff) unused. */
struct edge {
    uint64_t cycle;
    uint8_t pin;
    uint8_t level;
};

/* A byte on the serial line, and the cycle at which its stop bit ended. */
struct byte_sent {
    uint64_t cycle;
    uint8_t value;
};

/* Growing array of `item`. */
#define LIST(item) struct { item *items; size_t count, capacity; }

/* How a timer counts. */
enum shape { SHAPE_NORMAL, SHAPE_CTC, SHAPE_FAST_PWM, SHAPE_PHASE_CORRECT };

struct board;

struct timer {
    struct board *board;
    uint8_t index;
    uint64_t at;       /* the cycle up to which it was counted */
    uint32_t position; /* the count then; in phase-correct modes: of up and down together */
    uint32_t divider;  /* cycles per count; 0 = stopped */
    bool blocked;      /* the count was written: the next clock makes no match */
    enum shape shape;
    uint32_t top, max;
    uint16_t compare[2], buffer[2]; /* OCRnx, in use and written */
    uint16_t capture;
    uint8_t latch[2]; /* OCnx */
    uint64_t next;    /* when something will next change, or NEVER */
};

struct pin_change {
    uint64_t cycle;
    uint8_t pin;
    int8_t level;
};

struct board {
    avr_t *avr;
    avr_io_t io; /* hears the WDR instruction */
    struct timer timer[3];
    uint8_t temporary;           /* TEMP of the 16-bit registers */
    uint64_t prescaler_zero[2];  /* of timers 0 and 1; of timer 2 */
    bool prescaler_held[2];

    /* pins */
    int8_t driven[PINS], stuck[PINS], source[PINS]; /* FLOATING = not */
    uint8_t level[PINS];
    uint8_t sampled[3];   /* the levels one synchroniser clock ago, per port */
    uint64_t changed[3];  /* since when they differ */
    LIST(struct edge) edges;
    LIST(struct pin_change) plan; /* external changes to come, by cycle */
    size_t plan_done;

    /* interrupts */
    uint32_t pending;
    uint64_t raised[VECTORS];
    uint64_t latency[VECTORS];
    uint64_t entries[VECTORS];
    int depth;
    bool shadow; /* I was just set: one more instruction first */
    uint16_t stack_low;

    /* serial port */
    uint64_t transmitted_at, receive_at;
    uint8_t transmit_shift, transmit_buffer;
    bool transmit_waiting, receiving;
    uint8_t receive_buffer[2], receive_count, receive_shift;
    bool receive_waiting, overrun;
    uint64_t overruns;
    LIST(uint8_t) line; /* bytes to come */
    size_t line_done;
    LIST(struct byte_sent) sent;

    /* watchdog */
    uint64_t watchdog_start, watchdog_at, watchdog_change_until;
    double watchdog_hz;

    uint8_t reset_due; /* cause, at cycle reset_at */
    uint64_t reset_at;
    uint64_t resets;
    char message[256];
};

/* list.c */
void list_grow(void **items, size_t *capacity, size_t count, size_t size);
#define LIST_PUSH(list, value)                                                                     \
    do {                                                                                           \
        if ((list).count == (list).capacity)                                                       \
            list_grow((void **)&(list).items, &(list).capacity, (list).count,                      \
                      sizeof *(list).items);                                                       \
        (list).items[(list).count++] = (value);                                                    \
    } while (0)

/* access.c: what the instruction in execution does to the registers. */
uint64_t access_cycle(const avr_t *avr);
uint8_t written_flags(const avr_t *avr, uint8_t value);
void on_read(struct board *b, unsigned address, avr_io_read_t reader);
void on_write(struct board *b, unsigned address, avr_io_write_t writer);
void end_batch(struct board *b);

/* engine.c */
void synchronise(struct board *b, uint64_t cycle);
void request_reset(struct board *b, uint8_t cause, uint64_t cycle);

/* interrupts.c */
void interrupts_attach(struct board *b);
void interrupts_reset(struct board *b);
void interrupts_renew(struct board *b, unsigned vector, uint64_t cycle);
void interrupts_refresh(struct board *b, uint64_t cycle);
bool interrupts_serve(struct board *b, unsigned wake_cycles);

/* timers.c */
void timers_attach(struct board *b);
void timers_reset(struct board *b, uint64_t cycle);
void timer_plan(struct timer *t, uint64_t cycle);
void timer_fire(struct timer *t, uint64_t cycle);
void timer_capture(struct board *b, uint64_t cycle, bool rising);
uint16_t timer_count(struct timer *t, uint64_t cycle);
int timer_output(struct board *b, unsigned pin);

/* pins.c */
void pins_attach(struct board *b);
void pins_reset(struct board *b, uint64_t cycle);
void pin_update(struct board *b, unsigned pin, uint64_t cycle);
void pins_update(struct board *b, uint64_t cycle);
void pins_planned(struct board *b, uint64_t cycle);

/* serial.c */
void serial_attach(struct board *b);
void serial_reset(struct board *b, uint64_t cycle);
void serial_transmitted(struct board *b, uint64_t cycle);
void serial_received(struct board *b, uint64_t cycle);
void serial_listen(struct board *b, uint64_t cycle);
uint64_t serial_cycles_per_byte(const struct board *b);

/* watchdog.c */
void watchdog_attach(struct board *b);
void watchdog_reset(struct board *b, uint64_t cycle, bool expired);
void watchdog_expired(struct board *b, uint64_t cycle);
void watchdog_plan(struct board *b);

#endif
