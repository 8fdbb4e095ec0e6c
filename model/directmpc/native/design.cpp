// A design of directmpc as a native library: see design.h.
//
// Compiled together with what Verilator makes of the converted VHDL (class Vdesign) and with ports.h,
// which the build writes from the header of the Verilog: the list PORTS(X) of X(direction, name, width)
// but for the clock, CLOCK, which is its name, and AXI, DECIDES, SPI where there is a register bus, a start of
// decisions, the pins of a board. resting.h lists members of the class
// that change while the design rests: COUNTERS(X) of X(member, width, way), COUNTED(X) of X(member) for what
// follows from counters alone, ROTATING(X) of X(part, member); and BEFORE, where Verilator keeps the clock as it was.
// Licence: Apache-2.0

#include "design.h"

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <new>
#include <vector>

#include "Vdesign.h"
#include "Vdesign___024root.h"
#include "ports.h"
#include "resting.h"
#include "verilated.h"
#include "verilated_save.h"

double sc_time_stamp() { return 0; }

// Computes all signals anew from registers and inputs; of the class that Verilator makes.
void Vdesign___024root___eval_settle(Vdesign___024root *self);

namespace {

constexpr unsigned RESET_CLOCKS = 4;
constexpr unsigned POWER_ON_CLOCKS = 100;  // of a board: its own reset takes 15
constexpr unsigned ANSWER_CLOCKS = 64;  // several times the longest access of a system

enum Direction { in, out };

struct Port {
    Direction direction;
    const char *name;
    unsigned width;
};

#define ROW(direction, name, width) {direction, #name, width},
constexpr Port LIST[] = {PORTS(ROW)};
#undef ROW
constexpr unsigned COUNT = sizeof LIST / sizeof *LIST;

constexpr uint32_t mask(unsigned width) { return width >= 32 ? ~0u : (1u << width) - 1; }

enum Way { down, up };

struct Counter {
    uint32_t most;
    Way way;
};

#define ROW(member, width, way) {mask(width), way},
constexpr Counter COUNTER[] = {COUNTERS(ROW){0, down}};
#undef ROW
constexpr unsigned COUNTER_COUNT = sizeof COUNTER / sizeof *COUNTER - 1;

constexpr size_t WINDOW = 24;  // clocks within which a rotating part comes back; 16 are the longest
constexpr uint64_t WORTH = 4;  // clocks that a look costs
#define ONE(part, member) +1
constexpr size_t PARTS = 0 ROTATING(ONE);  // more than there can be
#undef ONE

// Serialisation into memory; Verilator's own writes files.
class Writer final : public VerilatedSerialize {
   public:
    explicit Writer(std::vector<uint8_t> &bytes) : bytes_(bytes) {
        m_isOpen = true;
        header();
    }
    ~Writer() override { m_isOpen = false; }
    void end() {
        trailer();
        flush();
    }
    void flush() override {
        bytes_.insert(bytes_.end(), m_bufp, m_cp);
        m_cp = m_bufp;
    }

   private:
    std::vector<uint8_t> &bytes_;
};

class Reader final : public VerilatedDeserialize {
   public:
    Reader(const uint8_t *bytes, size_t size) : next_(bytes), left_(size) {
        m_isOpen = true;
        m_endp = m_bufp;
        header();
    }
    ~Reader() override { m_isOpen = false; }

   protected:
    void fill() override {
        const size_t kept = m_endp - m_cp;
        std::memmove(m_bufp, m_cp, kept);
        m_cp = m_bufp;
        m_endp = m_bufp + kept;
        const size_t room = m_bufp + bufferSize() - m_endp;
        const size_t taken = left_ < room ? left_ : room;
        std::memcpy(m_endp, next_, taken);
        std::memset(m_endp + taken, 0, room - taken);  // the readers look ahead
        next_ += taken;
        left_ -= taken;
        m_endp += room;
    }

   private:
    const uint8_t *next_;
    size_t left_;
};

// What a saved state begins with, so that foreign bytes are refused.
struct Head {
    char magic[8];
    uint64_t edges;
    uint64_t size;
};
constexpr char MAGIC[8] = {'d', 'm', 'p', 'c', 'r', 't', 'l', '1'};

}  // namespace

struct directmpc_design {
    VerilatedContext context;
    std::unique_ptr<Vdesign> model;
    uint64_t edges = 0;
    uint64_t skipped = 0;

    directmpc_design();
    // What Verilator keeps of a model's signals, it looks for in the context of the thread.
    ~directmpc_design() { Verilated::threadContextp(&context); }
    // Zeroed, padding too: equal states are saved as equal bytes.
    static void *operator new(size_t size) {
        void *const memory = std::calloc(1, size);
        if (!memory) throw std::bad_alloc();
        return memory;
    }
    static void operator delete(void *memory) { std::free(memory); }
    // Inputs settle with the clock low; what an edge samples is read just before it.
    void settle() {
        model->CLOCK = 0;
        model->eval();
    }
    void edge() {
        model->CLOCK = 1;
        model->eval();
        edges++;
    }
    // One more, with inputs that have settled: outputs are right behind it, and the low clock needs no look.
    void again() {
#ifdef BEFORE
        model->rootp->BEFORE = 0;
#else
        settle();
#endif
        edge();
    }
#ifdef SPI
    // The pins as a host leaves them. What is asynchronous is seen by its edge.
    void power_on() {
        for (const bool high : {false, true}) {
            model->permit = !high;
            model->spi_cs_n = high;
            model->uart_rx = 1;
            settle();
        }
        model->permit = 1;
        for (unsigned k = 0; k < POWER_ON_CLOCKS; k++) again();
        settle();
    }
#endif
    void put(unsigned port, uint32_t value);
    uint32_t get(unsigned port) const;
    template <class Changed>
    uint64_t run(uint64_t clocks, Changed changed);

   private:
    struct Range {
        size_t at, size, part;
    };
    std::vector<Range> fixed_;     // bytes of the model that stand while it rests
    std::vector<Range> rotating_;  // those of parts that run in a circle
    size_t parts_ = 0;
    std::vector<uint8_t> before_;  // all of the model, a clock ago
    std::vector<uint8_t> turns_;   // rotating_, clock by clock
    size_t turn_ = 0;              // bytes of one clock
    size_t suspect_ = 0;           // of the model: what changed when it was looked at last
    uint8_t seen_ = 0;             // what stood there

    uint8_t *bytes() const { return reinterpret_cast<uint8_t *>(model->rootp); }
    bool calm();
    bool same();
    void counts(uint32_t *values) const;
    void record(size_t clock);
    bool turned(size_t clock, size_t *periods) const;
    void advance(const uint32_t *steps, size_t clock, const size_t *periods, uint32_t clocks);
};

directmpc_design::directmpc_design()
    : before_(sizeof(Vdesign___024root)) {
    context.threads(1);
    Verilated::threadContextp(&context);
    model.reset(new Vdesign{&context});
    const Vdesign___024root *const root = model->rootp;
    (void)root;
    std::vector<Range> loose;
#define AT(member) static_cast<size_t>(reinterpret_cast<const uint8_t *>(&root->member) - bytes())
#define LOOSE(member) loose.push_back({AT(member), sizeof root->member, 0});
#define LOOSE_COUNTER(member, width, way) LOOSE(member)
#define LOOSE_PART(part, member) rotating_.push_back({AT(member), sizeof root->member, part});
    COUNTERS(LOOSE_COUNTER)
    COUNTED(LOOSE)
    ROTATING(LOOSE_PART)
#undef LOOSE_PART
#undef LOOSE_COUNTER
#undef LOOSE
#undef AT
    const auto in_memory = [](const Range &a, const Range &b) {
        return a.part != b.part ? a.part < b.part : a.at < b.at;
    };
    std::vector<Range> joined;  // neighbours are one range
    std::sort(rotating_.begin(), rotating_.end(), in_memory);
    for (const Range &range : rotating_) {
        loose.push_back({range.at, range.size, 0});
        turn_ += range.size;
        parts_ = range.part + 1;
        if (!joined.empty() && joined.back().part == range.part &&
            joined.back().at + joined.back().size == range.at)
            joined.back().size += range.size;
        else
            joined.push_back(range);
    }
    rotating_ = joined;
    std::sort(loose.begin(), loose.end(), in_memory);
    loose.push_back({before_.size(), 0, 0});
    size_t end = 0;
    for (const Range &range : loose) {
        if (range.at > end) fixed_.push_back({end, range.at - end, 0});
        end = range.at + range.size;
    }
    turns_.resize(turn_ * (WINDOW + 1));
}

// Whether no decision is under way and the byte that gave motion away the last time stands still: a guess that costs
// nothing.
bool directmpc_design::calm() {
#ifdef DECIDES
    if (model->busy) return false;
#endif
    const uint8_t now = bytes()[suspect_];
    const bool still = now == seen_;
    seen_ = now;
    return still;
}

// Whether the model is before_ but for what is loose.
bool directmpc_design::same() {
    for (const Range &range : fixed_) {
        const uint8_t *const was = &before_[range.at], *const is = bytes() + range.at;
        if (!std::memcmp(was, is, range.size)) continue;
        suspect_ = range.at + (std::mismatch(was, was + range.size, is).first - was);
        return false;
    }
    return true;
}

void directmpc_design::counts(uint32_t *values) const {
    (void)values;
#define COUNT(member, width, way) *values++ = model->rootp->member;
    COUNTERS(COUNT)
#undef COUNT
}

void directmpc_design::record(size_t clock) {
    uint8_t *to = turns_.data() + clock * turn_;
    for (const Range &range : rotating_) to = std::copy_n(bytes() + range.at, range.size, to);
}

// Whether every rotating part is as it was some clocks ago, and how many.
bool directmpc_design::turned(size_t clock, size_t *periods) const {
    std::fill_n(periods, parts_, 0);
    for (size_t part = 0, first = 0, at = 0; part < parts_; part++) {
        size_t end = first, size = 0;
        for (; end < rotating_.size() && rotating_[end].part == part; end++) size += rotating_[end].size;
        const uint8_t *const now = turns_.data() + clock * turn_ + at;
        size_t period = 1;
        while (period <= clock && std::memcmp(now, now - period * turn_, size)) period++;
        if (period > clock) return false;
        periods[part] = period;
        first = end;
        at += size;
    }
    return true;
}

void directmpc_design::advance(const uint32_t *steps, size_t clock, const size_t *periods,
                               uint32_t clocks) {
    (void)steps;
#define MOVE(member, width, way) \
    model->rootp->member = (model->rootp->member + *steps++ * clocks) & mask(width);
    COUNTERS(MOVE)
#undef MOVE
    size_t at = 0;
    for (const Range &range : rotating_) {
        const size_t period = periods[range.part], then = clock - period + clocks % period;
        std::copy_n(turns_.data() + then * turn_ + at, range.size, bytes() + range.at);
        at += range.size;
    }
    Vdesign___024root___eval_settle(model->rootp);
    edges += clocks;
    skipped += clocks;
}

// Lets clocks pass, until `changed` says so behind an edge; returns how many have.
//
// Clocks in which nothing can change are not computed. They are told from the model itself: for some
// clocks in succession, with inputs that stand, nothing in it has changed but
//
//   what runs in a circle inside of a part, whose outputs have stood. In these clocks each such part
//   has come back to a state that it had, so it goes on in that circle as long as its inputs stand.
//   counts, on which nothing but themselves depends until a countdown has come to 1, and the clocks of
//   a decision to their most. tb/proofs proves that of their VHDL.
//
// All else is a function of what has not changed. So it stays as it is until the first count is there;
// until then a clock moves counts by one and circles by one place.
template <class Changed>
uint64_t directmpc_design::run(uint64_t clocks, Changed changed) {
    uint64_t passed = 0;
    size_t periods[PARTS + 1];
    uint32_t value[3][COUNTER_COUNT + 1];
    if (clocks) settle();
    while (passed < clocks) {
        if (!calm() || clocks - passed <= 2 * WORTH) {
            again();
            passed++;
            if (changed()) break;
            continue;
        }
        std::copy_n(bytes(), before_.size(), before_.begin());
        counts(value[0]);
        record(0);
        bool rests = false, stops = false;
        size_t looked = 0;
        while (looked < WINDOW && passed < clocks && !rests) {
            again();
            passed++;
            looked++;
            if ((stops = changed()) || !same()) break;
            record(looked);
            if (looked > 2) std::memmove(value[0], value[1], 2 * sizeof *value);
            counts(value[std::min<size_t>(looked, 2)]);
            rests = looked > 1 && turned(looked, periods);
        }
        if (stops) break;
        if (!rests) continue;
        uint64_t most = std::min<uint64_t>(clocks - passed, UINT32_MAX);
        uint32_t steps[COUNTER_COUNT + 1];
        for (unsigned k = 0; k < COUNTER_COUNT; k++) {
            const Counter &counter = COUNTER[k];
            const uint32_t step = (value[2][k] - value[1][k]) & counter.most;
            steps[k] = step;
            if (((value[1][k] - value[0][k]) & counter.most) != step) most = 0;
            if (!step) continue;
            if (step != (counter.way == up ? 1 : counter.most)) most = 0;
            const uint32_t left = counter.way == up ? counter.most - value[2][k]
                                                    : (value[2][k] - 1) & counter.most;
            most = std::min<uint64_t>(most, left);
        }
        if (most) advance(steps, looked, periods, most);
        passed += most;
    }
    return passed;
}

void directmpc_design::put(unsigned port, uint32_t value) {
    unsigned at = 0;
    (void)at;
#define INTO_in(name, width) model->name = value & mask(width)
#define INTO_out(name, width) (void)0
#define PUT(direction, name, width)      \
    if (at++ == port) {                  \
        INTO_##direction(name, width);   \
        return;                          \
    }
    PORTS(PUT)
#undef PUT
}

uint32_t directmpc_design::get(unsigned port) const {
    unsigned at = 0;
    (void)at;
#define GET(direction, name, width) \
    if (at++ == port) return model->name;
    PORTS(GET)
#undef GET
    return 0;
}

const char *directmpc_ports(void) {
#define LINE(direction, name, width) #direction " " #name " " #width "\n"
    return PORTS(LINE);
#undef LINE
}

directmpc_design *directmpc_create(void) {
    try {
        auto *design = new directmpc_design;
#ifdef SPI
        design->power_on();
#else
        directmpc_reset(design);
#endif
        Vdesign___024root___eval_settle(design->model->rootp);  // keeps count of its rounds: one from here on
        return design;
    } catch (const std::bad_alloc &) {
        return nullptr;
    }
}

void directmpc_destroy(directmpc_design *design) {
    delete design;
}

void directmpc_reset(directmpc_design *design) {
#ifdef SPI
    (void)design;
#else
    design->model->rst = 1;
    directmpc_clocks(design, RESET_CLOCKS);
    design->model->rst = 0;
    design->settle();
#endif
}

void directmpc_put(directmpc_design *design, uint32_t port, uint32_t value) {
    design->put(port, value);
}

uint32_t directmpc_get(const directmpc_design *design, uint32_t port) { return design->get(port); }

uint64_t directmpc_edges(const directmpc_design *design) { return design->edges; }

void directmpc_clocks(directmpc_design *design, uint32_t clocks) {
    design->run(clocks, [] { return false; });
    design->settle();
}

uint32_t directmpc_until(directmpc_design *design, uint32_t port, uint32_t clocks) {
    design->settle();
    const uint32_t before = design->get(port);
    const uint32_t passed =
        design->run(clocks, [&] { return design->get(port) != before; });
    design->settle();
    return passed;
}

uint64_t directmpc_skipped(const directmpc_design *design) { return design->skipped; }

uint32_t directmpc_decide(directmpc_design *design, const uint32_t *inputs, uint32_t *outputs,
                          uint32_t limit) {
#ifdef DECIDES
    Vdesign *const model = design->model.get();
    uint32_t waited = 0;
    for (design->settle(); model->busy; design->again())
        if (waited++ >= limit) return 0;
    unsigned at = 0;
#define TAKE_in(name, width)                                                              \
    if (std::strcmp(#name, "rst") && std::strcmp(#name, "start") && !std::strstr(#name, "axil")) \
        model->name = inputs[at] & mask(width);                                           \
    at++;
#define TAKE_out(name, width)
#define TAKE(direction, name, width) TAKE_##direction(name, width)
    PORTS(TAKE)
#undef TAKE
    model->start = 1;
    design->settle();
    design->edge();
    model->start = 0;
    design->settle();
    for (uint32_t cycles = 1; cycles <= limit; cycles++) {
        if (model->valid) {
            at = 0;
#define SHOW_in(name, width)
#define SHOW_out(name, width) outputs[at++] = model->name;
#define SHOW(direction, name, width) SHOW_##direction(name, width)
            PORTS(SHOW)
#undef SHOW
            design->again();
            return cycles;
        }
        design->again();
    }
#else
    (void)design, (void)inputs, (void)outputs, (void)limit;
#endif
    return 0;
}

int directmpc_write(directmpc_design *design, uint32_t address, uint32_t word) {
#ifdef AXI
    Vdesign *const m = design->model.get();
    bool address_there = true, word_there = true;
    int answer = -1;
    m->s_axil_awaddr = address;
    m->s_axil_wdata = word;
    m->s_axil_wstrb = 15;
    m->s_axil_bready = 1;
    for (unsigned k = 0; k < ANSWER_CLOCKS && answer < 0; k++) {
        m->s_axil_awvalid = address_there;
        m->s_axil_wvalid = word_there;
        design->settle();
        address_there = address_there && !m->s_axil_awready;
        word_there = word_there && !m->s_axil_wready;
        if (m->s_axil_bvalid) answer = m->s_axil_bresp;
        design->edge();
    }
    m->s_axil_awvalid = m->s_axil_wvalid = m->s_axil_bready = 0;
    design->settle();
    return answer;
#else
    (void)design, (void)address, (void)word;
    return -1;
#endif
}

int directmpc_read(directmpc_design *design, uint32_t address, uint32_t *word) {
#ifdef AXI
    Vdesign *const m = design->model.get();
    bool address_there = true;
    int answer = -1;
    m->s_axil_araddr = address;
    m->s_axil_rready = 1;
    for (unsigned k = 0; k < ANSWER_CLOCKS && answer < 0; k++) {
        m->s_axil_arvalid = address_there;
        design->settle();
        address_there = address_there && !m->s_axil_arready;
        if (m->s_axil_rvalid) {
            answer = m->s_axil_rresp;
            *word = m->s_axil_rdata;
        }
        design->edge();
    }
    m->s_axil_arvalid = m->s_axil_rready = 0;
    design->settle();
    return answer;
#else
    (void)design, (void)address, (void)word;
    return -1;
#endif
}

int directmpc_transfer(directmpc_design *design, const uint8_t *bytes, uint8_t *back, size_t count) {
#ifdef SPI
    Vdesign *const m = design->model.get();
    m->spi_cs_n = 0;
    design->settle();
    for (size_t k = 0; k < count; k++) {
        uint8_t in = 0;
        for (int bit = 7; bit >= 0; bit--) {
            m->spi_mosi = bytes[k] >> bit & 1;
            design->settle();
            in = in << 1 | m->spi_miso;
            m->spi_sck = 1;
            m->eval();
            design->edge();
            m->spi_sck = 0;
            m->eval();
        }
        back[k] = in;
    }
    directmpc_clocks(design, 2);
    m->spi_cs_n = 1;
    directmpc_clocks(design, 8);
    return 0;
#else
    (void)design, (void)bytes, (void)back, (void)count;
    return -1;
#endif
}

namespace {

std::vector<uint8_t> saved(const directmpc_design *design) {
    // Marks of Verilator's own, of what it settled last, are then the same in equal designs.
    Vdesign___024root___eval_settle(design->model->rootp);
    std::vector<uint8_t> bytes;
    Writer writer(bytes);
    // Verilator serialises what it is given to write, but asks for a model that is not const
    writer << const_cast<Vdesign &>(*design->model);
    writer.end();
    return bytes;
}

}  // namespace

size_t directmpc_state_size(const directmpc_design *design) {
    return sizeof(Head) + saved(design).size();
}

void directmpc_save(const directmpc_design *design, void *bytes) {
    const std::vector<uint8_t> state = saved(design);
    Head head{};
    std::memcpy(head.magic, MAGIC, sizeof MAGIC);
    head.edges = design->edges;
    head.size = state.size();
    std::memcpy(bytes, &head, sizeof head);
    std::memcpy(static_cast<uint8_t *>(bytes) + sizeof head, state.data(), state.size());
}

int directmpc_restore(directmpc_design *design, const void *bytes, size_t size) {
    Head head;
    if (size < sizeof head) return -1;
    std::memcpy(&head, bytes, sizeof head);
    if (std::memcmp(head.magic, MAGIC, sizeof MAGIC) || head.size != size - sizeof head ||
        size != directmpc_state_size(design))
        return -1;
    Reader reader(static_cast<const uint8_t *>(bytes) + sizeof head, head.size);
    reader >> *design->model;
    design->edges = head.edges;
    design->settle();
    return 0;
}
