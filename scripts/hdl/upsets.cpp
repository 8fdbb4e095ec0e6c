// Flips single flip-flops of a mapped netlist and tells what comes of it.
//
// The netlist is a list of AND gates, a function (inputs, state) -> (outputs, next state); upsets.py makes it so. Each
// bit of a machine word is a run of its own: run 0 has no flip, each of the others has one. All have the same inputs.
//
//   upsets begin ...   runs without a flip up to the first clock of one, and writes the state of it into the file base
//   upsets flip ...    goes on from there
//
// Files, words of 32 bits: netlist: inputs, flip-flops, outputs, gates, and two operands of each gate, then what the
// flip-flops get and the outputs. Operand: twice a number, 1 more for its inverse; number 0 is '0', then come inputs,
// flip-flops and gates. changes: clock, input, value, in the order of time. forbidden: a byte for each pattern of a leg,
// 1 if it may never be. ways: a byte for each pattern and the one behind it, the first one times the number of patterns,
// 1 if a leg may go so. seeds: 64 bits for each flip-flop, its own seed. base: a word for each flip-flop.
// Outputs begin with the gates, 24 bits, and the faults, 16 bits.
// Arguments: clocks, first and last clock of a flip, clock from which on all gates have to be off, dead time in clocks,
// gates of a leg, flips of each flip-flop, seed, first and last flip-flop. Prints, for every 255
// flips, "golden N M" with the N problems of the run without a flip and the M changes of its gates, and a line for each
// flip: flip-flop, clock, outcome, longest forbidden pattern in clocks.
#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <vector>

using Word = uint32_t;
constexpr int PARTS = 4, RUNS = 64 * PARTS;
typedef uint64_t Runs __attribute__((vector_size(8 * PARTS)));

template <typename T>
static std::vector<T> content(const char* name) {
  FILE* file = fopen(name, "rb");
  if (!file) {
    fprintf(stderr, "upsets: no file %s\n", name);
    exit(2);
  }
  std::vector<T> found;
  T one;
  while (fread(&one, sizeof(one), 1, file) == 1) found.push_back(one);
  fclose(file);
  return found;
}

static Runs all(bool value) {
  Runs out;
  for (int part = 0; part < PARTS; part++) out[part] = value ? ~0ull : 0;
  return out;
}
static bool of(const Runs& word, int run) { return word[run / 64] >> (run % 64) & 1; }

struct Netlist {
  Word inputs, bits, outputs, gates;
  std::vector<Word> words, changes;
  const Word *operands, *next, *told;
  std::vector<Runs> value, after;
  size_t change = 0;
  Netlist() : words(content<Word>("netlist")), changes(content<Word>("changes")) {
    inputs = words[0], bits = words[1], outputs = words[2], gates = words[3];
    operands = words.data() + 4;
    next = operands + 2 * gates;
    told = next + bits;
    value.assign(1 + inputs + bits + gates, all(false));
    after.resize(bits);
  }
  Runs* state() { return &value[1 + inputs]; }
  Runs at(Word operand) const { return value[operand >> 1] ^ all(operand & 1); }
  void rewind() {
    std::fill(value.begin() + 1, value.begin() + 1 + inputs, all(false));
    change = 0;
  }
  // outputs of this clock; the state is that of the next one then, in `after`
  void evaluate(long t) {
    for (; change < changes.size() && (long)changes[change] <= t; change += 3)
      value[1 + changes[change + 1]] = all(changes[change + 2]);
    Runs* out = &value[1 + inputs + bits];
    const Runs inverse[2] = {all(false), all(true)};
    for (const Word *one = operands, *end = next; one != end; one += 2, out++)
      *out = (value[one[0] >> 1] ^ inverse[one[0] & 1]) & (value[one[1] >> 1] ^ inverse[one[1] & 1]);
    for (Word k = 0; k < bits; k++) after[k] = at(next[k]);
  }
  void step() { memcpy((void*)state(), (const void*)after.data(), bits * sizeof(Runs)); }
};

static uint64_t seed;
static Word draw() {  // xorshift64*
  seed ^= seed >> 12;
  seed ^= seed << 25;
  seed ^= seed >> 27;
  return (Word)((seed * 2685821657736338717ull) >> 32);
}

static std::vector<uint8_t> forbidden, ways;  // by the gates of a leg
static int leg;
static bool strays(Word before, Word after) {
  for (int x = 0; x < 3 && before != after; x++) {
    const Word mask = (1u << leg) - 1, was = before >> (leg * x) & mask, is = after >> (leg * x) & mask;
    if (was != is && !ways[was << leg | is]) return true;
  }
  return false;
}
static bool shorted(Word gates) {
  for (int x = 0; x < 3; x++)
    if (forbidden[gates >> (leg * x) & ((1u << leg) - 1)]) return true;
  return false;
}

// Rules for the gates, fed clock by clock.
struct Watch {
  std::vector<Word> recent;  // gates of the last clocks, a ring
  size_t place = 0;
  long row = 0, longest = 0, close = 0, late = 0, stray = 0, changes = 0;
  Word last = ~0u;  // none yet
  explicit Watch(long dead) : recent(std::max(dead - 1, 1l)) {}
  void look(Word gates, bool after_deadline) {
    row = shorted(gates) ? row + 1 : 0;
    longest = std::max(longest, row);
    Word together = gates;
    for (Word one : recent)
      if (!shorted(one)) together |= one;  // a pattern that is shorted counts by itself
    close += !row && shorted(together);
    late += after_deadline && gates;
    if (last != ~0u) changes += gates != last, stray += strays(last, gates);
    last = recent[place] = gates;
    place = (place + 1) % recent.size();
  }
};

struct Flip {
  long flip_flop, clock;
  bool differs = false, fault = false;
};

int main(int argc, char** argv) {
  if (argc != 12) return 2;
  const bool begins = !strcmp(argv[1], "begin");
  long number[10];
  for (int k = 0; k < 10; k++) number[k] = atol(argv[2 + k]);
  const long clocks = number[0], first = number[1], last = number[2], deadline = number[3], dead = number[4];
  const long times = number[6], base = number[7], lowest = number[8], highest = number[9];
  leg = number[5];
  forbidden = content<uint8_t>("forbidden");
  ways = content<uint8_t>("ways");
  const std::vector<uint64_t> own = content<uint64_t>("seeds");
  Netlist netlist;
  std::vector<Word> state = content<Word>("base");
  for (Word k = 0; k < netlist.bits; k++) netlist.state()[k] = all(state[k]);
  if (begins) {
    for (long t = 0; t < first; t++) netlist.evaluate(t), netlist.step();
    FILE* file = fopen("base", "wb");
    for (Word k = 0; k < netlist.bits; k++) {
      const Word bit = of(netlist.state()[k], 0);
      fwrite(&bit, sizeof(bit), 1, file);
    }
    fclose(file);
    return 0;
  }
  std::vector<Flip> flips;
  for (long k = lowest; k <= highest; k++)
    for (int r = 0; r < times; r++) {
      seed = ((uint64_t)base * 1000003 + own[k]) * 1009 + r + 1;
      draw();
      flips.push_back({k, first + (long)(draw() % (last - first))});
    }
  const std::vector<Runs> before(netlist.state(), netlist.state() + netlist.bits);
  for (size_t from = 0; from < flips.size(); from += RUNS - 1) {
    const int runs = 1 + (int)std::min<size_t>(RUNS - 1, flips.size() - from);
    std::vector<Watch> watch(runs, Watch(dead));
    std::copy(before.begin(), before.end(), netlist.state());
    netlist.rewind();
    long alarms = 0;
    for (long t = first; t < clocks; t++) {
      for (int run = 1; run < runs; run++)
        if (flips[from + run - 1].clock == t)
          netlist.state()[flips[from + run - 1].flip_flop][run / 64] ^= 1ull << (run % 64);
      netlist.evaluate(t);
      Runs differs = all(false), fault = all(false);
      Runs pins[24];
      for (Word k = 0; k < netlist.outputs; k++) {
        const Runs bit = netlist.at(netlist.told[k]);
        differs |= bit ^ all(of(bit, 0));
        if (k < 24) pins[k] = bit;
        else if (k < 40) fault |= bit;
      }
      const bool tripped = of(fault, 0);
      alarms += t < last && tripped;
      for (int run = 0; run < runs; run++) {
        Word gates = 0;
        for (int k = 0; k < 3 * leg; k++) gates |= (Word)of(pins[k], run) << k;
        watch[run].look(gates, t >= deadline);
        if (run) {
          flips[from + run - 1].differs |= of(differs, run);
          flips[from + run - 1].fault |= of(fault, run) && !tripped;
        }
      }
      netlist.step();
    }
    const Watch& none = watch[0];
    printf("golden %ld %ld\n", none.longest + none.close + none.late + none.stray + alarms, none.changes);
    for (int run = 1; run < runs; run++) {
      const Flip& one = flips[from + run - 1];
      const Watch& seen = watch[run];
      const char* outcome = seen.longest > 1 ? "shorted"
                            : seen.late      ? "late"
                            : seen.close     ? "close"
                            : seen.stray     ? "stray"
                            : one.fault      ? "fault"
                            : one.differs    ? "wrong"
                                             : "nothing";
      printf("%ld %ld %s %ld\n", one.flip_flop, one.clock, outcome, seen.longest);
    }
  }
  return 0;
}
