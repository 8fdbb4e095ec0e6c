// A system of directmpc as a unit of an FMU: the RTL (design.h), clocked, with its registers and its period.
//
// Time t is clock round(t * f). Once a period, from 0 on, the inputs go to the measurement ports with a start. What the
// decision does to gates and positions happens at its clocks; outputs are those at the end of a step.
// Licence: Apache-2.0

#include <algorithm>
#include <cmath>
#include <cstring>

#include "design.h"
#include "unit.h"

namespace directmpc {
namespace {

constexpr uint32_t ROOM = 128;       // clocks before a sample; half of them are enough for the writes of enable
constexpr unsigned PATIENCE = 4096;  // clocks in which a commit is through

// A measurement port: value = sum of factor * input, times scale, rounded half to even.
struct Measurement {
    uint32_t port;
    double scale, low, high;
    std::vector<std::pair<size_t, double>> terms;
};

struct Shown {
    size_t variable;
    uint32_t port;
    unsigned low, width;
    bool is_signed;
    double scale;
};

struct Write {
    uint32_t address, word;
    size_t parameter;  // whose value it has, or NONE
    double scale, most;
    std::string rounding;
    size_t node;  // whose value it has, or NONE
    double least;
};
constexpr size_t NONE = ~size_t{0};

// The program that makes words of parameters; model/directmpc/straight_line.py writes it.
struct Node {
    std::string what;
    double value;
    std::vector<size_t> of;
};

struct Hold {
    std::string comparison;
    size_t left, right;
    bool outcome;
};

// What model/directmpc/mpdcc/coefficients.py does by this name.
double bounds_fit(const std::vector<double> &given) {
    double unit = given[0];
    const auto above = [&] {
        for (size_t k = 2; k < 5; k++) {
            const double error = given[k + 3] * unit;
            const double gain = error != 0 ? std::nearbyint(error) / error : 1.0;
            if (std::nearbyint(given[k] * unit * gain) > given[1]) return true;
        }
        return false;
    };
    while (above()) unit *= 1.0 - std::ldexp(1.0, -16);
    return unit;
}

double done(const std::string &what, const std::vector<double> &given) {
    const double a = given.at(0), b = given.back();
    if (what == "add") return a + b;
    if (what == "sub") return a - b;
    if (what == "mul") return a * b;
    if (what == "div") return a / b;
    if (what == "pow") return std::pow(a, b);
    if (what == "neg") return -a;
    if (what == "abs") return std::fabs(a);
    if (what == "floor") return std::floor(a);
    if (what == "ceil") return std::ceil(a);
    if (what == "round") return std::nearbyint(a);
    if (what == "least") return *std::min_element(given.begin(), given.end());
    if (what == "bounds_fit" && given.size() == 8) return bounds_fit(given);
    throw Refused{"unit.txt: there is no operation " + what};
}

class Controller final : public Unit {
   public:
    Controller() : design_(directmpc_create()) {
        if (!design_) throw Refused{"no memory for the design"};
        std::istringstream ports(directmpc_ports());
        std::string way, name;
        unsigned width = 0;
        for (uint32_t k = 0; ports >> way >> name >> width; k++) ports_[name] = k;
    }
    ~Controller() override { directmpc_destroy(design_); }

    void line(const std::string &kind, Line &line) override {
        if (kind == "clock") {
            line >> clock_ >> period_;
        } else if (kind == "control") {
            line >> control_ >> enabled_ >> disabled_;
        } else if (kind == "forget") {
            line >> command_ >> forget_;
        } else if (kind == "faults") {
            line >> faults_ >> all_faults_;
        } else if (kind == "status") {
            line >> status_ >> pending_;
        } else if (kind == "write") {
            Write write{0, 0, NONE, 0, 0, "", NONE, 0};
            std::string name;
            line >> write.address >> write.word;
            if (line >> name >> write.scale >> write.most >> write.rounding)
                write.parameter = number(name);
            writes_.push_back(write);
        } else if (kind == "compute") {
            Write write{0, 0, NONE, 0, 0, "", NONE, 0};
            line >> write.address >> write.least >> write.most >> write.word >> write.node;
            writes_.push_back(write);
        } else if (kind == "let") {
            Node node{"", 0, {}};
            std::string name;
            line >> node.what;
            if (node.what == "value") line >> node.value;
            else if (node.what == "of" && line >> name) node.of.push_back(number(name));
            else for (size_t k; line >> k;) node.of.push_back(k);
            program_.push_back(node);
        } else if (kind == "hold") {
            Hold hold{};
            line >> hold.comparison >> hold.left >> hold.right >> hold.outcome;
            holds_.push_back(hold);
        } else if (kind == "measure") {
            Measurement one{};
            std::string port, name;
            double factor = 0;
            line >> port >> one.scale >> one.low >> one.high;
            one.port = at(port);
            while (line >> name >> factor) one.terms.push_back({number(name), factor});
            measurements_.push_back(one);
        } else if (kind == "show") {
            Shown one{};
            std::string port, name;
            line >> name >> port >> one.low >> one.width >> one.is_signed >> one.scale;
            one.variable = number(name);
            one.port = at(port);
            shown_.push_back(one);
        } else {
            throw Refused{"unit.txt: " + kind};
        }
    }

    void begin() override {
        start_ = at("start");
        enable_ = at("enable");
        trip_ = at("external_trip");
        gates_ = at("gates");
        directmpc_reset(design_);
        settle();
        const std::vector<double> computed = run();
        for (const Write &write : writes_) {
            uint32_t word = write.word;
            if (write.parameter != NONE) word = word_of(write);
            if (write.node != NONE) {
                const double value = computed.at(write.node);
                if (!(value >= write.least && value <= write.most)) throw Refused{together()};
                word = static_cast<uint32_t>(static_cast<int64_t>(value)) & write.word;
            }
            if (directmpc_write(design_, write.address, word))
                throw Refused{"register " + std::to_string(write.address) + " was not taken"};
        }
        settle();
        on_ = false;
        directmpc_put(design_, enable_, 1);
        directmpc_clocks(design_, PATIENCE);  // the longest minimum time, before the first decision
        turn(values[number("enable")] != 0);
        zero_ = directmpc_edges(design_);
        next_ = 0;
        show();
    }

    double step(double from, double to, bool early) override {
        (void)from;
        const auto goal = static_cast<uint64_t>(std::floor(to * clock_ + 1e-3));
        directmpc_put(design_, trip_, values[number("trip")] != 0);
        const bool wanted = values[number("enable")] != 0;
        bool stopped = false;
        while (now() < goal && !stopped) {
            const uint64_t left = next_ - now();
            // off at once, but for what a sample needs; on before a sample, or the watchdog runs out
            const bool turns = wanted != on_ && left > ROOM / 2 && (!wanted || left <= ROOM);
            if (!left) {
                sample();
            } else if (turns) {
                turn(wanted);
            } else {
                const uint64_t free = wanted && !on_ && left > ROOM ? left - ROOM : left;
                const uint64_t clocks = std::min(goal - now(), free);
                const auto count = static_cast<uint32_t>(std::min<uint64_t>(clocks, UINT32_MAX));
                if (early) {
                    const uint32_t before = directmpc_get(design_, gates_);
                    directmpc_until(design_, gates_, count);
                    stopped = directmpc_get(design_, gates_) != before;
                } else {
                    directmpc_clocks(design_, count);
                }
            }
        }
        show();
        return stopped && now() < goal ? now() / clock_ : to;
    }

    size_t state_size() const override { return sizeof(Kept) + directmpc_state_size(design_); }
    void save(uint8_t *bytes) const override {
        const Kept kept{zero_, next_, on_, clipped_};
        std::memset(bytes, 0, sizeof kept);
        std::memcpy(bytes, &kept, sizeof kept);
        directmpc_save(design_, bytes + sizeof kept);
    }
    void restore(const uint8_t *bytes) override {
        Kept kept;
        std::memcpy(&kept, bytes, sizeof kept);
        if (directmpc_restore(design_, bytes + sizeof kept, directmpc_state_size(design_)))
            throw Refused{"these bytes are no state of this design"};
        zero_ = kept.zero;
        next_ = kept.next;
        on_ = kept.on;
        clipped_ = kept.clipped;
    }

   private:
    struct Kept {
        uint64_t zero, next, on, clipped;
    };

    uint64_t now() const { return directmpc_edges(design_) - zero_; }
    uint32_t at(const std::string &port) const {
        const auto found = ports_.find(port);
        if (found == ports_.end()) throw Refused{"the design has no port " + port};
        return found->second;
    }

    void settle() {
        for (unsigned k = 0; k < PATIENCE; k += 8) {
            uint32_t word = 0;
            if (!directmpc_read(design_, status_, &word) && !(word & pending_)) return;
            directmpc_clocks(design_, 8);
        }
        throw Refused{"parameters do not come into force"};
    }

    // The values of all nodes.
    std::vector<double> run() const {
        std::vector<double> found, given;
        for (const Node &node : program_) {
            given.clear();
            if (node.what == "value") {
                found.push_back(node.value);
            } else if (node.what == "of") {
                found.push_back(values[node.of.at(0)]);
            } else {
                for (const size_t k : node.of) given.push_back(found.at(k));
                found.push_back(done(node.what, given));
            }
            if (!std::isfinite(found.back())) throw Refused{together()};
        }
        for (const Hold &hold : holds_) {
            const double a = found.at(hold.left), b = found.at(hold.right);
            const bool so = hold.comparison == "less" ? a < b : hold.comparison == "most" ? a <= b : a == b;
            if (so != hold.outcome) throw Refused{together()};
        }
        return found;
    }

    // Why values of parameters cannot be had, each of which alone could.
    std::string together() const {
        std::ostringstream text;
        for (const Node &node : program_)
            if (node.what == "of" && values[node.of.at(0)] != variables[node.of.at(0)].start)
                text << variables[node.of.at(0)].name << " = " << values[node.of.at(0)] << ", ";
        return text.str() + "together they do not fit the registers; write the FMU of such a drive";
    }

    uint32_t word_of(const Write &write) const {
        const double exact = values[write.parameter] * write.scale;
        const double counts = write.rounding == "up"     ? std::ceil(exact - 1e-6)
                              : write.rounding == "down" ? std::floor(exact + 1e-6)
                                                         : std::nearbyint(exact);
        if (!(counts >= 0 && counts <= write.most)) {
            std::ostringstream text;
            text << variables[write.parameter].name << ": got " << values[write.parameter]
                 << "; it must be at most " << write.most / write.scale;
            throw Refused{text.str()};
        }
        return static_cast<uint32_t>(counts);
    }

    // What a host does: faults of before are cleared, estimates begin anew, then the gates may switch.
    void turn(bool on) {
        if (on) {
            directmpc_write(design_, control_, disabled_);
            directmpc_write(design_, faults_, all_faults_);
            directmpc_write(design_, command_, forget_);
        }
        directmpc_write(design_, control_, on ? enabled_ : disabled_);
        on_ = on;
    }

    void sample() {
        clipped_ = false;
        for (const Measurement &one : measurements_) {
            double real = 0;
            for (const auto &[variable, factor] : one.terms) real += factor * values[variable];
            const double word = std::nearbyint(real * one.scale);
            const double inside = std::fmin(std::fmax(word, one.low), one.high);
            clipped_ = clipped_ || inside != word;
            directmpc_put(design_, one.port, static_cast<uint32_t>(static_cast<int64_t>(inside)));
        }
        directmpc_put(design_, start_, 1);
        directmpc_clocks(design_, 1);
        directmpc_put(design_, start_, 0);
        next_ += period_;
    }

    void show() {
        for (const Shown &one : shown_) {
            const uint32_t all = directmpc_get(design_, one.port);
            int64_t word = (static_cast<uint64_t>(all) >> one.low) & ((uint64_t{1} << one.width) - 1);
            if (one.is_signed && word >> (one.width - 1)) word -= int64_t{1} << one.width;
            values[one.variable] = word / one.scale;
        }
        // what did not fit a port is not known to the design
        const size_t saturated = number("saturated");
        values[saturated] = values[saturated] != 0 || clipped_;
        values[number("clocks")] = static_cast<double>(now());
    }

    directmpc_design *design_;
    std::map<std::string, uint32_t> ports_;
    std::vector<Measurement> measurements_;
    std::vector<Shown> shown_;
    std::vector<Write> writes_;
    std::vector<Node> program_;
    std::vector<Hold> holds_;
    double clock_ = 0;
    uint64_t period_ = 0, zero_ = 0, next_ = 0;
    uint32_t control_ = 0, enabled_ = 0, disabled_ = 0, command_ = 0, forget_ = 0, faults_ = 0,
             all_faults_ = 0, status_ = 0, pending_ = 0;
    uint32_t start_ = 0, enable_ = 0, trip_ = 0, gates_ = 0;
    bool on_ = false, clipped_ = false;
};

}  // namespace

std::unique_ptr<Unit> make_unit() { return std::make_unique<Controller>(); }

}  // namespace directmpc
