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

end package body mpdcc_program;
