/* A design of directmpc as a native library: the converted VHDL itself, clock by clock.
 *
 * One library holds one design. Instances are independent of one another and may run in different
 * threads; one instance is used by one thread at a time. No function keeps a pointer that it is given.
 *
 * Ports are numbered as directmpc_ports lists them. Values are words of at most 32 bits; bits above a
 * port's width are ignored. The clock is driven here and is no port.
 */
#ifndef DIRECTMPC_DESIGN_H
#define DIRECTMPC_DESIGN_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif
#ifdef __GNUC__
#pragma GCC visibility push(default)
#endif

typedef struct directmpc_design directmpc_design;

/* One line for each port, "in NAME WIDTH" or "out NAME WIDTH", in the order of their numbers. */
const char *directmpc_ports(void);

/* A new instance after a reset, all inputs 0; null without memory. A board: after power-on, permit 1. */
directmpc_design *directmpc_create(void);
void directmpc_destroy(directmpc_design *design);

/* Four clocks with rst = 1. Inputs stay as they are. A board resets itself at power-on alone: nothing. */
void directmpc_reset(directmpc_design *design);

/* An input's value from now on; a port's value now. */
void directmpc_put(directmpc_design *design, uint32_t port, uint32_t value);
uint32_t directmpc_get(const directmpc_design *design, uint32_t port);

/* Rising edges of the clock since the instance was made. */
uint64_t directmpc_edges(const directmpc_design *design);
void directmpc_clocks(directmpc_design *design, uint32_t clocks);

/* Lets clocks pass until a port has another value, at most `clocks`; returns how many have passed. */
uint32_t directmpc_until(directmpc_design *design, uint32_t port, uint32_t clocks);

/* How many of the edges have not been computed, because nothing but counts could change. */
uint64_t directmpc_skipped(const directmpc_design *design);

/* One decision. The instance runs until busy is 0, takes `inputs` with a start of one clock and runs
 * until valid is 1. inputs, outputs: one word for each input (rst, start and the bus are skipped, but
 * have a place) and for each output, in port order. Returns the number of the edge at which valid is
 * seen less that of the start; 0 if there was none within `limit` clocks. */
uint32_t directmpc_decide(directmpc_design *design, const uint32_t *inputs, uint32_t *outputs,
                          uint32_t limit);

/* One access to the registers over AXI4-Lite: 0 OKAY, 2 SLVERR, -1 no answer or no registers. */
int directmpc_write(directmpc_design *design, uint32_t address, uint32_t word);
int directmpc_read(directmpc_design *design, uint32_t address, uint32_t *word);

/* One SPI transaction with a board, mode 0, a clock a bit: `count` bytes there and back. -1: no such pins. */
int directmpc_transfer(directmpc_design *design, const uint8_t *bytes, uint8_t *back, size_t count);

/* The whole state, for the same library alone: its size in bytes, a copy of it, and back (0: done,
 * -1: the bytes are not a state of this design). */
size_t directmpc_state_size(const directmpc_design *design);
void directmpc_save(const directmpc_design *design, void *bytes);
int directmpc_restore(directmpc_design *design, const void *bytes, size_t size);

#ifdef __GNUC__
#pragma GCC visibility pop
#endif
#ifdef __cplusplus
}
#endif
#endif
