"""The numbers that the torque balance chose between a record and its verdict, and what they mean.

Times are in s, "friction" is the RMS friction torque of the record.
"""

import numpy as np

# blocks
BLOCK = 0.3  # length of the blocks over which two descriptions are compared
FEWEST_BLOCKS, MOST_BLOCKS = 12, 600

# the motion
SOFT = 1e-2  # stiffness of the motion for friction over that of the motion for acceleration
NOISE_FIT = 1.15  # a motion is smooth enough when its residual is so much of the noise (variance)
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

# more

STRETCH = 25  # samples over which noise is one number
SHORTEST = 40  # samples: a shorter piece is left out
SAME_RATE = 0.01  # relative difference of two sample times that are one
KERNEL = 0.03  # half-width (s) of the kernel on which theta and w are compared
FILTER = 0.03  # s: a filter makes a w no later than this
WHOLE_SAMPLE = 1e-9  # of a sample
LEAST_LATE = 2e-4  # s: a w that is later is corrected
LEAST_NOISE = 100  # samples
ALIKE_NOISE = 0.5  # correlation of noise from which w is a difference of theta
DRIFT = 50.0  # samples of noise of w that a position summed from it has
FAR_RESIDUAL = 25.0  # a residual counts for no more than five sigma
ROOM_DRIVEN = 2**22  # numbers that are kept at a time
TRIED = 0.3  # strength at which an effect is tried for being linear
SAME_TORQUE = 1e-6  # of its torque
STEP_SHARE = 0.005  # step of a positive quantity, of its value
STEP_TURN = 0.1  # rad by which a step of a frequency moves the end of the log
STEP_TRAVEL, STEP_DURATION = 1e-3, 1e-2  # steps of a position and of a time, of the log's
NEW = 1e-3  # of a column: what must be left of it beside the base
FAR_BEHIND = 0.03  # of the best gain: what promises less decides nothing beside it
UNKNOWN_SIZES = (0.04, 0.2)  # of friction: standard deviations that an unknown torque may have
UNKNOWN_QUICK = 0.1  # the same in the first pass
FURTHEST = 10.0  # steps by which a value that is not linear moves at most at a time ...
FAR_SHARE = 0.3  # ... and of itself
DIP = 2.0  # times all torque: no Stribeck dip is larger
NOTHING = 1e-100  # a column without torque
MOST_TURNS, STAYS = 12, 0.2  # of a fit; holds by which a delay still moves
RIGID = 1e-3  # of the bristles: as good as none
KAPPA = 3.0  # rows at least that tell as much as one that knows nothing of its neighbours
SURE = 1e-6  # of a held value: its standard deviation
FEWEST_LEFT_OUT = 15  # blocks
OTHER_SPEEDS = (0.35, 0.6, 1.0, 1.7, 3.0)  # Stribeck speeds that are tried, over the fitted one
EXPONENTS = (1.0, 2.0)  # of the Stribeck curve
STEP_SD = 0.3  # standard deviations of a coefficient, for the slopes of what is reported
PART_OF_SAMPLE = 0.1  # standard deviation of a delay, in samples
CERTAIN = 0.5  # half-width over value up to which an inertia is given
PART_TIME = 2.0  # s: length of alternate parts
ALTERNATE = 40  # of a log at least: both kinds see every place and speed
LONGER_REACH = 6.0  # windows reach: a part is so many times as long
LASTS = 3.0  # windows reach: two would be one bad sample
AGAIN = 6  # stretches that are far off: bad samples are fewer
OUTLIER = 10.0  # robust standard deviations beyond which a row counts no more
ALIKE_FACTORS = 0.05  # relative spread within which factors on these count as one
SURE_BEND = 4.0  # standard errors that a bend must have: it is any curve
ODD_TORQUE = 0.05  # of friction: beside a larger unknown torque a late speed is a note
HELD = 0.7  # of the floor: what the last fit must leave of a name's torque
OFFSETS = np.geomspace(1e-3, 0.1, 21)  # of top speed, that are tried
NEAR_BY = 0.1  # of an offset: where its likelihood is compared
KEPT = 0.5  # of the inertia: what a u that is moved must leave of it
CURVE = 0.02  # of top speed: the Stribeck speed beside them
SHORT = 30.0  # s: a log up to twice as long is searched as a whole
GOLDEN = 0.6180339887  # of a period: parts at equal distances take one frequency for another
OVERLAP = 0.55  # of the half-width: distance of neighbouring windows
FEW_WINDOWS = 80  # windows: fewer overlap more
SEVERAL = 3.0  # times as wide: windows that show what narrow ones lose
FINEST_ORDER = 400  # per turn: the finest wave over the angle that is looked for
LEAST_FRICTION = 0.05  # of all torque: shares are of friction, but of no less
LARGE = 30.0  # times all torque: no term is larger, whatever the log tells of it
ROOM = 2**24  # numbers of columns that a view keeps
ASYMMETRY = 1e-3  # step of the derivative of a bristle by an asymmetry of its limit
ORDERS = 200  # per turn: the highest order of the angle
ORDER_WAYS = {"torque_ripple": 2}  # how many orders of an effect are entered; else one
MINORITY = 0.3  # of the rows: a stop is touched by fewer
GAPS = 90  # of a gap that are tried: one that is 5 % off loses three quarters of its gain
RINGING, FASTEST = (4.0, 60.0), 400.0  # Hz: resonances of a load that are looked for
CLOSER, FARTHEST = 0.35, 1.5  # steps of a polish: over the last ones; how far a top may lie
TURNS = 4  # of a polish, two more in one dimension; two in the first pass, or where it is known
FIRSTS = 6  # likeliest contenders that may be the first
SURELY = 20.0  # nats: a contender with more may shape the friction of the base
BINS = 8  # of speed in each direction, for the friction curve
PLAIN_VALUES = 4  # values of a plain law: Fc, Fs, vs, Fv
LEAST_RUNS = 4
LEAST_SPEEDS = 3
ONE_RUN = 0.1  # relative difference of two speeds that are one
CELLS = 8  # parts of a run that must have its speed
STEADY_SPEED = 0.3  # of the speed of a run: what its parts may differ by ...
STEADY_SHARE = 0.7  # ... and the share of them that must: a run may start and stop
FEWEST_SAMPLES = 2 * CELLS  # samples of a run
PER_TURN = 16  # stretches, up to FINEST of a run: longer ones hide a wave over the angle
FINEST = 12 * CELLS
NODES = 4  # of a stretch: means of the angle, over which effects are averaged
EVERY = 3  # one of three speeds is held out
Z_ALIKE = 2.6  # standard errors by which residuals of neighbours in speed are alike
FALLS = 8  # Stribeck speeds that are tried
DAMPING = 0.5  # of the critical one: bristles of which no damping is declared
SEEN_STATIC = 1.05  # times Fc: an Fs that rows show
LEAST_LEVEL = 1e-3  # of the level of friction: a stiffness must have one
TRY_SPEEDS = (-100.0, -10.0, -1.0, 1.0, 10.0, 100.0)  # rad/s
SAME_LAW = 0.01  # relative difference of two torques
MOST_EVALUATIONS, FURTHEST_LOG = 60, 7.0  # evaluations; natural logarithm of a factor on a value
ENOUGH_ROWS = 1500  # rows
DIPPED = 1.3  # of Fc: where Fs starts
