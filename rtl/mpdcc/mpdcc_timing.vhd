-- Every stage and every latency of the cores that another unit counts on.
--
-- A number here is either a property of one unit, which that unit reads here too, or it is derived
-- from such properties and from the program tables of directmpc_constants. A test bench holds the
-- latencies that are visible at a port to scripts/measure/budgets.toml.
--
-- Fast explorer: a stage is the number of clocks since the position of a candidate is registered
-- (stage 0). valid(n) = '1' says that the registers of stage n hold a candidate.
-- Second level: clocks are counted from the pulse that begins a successor's program in common_terms.
-- Licence: Apache-2.0

library work;
  use work.directmpc_constants.all;
  use work.mpdcc_program.all;

package mpdcc_timing is

  -- fast explorer, stages
  constant SLOPE_STAGE : natural := 3;                            -- slopes of the current errors
  constant ERROR_STAGE : natural := SLOPE_STAGE + 1;              -- errors at k+1
  constant SEARCH      : natural := ERROR_STAGE + 1;              -- first stage of the search
  constant PROBE_STAGE : natural := SEARCH + 2;                   -- answer to a probe
  constant ALLOW_STAGE : natural := SEARCH + 3;                   -- what the capacitors allow; +1 with SECOND_LEVEL
  constant DEAD_STAGE  : natural := SEARCH + 4;                   -- excess of a dead candidate; likewise
  constant SHORTEST    : natural := SEARCH + LENGTH_WIDTH;        -- first stage of the shortest length
  constant LENGTH_STAGE : natural := SHORTEST + 1;                -- shortest length
  constant COST_STAGE  : natural := LENGTH_STAGE + 4;             -- cost

  -- mac_block: clocks from operands to the accumulator
  constant MAC_STAGES : natural := 3;

  -- stages of capacitor_search: two bits of the length in each after stage 2
  constant CAPACITOR_STAGES : natural := 2 + LENGTH_WIDTH / 2;

  -- lines of capacitor_search, at most: all of a root; those of a successor that have a slope
  constant ROOT_LINES      : natural := 17;
  constant SUCCESSOR_LINES : natural := 13;

  -- capacitor_search: clocks from start to the first in which a current term is read, and to that
  -- in which the last row of a successor is out
  constant CAPACITOR_READ     : natural := 2;
  constant LAST_SUCCESSOR_ROW : natural := 1 + SUCCESSOR_LINES + CAPACITOR_STAGES;

  -- leaf_dispatcher: clocks from load to the first leaf; clocks that ending announces ready by, at most
  constant LAUNCH_CLOCKS : natural := 2;
  constant ENDING_CLOCKS : natural := 8;

  -- clocks from the begin of a step of a successor's program until its result can be read: one to
  -- issue the step, the block, the register of the result
  constant STEP_CLOCKS : natural := 1 + MAC_STAGES + 1;

  -- clocks of a successor's program
  constant SUCCESSOR_CLOCKS : natural := PROGRAM_STEPS - SUCCESSOR_FIRST;

  -- clocks from the begin of a successor's program: capacitor_search starts so that the terms of the
  -- phases are complete when it reads them
  constant CAPACITORS_AT : natural := CAPACITOR_AHEAD + STEP_CLOCKS - CAPACITOR_READ;
  -- the queue may show the next entry: what is needed of this one is kept at CAPACITORS_AT
  constant TAKEN_AT : natural := CAPACITORS_AT + 1;
  -- errors are complete, the search for the thresholds starts
  constant TURN_AT : natural := steps_to(RESULT_ERROR_ALPHA) + STEP_CLOCKS;
  -- the first leaf may be loaded: it reads the table in stage SEARCH, a clock after the last row is out
  constant HAND_OUT_AT : natural := CAPACITORS_AT + LAST_SUCCESSOR_ROW + 1 - (LAUNCH_CLOCKS + 1 + SEARCH);
  -- the next program may begin one clock later
  constant NEXT_AT : natural := SUCCESSOR_CLOCKS - 1;

  -- clocks from launch to the last in which an explorer reads the old value of a field: the candidate
  -- of launch is in stage 0 a clock later
  constant SLOPE_READ  : natural := SLOPE_STAGE - 1;
  constant ERROR_READ  : natural := ERROR_STAGE - 1;
  constant WEIGHT_READ : natural := LENGTH_STAGE - 1;
  constant LEAD_READ   : natural := LENGTH_STAGE;
  constant START_READ  : natural := LENGTH_STAGE + 1;
  constant BEST_READ   : natural := COST_STAGE;

  -- step of the program with whose result the natural slope of the successor is stored: after its own
  -- bend_step is complete, before the next successor's is
  constant SLOPE_STEP : natural := SUCCESSOR_FIRST + 10;

end package mpdcc_timing;
