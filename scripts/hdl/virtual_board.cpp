// The simulated board's pins, driven from outside: see scripts/hdl/virtual_board.py.
//
//   board pty CLOCKS_PER_BIT DIVIDE SETTLE LINK GATES SPI FREE   a pseudo-terminal, LINK a symbolic link to it
//   board script CLOCKS_PER_BIT DIVIDE SETTLE                    orders on standard input, what came of each on standard output
//
// SPI 0: the pseudo-terminal is its UART. 1: it carries SPI transactions, and the switch gives control to SPI. MARK, two
// bytes of length, the lower first, and as many bytes; as many come back. What does not begin so is skipped: a host that
// takes the port for a UART leaves nothing behind.
// FREE 1: time runs on without traffic too, as fast as the simulation goes.
// Clocks are the core's: DIVIDE of the oscillator's. Before anything else the board gets SETTLE of them.
//
// Licence: Apache-2.0

#include <cerrno>
#include <csignal>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <deque>
#include <fcntl.h>
#include <poll.h>
#include <string>
#include <termios.h>
#include <unistd.h>
#include <vector>

#include "Vboard.h"
#include "verilated.h"

double sc_time_stamp() { return 0; }

static Vboard *m;
static uint64_t clocks = 0;
static int divide = 1;              // clocks of the oscillator to one of the core
static uint32_t gates_before = 0;
static uint64_t gate_changes = 0;
static FILE *gate_log = nullptr;

// Bytes to and from the UART, in time: the bit clock need not divide the clock.
struct Uart {
    double period;                  // clocks a bit
    std::deque<uint8_t> to_board;
    std::vector<uint8_t> from_board;
    int send_bits = 0;              // of the byte on its way, 0: idle
    uint32_t send_shift = 0;
    double send_next = 0;
    int get_bits = 0;
    uint32_t get_shift = 0;
    double get_next = 0;
    uint64_t last_busy = 0;
    bool asked = false;             // bytes have gone in since the last came out

    void tick() {                   // once a clock, before its rising edge
        // the stop bit of the byte before lasts until send_next
        if (send_bits == 0 && !to_board.empty() && (double)clocks >= send_next) {
            send_shift = 0x200u | (uint32_t)to_board.front() << 1;
            to_board.pop_front();
            send_bits = 10;
            asked = true;
            send_next = (double)clocks;
        }
        if (send_bits && (double)clocks >= send_next) {
            m->uart_rx = send_shift & 1;
            send_shift >>= 1;
            send_bits--;
            send_next += period;
            last_busy = clocks;
        }
        if (get_bits == 0) {
            if (!m->uart_tx) {
                get_bits = 10;
                get_next = (double)clocks + period / 2;
            }
        } else if ((double)clocks >= get_next) {
            get_shift = get_shift >> 1 | (uint32_t)m->uart_tx << 9;
            get_next += period;
            last_busy = clocks;
            if (--get_bits == 0) {
                if (!(get_shift >> 9 & 1) || (get_shift & 1)) {
                    fprintf(stderr, "board: broken byte on uart_tx\n");
                    exit(3);
                }
                from_board.push_back((uint8_t)(get_shift >> 1));
                asked = false;
            }
        }
    }
    bool idle() const { return to_board.empty() && send_bits == 0 && get_bits == 0; }
};

static Uart uart;

static void watch_gates() {
    uint32_t now = m->gates;
    if (now != gates_before) {
        gates_before = now;
        gate_changes++;
        if (gate_log) fprintf(gate_log, "%llu,%06x\n", (unsigned long long)clocks, now);
    }
}

// What the pins are set to is seen at the first rising edge; the rest of the core's clock.
static void finish() {
    m->clock = 1;
    m->eval();
    for (int i = 1; i < divide; i++) {
        m->clock = 0;
        m->eval();
        m->clock = 1;
        m->eval();
    }
    clocks++;
    watch_gates();
}

static void cycle() {
    m->clock = 0;
    uart.tick();
    m->eval();
    finish();
}

// One byte over SPI, mode 0, SCK as fast as the clock; returns what came back.
static uint8_t spi_byte(uint8_t out) {
    uint8_t in = 0;
    for (int bit = 7; bit >= 0; bit--) {
        m->clock = 0;
        uart.tick();
        m->spi_mosi = out >> bit & 1;
        m->eval();
        in = in << 1 | m->spi_miso;
        m->spi_sck = 1;
        m->eval();
        finish();
        m->spi_sck = 0;
        m->eval();
    }
    return in;
}

// One SPI transaction: chip select is low for all of it.
static void spi_transaction(const std::vector<uint8_t> &bytes, std::vector<uint8_t> &back) {
    m->spi_cs_n = 0;
    m->eval();
    for (uint8_t byte : bytes) back.push_back(spi_byte(byte));
    for (int i = 0; i < 2; i++) cycle();
    m->spi_cs_n = 1;
    for (int i = 0; i < 8; i++) cycle();
}

static const uint8_t MARK[] = {'S', 'P', 'I'};
static const size_t HEAD = sizeof MARK + 2, LONGEST = 4096;  // bytes

// Whether a transaction may begin with what has come.
static bool begins(const std::deque<uint8_t> &came) {
    for (size_t i = 0; i < sizeof MARK && i < came.size(); i++)
        if (came[i] != MARK[i]) return false;
    return came.size() < HEAD || (came[HEAD - 2] | (size_t)came[HEAD - 1] << 8) <= LONGEST;
}

// The transaction that has come whole, if there is one.
static bool taken(std::deque<uint8_t> &came, std::vector<uint8_t> &bytes) {
    while (!begins(came)) came.pop_front();
    if (came.size() < HEAD) return false;
    size_t size = came[HEAD - 2] | (size_t)came[HEAD - 1] << 8;
    if (came.size() < HEAD + size) return false;
    bytes.assign(came.begin() + (long)HEAD, came.begin() + (long)(HEAD + size));
    came.erase(came.begin(), came.begin() + (long)(HEAD + size));
    return true;
}

static std::string link_name;

static void leave(int) {
    if (!link_name.empty()) unlink(link_name.c_str());
    _exit(0);
}

static void start(int settle) {
    m = new Vboard;
    m->clock = 0;
    m->uart_rx = 1;
    m->spi_cs_n = 0;  // the simulator sees an asynchronous reset by its edge
    m->permit = 1;
    m->spi_sck = 0;
    m->spi_mosi = 0;
    m->steps_over_spi = 0;
    m->eval();
    m->spi_cs_n = 1;
    m->permit = 0;
    m->eval();
    m->permit = 1;
    m->eval();
    // from the first clock on, before the reset has done anything
    for (int i = 0; i < settle; i++) {
        if (m->gates) {
            fprintf(stderr, "board: gates are on at clock %d\n", i);
            exit(3);
        }
        cycle();
    }
}

static int run_pty(const char *link, const char *gates_file, bool over_spi, bool free_running) {
    int master = posix_openpt(O_RDWR | O_NOCTTY);
    if (master < 0 || grantpt(master) || unlockpt(master)) { perror("board: pseudo-terminal"); return 2; }
    const char *name = ptsname(master);
    int slave = open(name, O_RDWR | O_NOCTTY);  // kept open: a client may come and go
    if (slave < 0) { perror("board: pseudo-terminal"); return 2; }
    struct termios raw;
    tcgetattr(slave, &raw);
    cfmakeraw(&raw);
    tcsetattr(slave, TCSANOW, &raw);
    fcntl(master, F_SETFL, O_NONBLOCK);
    // beside the file, which it replaces once the board is up
    const std::string gates_new = std::string(gates_file) + ".new";
    if (strcmp(gates_file, "-")) {
        gate_log = fopen(gates_new.c_str(), "w");
        if (!gate_log) { perror(gates_file); return 2; }
        setvbuf(gate_log, nullptr, _IOLBF, 0);
        fprintf(gate_log, "clock,gates\n");
    }
    unlink(link);
    if (symlink(name, link) || (gate_log && rename(gates_new.c_str(), gates_file))) {
        perror(link);
        if (gate_log) unlink(gates_new.c_str());
        return 2;
    }
    link_name = link;
    signal(SIGINT, leave);
    signal(SIGTERM, leave);
    signal(SIGHUP, leave);
    m->steps_over_spi = over_spi;
    printf("virtual board: %s at %s -> %s\n", over_spi ? "SPI" : "UART", link, name);
    fflush(stdout);
    // Unless it runs freely, time runs while the line is in use, and a little longer: a reply takes less than that to begin.
    // Between two bytes of a reply the board may be idle for half a stop bit and a little longer.
    const uint64_t patience = 4000, rest = 60 + (uint64_t)uart.period;
    uint8_t buffer[256];
    std::deque<uint8_t> came;  // over SPI
    std::vector<uint8_t> bytes;
    for (;;) {
        bool quiet = !free_running &&
            (over_spi || (uart.idle() && clocks > uart.last_busy + (uart.asked ? patience : rest)));
        if (quiet) {
            struct pollfd wait = {master, POLLIN, 0};
            poll(&wait, 1, 1000);
            if (getppid() == 1) leave(0);  // whoever started it is gone
        }
        if (free_running && clocks % 65536 == 0 && getppid() == 1) leave(0);
        if (quiet || clocks % 64 == 0) {
            ssize_t count = read(master, buffer, sizeof buffer);
            for (ssize_t i = 0; i < count; i++) (over_spi ? came : uart.to_board).push_back(buffer[i]);
            if (over_spi) {
                while (taken(came, bytes)) spi_transaction(bytes, uart.from_board);
            } else if (count > 0) uart.last_busy = clocks;
            if (quiet && (over_spi || count <= 0) && uart.from_board.empty()) continue;
        }
        if (!over_spi || free_running) cycle();
        if (!uart.from_board.empty() && (uart.from_board.size() >= 16 || uart.idle())) {
            size_t done = 0;
            while (done < uart.from_board.size()) {
                ssize_t count = write(master, uart.from_board.data() + done, uart.from_board.size() - done);
                if (count > 0) done += (size_t)count;
                else if (errno == EAGAIN) { usleep(1000); }
                else break;
            }
            uart.from_board.clear();
        }
    }
}

static bool get(void *to, size_t size) { return fread(to, 1, size, stdin) == size; }

static void put_bytes(const std::vector<uint8_t> &bytes) {
    uint32_t size = (uint32_t)bytes.size();
    fwrite(&size, 4, 1, stdout);
    fwrite(bytes.data(), 1, size, stdout);
}

// Orders: a letter and a 32-bit number; u and s are followed by that many bytes.
//   u: send over the UART   s: one SPI transaction   w: wait so many clocks
//   p: permit               l: steps over SPI        f: flush what is written
static int run_script() {
    std::vector<uint8_t> bytes, back;
    char order;
    uint32_t number;
    while (get(&order, 1) && get(&number, 4)) {
        back.clear();
        uint64_t before = gate_changes;
        if (order == 'u' || order == 's') {
            bytes.resize(number);
            if (number && !get(bytes.data(), number)) return 4;
        }
        if (order == 'u') {
            uart.to_board.insert(uart.to_board.end(), bytes.begin(), bytes.end());
            while (!uart.to_board.empty() || uart.send_bits || clocks < uart.send_next) cycle();
        } else if (order == 's') {
            spi_transaction(bytes, back);
        } else if (order == 'w') {
            for (uint32_t i = 0; i < number; i++) cycle();
        } else if (order == 'p') {
            m->permit = number & 1;
            m->eval();  // no clock: the pins follow by themselves
            watch_gates();
        } else if (order == 'l') {
            m->steps_over_spi = number & 1;
        } else if (order != 'f') {
            fprintf(stderr, "board: order %d is unknown\n", order);
            return 4;
        }
        put_bytes(uart.from_board);
        uart.from_board.clear();
        put_bytes(back);
        uint32_t seen[2] = {(uint32_t)(gate_changes - before), (uint32_t)m->gates};
        fwrite(seen, 4, 2, stdout);
        fwrite(&clocks, 8, 1, stdout);
        if (order == 'f') fflush(stdout);
    }
    fflush(stdout);
    m->final();
    return 0;
}

int main(int argc, char **argv) {
    Verilated::commandArgs(argc, argv);
    if (argc >= 5) {
        uart.period = atof(argv[2]);
        divide = atoi(argv[3]);
    }
    if (argc >= 9 && !strcmp(argv[1], "pty")) {
        start(atoi(argv[4]));
        return run_pty(argv[5], argv[6], argv[7][0] == '1', argv[8][0] == '1');
    }
    if (argc >= 5 && !strcmp(argv[1], "script")) {
        start(atoi(argv[4]));
        return run_script();
    }
    fprintf(stderr, "usage: board pty CLOCKS_PER_BIT DIVIDE SETTLE LINK GATES SPI FREE | board script CLOCKS_PER_BIT DIVIDE SETTLE\n");
    return 2;
}
