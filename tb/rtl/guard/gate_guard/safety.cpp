// Drives gate_guard_checked, converted to Verilog: random decisions, resets, trips and parameter
// writes; stops at the first violation. Arguments: clocks, seed, five-level (1 or 0).
// Prints one line of counts as name=value.
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include "Vcore.h"
#include "verilated.h"

static uint64_t state;

static uint32_t word() {  // xorshift64*
  state ^= state >> 12;
  state ^= state << 25;
  state ^= state >> 27;
  return (uint32_t)((state * 0x2545F4914F6CDD1Dull) >> 32);
}
static bool chance(double p) { return word() < p * 4294967296.0; }
static uint32_t below(uint32_t n) { return (uint32_t)(((uint64_t)word() * n) >> 32); }

static const int NEXT[8][4] = {{0, 1, 2, 2}, {0, 1, 3, 3}, {0, 2, 3, 4}, {1, 2, 3, 5},
                               {2, 4, 5, 6}, {3, 4, 5, 7}, {4, 6, 7, 7}, {5, 6, 7, 7}};

static void times(Vcore* m, bool anything) {
  if (anything) {
    m->dead_time = word() & 0xFFF;
    m->minimum_on = word() & 0xFFF;
    m->minimum_off = word() & 0xFFF;
    m->decision_limit = word() & 0xFFFF;
    m->watchdog = word() & 0xFFFF;
  } else {
    m->dead_time = below(6);
    m->minimum_on = below(9);
    m->minimum_off = below(9);
    m->decision_limit = 3 + below(9);
    m->watchdog = 30 + below(30);
  }
}

int main(int argc, char** argv) {
  Verilated::commandArgs(argc, argv);
  const long clocks = atol(argv[1]);
  state = 0x9E3779B97F4A7C15ull * (uint64_t)(atol(argv[2]) + 1);
  const bool five = atoi(argv[3]);
  Vcore* m = new Vcore;
  long running = 0, moves = 0, decisions = 0, resets = 0, trips = 0, writes = 0, starts = 0;
  long by_fault[15] = {0};
  int phase = 0, period = 40;
  bool due = false;  // the positions at the ports are a decision's of the next clock
  bool wild = false;
  uint32_t limit = 12000;
  uint32_t last_gates = 0, last_faults = 0, last_running = 0;
  m->clk = 0;
  m->enable = 0;
  m->clear = 0;
  times(m, false);
  m->current_limit = 12000;
  m->link_high = 40000;
  m->link_low = 20000;
  m->v_dc = 32000;
  m->v_ph_high = 20000;
  m->v_ph_low = 12000;
  m->v_n_limit = 4000;
  m->speed_limit = 9000;
  m->frozen_limit = 3;
  m->v_ph_a = m->v_ph_b = m->v_ph_c = 16000;
  for (long n = 0; n < clocks; n++) {
    m->rst = n < 2;
    m->external_trip = m->driver_fault = m->upset = m->measured = m->start = m->decided = m->renew = 0;
    m->clear = 0;
    if (n % 700 == 0) {
      wild = chance(0.15);
      period = 12 + below(40);
      times(m, false);
    }
    if (chance(0.0005)) m->rst = 1;
    resets += m->rst;
    if (m->faults && chance(0.3)) {
      m->clear = chance(0.5) ? 0x7FFF : word() & 0x7FFF;
      m->enable = word() & 1;
    } else if (!m->running && chance(m->enable ? 0.01 : 0.3)) {
      m->enable = !m->enable;
    } else if (chance(wild ? 0.01 : 0.0005)) {
      m->enable = !m->enable;
    }
    if (chance(0.004)) { times(m, chance(0.1)); writes++; }
    m->current_limit = limit;  // announced by renew a clock ago
    if (wild && chance(0.02)) { limit = word() & 0xFFFF; writes++; }
    if (!wild) limit = 12000;
    if (limit != m->current_limit || chance(0.002)) m->renew = 1;
    if (chance(0.01)) m->measured = 1;
    if (++phase >= period) {
      phase = 0;
      m->start = m->measured = 1;
      if (n % 20000 > 1000) {  // else the currents stand still
        m->is_alpha = (below(18000) - 9000) & 0xFFFF;
        m->is_beta = (below(18000) - 9000) & 0xFFFF;
      }
      m->v_ph_a = 13000 + below(6000);
      m->v_n = (below(6000) - 3000) & 0xFFFF;
      m->omega_r = (below(16000) - 8000) & 0xFFFF;
      if (chance(0.01)) m->v_ph_a = word() & 0xFFFF;
      if (chance(0.01)) m->v_n = word() & 0xFFFF;
      if (chance(0.01)) m->omega_r = word() & 0xFFFF;
      m->v_dc = 24000 + below(14000);
      if (chance(0.02)) m->is_alpha = word() & 0xFFFF;
      if (chance(0.02)) m->v_dc = word() & 0xFFFF;
    }
    if (chance(0.0005)) { m->external_trip = 1; trips++; }
    if (chance(0.0001)) m->driver_fault = 1;
    if (chance(0.0001)) m->upset = 1;
    if (wild && chance(0.02)) m->start = 1;
    uint32_t goal[3];
    m->decided = due;
    decisions += due;
    for (int x = 0; x < 3; x++) goal[x] = below(five ? 8 : 2);
    due = (phase == 2 && !chance(0.02)) || chance(wild ? 0.03 : phase == 3 ? 0.03 : 0.001);
    if (due) {
      for (int x = 0; x < 3; x++) {
        const uint32_t now = m->goals >> (3 * x) & 7;
        if (!chance(0.01)) goal[x] = chance(0.5) ? now : five ? NEXT[now][below(4)] : now ^ 1;
      }
    }
    m->position_a = goal[0];
    m->position_b = goal[1];
    m->position_c = goal[2];
    m->eval();
    m->clk = 1;
    m->eval();
    m->clk = 0;
    m->eval();
    if (m->violations) {
      printf("violated=0x%x clock=%ld gates=0x%x faults=0x%x\n", m->violations, n, m->gates, m->faults);
      return 1;
    }
    running += m->running;
    moves += m->gates != last_gates;
    starts += m->running && !last_running;
    for (int f = 0; f < 15; f++) by_fault[f] += (m->faults & ~last_faults) >> f & 1;
    last_gates = m->gates;
    last_faults = m->faults;
    last_running = m->running;
  }
  printf("clocks=%ld running=%ld moves=%ld starts=%ld decisions=%ld resets=%ld trips=%ld writes=%ld",
         clocks, running, moves, starts, decisions, resets, trips, writes);
  for (int f = 0; f < 15; f++) printf(" fault%d=%ld", f, by_fault[f]);
  printf("\n");
  m->final();
  delete m;
  return 0;
}
