"""The numbers on which the comparison depends, each with its meaning."""

from __future__ import annotations

ALPHA = 0.01  # chance of naming something on a record where nothing is missing
POWER = 0.8  # chance that an effect as large as the detection limit is seen
LEAST = 0.015  # of RMS friction torque: the smallest torque that matters
FREEDOM = 4.0  # of the Student density of a window: reversals are outliers by nature
BLOCK = 0.1  # s, the piece of a record that is left out and predicted, at least ...
APART = 4.0  # ... half-widths of a window: windows in two pieces share little noise
UNKNOWN = 2.0  # an unknown torque must be so many times `least`: it is free in its shape
REST = 0.3  # share of the named effect that an unknown torque beside it makes "unexplained"
SECOND = 0.25  # share of the first effect from which a second one is named
SECOND_GAIN = 0.1  # of the gain of the first, for a second one
MORE = 2.0  # nats beyond the logarithm of the number of contenders, for the best of them
MOST = 0.7  # of what the base leaves, for an effect that is smaller than `least` beyond the law
TOGETHER = 0.9  # of the gain of two effects: an unknown torque that has it alone is the answer
FAR = 1.5  # times the gain of the best effect: an unknown torque so much better has no name
ALONE = 0.06  # of a named torque must be beyond the declared law, which imitates the rest
STIFFLY = 1.35  # times the declared inertia, from which a load may turn with the motor
KNOWN_TIME = 0.33  # of `least` for a delay that is 1 ms or more beyond what is free
TIMING = 5e-4  # s that a torque may be early or late beyond half a sample, without an effect
NOISE = 0.03  # of friction: the noise of J a in a window
LOST = 0.05  # of J that noise of the acceleration may take
HALF = 0.5  # of the torque: a model that leaves more of it says nothing of the drive
OFF = 3.0  # times a declared inertia is too large, at most: less would be taken for other effects
HELD = 0.02  # half-width within which a certain J of the plain answer is held, at least
SOFTER = 1e-2  # stiffness of the motion that friction is made from, over that of the acceleration
STILL = 0.004  # of the top speed: below it the drive rests
TAIL = 0.15  # of the top speed: the longest Stribeck curve; a longer one bends like a drag
HIDING = 0.015  # s: windows from which on a coupling may resonate unseen
ALIKE_SCALES = 0.3  # relative difference of the factors of J and Fc, to which u has another scale
HALF_RESPONSE = 0.55  # frequency times half-width at which a window halves a wave
TRUSTED = 12  # groups of blocks from which what chance gives and takes is computed, at least
NEIGHBOURS = 3  # blocks in a row that count as one for an unknown torque
BEYOND = 5.0  # medians of the residual: an event leaves more
TAKEN = 0.3  # of the torque of the events: an effect that leaves less of it explains them
NEAR = 0.8  # of the gain of the best, from which each has its own law before they are compared
COARSE = 0.1  # of the least torque: what the shift of a torque may leave
MOST_ROWS, MOST_SAMPLES = 15_000, 250_000  # of a longer record, pieces all over it are compared
WIDTHS = (0.01, 0.012, 0.0145, 0.0174, 0.021, 0.025, 0.03, 0.036, 0.05, 0.07, 0.1, 0.14, 0.19, 0.26)
BIASED = 0.005  # of a value: what smoothing over windows may take off it
SPREADS = 1.5  # times the spread over parts of a record: what is common to all parts is not in it
UNLIKE = 0.4  # of a gain, by which blocks differ at least: four that agree decide, three do not
FEW_STRETCHES = 24  # independent ones, fewer than which make a comparison uncertain
FEWEST_PARTS = 12  # long parts of a record for that spread
SLIGHTLY = 0.004  # of friction: what every drive has of any torque, in standard deviations
