/* SPDX-License-Identifier: Apache-2.0 */
#include "directmpc.h"

#include "directmpc_mpdcc.h" /* registers/, generated from the register map */

#define AT(member) ((uint32_t)offsetof(directmpc_mpdcc_t, member))
#define BIT(name) SYSTEM_REGISTERS__##name##_bm
#define FIELD(word, name) (((word) & name##_bm) >> name##_bp)

enum {
    CONTROLLER_MPDCC = 1,
    POLLS = 10000 /* of a commit; it waits for one decision at most */
};

static directmpc_status put(const directmpc *system, uint32_t address, uint32_t word)
{
    return system->bus.write(system->bus.context, address, word) ? DIRECTMPC_BUS : DIRECTMPC_OK;
}

static directmpc_status get(const directmpc *system, uint32_t address, uint32_t *word)
{
    return system->bus.read(system->bus.context, address, word) ? DIRECTMPC_BUS : DIRECTMPC_OK;
}

directmpc_status directmpc_stop(directmpc *system)
{
    return put(system, AT(system.control), system->control);
}

directmpc_status directmpc_open(directmpc *system, directmpc_bus bus, int observer)
{
    directmpc_status status;
    uint32_t word;

    system->bus = bus;
    system->deciding = 0;
    system->control = BIT(CONTROL__REGISTERS_AS_SOURCE) | BIT(CONTROL__OWN_POSITIONS);
    if (observer)
        system->control |= BIT(CONTROL__USE_OBSERVER);
    if ((status = get(system, AT(system.identification), &word)) != DIRECTMPC_OK)
        return status;
    if (word != SYSTEM_REGISTERS__IDENTIFICATION__IDENTIFICATION_reset)
        return DIRECTMPC_UNKNOWN;
    if ((status = get(system, AT(system.capabilities), &word)) != DIRECTMPC_OK)
        return status;
    if (FIELD(word, SYSTEM_REGISTERS__CAPABILITIES__CONTROLLER) != CONTROLLER_MPDCC)
        return DIRECTMPC_UNKNOWN;
    if ((status = get(system, AT(system.version), &word)) != DIRECTMPC_OK)
        return status;
    if (FIELD(word, SYSTEM_REGISTERS__VERSION__MAP) != SYSTEM_REGISTERS__VERSION__MAP_reset)
        return DIRECTMPC_OTHER_MAP;
    return directmpc_stop(system);
}

static int of_a_drive(uint32_t address)
{
    uint32_t guard = AT(guard), guard_end = guard + sizeof(guard_registers_t);
    uint32_t bands = AT(bands), bands_end = bands + sizeof(capacitor_bands_t);
    uint32_t parameters = AT(parameters), parameters_end = parameters + sizeof(mpdcc_parameters_t);

    if (address % 4)
        return 0;
    return (address >= guard && address < guard_end) || (address >= bands && address < bands_end) ||
           (address >= parameters && address < parameters_end) || address == AT(system.command);
}

/* until no commit waits and its parameters are in force: so long shadows refuse writes */
static directmpc_status settled(const directmpc *system)
{
    directmpc_status status;
    uint32_t word;
    size_t n;

    for (n = 0; n < POLLS; n++) {
        if ((status = get(system, AT(system.status), &word)) != DIRECTMPC_OK)
            return status;
        if (!(word & BIT(STATUS__COMMIT_PENDING)))
            return DIRECTMPC_OK;
    }
    return DIRECTMPC_TIMEOUT;
}

directmpc_status directmpc_load(directmpc *system, const directmpc_write *writes, size_t count)
{
    directmpc_status status;
    size_t n;

    for (n = 0; n < count; n++)
        if (!of_a_drive(writes[n].address))
            return DIRECTMPC_RANGE;
    /* settings of the guard are locked while the drive is enabled */
    if ((status = directmpc_stop(system)) != DIRECTMPC_OK)
        return status;
    /* a reset commits, too */
    if ((status = settled(system)) != DIRECTMPC_OK)
        return status;
    for (n = 0; n < count; n++)
        if ((status = put(system, writes[n].address, writes[n].word)) != DIRECTMPC_OK)
            return status;
    if ((status = settled(system)) != DIRECTMPC_OK)
        return status;
    /* the estimate belongs to the drive before */
    return put(system, AT(system.command), BIT(COMMAND__RESET_OBSERVER) | BIT(COMMAND__CLEAR_COUNTERS));
}

directmpc_status directmpc_faults(directmpc *system, uint32_t *faults)
{
    return get(system, AT(system.faults), faults);
}

directmpc_status directmpc_clear(directmpc *system)
{
    directmpc_status status = directmpc_stop(system);
    uint32_t faults;

    if (status == DIRECTMPC_OK)
        status = directmpc_faults(system, &faults);
    return status == DIRECTMPC_OK ? put(system, AT(system.faults), faults) : status;
}

directmpc_status directmpc_start(directmpc *system)
{
    directmpc_status status;
    uint32_t faults;

    if ((status = directmpc_faults(system, &faults)) != DIRECTMPC_OK)
        return status;
    if (faults)
        return DIRECTMPC_TRIPPED;
    return put(system, AT(system.control), system->control | BIT(CONTROL__ENABLE));
}

directmpc_status directmpc_begin(directmpc *system, const directmpc_measurement *measurement)
{
    const directmpc_measurement *m = measurement;
    const struct {
        uint32_t address;
        int32_t value;
        int is_signed;
    } words[] = {
        {AT(measurements.is_alpha), m->is_alpha, 1},     {AT(measurements.is_beta), m->is_beta, 1},
        {AT(measurements.psir_alpha), m->psir_alpha, 1}, {AT(measurements.psir_beta), m->psir_beta, 1},
        {AT(measurements.v_n), m->v_n, 1},               {AT(measurements.v_ph_a), m->v_ph_a, 0},
        {AT(measurements.v_ph_b), m->v_ph_b, 0},         {AT(measurements.v_ph_c), m->v_ph_c, 0},
        {AT(measurements.v_dc), m->v_dc, 0},             {AT(measurements.iref_alpha), m->iref_alpha, 1},
        {AT(measurements.iref_beta), m->iref_beta, 1},   {AT(measurements.omega_s), m->omega_s, 1},
        {AT(measurements.omega_r), m->omega_r, 1},
    };
    const size_t count = sizeof words / sizeof words[0];
    directmpc_status status;
    size_t n;

    if (system->deciding)
        return DIRECTMPC_BUSY;
    for (n = 0; n < count; n++) {
        int32_t least = words[n].is_signed ? INT16_MIN : 0;
        int32_t most = words[n].is_signed ? INT16_MAX : UINT16_MAX;
        if (words[n].value < least || words[n].value > most)
            return DIRECTMPC_RANGE;
    }
    for (n = 0; n < count; n++)
        if ((status = put(system, words[n].address, (uint32_t)words[n].value & 0xFFFFu)) != DIRECTMPC_OK)
            return status;
    if ((status = put(system, AT(system.command), BIT(COMMAND__START))) != DIRECTMPC_OK)
        return status;
    system->deciding = 1;
    return DIRECTMPC_OK;
}

directmpc_status directmpc_take(directmpc *system, directmpc_decision *decision)
{
    directmpc_status status;
    uint32_t word, faults;

    if ((status = get(system, AT(system.status), &word)) != DIRECTMPC_OK)
        return status;
    if (!system->deciding || (word & BIT(STATUS__BUSY)))
        return DIRECTMPC_BUSY;
    if ((status = get(system, AT(result.decision), &word)) != DIRECTMPC_OK)
        return status;
    decision->s_a = (uint8_t)FIELD(word, MPDCC_DECISION__DECISION__S_A);
    decision->s_b = (uint8_t)FIELD(word, MPDCC_DECISION__DECISION__S_B);
    decision->s_c = (uint8_t)FIELD(word, MPDCC_DECISION__DECISION__S_C);
    decision->held = (uint8_t)FIELD(word, MPDCC_DECISION__DECISION__HELD);
    decision->deadlock = (uint8_t)FIELD(word, MPDCC_DECISION__DECISION__DEADLOCK);
    decision->saturated = (uint8_t)FIELD(word, MPDCC_DECISION__DECISION__SATURATED);
    decision->exhausted = (uint8_t)FIELD(word, MPDCC_DECISION__DECISION__EXHAUSTED);
    decision->length = (uint8_t)FIELD(word, MPDCC_DECISION__DECISION__LENGTH);
    if ((status = get(system, AT(system.cycles), &word)) != DIRECTMPC_OK)
        return status;
    decision->cycles = (uint16_t)FIELD(word, SYSTEM_REGISTERS__CYCLES__LAST);
    system->deciding = 0;
    if ((status = directmpc_faults(system, &faults)) != DIRECTMPC_OK)
        return status;
    return faults ? DIRECTMPC_TRIPPED : DIRECTMPC_OK;
}
