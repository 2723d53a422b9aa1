"""Every number of the torque balance: what it means, on what it was set, what moves at half of it.

Set on drawn drives (clean, messy, an encoder off its centre), on a second rig, on damaged and on
measured logs, unless it says otherwise. "Widths" are those of the intervals.
"""

from __future__ import annotations

# Shares of something, by what they are called in a sentence
NOTHING = 1e-4  # torque, misfit, friction: below the last digit of any log. Half: nothing moves
RARE = 0.01  # windows with torque in a dead channel; a step that is the last. Half: CPU
SMALL = 0.05  # half-width of a certain value in RMS torques; a gain; a column. Half: fewer values
LITTLE = 0.1  # friction, a part of a sum, spread of a steady speed. Half: fewer maps, longer sums
KNOWN_INERTIA = 0.5  # half-width of an inertia that is known, in that inertia
QUARTER = 0.25  # half-width of a certain value, in that value. Half: fewer values
MAJORITY = 0.5  # rest in a window, coherence, noise in a derivative of u. Half: short strokes lost
ALL_LEFT = 0.7  # of the torque, above which nothing is explained. Half: measured servos refused
MOST = 0.8  # rows of a map; of a term's information that noise may take. Half: J of noisy logs
TOP = 0.95  # share of the path below the top speed; a window without reversal; the intervals
WHOLLY = 0.98  # a window of rest; what a block may carry of a direction. Half: widths

# Windows
WIDTHS = (0.012, 0.02, 0.03, 0.045, 0.07, 0.11, 0.17, 0.26)  # half-widths to choose from, s
STEP = 1.0 / 3.0  # distance of two windows, in half-widths. Half: CPU
FEWEST_SAMPLES = 5.0  # in a half-width. Half: rough columns on logs below 100 Hz
LONGEST_SHARE = 1.0 / 6.0  # of the longest stretch that a half-width takes. Half: short runs
MANY = 15_000  # windows or values that are looked at. Half: CPU of logs above 1e5 rows
PER_TERM = 1.5  # windows for each term without which nothing is fitted. Half: a fit of nothing
ALIGNED = 8  # samples by which the edge grows with the delay, so that delays share windows
DENSE = 6  # windows closer than so many samples are found by a convolution. Half: CPU
SHORTEST = 12  # good samples that a stretch has more of

# Residual
SLIDING = 0.2  # rest in a window that counts for the scale. Half: an offset of w is not seen
STUDENT = 4.0  # degrees of freedom of its density: few bad windows do not decide. Half: noise of J
FLOOR_OF_NOISE = 0.3  # of the variance of the noise of u: no residual is below. Half: widths
PASSES = 16  # of a reweighted fit, at most; it ends where it has settled
ROBUST_PASSES = 4  # the first ones, whose scale is that of the median
ROUNDS = 3  # of a delay, a lag, a load. Half: delays above 10 ms stop short
WIDE = 30.0  # prior of a term, in RMS torques. Half: gravity of arms
GONE = 40.0  # exponents from which exp(-x) changes no sum with 1
HUGE = 1e4  # variance of a window mostly at rest, in mean squares of the torque

# Noise of the channels
SEGMENT = 256  # length of a segment of the spectrum, samples
DIFFERENCE = 4  # order of the difference that keeps slow motion out of it
TOP_OF_SPECTRUM = (0.3, 0.48)  # frequencies where only noise is left, times the rate
NO_NOISE = 1e-12  # a standard deviation is never below this
FOR_NOISE = 10.0  # windows for each term from which a residual bounds the noise of u

# Speed
SMOOTHINGS = (3, 5, 8, 12, 18, 27, 40)  # half-widths of its windows, samples
SLOW = 0.003  # of the top speed: rest. Half: noise is motion
CLEAN = 0.002  # noise of a speed that is clean, in top speeds. Half: reversals are smeared
SURE = 4.0  # standard deviations of an effect that is no chance; of rest. Half: notes by chance
NOTICED_GAIN = 0.02  # of w, from 1, that is said
NOTICED_LAG = 3e-4  # of w that is said, s
LAG = 0.05  # of w: its weak prior, s
LAGS = (0.0, 0.05, 0.1, 0.2, 0.4)  # s, from the likeliest of which the lag of w is searched
GAIN, OFFSET = 3.0, 0.02  # priors of gain, and of offset in speeds. Half: maps with offset
MOST_OFFSET = 0.25  # of a w without a position, in top speeds
OFFSETS = 41  # that are tried

# Delay of u
SPREAD = 1.0 / 12.0  # of u beyond the hold, samples squared: a mean over one is 1/24. Half: J 0.1 %
DELAY_SAMPLES, DELAY_SECONDS = 3.0, 5e-3  # its prior, the shorter one. Half: late logs lose J
DECLARED_DELAY = 0.05  # prior of one that the model declares, s
LARGEST_DELAY = 0.2  # s
LATE = 0.02  # s, above which it is compared with none: slow turning looks like it
NO_DELAY = 1e-3  # prior of one that is to be none, samples
FEWEST_CHANGES = 4  # independent changes of u without which inertia looks like a delay

# Friction near rest: what no other term shows, as priors in Fc. Half of these: widths of Fc, Fv
TURNS = (((0.0, 3e-3), 0.7), ((3e-3, 3e-2), 0.5))  # distances, in speed times half-width
DIPS = ((0.003, 0.3), (0.008, 0.2), (0.02, 0.2), (0.05, 0.1))  # speeds, in top speeds
REST_TORQUE = 1.0  # at rest, with the direction of the motion before or after
COSTLY = 1.2  # another width is tried where they raise the expected error so much
CLEARLY = 15.0  # nats by which a dip, a delay, an offset is taken. Half: dips by chance
DIP_SPEEDS = 8  # that are tried for a fall of friction with speed. Half: Fv of Stribeck friction
TURN_DISTANCES = (3e-3, 3.0, 7)  # from, to, how many, as in TURNS. Half: swapped columns
SLOWEST_DIP = 1e-6  # the lowest, in top speeds
RISE = 0.02  # in top speeds, below which friction may be lower at rest

# Errors
BLOCKS = (4, 8, 16)  # lengths of blocks, in memories of the residual. Half: intervals too narrow
PARTS = 15  # of a record, or of a range of speed, torque, position, whose misfit may be one
GROUPS = 20  # blocks of the lag of w. Half: a lag by chance
LONGEST_MEMORY = 400  # windows
FEW = 8  # windows in a bin or a block, runs that are blocks
NEIGHBOUR = 4.0  # times the expected error, or the limit of rest, of another fit that counts
LOADED = 5e-3  # usual rise of friction with the load, per N m
SLOW_TURN = 0.01  # usual part that turns over slowly after a reversal, in Fc,
SLOW_TURNS = (0.03, 0.3)  # and its distances, in travels
ECCENTRIC = 5e-4  # rad by which an encoder is off its centre
SCALE_ERROR = 2.5e-4  # no clock and no scale is better
ENCODER_ERROR = 0.3  # quanta of nonlinearity per radian of travel

# Sums, gravity, curve
MOST_PARTS = 3  # of a sum: more say nothing to anybody
TURNED, TURNED_IN_MAP = 2.0, 0.3  # rad of travel in a stretch, or over runs, that show gravity
STEEP = 6.5  # tangent of 95 % of a right angle, by 1.96: gravity beside its slope, any phase alike
BINS = 12  # of speed in each direction

# Runs at one speed
STEADY_WINDOW = 0.2  # half-width in which a speed is steady, s
PARTS_TURNING, PARTS_OF_RUN = 12.0, 5.0  # windows in a run whose angle changes, or does not
TURN = 0.7  # rad that a half-width turns where the angle changes
# usual fall with speed in Fc; at top speed, in RMS torque: drag, and what is steeper one way
DIP_OF_MAP, BEND_OF_MAP, TILT_OF_MAP = 0.3, 1.0, 0.1

# Runs compared
MOST_RUNS = 20  # that are compared one by one
ALIKE = 0.03  # share by which runs of one drive differ beyond chance
