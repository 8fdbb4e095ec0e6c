// Flips single flip-flops of a mapped netlist and tells what comes of it.
//
// The netlist is a function: (inputs, state) -> (outputs, next state); upsets.py makes it so. A run without a flip is
// kept clock by clock. A run with a flip begins at one of its states and ends where it is in that run's state again.
//
// Compiled with: INPUTS, STATE, OUTPUTS, words of 32 bits of each; GATES, of a leg.
// Outputs begin with the gates, 24 bits, and the faults, 16 bits.
// Arguments: files of the inputs (words, clock by clock), of the first state and of the forbidden patterns (a byte for
// each pattern of a leg, 1: forbidden) and of 64 bits for each flip-flop, its own seed; clocks, first and last clock of a flip, clock from which on all gates have to be
// off, dead time in clocks, flips of each flip-flop, seed, first and last flip-flop. Prints "golden N" with the N problems of the run without a flip, and a line for each flip:
// flip-flop, clock, outcome, longest forbidden pattern in clocks, and 1 where the state is another one at the end.
#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <vector>
#include "Vcore.h"
#include "verilated.h"

using Word = uint32_t;
static Vcore* m;
static long clocks, deadline, dead;
static std::vector<Word> inputs, states, told;  // of the run without a flip

static uint8_t forbidden[1 << GATES];  // by the gates of a leg
static bool shorted(Word gates) {
  for (int x = 0; x < 3; x++)
    if (forbidden[gates >> (GATES * x) & ((1u << GATES) - 1)]) return true;
  return false;
}
static uint64_t seed;
static Word draw() {  // xorshift64*
  seed ^= seed >> 12;
  seed ^= seed << 25;
  seed ^= seed >> 27;
  return (Word)((seed * 2685821657736338717ull) >> 32);
}
static void step(long t, const Word* state, Word* next, Word* out) {
  for (int k = 0; k < INPUTS; k++) m->i[k] = inputs[t * INPUTS + k];
  for (int k = 0; k < STATE; k++) m->s[k] = state[k];
  m->eval();
  for (int k = 0; k < STATE; k++) next[k] = m->n[k];
  for (int k = 0; k < OUTPUTS; k++) out[k] = m->o[k];
}
static void fill(const char* name, void* place, size_t bytes) {
  FILE* file = fopen(name, "rb");
  if (!file || fread(place, 1, bytes, file) != bytes) {
    fprintf(stderr, "upsets: %s is too short\n", name);
    exit(2);
  }
  fclose(file);
}
static Word faults_of(const Word* out) { return (out[0] >> 24) | (out[1] & 0xFF) << 8; }

// Rules for the gates, fed clock by clock.
struct Watch {
  std::vector<Word> recent;  // gates of the last clocks
  long row = 0, longest = 0, close = 0, late = 0;
  void before(Word gates) { recent.push_back(gates & 0xFFFFFF); }
  void look(long t, Word gates) {
    gates &= 0xFFFFFF;
    row = shorted(gates) ? row + 1 : 0;
    longest = std::max(longest, row);
    Word together = gates;
    const long size = (long)recent.size();
    for (long k = std::max(0l, size - dead + 1); k < size; k++)
      if (!shorted(recent[k])) together |= recent[k];  // a pattern that is shorted counts by itself
    close += !row && shorted(together);
    late += t >= deadline && gates;
    recent.push_back(gates);
  }
};

int main(int argc, char** argv) {
  Verilated::commandArgs(argc, argv);
  m = new Vcore;
  clocks = atol(argv[5]);
  const long first = atol(argv[6]), last = atol(argv[7]);
  deadline = atol(argv[8]);
  dead = atol(argv[9]);
  const int times = atoi(argv[10]);
  const uint64_t base = strtoull(argv[11], nullptr, 10);
  inputs.resize(clocks * INPUTS);
  states.resize((clocks + 1) * STATE);
  told.resize(clocks * OUTPUTS);
  fill(argv[1], inputs.data(), inputs.size() * sizeof(Word));
  fill(argv[2], states.data(), STATE * sizeof(Word));
  fill(argv[3], forbidden, sizeof(forbidden));
  Watch whole;
  long alarms = 0;
  for (long t = 0; t < clocks; t++) {
    step(t, &states[t * STATE], &states[(t + 1) * STATE], &told[t * OUTPUTS]);
    whole.look(t, told[t * OUTPUTS]);
    alarms += t < last && t >= first && faults_of(&told[t * OUTPUTS]);
  }
  printf("golden %ld\n", whole.longest + whole.close + whole.late + alarms);
  std::vector<Word> state(STATE), next(STATE), out(OUTPUTS);
  std::vector<uint64_t> own(atol(argv[13]) + 1);
  fill(argv[4], own.data(), own.size() * sizeof(uint64_t));
  for (long k = atol(argv[12]); k <= atol(argv[13]); k++) {
    for (int r = 0; r < times; r++) {
      seed = (base * 1000003 + own[k]) * 1009 + r + 1;
      draw();
      const long flip = first + draw() % (last - first);
      memcpy(state.data(), &states[flip * STATE], STATE * sizeof(Word));
      state[k / 32] ^= 1u << (k % 32);
      Watch watch;
      for (long t = std::max(0l, flip - dead); t < flip; t++) watch.before(told[t * OUTPUTS]);
      bool differs = false, fault = false, same = false;
      long t = flip;
      for (; t < clocks; t++) {
        step(t, state.data(), next.data(), out.data());
        state.swap(next);
        watch.look(t, out[0]);
        differs |= memcmp(out.data(), &told[t * OUTPUTS], OUTPUTS * sizeof(Word)) != 0;
        fault |= faults_of(out.data()) && !faults_of(&told[t * OUTPUTS]);
        same = memcmp(state.data(), &states[(t + 1) * STATE], STATE * sizeof(Word)) == 0;
        // gates of before count for a dead time
        if (same && out[0] == told[t * OUTPUTS] && t >= flip + dead) break;
      }
      const char* outcome = watch.longest > 1 ? "shorted"
                            : watch.late      ? "late"
                            : watch.close     ? "close"
                            : fault           ? "fault"
                            : differs         ? "wrong"
                                              : "nothing";
      printf("%ld %ld %s %ld %d\n", k, flip, outcome, watch.longest, (int)!same);
    }
  }
  delete m;
  return 0;
}
