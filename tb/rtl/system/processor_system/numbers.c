/* SPDX-License-Identifier: Apache-2.0
 * The example's period without a system: states on standard input, eleven doubles each; on standard output the status and
 * the words of measurements.is_alpha to omega_r, and whether the gates are enabled. */
#include <stdio.h>
#include <string.h>

#include "drive_control.h"

enum { IDENTIFICATION = 0x000, VERSION = 0x004, CAPABILITIES = 0x008, CONTROL = 0x00C, STATUS = 0x014, FAULTS = 0x01C };
enum { MEASUREMENTS = 0x200, WORDS = 13 };

extern drive_state rig_state;

static uint32_t registers[0x400 / 4];

static int write_word(void *context, uint32_t address, uint32_t word)
{
    (void)context;
    if (address != STATUS)
        registers[address / 4] = address == FAULTS ? 0 : word;
    return 0;
}

static int read_word(void *context, uint32_t address, uint32_t *word)
{
    (void)context;
    *word = registers[address / 4];
    return 0;
}

int main(void)
{
    const directmpc_bus bus = {write_word, read_word, NULL};
    double x[11];
    int n;

    registers[IDENTIFICATION / 4] = 0x444D5043u;
    registers[VERSION / 4] = 0x01000100u;
    registers[CAPABILITIES / 4] = 0x00640011u;
    while (fread(x, sizeof *x, 11, stdin) == 11) {
        directmpc_status status = drive_begin(bus);
        const drive_state state = {
            {x[0], x[1]}, {x[6], x[7]}, x[2], {x[3], x[4], x[5]}, x[10], x[8], x[9],
        };

        if (status != DIRECTMPC_OK)
            return 1;
        memset(registers + MEASUREMENTS / 4, 0xFF, WORDS * sizeof *registers);
        rig_state = state;
        printf("%d", (int)drive_period());
        for (n = 0; n < WORDS; n++)
            printf(" %u", (unsigned)registers[MEASUREMENTS / 4 + n]);
        printf(" %u\n", (unsigned)(registers[CONTROL / 4] & 1));
    }
    return 0;
}
