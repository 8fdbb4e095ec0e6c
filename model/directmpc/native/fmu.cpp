// FMI 2.0 and 3.0 for co-simulation around a unit (unit.h): instances, their life, values, states, messages.
//
// The functions are those of the two standards, https://fmi-standard.org, with the types that they prescribe. What an
// FMU does not have (model exchange, scheduled execution, derivatives, clocks) answers with an error. No exception and
// no crash leaves a function: what is refused goes to the importer's logger and the answer is fmi2Error or fmi3Error.
// Licence: Apache-2.0

#include <cmath>
#include <cstring>
#include <fstream>
#include <locale>
#include <new>

#include "unit.h"

#ifdef _WIN32
#define EXPORT extern "C" __declspec(dllexport)
#else
#define EXPORT extern "C" __attribute__((visibility("default")))
#endif

namespace {

using namespace directmpc;

enum Status { OK = 0, ERROR = 3 };

enum class Phase { made, initialising, stepping, over, broken };

struct Fmu {
    std::unique_ptr<Unit> unit;
    std::string name, resources, token;
    std::function<void(const std::string &)> say;
    Phase phase = Phase::made;
    double time = 0, first = 0;
    bool early = false;
};

// The resource file; the C locale, whatever the importer has set.
std::unique_ptr<Unit> unit_of(const std::string &folder, const std::string &token) {
    std::ifstream file(folder + "/unit.txt");
    if (!file) throw Refused{"cannot open " + folder + "/unit.txt"};
    auto unit = make_unit();
    std::string text, kind;
    while (std::getline(file, text)) {
        Line line(text);
        line.imbue(std::locale::classic());
        if (!(line >> kind)) continue;
        if (kind == "token") {
            std::string found;
            line >> found;
            if (found != token) throw Refused{"the description is that of another FMU"};
        } else if (kind == "var") {
            Variable one;
            int type = 0, role = 0;
            line >> one.name >> type >> role >> one.start >> one.least >> one.most;
            one.type = static_cast<Type>(type);
            one.role = static_cast<Role>(role);
            unit->variables.push_back(one);
            unit->values.push_back(one.start);
        } else {
            unit->line(kind, line);
        }
        if (line.fail() && !line.eof()) throw Refused{"unit.txt: " + text};
    }
    return unit;
}

template <class Work>
int guarded(Fmu *fmu, Work work) {
    if (!fmu) return ERROR;
    try {
        work();
        return OK;
    } catch (const Refused &refused) {
        fmu->say(refused.why);
    } catch (const std::bad_alloc &) {
        fmu->say("no memory");
    } catch (const std::exception &error) {
        fmu->say(error.what());
    }
    return ERROR;
}

const Variable &variable(const Fmu &fmu, uint32_t reference) {
    if (reference >= fmu.unit->variables.size())
        throw Refused{"there is no value reference " + std::to_string(reference)};
    return fmu.unit->variables[reference];
}

template <class Value>
int get(Fmu *fmu, Type type, const uint32_t *references, size_t count, Value *values) {
    return guarded(fmu, [&] {
        for (size_t k = 0; k < count; k++) {
            if (type == Type::real && references[k] == fmu->unit->variables.size()) {
                values[k] = static_cast<Value>(fmu->time);  // the independent variable
                continue;
            }
            const Variable &one = variable(*fmu, references[k]);
            if (one.type != type) throw Refused{one.name + " is of another type"};
            values[k] = static_cast<Value>(fmu->unit->values[references[k]]);
        }
    });
}

template <class Value>
int set(Fmu *fmu, Type type, const uint32_t *references, size_t count, const Value *values) {
    return guarded(fmu, [&] {
        for (size_t k = 0; k < count; k++) {
            const Variable &one = variable(*fmu, references[k]);
            const auto value = static_cast<double>(values[k]);
            if (one.type != type) throw Refused{one.name + " is of another type"};
            if (one.role == Role::output) throw Refused{one.name + " cannot be set"};
            if (one.role == Role::constant)
                throw Refused{one.name + " is built in; write the FMU of another drive"};
            if (one.role == Role::parameter && fmu->phase != Phase::made &&
                fmu->phase != Phase::initialising)
                throw Refused{one.name + " is fixed once the simulation has begun"};
            if (!std::isfinite(value) || value < one.least || value > one.most) {
                std::ostringstream text;
                text << one.name << ": got " << value << "; it must be from " << one.least << " to "
                     << one.most;
                throw Refused{text.str()};
            }
        }
        for (size_t k = 0; k < count; k++)
            fmu->unit->values[references[k]] = static_cast<double>(values[k]);
    });
}

int begin(Fmu *fmu, double start) {
    return guarded(fmu, [&] {
        if (fmu->phase != Phase::made) throw Refused{"initialisation comes once, before the steps"};
        if (!std::isfinite(start)) throw Refused{"the start time is no number"};
        fmu->first = fmu->time = start;
        fmu->phase = Phase::initialising;
    });
}

int initialised(Fmu *fmu) {
    return guarded(fmu, [&] {
        if (fmu->phase != Phase::initialising) throw Refused{"initialisation has not begun"};
        fmu->unit->begin();
        fmu->phase = Phase::stepping;
    });
}

// One communication step; `reached` is what time it has come to.
int advance(Fmu *fmu, double from, double size, double *reached) {
    return guarded(fmu, [&] {
        if (fmu->phase != Phase::stepping) throw Refused{"a step before the end of initialisation"};
        if (!std::isfinite(from) || !std::isfinite(size) || size < 0)
            throw Refused{"a step needs a time and a size of 0 or more"};
        const double slack = 1e-9 * (1 + std::fabs(fmu->time));
        if (std::fabs(from - fmu->time) > slack) {
            std::ostringstream text;
            text << "a step from " << from << " s, but the FMU is at " << fmu->time << " s";
            throw Refused{text.str()};
        }
        if (size == 0) {
            *reached = from;
            return;
        }
        const double to = from + size;
        *reached = fmu->unit->step(from - fmu->first, to - fmu->first, fmu->early) + fmu->first;
        if (*reached > to - slack) *reached = to;
        fmu->time = *reached;
    });
}

// Everything of an instance, for a rollback or another process.
struct Head {
    char magic[8];
    uint64_t size, count;
    double time, first;
    uint64_t phase;
};
constexpr char MAGIC[8] = {'d', 'm', 'p', 'c', 'f', 'm', 'u', '1'};

size_t state_size(const Fmu &fmu) {
    return sizeof(Head) + fmu.unit->values.size() * sizeof(double) + fmu.unit->state_size();
}

std::vector<uint8_t> *saved(const Fmu &fmu) {
    auto bytes = std::make_unique<std::vector<uint8_t>>(state_size(fmu));
    Head head{};
    std::memcpy(head.magic, MAGIC, sizeof MAGIC);
    head.size = bytes->size();
    head.count = fmu.unit->values.size();
    head.time = fmu.time;
    head.first = fmu.first;
    head.phase = static_cast<uint64_t>(fmu.phase);
    uint8_t *to = bytes->data();
    std::memcpy(to, &head, sizeof head);
    to += sizeof head;
    std::memcpy(to, fmu.unit->values.data(), head.count * sizeof(double));
    fmu.unit->save(to + head.count * sizeof(double));
    return bytes.release();
}

void restore(Fmu &fmu, const std::vector<uint8_t> &bytes) {
    Head head;
    if (bytes.size() < sizeof head) throw Refused{"these bytes are no state of this FMU"};
    const uint8_t *from = bytes.data();
    std::memcpy(&head, from, sizeof head);
    from += sizeof head;
    if (std::memcmp(head.magic, MAGIC, sizeof MAGIC) || head.size != bytes.size() ||
        head.size != state_size(fmu) || head.count != fmu.unit->values.size() ||
        head.phase > static_cast<uint64_t>(Phase::broken))
        throw Refused{"these bytes are no state of this FMU"};
    fmu.unit->restore(from + head.count * sizeof(double));
    std::memcpy(fmu.unit->values.data(), from, head.count * sizeof(double));
    fmu.time = head.time;
    fmu.first = head.first;
    fmu.phase = static_cast<Phase>(head.phase);
}

int keep_state(Fmu *fmu, void **state) {
    return guarded(fmu, [&] {
        std::vector<uint8_t> *const bytes = saved(*fmu);
        delete static_cast<std::vector<uint8_t> *>(*state);
        *state = bytes;
    });
}

int take_state(Fmu *fmu, void *state) {
    return guarded(fmu, [&] {
        if (!state) throw Refused{"no state was given"};
        restore(*fmu, *static_cast<std::vector<uint8_t> *>(state));
    });
}

int free_state(void **state) {
    if (state) {
        delete static_cast<std::vector<uint8_t> *>(*state);
        *state = nullptr;
    }
    return OK;
}

int state_bytes(Fmu *fmu, void *state, uint8_t *bytes, size_t size) {
    return guarded(fmu, [&] {
        const auto *const kept = static_cast<std::vector<uint8_t> *>(state);
        if (!kept || size < kept->size()) throw Refused{"there is too little room for a state"};
        std::memcpy(bytes, kept->data(), kept->size());
    });
}

int state_of(Fmu *fmu, const uint8_t *bytes, size_t size, void **state) {
    return guarded(fmu, [&] {
        auto made = std::make_unique<std::vector<uint8_t>>(bytes, bytes + size);
        delete static_cast<std::vector<uint8_t> *>(*state);
        *state = made.release();
    });
}

int again(Fmu *fmu) {
    return guarded(fmu, [&] {
        fmu->unit = unit_of(fmu->resources, fmu->token);
        fmu->phase = Phase::made;
    });
}

Fmu *made(std::unique_ptr<Fmu> fmu) {
    if (again(fmu.get()) != OK) return nullptr;
    return fmu.release();
}

// Path of FMI 2.0's resource location, a URI.
std::string path_of(const std::string &uri) {
    std::string path, rest = uri;
    for (const char *begin : {"file:///", "file://localhost/", "file:/"})
        if (!rest.compare(0, std::strlen(begin), begin)) {
            rest = "/" + rest.substr(std::strlen(begin));
            break;
        }
    for (size_t k = 0; k < rest.size(); k++) {
        if (rest[k] == '%' && k + 2 < rest.size()) {
            path += static_cast<char>(std::stoi(rest.substr(k + 1, 2), nullptr, 16));
            k += 2;
        } else {
            path += rest[k];
        }
    }
    if (path.size() > 2 && path[0] == '/' && path[2] == ':') path.erase(0, 1);  // /C:/
    return path;
}

}  // namespace

// ---------------------------------------------------------------------------------------------------------------------
// FMI 2.0
// ---------------------------------------------------------------------------------------------------------------------

using Logger2 = void (*)(void *, const char *, int, const char *, const char *, ...);
struct Callbacks2 {
    Logger2 logger;
    void *(*allocate)(size_t, size_t);
    void (*release)(void *);
    void (*finished)(void *, int);
    void *environment;
};

EXPORT const char *fmi2GetTypesPlatform() { return "default"; }
EXPORT const char *fmi2GetVersion() { return "2.0"; }
EXPORT int fmi2SetDebugLogging(Fmu *, int, size_t, const char *const *) { return OK; }

EXPORT Fmu *fmi2Instantiate(const char *name, int type, const char *guid, const char *resources,
                            const Callbacks2 *callbacks, int, int) {
    try {
        auto fmu = std::make_unique<Fmu>();
        fmu->name = name ? name : "";
        const Callbacks2 said = callbacks ? *callbacks : Callbacks2{};
        const std::string called = fmu->name;
        fmu->say = [said, called](const std::string &text) {
            std::string form;  // without arguments: some importers do not fill them in
            for (const char sign : text) form += sign == '%' ? "%%" : std::string(1, sign);
            if (said.logger)
                said.logger(said.environment, called.c_str(), ERROR, "error", form.c_str());
        };
        if (type != 1) {
            fmu->say("co-simulation alone");
            return nullptr;
        }
        fmu->resources = path_of(resources ? resources : "");
        fmu->token = guid ? guid : "";
        return made(std::move(fmu));
    } catch (const std::exception &) {
        return nullptr;
    }
}
EXPORT void fmi2FreeInstance(Fmu *fmu) { delete fmu; }
EXPORT int fmi2SetupExperiment(Fmu *fmu, int, double, double start, int, double) {
    return guarded(fmu, [&] {
        if (fmu->phase != Phase::made) throw Refused{"the experiment is set up before initialisation"};
        fmu->first = start;
    });
}
EXPORT int fmi2EnterInitializationMode(Fmu *fmu) { return fmu ? begin(fmu, fmu->first) : ERROR; }
EXPORT int fmi2ExitInitializationMode(Fmu *fmu) { return initialised(fmu); }
EXPORT int fmi2Terminate(Fmu *fmu) {
    return guarded(fmu, [&] { fmu->phase = Phase::over; });
}
EXPORT int fmi2Reset(Fmu *fmu) { return again(fmu); }
EXPORT int fmi2GetReal(Fmu *f, const uint32_t *r, size_t n, double *v) { return get(f, Type::real, r, n, v); }
EXPORT int fmi2GetInteger(Fmu *f, const uint32_t *r, size_t n, int *v) { return get(f, Type::integer, r, n, v); }
EXPORT int fmi2GetBoolean(Fmu *f, const uint32_t *r, size_t n, int *v) { return get(f, Type::boolean, r, n, v); }
EXPORT int fmi2GetString(Fmu *, const uint32_t *, size_t n, const char **) { return n ? ERROR : OK; }
EXPORT int fmi2SetReal(Fmu *f, const uint32_t *r, size_t n, const double *v) { return set(f, Type::real, r, n, v); }
EXPORT int fmi2SetInteger(Fmu *f, const uint32_t *r, size_t n, const int *v) { return set(f, Type::integer, r, n, v); }
EXPORT int fmi2SetBoolean(Fmu *f, const uint32_t *r, size_t n, const int *v) { return set(f, Type::boolean, r, n, v); }
EXPORT int fmi2SetString(Fmu *, const uint32_t *, size_t n, const char *const *) { return n ? ERROR : OK; }
EXPORT int fmi2GetFMUstate(Fmu *fmu, void **state) { return keep_state(fmu, state); }
EXPORT int fmi2SetFMUstate(Fmu *fmu, void *state) { return take_state(fmu, state); }
EXPORT int fmi2FreeFMUstate(Fmu *, void **state) { return free_state(state); }
EXPORT int fmi2SerializedFMUstateSize(Fmu *fmu, void *state, size_t *size) {
    return guarded(fmu, [&] {
        if (!state) throw Refused{"no state was given"};
        *size = static_cast<std::vector<uint8_t> *>(state)->size();
    });
}
EXPORT int fmi2SerializeFMUstate(Fmu *fmu, void *state, char *bytes, size_t size) {
    return state_bytes(fmu, state, reinterpret_cast<uint8_t *>(bytes), size);
}
EXPORT int fmi2DeSerializeFMUstate(Fmu *fmu, const char *bytes, size_t size, void **state) {
    return state_of(fmu, reinterpret_cast<const uint8_t *>(bytes), size, state);
}
EXPORT int fmi2GetDirectionalDerivative(Fmu *, const uint32_t *, size_t, const uint32_t *, size_t, const double *,
                                        double *) {
    return ERROR;
}
EXPORT int fmi2SetRealInputDerivatives(Fmu *, const uint32_t *, size_t, const int *, const double *) { return ERROR; }
EXPORT int fmi2GetRealOutputDerivatives(Fmu *, const uint32_t *, size_t, const int *, double *) { return ERROR; }
EXPORT int fmi2DoStep(Fmu *fmu, double from, double size, int) {
    double reached = from;
    return advance(fmu, from, size, &reached);
}
EXPORT int fmi2CancelStep(Fmu *) { return ERROR; }
EXPORT int fmi2GetStatus(Fmu *, int, int *) { return ERROR; }
EXPORT int fmi2GetRealStatus(Fmu *fmu, int kind, double *value) {
    if (!fmu || kind != 2) return ERROR;
    *value = fmu->time;
    return OK;
}
EXPORT int fmi2GetIntegerStatus(Fmu *, int, int *) { return ERROR; }
EXPORT int fmi2GetBooleanStatus(Fmu *fmu, int kind, int *value) {
    if (!fmu || kind != 3) return ERROR;
    *value = fmu->phase == Phase::over;
    return OK;
}
EXPORT int fmi2GetStringStatus(Fmu *, int, const char **) { return ERROR; }

// ---------------------------------------------------------------------------------------------------------------------
// FMI 3.0
// ---------------------------------------------------------------------------------------------------------------------

using Logger3 = void (*)(void *, int, const char *, const char *);

EXPORT const char *fmi3GetVersion() { return "3.0"; }
EXPORT int fmi3SetDebugLogging(Fmu *, bool, size_t, const char *const *) { return OK; }
EXPORT Fmu *fmi3InstantiateModelExchange(const char *, const char *, const char *, bool, bool, void *, Logger3) {
    return nullptr;
}
EXPORT Fmu *fmi3InstantiateScheduledExecution(const char *, const char *, const char *, bool, bool, void *, Logger3,
                                              void *, void *, void *) {
    return nullptr;
}
EXPORT Fmu *fmi3InstantiateCoSimulation(const char *name, const char *token, const char *resources, bool, bool,
                                        bool events, bool early, const uint32_t *, size_t intermediate,
                                        void *environment, Logger3 logger, void *) {
    try {
        auto fmu = std::make_unique<Fmu>();
        fmu->name = name ? name : "";
        fmu->say = [environment, logger](const std::string &text) {
            if (logger) logger(environment, ERROR, "error", text.c_str());
        };
        if (events || intermediate) {
            fmu->say("there is neither an event mode nor an intermediate update");
            return nullptr;
        }
        fmu->resources = resources ? resources : "";
        while (!fmu->resources.empty() && (fmu->resources.back() == '/' || fmu->resources.back() == '\\'))
            fmu->resources.pop_back();
        fmu->token = token ? token : "";
        fmu->early = early;
        return made(std::move(fmu));
    } catch (const std::exception &) {
        return nullptr;
    }
}
EXPORT void fmi3FreeInstance(Fmu *fmu) { delete fmu; }
EXPORT int fmi3EnterInitializationMode(Fmu *fmu, bool, double, double start, bool, double) {
    return begin(fmu, start);
}
EXPORT int fmi3ExitInitializationMode(Fmu *fmu) { return initialised(fmu); }
EXPORT int fmi3EnterEventMode(Fmu *) { return ERROR; }
EXPORT int fmi3EnterStepMode(Fmu *) { return ERROR; }
EXPORT int fmi3Terminate(Fmu *fmu) {
    return guarded(fmu, [&] { fmu->phase = Phase::over; });
}
EXPORT int fmi3Reset(Fmu *fmu) { return again(fmu); }

#define NONE_OF(name, type)                                                                                     \
    EXPORT int fmi3Get##name(Fmu *, const uint32_t *, size_t n, type *, size_t) { return n ? ERROR : OK; }       \
    EXPORT int fmi3Set##name(Fmu *, const uint32_t *, size_t n, const type *, size_t) { return n ? ERROR : OK; }
#define SOME_OF(name, type, of)                                                                                 \
    EXPORT int fmi3Get##name(Fmu *f, const uint32_t *r, size_t n, type *v, size_t) { return get(f, of, r, n, v); } \
    EXPORT int fmi3Set##name(Fmu *f, const uint32_t *r, size_t n, const type *v, size_t) {                      \
        return set(f, of, r, n, v);                                                                             \
    }
SOME_OF(Float64, double, Type::real)
SOME_OF(Int32, int32_t, Type::integer)
SOME_OF(Boolean, bool, Type::boolean)
NONE_OF(Float32, float)
NONE_OF(Int8, int8_t)
NONE_OF(UInt8, uint8_t)
NONE_OF(Int16, int16_t)
NONE_OF(UInt16, uint16_t)
NONE_OF(UInt32, uint32_t)
NONE_OF(Int64, int64_t)
NONE_OF(UInt64, uint64_t)
NONE_OF(String, char *)
EXPORT int fmi3GetBinary(Fmu *, const uint32_t *, size_t n, size_t *, const uint8_t **, size_t) { return n ? ERROR : OK; }
EXPORT int fmi3SetBinary(Fmu *, const uint32_t *, size_t n, const size_t *, const uint8_t *const *, size_t) {
    return n ? ERROR : OK;
}
EXPORT int fmi3GetClock(Fmu *, const uint32_t *, size_t n, bool *) { return n ? ERROR : OK; }
EXPORT int fmi3SetClock(Fmu *, const uint32_t *, size_t n, const bool *) { return n ? ERROR : OK; }

#define NOT_HERE(name) \
    EXPORT int fmi3##name(Fmu *) { return ERROR; }
NOT_HERE(GetNumberOfVariableDependencies)
NOT_HERE(GetVariableDependencies)
NOT_HERE(GetDirectionalDerivative)
NOT_HERE(GetAdjointDerivative)
NOT_HERE(EnterConfigurationMode)
NOT_HERE(ExitConfigurationMode)
NOT_HERE(GetIntervalDecimal)
NOT_HERE(GetIntervalFraction)
NOT_HERE(GetShiftDecimal)
NOT_HERE(GetShiftFraction)
NOT_HERE(SetIntervalDecimal)
NOT_HERE(SetIntervalFraction)
NOT_HERE(SetShiftDecimal)
NOT_HERE(SetShiftFraction)
NOT_HERE(EvaluateDiscreteStates)
NOT_HERE(UpdateDiscreteStates)
NOT_HERE(EnterContinuousTimeMode)
NOT_HERE(CompletedIntegratorStep)
NOT_HERE(SetTime)
NOT_HERE(SetContinuousStates)
NOT_HERE(GetContinuousStateDerivatives)
NOT_HERE(GetEventIndicators)
NOT_HERE(GetContinuousStates)
NOT_HERE(GetNominalsOfContinuousStates)
NOT_HERE(GetNumberOfEventIndicators)
NOT_HERE(GetNumberOfContinuousStates)
NOT_HERE(GetOutputDerivatives)
NOT_HERE(ActivateModelPartition)

EXPORT int fmi3GetFMUState(Fmu *fmu, void **state) { return keep_state(fmu, state); }
EXPORT int fmi3SetFMUState(Fmu *fmu, void *state) { return take_state(fmu, state); }
EXPORT int fmi3FreeFMUState(Fmu *, void **state) { return free_state(state); }
EXPORT int fmi3SerializedFMUStateSize(Fmu *fmu, void *state, size_t *size) {
    return fmi2SerializedFMUstateSize(fmu, state, size);
}
EXPORT int fmi3SerializeFMUState(Fmu *fmu, void *state, uint8_t *bytes, size_t size) {
    return state_bytes(fmu, state, bytes, size);
}
EXPORT int fmi3DeserializeFMUState(Fmu *fmu, const uint8_t *bytes, size_t size, void **state) {
    return state_of(fmu, bytes, size, state);
}
EXPORT int fmi3DoStep(Fmu *fmu, double from, double size, bool, bool *event, bool *over, bool *early, double *reached) {
    double to = from;
    const int status = advance(fmu, from, size, &to);
    if (event) *event = false;
    if (over) *over = false;
    if (early) *early = status == OK && to < from + size;
    if (reached) *reached = to;
    return status;
}
