/* What the instruction in execution does to the registers, and when. */
#include "board.h"

static uint16_t opcode(const avr_t *avr) {
    return (uint16_t)(avr->flash[avr->pc] | avr->flash[avr->pc + 1] << 8);
}

/* The cycle in which the instruction in execution accesses data: its first for IN, OUT, SBIC and
 * SBIS, its second for all others. */
uint64_t access_cycle(const avr_t *avr) {
    uint16_t op = opcode(avr);
    bool first = (op & 0xf000) == 0xb000 || (op & 0xfd00) == 0x9900;
    return avr->cycle + (first ? 0 : 1);
}

/* What is written to a register of flags: SBI writes its own bit alone, simavr writes them all. */
uint8_t written_flags(const avr_t *avr, uint8_t value) {
    uint16_t op = opcode(avr);
    return (op & 0xff00) == 0x9a00 ? (uint8_t)(1u << (op & 7)) : value;
}

/* Have `reader` called instead of simavr's own. */
void on_read(struct board *b, unsigned address, avr_io_read_t reader) {
    b->avr->io[AVR_DATA_TO_IO(address)].r.c = reader;
    b->avr->io[AVR_DATA_TO_IO(address)].r.param = b;
}

/* Have `writer` called instead of simavr's own. */
void on_write(struct board *b, unsigned address, avr_io_write_t writer) {
    b->avr->io[AVR_DATA_TO_IO(address)].w.c = writer;
    b->avr->io[AVR_DATA_TO_IO(address)].w.param = b;
}

/* Return to the engine after this instruction: what is due next may have changed. */
void end_batch(struct board *b) { b->avr->run_cycle_count = 1; }
