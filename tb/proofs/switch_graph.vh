// The switch graph of a five-level ANPC leg, told anew: one flying-capacitor commutation changes bit a or bit b of a
// position, the one of the ANPC stage leads from 2 to 4, from 3 to 5, and back.
// Licence: Apache-2.0

  function follows(input [2:0] s, input [2:0] t);
    follows = s == t || (s ^ t) == 1 || (s ^ t) == 2 || ((s ^ t) == 6 && s[2] != s[1]);
  endfunction

  // how many positions follow, and the one of a number, ascending
  function [2:0] count(input [2:0] s);
    integer t;
    begin
      count = 0;
      for (t = 0; t < 8; t = t + 1) count = count + follows(s, t);
    end
  endfunction

  function [2:0] next(input [2:0] s, input [1:0] n);
    integer t;
    reg [2:0] k;
    begin
      k = 0;
      next = 0;
      for (t = 0; t < 8; t = t + 1) begin
        if (follows(s, t)) begin
          if (k == n) next = t;
          k = k + 1;
        end
      end
    end
  endfunction

  function [3:0] effort(input [2:0] s, input [2:0] t);
    effort = s == t ? 0 : (s ^ t) == 6 ? 3 : 1;
  endfunction
