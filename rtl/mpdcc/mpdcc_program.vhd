-- What the tables of common_terms' program in directmpc_constants say about time.
--
-- A package of its own: a constant of a package may call a function only after the function's body
-- is elaborated, so mpdcc_timing cannot hold both.
-- Licence: Apache-2.0

library work;
  use work.directmpc_constants.all;

package mpdcc_program is

  -- clocks from the first step of a successor's program to the last that computes result
  function steps_to (result : natural) return natural;

  -- step of the fast variant's program that completes the curvature
  function curvature_step return natural;

  -- whether that is so early that one unit finds the thresholds of the three phases, one after the other, in time
  function curves_early return boolean;

end package mpdcc_program;

package body mpdcc_program is

  function steps_to (result : natural) return natural is

    variable last : natural;

  begin

    last := SUCCESSOR_FIRST;

    for b in 0 to BLOCK_COUNT - 1 loop
      for i in SUCCESSOR_FIRST to PROGRAM_STEPS - 1 loop
        if (PROGRAM_RESULT(0, b, i) = result) then
          last := i;
        end if;
      end loop;
    end loop;

    return last - SUCCESSOR_FIRST;

  end function steps_to;

  function curvature_step return natural is

    variable last : natural;

  begin

    last := 0;

    for b in 0 to BLOCK_COUNT - 1 loop
      for i in 0 to PROGRAM_LENGTHS(0) - 1 loop
        if (PROGRAM_RESULT(0, b, i) = RESULT_CURVATURE_ALPHA or PROGRAM_RESULT(0, b, i) = RESULT_CURVATURE_BETA) then
          last := i;
        end if;
      end loop;
    end loop;

    return last;

  end function curvature_step;

  function curves_early return boolean is
  begin

    return curvature_step + LENGTH_WIDTH <= PROGRAM_LENGTHS(0) - 1;

  end function curves_early;

end package body mpdcc_program;
