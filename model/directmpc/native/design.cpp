// A design of directmpc as a native library: see design.h.
//
// Compiled together with what Verilator makes of the converted VHDL (class Vdesign) and with ports.h,
// which the build writes from the header of the Verilog: the list PORTS(X) of X(direction, name, width)
// but for clk, and the macros START_PORT, VALID_PORT, BUSY_PORT, RST_PORT, and AXI where there is a bus.
// Licence: Apache-2.0

#include "design.h"

#include <cstring>
#include <memory>
#include <new>
#include <vector>

#include "Vdesign.h"
#include "ports.h"
#include "verilated.h"
#include "verilated_save.h"

double sc_time_stamp() { return 0; }

namespace {

constexpr unsigned RESET_CLOCKS = 4;
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

    directmpc_design() : model(new Vdesign{&context}) {}
    // Inputs settle with the clock low; what an edge samples is read just before it.
    void settle() {
        model->clk = 0;
        model->eval();
    }
    void edge() {
        model->clk = 1;
        model->eval();
        edges++;
    }
    void clock() {
        settle();
        edge();
    }
    void put(unsigned port, uint32_t value);
    uint32_t get(unsigned port) const;
};

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
        directmpc_reset(design);
        return design;
    } catch (const std::bad_alloc &) {
        return nullptr;
    }
}

void directmpc_destroy(directmpc_design *design) {
    if (!design) return;
    design->model->final();
    delete design;
}

void directmpc_reset(directmpc_design *design) {
    design->model->rst = 1;
    directmpc_clocks(design, RESET_CLOCKS);
    design->model->rst = 0;
    design->settle();
}

void directmpc_put(directmpc_design *design, uint32_t port, uint32_t value) {
    design->put(port, value);
}

uint32_t directmpc_get(const directmpc_design *design, uint32_t port) { return design->get(port); }

uint64_t directmpc_edges(const directmpc_design *design) { return design->edges; }

void directmpc_clocks(directmpc_design *design, uint32_t clocks) {
    for (; clocks; clocks--) design->clock();
    design->settle();
}

uint32_t directmpc_decide(directmpc_design *design, const uint32_t *inputs, uint32_t *outputs,
                          uint32_t limit) {
    Vdesign *const model = design->model.get();
    uint32_t waited = 0;
    for (design->settle(); model->BUSY_PORT; design->clock(), design->settle())
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
    design->clock();
    model->start = 0;
    for (uint32_t cycles = 1; cycles <= limit; cycles++) {
        design->settle();
        if (model->valid) {
            at = 0;
#define SHOW_in(name, width)
#define SHOW_out(name, width) outputs[at++] = model->name;
#define SHOW(direction, name, width) SHOW_##direction(name, width)
            PORTS(SHOW)
#undef SHOW
            design->edge();
            return cycles;
        }
        design->edge();
    }
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

namespace {

std::vector<uint8_t> saved(const directmpc_design *design) {
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
