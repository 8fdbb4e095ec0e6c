// Two instances of the FMU of an MPTC controller, for the sanitizers: steps, states to bytes and back, broken states,
// wrong values, a reset in the middle of a decision. Arguments: folder of the resources, token.
// Licence: Apache-2.0

#include <cmath>
#include <cstdint>
#include <cstdio>
#include <vector>

struct Fmu;
extern "C" {
Fmu *fmi3InstantiateCoSimulation(const char *, const char *, const char *, bool, bool, bool, bool, const uint32_t *,
                                 size_t, void *, void (*)(void *, int, const char *, const char *), void *);
void fmi3FreeInstance(Fmu *);
int fmi3EnterInitializationMode(Fmu *, bool, double, double, bool, double);
int fmi3ExitInitializationMode(Fmu *);
int fmi3Reset(Fmu *);
int fmi3SetFloat64(Fmu *, const uint32_t *, size_t, const double *, size_t);
int fmi3DoStep(Fmu *, double, double, bool, bool *, bool *, bool *, double *);
int fmi3GetFMUState(Fmu *, void **);
int fmi3SetFMUState(Fmu *, void *);
int fmi3FreeFMUState(Fmu *, void **);
int fmi3SerializedFMUStateSize(Fmu *, void *, size_t *);
int fmi3SerializeFMUState(Fmu *, void *, uint8_t *, size_t);
int fmi3DeserializeFMUState(Fmu *, const uint8_t *, size_t, void **);
}

static int refused;
static void say(void *, int, const char *, const char *) { refused++; }

static void begin(Fmu *one) {
    fmi3EnterInitializationMode(one, false, 0, 0, false, 0);
    fmi3ExitInitializationMode(one);
}

static void states(Fmu *one) {
    void *state = nullptr, *back = nullptr, *half = nullptr;
    size_t size = 0;
    fmi3GetFMUState(one, &state);
    fmi3SerializedFMUStateSize(one, state, &size);
    std::vector<uint8_t> bytes(size);
    fmi3SerializeFMUState(one, state, bytes.data(), size);
    fmi3DeserializeFMUState(one, bytes.data(), size, &back);
    fmi3SetFMUState(one, back);
    fmi3DeserializeFMUState(one, bytes.data(), size / 2, &half);
    fmi3SetFMUState(one, half);
    for (void **kept : {&state, &back, &half}) fmi3FreeFMUState(one, kept);
}

int main(int, char **given) {
    Fmu *both[2];
    for (Fmu *&one : both) {
        one = fmi3InstantiateCoSimulation("one", given[2], given[1], false, false, false, true, nullptr, 0, nullptr,
                                          say, nullptr);
        if (!one) return 1;
        begin(one);
    }
    const uint32_t inputs[8] = {0, 1, 2, 3, 4, 5, 6, 7};
    const uint32_t far = 99999;
    const double wrong = NAN;
    bool flags[3];
    double reached = 0;
    for (int k = 0; k < 600; k++)
        for (Fmu *one : both) {
            const double values[8] = {3 * std::cos(.02 * k), 3 * std::sin(.02 * k), .9, -.2, 100, 540,
                                      5 * std::sin(.3 * k),  .95};
            fmi3SetFloat64(one, inputs, 8, values, 8);
            for (double at = k * 50e-6, end = at + 50e-6; at < end - 1e-12; at = reached)
                fmi3DoStep(one, at, end - at, false, flags, flags + 1, flags + 2, &reached);
            if (k % 50 == 7) states(one);
        }
    fmi3SetFloat64(both[0], inputs, 1, &wrong, 1);
    fmi3SetFloat64(both[0], &far, 1, &wrong, 1);
    fmi3DoStep(both[0], 0.03, 0.6e-6, false, flags, flags + 1, flags + 2, &reached);
    fmi3Reset(both[0]);
    begin(both[0]);
    fmi3DoStep(both[0], 0, 1e-3, false, flags, flags + 1, flags + 2, &reached);
    for (Fmu *one : both) fmi3FreeInstance(one);
    std::printf("%d refused\n", refused);
}
