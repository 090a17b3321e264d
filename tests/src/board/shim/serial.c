/*
 * The serial port (USART0, asynchronous).
 *
 * A byte takes start bit, data bits, parity and stop bits at the rate the program has set: 640
 * cycles at 250,000 baud. The receiver holds two bytes and a third in its shift register, which is
 * lost when the next start bit comes. The sender is paced by the same rate; what is sent while the
 * receiver is off waits until it is on.
 */
#include "board.h"

enum { RXC = 0x80, TXC = 0x40, UDRE = 0x20, DOR = 0x08, U2X = 0x02, RXEN = 0x10, TXEN = 0x08 };

static uint8_t *status(struct board *b) { return &b->avr->data[UCSR0A]; }

/* Length of a byte on the line. */
uint64_t serial_cycles_per_byte(const struct board *b) {
    const uint8_t *data = b->avr->data;
    uint64_t divisor = (uint64_t)(data[UBRR0L] | (data[UBRR0H] & 15) << 8) + 1;
    unsigned bits = 5 + (data[UCSR0C] >> 1 & 3), parity = data[UCSR0C] >> 5 & 1;
    if (data[UCSR0B] & 4)
        bits = 9;
    return divisor * (data[UCSR0A] & U2X ? 8 : 16) * (2 + bits + parity + (data[UCSR0C] >> 3 & 1));
}

/* ---- to the host ----------------------------------------------------------------------------- */

static void transmit(struct board *b, uint8_t value, uint64_t cycle) {
    b->transmit_shift = value;
    b->transmitted_at = cycle + serial_cycles_per_byte(b);
}

/* The stop bit has ended. */
void serial_transmitted(struct board *b, uint64_t cycle) {
    LIST_PUSH(b->sent, ((struct byte_sent){cycle, b->transmit_shift}));
    b->transmitted_at = NEVER;
    if (b->transmit_waiting) {
        b->transmit_waiting = false;
        *status(b) |= UDRE;
        transmit(b, b->transmit_buffer, cycle);
    } else {
        *status(b) |= TXC;
    }
    interrupts_refresh(b, cycle);
}

static void data_written(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param) {
    struct board *b = param;
    uint64_t done = access_cycle(avr) + 1;
    (void)address;
    synchronise(b, done);
    if (avr->data[UCSR0B] & TXEN && avr->data[UCSR0A] & UDRE) {
        if (b->transmitted_at == NEVER) {
            transmit(b, value, done);
        } else {
            b->transmit_buffer = value;
            b->transmit_waiting = true;
            *status(b) &= (uint8_t)~UDRE;
        }
    }
    interrupts_renew(b, V_USART_UDRE, done);
    interrupts_refresh(b, done);
    end_batch(b);
}

/* ---- from the host --------------------------------------------------------------------------- */

/* If a byte waits on the line, its start bit comes now. */
void serial_listen(struct board *b, uint64_t cycle) {
    if (b->receiving || b->line_done == b->line.count || !(b->avr->data[UCSR0B] & RXEN))
        return;
    if (b->receive_waiting) {
        b->receive_waiting = false;
        b->overrun = true;
        b->overruns++;
    }
    b->receiving = true;
    b->receive_at = cycle + serial_cycles_per_byte(b);
}

static void store(struct board *b, uint8_t value) {
    b->receive_buffer[b->receive_count++] = value;
    *status(b) |= RXC;
}

/* A byte has arrived. */
void serial_received(struct board *b, uint64_t cycle) {
    uint8_t value = b->line.items[b->line_done++];
    if (b->line_done == b->line.count)
        b->line_done = b->line.count = 0;
    b->receiving = false;
    b->receive_at = NEVER;
    if (b->receive_count < 2) {
        store(b, value);
    } else {
        b->receive_shift = value;
        b->receive_waiting = true;
    }
    serial_listen(b, cycle);
    interrupts_refresh(b, cycle);
}

static uint8_t data_read(avr_t *avr, avr_io_addr_t address, void *param) {
    struct board *b = param;
    uint64_t cycle = access_cycle(avr);
    uint8_t value = b->receive_buffer[0];
    (void)address;
    synchronise(b, cycle);
    if (b->receive_count) {
        value = b->receive_buffer[0];
        b->receive_buffer[0] = b->receive_buffer[1];
        b->receive_count--;
    }
    b->overrun = false;
    if (b->receive_waiting) {
        b->receive_waiting = false;
        store(b, b->receive_shift);
    }
    if (!b->receive_count)
        *status(b) &= (uint8_t)~RXC;
    interrupts_renew(b, V_USART_RX, cycle + 1);
    interrupts_refresh(b, cycle + 1);
    end_batch(b);
    return value;
}

/* ---- control --------------------------------------------------------------------------------- */

static uint8_t status_read(avr_t *avr, avr_io_addr_t address, void *param) {
    struct board *b = param;
    synchronise(b, access_cycle(avr));
    return (uint8_t)((avr->data[address] & ~DOR) | (b->overrun ? DOR : 0));
}

/* TXC is cleared by a one; U2X and MPCM can be written. */
static void status_written(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param) {
    struct board *b = param;
    uint64_t done = access_cycle(avr) + 1;
    synchronise(b, done - 1);
    uint8_t kept = avr->data[address] & (RXC | TXC | UDRE);
    avr->data[address] = (uint8_t)((kept & ~(value & TXC)) | (value & 3));
    interrupts_refresh(b, done);
    end_batch(b);
}

static void empty_receiver(struct board *b) {
    b->receive_count = 0;
    b->receiving = b->receive_waiting = b->overrun = false;
    b->receive_at = NEVER;
    *status(b) &= (uint8_t)~RXC;
}

static void control_written(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param) {
    struct board *b = param;
    uint64_t done = access_cycle(avr) + 1;
    synchronise(b, done);
    avr->data[address] = value;
    if (!(value & RXEN))
        empty_receiver(b);
    serial_listen(b, done);
    interrupts_refresh(b, done);
    end_batch(b);
}

void serial_attach(struct board *b) {
    on_write(b, UDR0, data_written);
    on_read(b, UDR0, data_read);
    on_write(b, UCSR0A, status_written);
    on_read(b, UCSR0A, status_read);
    on_write(b, UCSR0B, control_written);
    b->avr->io[AVR_DATA_TO_IO(UBRR0L)].w.c = NULL;
}

void serial_reset(struct board *b, uint64_t cycle) {
    (void)cycle;
    empty_receiver(b);
    b->transmit_waiting = false;
    b->transmitted_at = NEVER;
    b->avr->data[UCSR0A] = UDRE;
    b->avr->data[UCSR0B] = 0;
    b->avr->data[UCSR0C] = 6;
}
