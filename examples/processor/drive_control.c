/* SPDX-License-Identifier: Apache-2.0
 *
 * A drive controlled by a processor: what it does at the start, in each control period, on the interrupt, at the end.
 * `bus`, `measure` and `applied` are yours: see drive_control.h. drive.h is written by
 *
 *   make -s registers DRIVE=drives/anpc5l_6kv.toml ARGS='--c --clock 100e6' > drive.h
 */
#include "drive_control.h"

#include <math.h>

#include "drive.h"

#ifdef __FAST_MATH__
#error "with -ffast-math a value that is no number goes unnoticed; compile without it"
#endif

static directmpc controller;

/* A finite value as a word: limited, then rounded half to even, as docs/specification.md (section 9) says. */
static int32_t counts(double value, double scale, int32_t least, int32_t most)
{
    volatile double product = value * scale; /* volatile: rounded to a double, and no part of a fused operation */
    double scaled = product, rest;
    int32_t whole;

    if (scaled <= least)
        return least;
    if (scaled >= most)
        return most;
    whole = (int32_t)scaled; /* towards zero */
    rest = scaled - whole;   /* exact */
    if (rest > 0.5 || (rest == 0.5 && whole % 2 != 0))
        return whole + 1;
    if (rest < -0.5 || (rest == -0.5 && whole % 2 != 0))
        return whole - 1;
    return whole;
}

static int32_t signed_counts(double value, double scale)
{
    return counts(value, scale, -INT16_MAX, INT16_MAX);
}

static int32_t unsigned_counts(double value, double scale)
{
    return counts(value, scale, 0, UINT16_MAX);
}

static int is_finite(const drive_state *x)
{
    const double values[] = {x->current[0], x->current[1], x->reference[0], x->reference[1], x->v_n,    x->v_ph[0],
                             x->v_ph[1],    x->v_ph[2],    x->v_dc,         x->omega_s,      x->omega_r};
    size_t n;

    for (n = 0; n < sizeof values / sizeof *values; n++)
        if (!isfinite(values[n]))
            return 0;
    return 1;
}

directmpc_status drive_begin(directmpc_bus bus)
{
    directmpc_status status = directmpc_open(&controller, bus, 1);

    if (status == DIRECTMPC_OK)
        status = directmpc_load(&controller, directmpc_registers, sizeof directmpc_registers / sizeof *directmpc_registers);
    /* faults of the time before: permit was low, or nothing was set */
    if (status == DIRECTMPC_OK)
        status = directmpc_clear(&controller);
    return status == DIRECTMPC_OK ? directmpc_start(&controller) : status;
}

directmpc_status drive_period(void)
{
    drive_state x = measure();
    directmpc_measurement m;
    directmpc_status status;

    if (!is_finite(&x)) {
        status = directmpc_stop(&controller);
        return status == DIRECTMPC_OK ? DIRECTMPC_NOT_FINITE : status;
    }
    m = (directmpc_measurement){
        .is_alpha = signed_counts(x.current[0], DIRECTMPC_COUNTS_IS_ALPHA),
        .is_beta = signed_counts(x.current[1], DIRECTMPC_COUNTS_IS_BETA),
        .v_n = signed_counts(x.v_n, DIRECTMPC_COUNTS_V_N),
        .v_ph_a = unsigned_counts(x.v_ph[0], DIRECTMPC_COUNTS_V_PH_A),
        .v_ph_b = unsigned_counts(x.v_ph[1], DIRECTMPC_COUNTS_V_PH_B),
        .v_ph_c = unsigned_counts(x.v_ph[2], DIRECTMPC_COUNTS_V_PH_C),
        .v_dc = unsigned_counts(x.v_dc, DIRECTMPC_COUNTS_V_DC),
        .iref_alpha = signed_counts(x.reference[0], DIRECTMPC_COUNTS_IREF_ALPHA),
        .iref_beta = signed_counts(x.reference[1], DIRECTMPC_COUNTS_IREF_BETA),
        .omega_s = signed_counts(x.omega_s, DIRECTMPC_COUNTS_OMEGA_S),
        .omega_r = signed_counts(x.omega_r, DIRECTMPC_COUNTS_OMEGA_R),
    };

    return directmpc_begin(&controller, &m);
}

directmpc_status drive_interrupt(void)
{
    directmpc_decision decision;
    directmpc_status status = directmpc_take(&controller, &decision);
    uint32_t faults;

    if (status == DIRECTMPC_OK || status == DIRECTMPC_TRIPPED)
        applied(&decision);
    /* a fault in the middle of a period interrupts without a decision */
    if (status == DIRECTMPC_BUSY && directmpc_faults(&controller, &faults) == DIRECTMPC_OK && faults)
        status = DIRECTMPC_TRIPPED;
    return status;
}

directmpc_status drive_end(void)
{
    return directmpc_stop(&controller);
}
