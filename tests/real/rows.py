"""The rows: measured logs of eight drives, with what their folders say of a right answer.

Ranges and names are from the READMEs of the folders, none from an answer of the package. Every
model declares the kind of motion alone, unless the row says otherwise.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from .row import Row, Source, Value, Way, value, way

ROTARY = {"motion": "rotary"}
LATE = "velocity_sensor_lag"


def _row(
    name: str,
    files: str,
    right: Sequence[Way],
    values: Sequence[Value] = (),
    *,
    options: Mapping[str, Any] | None = None,
    model: Mapping[str, Any] | None = None,
    group: str = "table",
    left: float | None = None,
    known: str = "",
) -> Row:
    sources = tuple(Source(file, options or {}) for file in files.split())
    made = ROTARY if model is None else model
    return Row(name, group, sources, made, tuple(right), tuple(values), left, known)


# ---- industrial arm: the speed column is 4.34 to 4.39 ms late; other axes change the inertia
KUKA_LATE = value(f"w_lag or {LATE}.time_constant", 4.2e-3, 4.6e-3, needed=True)
KUKA_J = (1230.0, 2040.0)
POSE = "pose_dependent_inertia"
KUKA_1 = (
    way("unexplained", beside=f"{LATE} {POSE} constant_torque"),
    way("found ambiguous", POSE, beside=f"{LATE} constant_torque"),
    way("adequate", values=(value("J", *KUKA_J, covering=True),)),
    way("found", LATE, values=(value("J", *KUKA_J, covering=True),)),
)
# offset and gravity reach three times u with opposite signs: the two cannot be separated
TWO = ("gravity", "constant_torque")
KUKA_2 = (
    way("ambiguous", *TWO, beside=f"return_spring {LATE} {POSE}"),
    way("unexplained", beside=f"gravity constant_torque return_spring {LATE} {POSE}"),
)
# one run of axis 3 does not determine the inertia: then nothing need be named
KUKA_3 = (
    *KUKA_2,
    way("adequate", absent=("J",)),
    way("found", LATE, absent=("J",)),
)


def kuka() -> list[Row]:
    one, late = "w 4.4 ms late, J depends on the pose, 13 to 19 % left", (KUKA_LATE,)
    first = (KUKA_LATE, value("J", *KUKA_J))
    two = "w 4.4 ms late; gravity cannot be separated from a constant torque"
    three = f"{two}; J is not determined by one run"
    a, b = "real/kuka-kr300/axis1_A.csv", "real/kuka-kr300/axis1_B.csv"
    return [
        _row("kuka axis 1 A", a, KUKA_1, first, left=0.134, known=one),
        _row("kuka axis 1 B", b, KUKA_1, first, left=0.127, known=one),
        _row("kuka axis 1 A and B", f"{a} {b}", KUKA_1, first, left=0.186, known=one),
        _row("kuka axis 2 A", a.replace("1", "2"), KUKA_2, late, left=0.087, known=two),
        _row("kuka axis 2 B", b.replace("1", "2"), KUKA_2, late, left=0.040, known=two),
        # the fits by hand of axis 3 have a negative inertia: what they leave is no measure
        _row("kuka axis 3 A", a.replace("1", "3"), KUKA_3, late, known=three),
        _row("kuka axis 3 B", b.replace("1", "3"), KUKA_3, late, known=three),
    ]


# ---- direct drive with a pendulum
AHEAD = "input_delay actuator_lag"
ANY_DELAY = "u_delay or input_delay.delay or actuator_lag.time_constant"
SWING = (way("found ambiguous", "gravity", beside=f"{AHEAD} {LATE} constant_torque"),)
SWING_VALUES = (
    value("gravity.amplitude", 3.4, 3.7, needed=True),
    value("J", 0.165, 0.185, needed=True),
    value("Fc", 0.16, 0.20),
    value("Fv", 0.0, 0.0),  # its sign changes from run to run
    value(ANY_DELAY, 0.008, 0.014),
)
NO_REASON = ("does not move", "too short", "not move")


def dfki() -> list[Row]:
    known = "gravity 3.4 to 3.7, J 0.165 to 0.185, torque 8 to 14 ms ahead of the motion"
    ddp, other = (f"real/dfki-pendulum/{n}.csv" for n in ("ddp", "direct_collocation"))
    law = "real/dfki-pendulum/gravity_compensation.csv"
    refusal = (way("refused", not_because=NO_REASON),)
    return [
        # what is left is at 8 Hz with the best shift
        _row("dfki ddp", ddp, SWING, SWING_VALUES, left=0.118, known=known),
        _row("dfki collocation", other, SWING, SWING_VALUES, left=0.139, known=known),
        _row("dfki two runs", f"{ddp} {other}", SWING, SWING_VALUES, known=known),
        _row("dfki compensation", law, refusal, known="the torque is a function of the position"),
    ]


# ---- hobby servo with a pendulum
LOADED = "load_dependent_friction torque_proportional_friction"
SERVO = (way("found ambiguous unexplained", LOADED, "gravity", beside=LATE),)
SERVO_VALUES = (
    value("gravity.amplitude", 0.40, 0.48, needed=True),
    value(f"w_lag or {LATE}.time_constant", 0.0105, 0.0205),  # 11 to 20 ms
)
SERVO_KNOWN = "load-dependent friction, gravity 0.40 to 0.48, w 11 to 20 ms late, 12 to 19 % left"
RUNS = {"kp100_sin_sin": 0.198, "kp100_sin_time_square": 0.137, "kp100_up_and_down": 0.069}
STEEP = {"kp400_sin_time_square": 0.170}
PWM = {
    "columns": {
        "t": "entries.timestamp",
        "u": "entries.load",
        "theta": "entries.position",
        "w": "entries.speed",
    },
    "scale": {"u": 0.091 * 7.4 / 885},
}


def bam() -> list[Row]:
    folder = "real/bam-xl330"
    rows = [
        _row(f"bam {n}", f"{folder}/{n}.csv", SERVO, SERVO_VALUES, left=left, known=SERVO_KNOWN)
        for n, left in {**RUNS, **STEEP}.items()
    ]
    three = " ".join(f"{folder}/{n}.csv" for n in RUNS)
    return [
        *rows,
        _row("bam three runs", three, SERVO, SERVO_VALUES, left=0.187, known=SERVO_KNOWN),
    ]


# ---- bare motor; the input is a voltage, so everything is in V
VOLT = {"scale": {"u": 1.0}}
RAW = {
    "columns": {"t": "1", "u": "2", "theta": "3", "w": "4"},
    "units": {"t": "s", "theta": "rev", "w": "rev/s"},  # its header says "8Hz" of t
    "scale": {"t": 1 / 8000, "u": 1.0},
}
PLAIN = (way("adequate"), way("found", LATE))
CHIRP_VALUES = (
    value("J", 1.4e-5, 3.2e-5),
    value("Fv", 0.0085, 0.0090),
    value("Fc", 0.0, 0.002),
    value(f"w_lag or {LATE}.time_constant", 1.5e-3, 2.5e-3),
)
STEP_VALUES = CHIRP_VALUES[:3]  # a single step hardly shows that w is late
NOT_U = (way("refused unexplained", beside=LATE),)
DEAD = (way("refused"),)


def odrive() -> list[Row]:
    def one(name: str, right: Sequence[Way], values: Sequence[Value], left: float | None) -> Row:
        files = " ".join(f"real/odrive-bldc/{n}.csv" for n in name.split())
        known = "adequate, J 1.4e-5 to 3.2e-5, w 2 ms late" if values else "u is not what acted"
        return _row(f"odrive {name}", files, right, values, options=VOLT, left=left, known=known)

    chirps = [one(f"chirp{i}", PLAIN, CHIRP_VALUES, x) for i, x in ((1, 0.0066), (2, 0.0066))]
    steps = {1: 0.0038, 2: 0.0038, 3: 0.0025}
    return [
        *chirps,
        one("chirp3", PLAIN, CHIRP_VALUES, 0.0183),
        one("chirp1 chirp2", PLAIN, CHIRP_VALUES, 0.0066),
        *(one(f"step{i}", PLAIN, STEP_VALUES, x) for i, x in steps.items()),
        one("noise1", NOT_U, (), None),
        one("impulse2", DEAD, (), None),
    ]


# ---- small geared motor, one direction
ANY_LATE = f"{ANY_DELAY} or w_lag or {LATE}.time_constant"
BEHIND = way("found ambiguous", f"{AHEAD} {LATE}")
OPEN_VALUES = (
    value("J", 0.012, 0.017),
    value("Fv", 0.34, 0.37),
    value("Fc + constant_torque", 0.20, 0.25),
)
NAMED_VALUES = (value(ANY_LATE, 0.020, 0.030, needed=True), *OPEN_VALUES)
STEP_OPEN = (value(ANY_LATE, 0.020, 0.030), *OPEN_VALUES)
# in closed loop the logged u has no dead zone: it is not what acted at the motor
CLOSED = (BEHIND, way("adequate"), way("unexplained", beside=f"{AHEAD} {LATE}"))
CLOSED_VALUES = (value("J", 0.009, 0.017), value("Fv", 0.34, 0.37), value(ANY_LATE, 0.0, 0.030))


def un() -> list[Row]:
    late = "motion late by 20 to 30 ms, J 0.012 to 0.017, Fc and offset cannot be separated"
    gone = "the dead zone is removed from the logged u"
    speed = {"columns": {"w": "y"}, "units": {"w": "deg/s"}}
    angle = {"columns": {"theta": "y"}, "units": {"theta": "deg"}}

    def one(name: str, right: Sequence[Way], values: Sequence[Value], **more: Any) -> Row:
        return _row(f"un {name}", f"real/un-dcmotor/{name}_exp.csv", right, values, **more)

    both = (BEHIND, way("adequate"))
    return [
        one("prbs_open", (BEHIND,), NAMED_VALUES, options=speed, left=0.0057, known=late),
        one("step_open", both, STEP_OPEN, options=speed, known=late),
        one("stairs_closed", CLOSED, CLOSED_VALUES, options=speed, known=gone),
        one("profile_closed", CLOSED, CLOSED_VALUES, options=angle, left=0.009, known=gone),
    ]


# ---- ball screw: position only
EMPS = {"columns": {"theta": "qm", "u": "vir"}, "units": {"theta": "m"}, "scale": {"u": 35.15}}
EMPS_J = (94.0, 96.0)
CARRIAGE = (
    way(
        "found ambiguous unexplained",
        "viscous_asymmetry",
        beside="constant_torque coulomb_asymmetry torque_ripple",  # ball screw of 2.5 mm pitch
    ),
    way("adequate", values=(value("J", *EMPS_J, needed=True),)),
)
PUBLISHED = {
    "motion": "linear",
    "plant": {"J": 95.1089},
    "friction": {"model": "coulomb", "Fc": 20.3935, "Fv": 203.5034},
    "effects": [{"name": "constant_torque", "torque": -3.1648}],
}


def emps() -> list[Row]:
    file, known = "emps/DATA_EMPS.mat", "viscous friction differs by direction, J 95.1"
    values = (value("J", *EMPS_J),)
    bare = {"motion": "linear"}
    return [
        _row("emps", file, CARRIAGE, values, options=EMPS, model=bare, known=known),
        _row("emps declared", file, CARRIAGE, values, options=EMPS, model=PUBLISHED, known=known),
    ]


# ---- the same logs in their second file format
def formats(table: Sequence[Row]) -> list[Row]:
    by_name = {row.name: row for row in table}

    def again(of: str, file: str, options: Mapping[str, Any], *right: Way) -> Row:
        one, form = by_name[of], file.rsplit(".", 1)[-1]
        form = "raw" if "/raw/" in file else form
        sources, ways = (Source(file, options),), (*one.right, *right)
        return replace(one, name=f"{of}, {form}", group="format", sources=sources, right=ways)

    arm = [
        again(f"kuka axis {n} {run}", f"real/kuka-kr300/trajectory_{run}.mat", _axis(n))
        for n, run in ((1, "A"), (1, "B"), (2, "B"))
    ]
    # the PWM is an unsigned number of 16 bit: as it stands it is no torque, so refusing is right
    servo = [
        again(f"bam {n}", f"real/bam-xl330/{n}.json", PWM, way("refused"))
        for n in ("kp100_sin_sin", "kp400_sin_time_square")
    ]
    motor = [
        again(f"odrive {n}", f"real/odrive-bldc/raw/{n}.csv", RAW)
        for n in ("chirp1", "step1", "noise1", "impulse2")
    ]
    return [*arm, *servo, *motor]


def _axis(n: int) -> dict[str, Any]:
    columns = {"u": "act_torque_abs_nm", "theta": "act_pos_mot_deg", "w": "act_vel_mot_deg_per_s"}
    return {
        "columns": {role: f"rec.{name}[{n}]" for role, name in columns.items()},
        "units": {"theta": "deg", "w": "deg/s"},
        "scale": {"u": (256.86, 267.43, 252.33)[n - 1]},
        "rate": 250.0,
    }


# ---- screw and worm drives at steady speeds: maps of torque over speed, friction by direction
#
# The fits by hand are of mean torque over mean speed, the first row of every file left out. The
# ranges of Fv reach from the slope of a straight line to that over the fastest runs, which a curve
# that bends at low speed has.

# the authors' signs are the opposite of the recorder's; 100 % of torque is 9.84 mN m
OPTIONS = {
    "columns": {"t": "1", "w": "2", "u": "3"},
    "units": {"t": "ms", "w": "rpm"},
    "scale": {"w": -1.0, "u": -9.84e-5},
}
FIRST = "screw-drive/steady_state/0.096kg"
THIRD = "real/screw-drive-3/steady_state"
_TENS = [2, *range(10, 101, 10), *range(120, 201, 20)]
FIRST_RUNS = [f"{FIRST}/{side}{n}.csv" for side in ("", "n") for n in _TENS]
_ONE_WAY = "1 2 6 10 17 25 40 60 80 100 140 180"
_OTHER_WAY = "n1 n4 n8 n13 n20 n30 n50 n70 n90 n120 n160 n200"
THIRD_RUNS = [f"{THIRD}/{n}.csv" for n in f"{_ONE_WAY} {_OTHER_WAY}".split()]
BY_DIRECTION = (
    way(
        "found ambiguous unexplained",
        "constant_torque coulomb_asymmetry",
        beside="viscous_asymmetry stribeck",
        absent=("J",),
    ),
)


def sources(files: list[str]) -> tuple[Source, ...]:
    return tuple(Source(file, OPTIONS) for file in files)


MAPS = (
    Row(
        "screw drive 1",
        "map",
        sources(FIRST_RUNS),
        {"motion": "rotary"},
        BY_DIRECTION,
        (value("Fv", 2.0e-5, 5.3e-5), value("constant_torque", -4.3e-4, -2.9e-4)),
        left=0.041,
        known="friction differs by direction, no J; by hand Fv 2.3e-5, Fc 2.9e-3, offset -0.36e-3",
    ),
    Row(
        "screw drive 3",
        "map",
        sources(THIRD_RUNS),
        {"motion": "rotary"},
        BY_DIRECTION,
        (value("Fv", 0.6e-5, 2.2e-5), value("constant_torque", -5.8e-4, -3.8e-4)),
        left=0.063,
        known="friction and its low-speed bend differ by direction, no J; Fv 1.16e-5, "
        "Fc 1.39e-3, offset -0.48e-3",
    ),
)


def all_rows() -> list[Row]:
    """Every row, in the order of the table."""
    table = [*kuka(), *dfki(), *bam(), *odrive(), *un(), *emps()]
    return [*table, *MAPS, *formats(table)]
