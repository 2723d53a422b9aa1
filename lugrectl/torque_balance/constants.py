"""The numbers that the torque balance chose between a record and its verdict, and what they mean.

Times are in s, "friction" is the RMS friction torque of the record. One idea is one number.
"""

import numpy as np

# shares: of one quantity in another, whatever they are
SLIGHT = 1e-3  # a step of a derivative; as good as none
SAME = 0.01  # a relative difference that is none
FAINT = 0.03  # decides nothing beside the best; noise that is small enough
LITTLE = 0.05  # may be lost or left
MUCH = 0.1  # counts: of a window at rest, of the power of all torque in one wave, of friction
NEAR = 0.1  # relative difference of what is near by
KNOWN = 0.25  # half of its interval is less of a value that is known
PART = 0.3  # counts beside the whole
MOSTLY = 0.5  # with more than this left nothing is found, and no value is given
ALIKE = 0.8  # two that bring so much of one another are alike
GROWN = 1.4  # an inertia that is so many times the declared one is another
BEYOND = 1.5  # so many times as much is more
SEVERAL = 3  # so many times as much is beyond doubt; so many are tried, named or needed together
EXACT = 1e-6  # relative difference by rounding

# chance
ALPHA = 0.01  # that a gain, a difference of two, or a ripple is called proven and is none
SCREEN, SURELY = 4.0, 20.0  # nats that make a contender worth a look; that shape the base
CLIP = 5.0  # standard deviations: a residual counts for no more
ONE_MORE = 2.0  # nats at independent rows that a law must gain for one parameter more
WHOLE = 1.3  # blocks tell nothing of errors that last the whole record: standard errors times this
SCALE = 0.003  # no clock, encoder or current sensor is better (share of a value, one sigma)
AGAIN = 6  # what comes so often is no accident, and tells its own error
FIRSTS = 6  # likeliest contenders that may be the first, waves over the angle of one ripple
PARTS, STRANGE = 20, 8  # of a long log, in which effects are searched; those that fit least

# blocks, rows, samples
BLOCK = 0.3  # length of the blocks over which two descriptions are compared
FEWEST_BLOCKS, MOST_BLOCKS = 12, 600
LONG_BLOCKS = 60  # of a whole log: longer ones, over which a table and held-out rows are judged
FEWEST_LEFT_OUT = 15  # of a fit, for an interval
FEW = 2 * FEWEST_BLOCKS  # independent stretches of motion: fewer leave a comparison uncertain
PART_TIME, SHORT = 2.0, 30.0  # alternate parts; a log up to twice as long is searched as a whole
LEAST_ROWS = 30  # rows in which something moves: fewer say nothing
ENOUGH = 50_000  # samples from which stiffness, width and effects are chosen; rows of a regression
STRETCH, SHORTEST, LEAST_NOISE = 25, 40, 100  # samples: of one noise, of a piece, to judge noise
ROOM = 2**23  # numbers of columns that are kept

# the motion
SOFT = 1e-2  # stiffness of the motion for friction over that of the motion for acceleration
NOISE_FIT = 1.15  # a motion is smooth enough when its residual is so much of the noise (variance)
FINE = 1e-3  # friction is evaluated at least this often: reversals do not wait for a sample
FREE_LATE = 5e-4  # how late a held torque may act for nothing: a current loop
LEAST_LATE, LATE_W = 2e-4, 3e-3  # a w that lags by more is corrected; is named
SLOW = 0.03  # as wide as theta and w are compared, a filter makes w late, declared J needs windows
FAR_W, VERY_LATE = 0.04, 0.3  # a w that is later is not used; the latest w or u
LATE_STEP = 0.01  # from one delay that is tried to the next
DRIFT = 50.0  # samples of noise of w that a position summed from it has

# the rows
WIDTHS = (0.010, 0.012, 0.0144, 0.0173, 0.0208, 0.025, 0.03, 0.036, 0.05, 0.07, 0.1, 0.14, 0.19,
          0.26)  # half-widths of the windows that are tried  # fmt: skip
OVERLAP, FEW_WINDOWS = 0.55, 80  # distance over half-width; fewer overlap more
AT_REST = 0.004  # of top speed: slower is rest
STANDS = 0.01  # of top speed: slower has no direction that counts
FINEST_ORDER, ORDERS = 400, 200  # per turn: the finest waves that are looked for, and named

# friction
FLOOR = 0.015  # of friction: the least torque that is worth a name; twice for an unknown one
BACKGROUND = 0.007  # of friction: what every drive has of an offset, unbalance, warming
ALONG = 0.4  # share of it that may follow the acceleration
TAIL = 0.15  # of top speed: the longest Stribeck tail; a longer one bends like a drag
GREASE = (0.6, 0.8)  # exponents of the speed that grease may have beside Fv
OTHER_SPEEDS = (0.35, 0.6, 1.0, 1.7, 3.0)  # Stribeck speeds that are tried, over the fitted one
EXPONENTS = (1.0, 2.0)  # of the Stribeck curve
NEAR_REST = (("turn", 3e-3, 0.7), ("turn", 3e-2, 0.5), ("dip", 3e-3, 0.3), ("dip", 8e-3, 0.2),
             ("dip", 0.02, 0.2), ("dip", 0.05, 0.1))  # fmt: skip
# what friction may do near rest: kind, share of top speed (dip) or of the way in half a window
# (turn), prior in shares of Fc
DIP, LARGE = 2.0, 30.0  # times all torque: no Stribeck dip, no other term is larger
DAMPING = 0.5  # of the critical one: bristles of which no damping is declared
UNKNOWN_SIZES = (0.04, 0.2)  # of friction: standard deviations that an unknown torque may have

# searching
STEP_SHARE = 0.005  # step of a positive quantity, of its value
STEP_TURN = 0.1  # rad by which a step of a frequency moves the end of the log
STEP_DURATION = 1e-2  # step of a time, of the log's
VIEWS = ((10.0, 1.5), (0.1, 2.0))  # other descriptions: stiffness of the motion, width of windows
MOST_TURNS, STAYS = 12, 0.2  # of a fit; holds by which a delay still moves
ORDER_WAYS = {"torque_ripple": 2}  # how many orders of an effect are entered; else one
GAPS = 90  # of a gap that are tried: one that is 5 % off loses three quarters of its gain
RINGING, FASTEST = (4.0, 60.0), 400.0  # Hz: resonances of a load that are looked for
CLOSER, FARTHEST = 0.35, 1.5  # steps of a polish: over the last ones; how far a top may lie
TURNS = 4  # of a polish, two more in one dimension; two in the first pass, or where it is known
GOLDEN = 0.6180339887  # of a period: parts at equal distances take one frequency for another
MOST_EVALUATIONS, FURTHEST_LOG = 60, 7.0  # evaluations; natural logarithm of a factor on a value
OFFSETS = np.geomspace(1e-3, 0.1, 21)  # of top speed, that are tried
CURVE = 0.02  # of top speed: the Stribeck speed beside them

# runs at steady speeds
LEAST_RUNS = 4
CELLS, FINEST = 8, 12  # parts of a run that must have its speed; stretches of each at most
PER_TURN, NODES = 16, 4  # stretches, as longer ones hide a wave; means of the angle in each
BINS = 8  # of speed in each direction, for the friction curve; Stribeck speeds that are tried
TRY_SPEEDS = (-100.0, -10.0, -1.0, 1.0, 10.0, 100.0)  # rad/s: where two laws are compared
