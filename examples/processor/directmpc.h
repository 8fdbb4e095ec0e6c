/* SPDX-License-Identifier: Apache-2.0
 *
 * Driver of mpdcc_system for a processor on its AXI4-Lite bus. C11, no library, no allocation.
 *
 *   directmpc_open       who is there, gates off
 *   directmpc_load       a drive's registers, from `make registers DRIVE=... ARGS=--c`
 *   directmpc_start      gates may switch from the next decision on
 *   directmpc_begin      measurements in, the decision begins; once in a control period
 *   directmpc_take       the decision, on the interrupt
 *   directmpc_stop       gates off
 *   directmpc_clear      forget the gate guard's faults, gates off
 *
 * A drive is started anew after a fault by directmpc_clear and directmpc_start.
 */
#ifndef DIRECTMPC_H
#define DIRECTMPC_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* What every function returns. */
typedef enum {
    DIRECTMPC_OK = 0,
    DIRECTMPC_BUS,       /* the bus refused an access, or did not answer it */
    DIRECTMPC_UNKNOWN,   /* no mpdcc_system is there */
    DIRECTMPC_OTHER_MAP, /* its registers are of another version than this driver */
    DIRECTMPC_RANGE,     /* an address is no register of a drive, or a measurement does not fit its register */
    DIRECTMPC_TIMEOUT,   /* a commit did not come into force */
    DIRECTMPC_BUSY,      /* the decision before is not ready */
    DIRECTMPC_TRIPPED,   /* the gate guard holds a fault: all gates are off */
    DIRECTMPC_NOT_FINITE /* a measurement is no finite number: all gates are off (drive_control.c) */
} directmpc_status;

/* Accesses of 32 bits. The address is a byte address in the register map. They return 0 if the bus answered OKAY.
 * On a processor whose bus errors are exceptions, write and read are to catch them. */
typedef struct {
    int (*write)(void *context, uint32_t address, uint32_t word);
    int (*read)(void *context, uint32_t address, uint32_t *word);
    void *context; /* handed on */
} directmpc_bus;

/* One write of `make registers ARGS=--c`, which declares it too. */
#ifndef DIRECTMPC_WRITE
#define DIRECTMPC_WRITE
typedef struct {
    uint16_t address;
    uint32_t word;
} directmpc_write;
#endif

/* Measurements and references in the registers' formats, see docs/registers.md at 0x200. Per unit times the counts of
 * DIRECTMPC_COUNTS_..., which `make registers ARGS=--c` prints, rounded half to even; drive_control.c does so. */
typedef struct {
    int32_t is_alpha, is_beta;        /* stator current */
    int32_t psir_alpha, psir_beta;    /* rotor flux; ignored with the observer */
    int32_t v_n;                      /* neutral point */
    int32_t v_ph_a, v_ph_b, v_ph_c;   /* phase capacitors */
    int32_t v_dc;                     /* dc link */
    int32_t iref_alpha, iref_beta;    /* reference of the stator current */
    int32_t omega_s, omega_r;         /* speed of the reference, and of the machine */
} directmpc_measurement;

/* A decision. */
typedef struct {
    uint8_t s_a, s_b, s_c;            /* switch positions */
    uint8_t held;                     /* 1: as before */
    uint8_t deadlock;                 /* 1: no candidate stays inside its bounds */
    uint8_t saturated;                /* 1: a value did not fit its word */
    uint8_t exhausted;                /* 1: the budget ended the search */
    uint8_t length;                   /* predicted steps */
    uint16_t cycles;                  /* clocks that it took */
} directmpc_decision;

/* A system that has been opened. */
typedef struct {
    directmpc_bus bus;
    uint32_t control;  /* what system.control holds without enable */
    uint32_t deciding; /* 1: a decision has begun and has not been taken */
} directmpc;

/* Finds the system and turns its gates off. observer: 1: rotor flux from the observer, 0: from the measurements. */
directmpc_status directmpc_open(directmpc *system, directmpc_bus bus, int observer);

/* Turns the gates off, writes a drive's registers and waits until they are in force. Nothing is written if an address is
 * no register that a drive has. */
directmpc_status directmpc_load(directmpc *system, const directmpc_write *writes, size_t count);

/* Lets the gates switch. They do so with the next decision. */
directmpc_status directmpc_start(directmpc *system);

/* Writes the measurements and begins a decision. Nothing is written if one does not fit. */
directmpc_status directmpc_begin(directmpc *system, const directmpc_measurement *measurement);

/* Reads the decision that has begun, which ends the interrupt. DIRECTMPC_BUSY: it is not ready yet.
 * DIRECTMPC_TRIPPED: the decision is there, and the gates are off. */
directmpc_status directmpc_take(directmpc *system, directmpc_decision *decision);

/* Turns the gates off. */
directmpc_status directmpc_stop(directmpc *system);

/* The gate guard's faults, bits as in system.faults. */
directmpc_status directmpc_faults(directmpc *system, uint32_t *faults);

/* Turns the gates off and forgets the faults. One whose cause is still there comes back at the next start. */
directmpc_status directmpc_clear(directmpc *system);

#ifdef __cplusplus
}
#endif

#endif /* DIRECTMPC_H */
