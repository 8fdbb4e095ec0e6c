// What the two kinds of FMU have behind the interface of FMI (fmu.cpp): the controller (controller.cpp) and the plant
// (plant.cpp). A unit is set up by the text of its resource file `unit.txt`; its variables have numbers from 0 on.
// Licence: Apache-2.0
#ifndef DIRECTMPC_UNIT_H
#define DIRECTMPC_UNIT_H

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <sstream>
#include <string>
#include <vector>

namespace directmpc {

// Why something cannot be done; the FMU says it through the importer's logger.
struct Refused {
    std::string why;
};

enum class Type { real, integer, boolean };
enum class Role { input, output, parameter, constant };

struct Variable {
    std::string name;
    Type type;
    Role role;
    double start, least, most;
};

// The words of one line behind its first.
using Line = std::istringstream;

class Unit {
   public:
    virtual ~Unit() = default;
    virtual void line(const std::string &kind, Line &line) = 0;  // one of unit.txt that is not `var`
    virtual void begin() = 0;                                    // parameters stand, time is 0
    virtual double step(double from, double to, bool early) = 0;  // to what time it has come
    virtual size_t state_size() const = 0;
    virtual void save(uint8_t *bytes) const = 0;
    virtual void restore(const uint8_t *bytes) = 0;

    std::vector<Variable> variables;
    std::vector<double> values;
    size_t number(const std::string &name) const {
        for (size_t k = 0; k < variables.size(); k++)
            if (variables[k].name == name) return k;
        throw Refused{"unit.txt: there is no variable " + name};
    }
};

std::unique_ptr<Unit> make_unit();

}  // namespace directmpc

#endif
