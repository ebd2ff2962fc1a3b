"""Rounding tolerances that several modules share.

None of them is tuned. Each is a plain choice far above the rounding errors of doubles in a mission's units (about
1e-13) and far below any length, speed or time that matters.
"""

AT_REST = 1e-9
"""An agent at or below this speed stands still [m/s]; also the least speed that anything is divided by."""
NO_DIRECTION = 1e-9
"""A vector shorter than this has no direction [m, or the unit of the vector]."""
STEP_ROUNDING = 1e-9
"""A number of periods that exceeds a whole number by less than this is that whole number [periods]."""
DIVISOR_MIN = 1e-12
"""Lower bound of non-negative divisors that may vanish where the quotient is then multiplied by zero or discarded."""
