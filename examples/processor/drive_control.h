/* SPDX-License-Identifier: Apache-2.0
 *
 * What drive_control.c offers a processor's program, and what it asks of it.
 */
#ifndef DRIVE_CONTROL_H
#define DRIVE_CONTROL_H

#include "directmpc.h"

/* What the converters and the speed controller say, per unit. */
typedef struct {
    double current[2];   /* stator current, alpha and beta */
    double reference[2]; /* of the stator current */
    double v_n;          /* neutral point */
    double v_ph[3];      /* phase capacitors */
    double v_dc;         /* dc link */
    double omega_s;      /* angular speed of the reference */
    double omega_r;      /* electrical angular speed of the machine */
} drive_state;

/* Yours: the state now, and what is to be done with a decision (to log it, for instance; the gates follow by themselves). */
drive_state measure(void);
void applied(const directmpc_decision *decision);

/* Once, after the power is there. */
directmpc_status drive_begin(directmpc_bus bus);
/* At the beginning of each control period, from a timer. A value beyond its word becomes the nearest. One that is not
 * finite ends the drive: DIRECTMPC_NOT_FINITE, all gates are off, drive_begin starts anew. */
directmpc_status drive_period(void);
/* The interrupt of processor_system. DIRECTMPC_TRIPPED: the gate guard has turned the gates off. */
directmpc_status drive_interrupt(void);
/* At the end, and on any error of the program's own. */
directmpc_status drive_end(void);

#endif /* DRIVE_CONTROL_H */
