"""Every constant of the torque balance, with its meaning."""

from __future__ import annotations

# Windows
WIDTHS = (0.012, 0.02, 0.03, 0.045, 0.07, 0.11, 0.17, 0.26)  # half-widths to choose from, s
STEP = 1.0 / 3.0  # distance of two windows, in half-widths
FEWEST_SAMPLES = 5.0  # samples in a half-width, at least
LONGEST_SHARE = 1.0 / 6.0  # of the longest stretch that a half-width may take
MOST_WINDOWS = 15_000  # a longer log is read at wider steps
WINDOWS_PER_TERM = 1.5  # fewer windows than this for each term cannot be fitted

# Residual
STUDENT = 4.0  # degrees of freedom of its density: a few bad windows do not decide
FLOOR_OF_FRICTION = 1e-4  # no balance is closer than this share of the friction level
FLOOR_OF_NOISE = 0.3  # nor than this share of the variance of the noise of u
MOSTLY_AT_REST = 0.5  # a window with more rest than this gives no mean
SLIDING = 0.2  # windows with less rest than this set the scale of the residual
PASSES = 16  # of the reweighted fit, at most
PASSES_NEARBY = 8  # from the weights of a fit nearby
ROBUST_PASSES = 4  # the first ones, whose scale is that of the median
SETTLED = 0.01  # a step of this many standard deviations, or less, is the last

# A dead torque channel
DEAD = 1e-4  # torque below this share of the largest is none
DEAD_SHARE = 0.01  # fewer windows with torque than this share: nothing to balance

COASTING = 0.5  # share of J a that friction leaves, at most, when a drive coasts

# Noise
LATTICE = 0.8  # a channel with more different values than this share is not quantised
TOP_OF_SPECTRUM = (0.3, 0.48)  # frequencies where only noise is left, times the rate
NO_NOISE = 1e-12  # a standard deviation is never taken below this
WINDOWS_FOR_NOISE = 10.0  # windows for each term from which a residual bounds the noise of u
MOST_OF_A_TERM = 0.8  # noise takes at most this share off the information of a term
MOST_OF_A_DERIVATIVE = 0.5  # the same for the derivatives of u
ONE_SOURCE = 0.5  # noise of two signals that is more coherent than this has one source

# w beside dtheta/dt
COMPARED = 0.03  # half-width of the windows in which they are compared, s
NOTICED_GAIN = 0.02  # a gain of w further than this from 1 is said
NOTICED_LAG = 3e-4  # a lag of w above this is said, s
LARGEST_LAG = 0.05  # a larger lag of w is not believed, s
UNRELATED = 0.05  # below this gain w has nothing to do with dtheta/dt
PRIOR_GAIN = 3.0  # widths of the priors on gain (1), lag (s), offset (share of the speed)
PRIOR_LAG = 0.05
PRIOR_OFFSET = 0.02

# Speed
SMOOTHINGS = (3, 5, 8, 12, 18, 27, 40)  # half-widths of the windows for the speed, samples
CLEAN_SPEED = 0.002  # noise of the speed that is small enough, as a share of its top
REST_IN_NOISE = 4.0  # a drive rests below so many standard deviations of the speed's noise
REST_IN_SPEED = 0.003  # or below this share of the top speed
TOP_SPEED = 0.95  # quantile of |w| that is called the top speed

# Priors
WIDE = 30.0  # standard deviation of a term, in units of the RMS torque
SPREAD = 1.0 / 12.0  # of the spread of u beyond the hold, samples squared: a mean over one is 1/24
DELAY_SAMPLES = 3.0  # standard deviation of the delay of u: so many samples,
DELAY_SECONDS = 5e-3  # but no more than this (or one sample), s
LARGEST_DELAY = 0.2  # s
DECLARED_DELAY = 0.05  # standard deviation of a delay that the model declares, s
SCALE_OF_SHAPES = 0.1  # friction counts at least this share of the torque for the priors below
# What friction may do near rest, standard deviations in shares of Fc
TURNS = (((0.0, 3e-3), 0.7), ((3e-3, 3e-2), 0.5))  # distances in speed times half-width
DIPS = ((0.003, 0.3), (0.008, 0.2), (0.02, 0.2), (0.05, 0.1))  # speeds in top speeds
REST_TORQUE = 1.0  # torque at rest, with the direction of the motion before or after

# What friction may do beside the terms, usual sizes
LOADED = 5e-3  # rise with the load, per N m
SLOW_TURN = 0.01  # part that turns over slowly after a reversal, in Fc,
SLOW_TURNS = (0.03, 0.3)  # and its distances, in travels
PASSES_OF_SIZE = 12  # passes of the size that a machine has of these

# An encoder off its centre
ECCENTRIC = 5e-4  # rad, once in a turn

COST_OF_SHAPES = 1.2  # another width is tried if they raise the expected error by this factor

# Choice of a friction shape
CLEARLY = 15.0  # nats by which a shape must be more likely to be taken
TURN_DISTANCES = (3e-3, 3.0, 7)  # tried: from, to (in speed times half-width), how many
DIP_SPEEDS = 8  # speeds tried for a dip
FEWEST_TURNS = 4  # reversals without which a turning distance cannot be seen
SIGNIFICANT = 4.0  # standard deviations that a dip must have
RISE = 0.02  # a negative dip must end below this share of the top speed

# Errors
BLOCK_MEMORIES = (4, 8, 16)  # lengths of the blocks, in memories of the residual
FORGOTTEN = 0.1  # correlation at which the memory of the residual ends
LONGEST_MEMORY = 400  # windows
FEWEST_BLOCKS = 15  # blocks that a record is cut into, about
LEAST_BLOCK = 6  # windows
COHERENT_BLOCKS = 16  # parts of the range of speed, torque or position whose misfit may be one
MOST_LEVERAGE = 0.98  # a block that carries more of a direction than this counts as this
FEWEST_RUNS = 8  # so many runs are blocks of their own as well
RATIO_OF_NEIGHBOURS = 4.0  # another width counts if its expected error is at most so many times
REST_TO_TRY = 4.0  # the other limit of rest that is tried, as a factor
SCALE_ERROR = 2.5e-4  # no clock and no scale is better than this
ENCODER_ERROR = 0.3  # quanta of nonlinearity per radian of travel
CONFIDENCE = 0.95

# What is certain
SHARE_OF_TORQUE = 0.05  # half-width below this share of the RMS torque
SHARE_OF_VALUE = 0.25  # or below this share of the value
SMALL_PART = 0.1  # parts of a combination below this share are left out
MOST_PARTS = 3  # a sum of more says nothing to anybody
ALL_LEFT = 0.7  # share of the torque above which nothing is explained

# Gravity
TURNED = 2.0  # rad of travel within a stretch from which gravity is a term
TURNED_IN_MAP = 0.3  # the same over the runs of a map

STEEP = 6.5  # tangent of 95 % of a right angle, by 1.96: gravity beside its slope, any phase alike

# Steady speed
SHARE_STEADY = 0.8  # share of the samples at steady speed that makes a map
STEADY = 0.1  # spread of a steady speed, as a share of the speed

# Curve
BINS = 12  # of speed in each direction
LEAST_OF_BIN = 8  # windows

# A large delay
LATE_SAMPLES = 1.0  # above so many samples
LATE_SECONDS = 0.02  # and so many seconds it is compared with none
FEWEST_CHANGES = 4  # independent changes of u without which inertia looks like a delay
NO_DELAY = 1e-3  # samples: width of the prior of a delay that is to be none

# Smaller choices
DENSE = 6  # windows closer than this many samples are found by a convolution
SEGMENT = 256  # length of a segment of the spectrum, samples
MANY_VALUES = 20_000  # values that are looked at for a lattice
DIFFERENCE = 4  # order of the difference that keeps slow motion out of the spectrum
SHORTEST = 12  # good samples that a stretch must have more of
ROUNDS_OF_LAG = 3  # rounds of the lag of w
PASSES_OF_GAIN = 15  # passes of its robust fit
GROUPS = 20  # blocks of its covariance
EDGE_STEP = 8  # samples by which the edge grows with the delay, so that most delays share windows
MAD = 1.4826  # standard deviation of a normal density, in medians of the absolute value
HUGE = 1e4  # variance of a window mostly at rest, in mean squares of the torque
ROUNDS_OF_DELAY = 3  # rounds of the delay of u
LITTLE = 0.1  # friction below this share of the torque is hardly any
SLIDES = 0.1  # a window with less rest than this shows sliding
STEADY_WINDOW = 0.2  # half-width of the windows in which a speed must be steady, s
PARTS_TURNING = 12.0  # windows in a run of a map where the angle changes,
PARTS = 5.0  # and where it does not
OVERLAP = 3.0  # windows that share their samples, for each independent one
ROUNDS_OF_SCATTER = 60  # of values and variances in turn, at most
DIP_OF_MAP = 0.3  # usual fall of friction with speed, in Fc
BEND_OF_MAP = 1.0  # usual drag at top speed, in the RMS torque
TURN = 0.7  # rad that a half-width may turn where the angle changes
RESTS = 0.05  # a window of the curve has less rest than this
ROUNDS_OF_MEAN = 10  # passes of the robust mean of a bin
ONE_WAY = 0.95  # mean of sign(w) in a window without a reversal
LEAST_COLUMN = 0.05  # a shape that is nowhere larger than this is not tried
SNAP = 0.05  # a factor this close to 1 is written as 1
SLOWEST_DIP = 1e-6  # lowest speed of a dip, as a share of the top speed
ROUNDS_OF_LOAD = 2  # rounds of the load on which friction depends

# Runs compared
MOST_RUNS_COMPARED = 20  # more runs are not compared one by one
ALIKE = 0.03  # and this share beyond that
ANOTHER_FRICTION = 0.1  # friction that differs by less is not said

# A speed without a position
MOST_OFFSET = 0.25  # largest offset of w tried, as a share of the top speed
OFFSETS = 41  # how many are tried
WHOLLY = 0.98  # a window with more rest than this is one of rest
STANDING = 0.01  # share of windows in which the drive stands at 0: then w has no offset
ROUNDS_OF_OFFSET = 6  # rounds of Gauss and Newton
