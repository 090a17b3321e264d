/* What Rust calls. Pins are numbers below 20, levels 0, 1 or -1 for none. */
#ifndef PHASEWALK_SHIM_H
#define PHASEWALK_SHIM_H

#include "board.h"

struct board *board_new(const uint8_t *flash, size_t size);
void board_free(struct board *b);
void board_reset(struct board *b, uint8_t cause);
bool board_run(struct board *b, uint64_t until);
bool board_step(struct board *b);
uint64_t board_cycle(const struct board *b);
bool board_alive(const struct board *b);
bool board_asleep(const struct board *b);
uint64_t board_resets(const struct board *b);
const char *board_message(const struct board *b);
uint32_t board_pc(const struct board *b);
void board_set_pc(struct board *b, uint32_t pc);
int board_depth(const struct board *b);
bool board_interrupts_on(const struct board *b);
void board_set_interrupts(struct board *b, bool on);
uint16_t board_stack_low(const struct board *b);
uint64_t board_latency(const struct board *b, unsigned vector);
uint64_t board_entries(const struct board *b, unsigned vector);
void board_forget_latency(struct board *b);
void board_set_watchdog_hz(struct board *b, double hz);
uint8_t board_peek(struct board *b, uint16_t address);
void board_poke(struct board *b, uint16_t address, uint8_t value);
uint8_t board_flash(const struct board *b, uint32_t address);
void board_set_flash(struct board *b, uint32_t address, uint8_t value);
void board_drive(struct board *b, unsigned pin, int level);
void board_drive_at(struct board *b, uint64_t cycle, unsigned pin, int level);
void board_stick(struct board *b, unsigned pin, int level);
void board_connect(struct board *b, int from, unsigned to);
bool board_level(const struct board *b, unsigned pin);
size_t board_edges(const struct board *b, const struct edge **edges);
void board_forget_edges(struct board *b);
void board_send(struct board *b, const uint8_t *bytes, size_t count);
size_t board_unsent(const struct board *b);
uint64_t board_overruns(const struct board *b);
uint64_t board_cycles_per_byte(const struct board *b);
size_t board_sent(const struct board *b, const struct byte_sent **sent);
void board_forget_sent(struct board *b);

#endif
