/* SPDX-License-Identifier: Apache-2.0
 *
 * A drive controlled by a processor: what it does at the start, in each control period, on the interrupt, at the end.
 * `bus`, `measure` and `applied` are yours: see drive_control.h. drive.h is written by
 *
 *   make -s registers DRIVE=drives/anpc5l_6kv.toml ARGS='--c --clock 100e6' > drive.h
 */
#include "drive_control.h"

#include "drive.h"

static directmpc controller;

static int32_t counts(double value, double scale)
{
    double scaled = value * scale;

    return (int32_t)(scaled < 0 ? scaled - 0.5 : scaled + 0.5);
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
    directmpc_measurement m = {
        .is_alpha = counts(x.current[0], DIRECTMPC_COUNTS_IS_ALPHA),
        .is_beta = counts(x.current[1], DIRECTMPC_COUNTS_IS_BETA),
        .v_n = counts(x.v_n, DIRECTMPC_COUNTS_V_N),
        .v_ph_a = counts(x.v_ph[0], DIRECTMPC_COUNTS_V_PH_A),
        .v_ph_b = counts(x.v_ph[1], DIRECTMPC_COUNTS_V_PH_B),
        .v_ph_c = counts(x.v_ph[2], DIRECTMPC_COUNTS_V_PH_C),
        .v_dc = counts(x.v_dc, DIRECTMPC_COUNTS_V_DC),
        .iref_alpha = counts(x.reference[0], DIRECTMPC_COUNTS_IREF_ALPHA),
        .iref_beta = counts(x.reference[1], DIRECTMPC_COUNTS_IREF_BETA),
        .omega_s = counts(x.omega_s, DIRECTMPC_COUNTS_OMEGA_S),
        .omega_r = counts(x.omega_r, DIRECTMPC_COUNTS_OMEGA_R),
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
