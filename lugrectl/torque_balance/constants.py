"""Every number that was chosen between a record and its verdict, and what it means.

Times are in s, "friction" is the RMS friction torque of the record.
"""

# blocks
BLOCK = 0.3  # length of the blocks over which two descriptions are compared
FEWEST_BLOCKS, MOST_BLOCKS = 12, 600

# the motion
SOFT = 1e-2  # stiffness of the motion for friction over that of the motion for acceleration
NOISE_FIT = (
    1.15  # a motion is smooth enough when its residual is so many times the noise (variance)
)
FINE = 1e-3  # friction is evaluated at least this often: reversals do not wait for a sample
FREE_LATE = 5e-4  # how late a held torque may act for nothing: a current loop
LATE_W = 3e-3  # a w that lags by more is named
VERY_LATE = 0.3  # a w or u may be late by this much (a filter, a slow bus)
LATE_STEP = 0.01  # from one delay of u that is tried to the next, up to VERY_LATE
FAR_W = 0.04  # a w that is later than this is not used
ENOUGH = 60_000  # samples from which stiffness, width and effects are chosen
PARTS, STRANGE = 20, 8  # of a longer log, in which effects are searched; those that fit least

# the rows
WIDTHS = (0.010, 0.012, 0.0144, 0.0173, 0.0208, 0.025, 0.03, 0.036, 0.05, 0.07, 0.1, 0.14, 0.19,
          0.26)  # half-widths of the windows that are tried  # fmt: skip
WIDE = 0.035  # a declared inertia needs no wider window unless the noise asks for it
NOISY = 0.03  # noise of J a in one row, in friction, that is small enough
LOST = 0.05  # share of J that noise in the acceleration may take away
FINE_WAVE = 0.1  # of the power of the fast torque: a wave over the angle that needs narrow windows
LEAST_ROWS = 30  # rows in which something moves: fewer say nothing
MOST_ROWS = 40_000  # windows overlap less, and widen, where there would be more
SPARSEST = 3  # times the usual distance of windows: every sample is in one
STILL = 0.1  # share of a window at rest from which on it is left out
AT_REST = 0.004  # of top speed: slower is rest

# friction
TAIL = 0.15  # of top speed: the longest Stribeck tail; a longer one bends like a drag
BACKGROUND = 0.007  # of friction: what every drive has of an offset, unbalance, warming
ALONG = 0.4  # share of it that may follow the acceleration
BETWEEN = 0.1  # of all torque: by how much the offset of a run may differ from the first one's
GREASE = (0.6, 0.8)  # exponents of the speed that grease may have beside Fv
ONE_MORE = 2.0  # nats at independent rows that a law must gain for one parameter more
NEAR_REST = (("turn", 3e-3, 0.7), ("turn", 3e-2, 0.5), ("dip", 3e-3, 0.3), ("dip", 8e-3, 0.2),
             ("dip", 0.02, 0.2), ("dip", 0.05, 0.1))  # fmt: skip
# what friction may do near rest: kind, share of top speed (dip) or of the way in half a window
# (turn), prior in shares of Fc

# the decision
ALPHA = 0.01  # chance that a gain, or a difference of two, is called proven and is none
FLOOR = 0.015  # of friction: the least torque that is worth a name; twice for an unknown one
LATE_FLOOR = 0.33  # times the floor, for a delay of 1 ms or more beyond the free one
SCREEN = 4.0  # nats that a contender must promise before it is entered and scored
WAVES_AT_ONCE = 6  # waves over the angle that one ripple may have
PERIODS = 6  # that a disturbance must have in the record
MAIN_WAVE = 0.1  # of the power of all torque: a wave above it may have others beside it
FEW = 24  # independent stretches of motion: with fewer a comparison is uncertain
ALIKE = 0.8  # share of the best gain above which the last fit decides between two names
RIVAL = 0.3  # share of the best gain above which an equal one is an alternative
REST = 0.3  # share of the named effect that an unknown torque must take to leave it unexplained
FAR = 1.5  # an unknown torque with so many times the gain of the best name: no name comes near
SECOND = 1.5  # times the floor: the least torque of a further effect
NEAR = 0.8  # share of an unknown torque's gain that a further name must bring to take its place
TOGETHER = 3  # first names that are tried in pairs where one alone does not explain
MOST = 3  # effects that are named together
HEAVY = 0.3  # of friction: gravity above it joins the base before anything else is judged
CLEAR = 3.0  # times what stays: effects that explain this much are found, whatever else there is
MOSTLY = 0.5  # of all torque: with more than this left on unseen rows nothing is found; of the
# speed of theta: with more than this left w is no speed of it
ONE_SPEED = 0.3  # of the typical speed: speeds that spread by less are one
LESS = 0.8  # of what stays: what a base with gravity must leave to be the base
UNSEEN = 0.1  # of friction: where every effect would have to be larger to show, nothing is judged
GROWN = 1.35  # inertia over the declared one that is itself a trace of a load

# the interval
VIEWS = ((10.0, 1.5), (0.1, 2.0))  # other descriptions: stiffness of the motion, width of windows
WHOLE = 1.3  # blocks tell nothing of errors that last the whole record: standard errors times this
SCALE = 0.003  # no clock, encoder or current sensor is better (share of a value, one sigma)
