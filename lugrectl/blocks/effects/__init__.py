# isort: skip_file
"""Physical effects that may be missing from a declared model: one registered function each.

The output of a torque effect is ``d``, a torque on the resisting side. The output of a level
effect is the change of the plant's parameters named in ``acts``: relative, or in N m after a
plus. That of an input effect is the torque that reaches the drive, those of a sensor effect are
the measured signals. At the neutral value of its gain an effect changes nothing. The order here
is that of the catalogue.
"""

from .loads import (
    constant_torque,
    gravity,
    torque_ripple,
    return_spring,
    hard_stop,
    periodic_disturbance,
)
from .levels import (
    position_dependent_friction,
    coulomb_asymmetry,
    viscous_asymmetry,
    thermal_drift,
    load_dependent_friction,
    friction_step,
)
from .contact import quadratic_drag, sublinear_viscous, dwell_stiction, stribeck, presliding
from .actuator import (
    input_delay,
    actuator_lag,
    actuator_saturation,
    actuator_dead_zone,
    torque_constant_ripple,
    held_late,
    held_lagging,
)
from .inertia import inertia_step, pose_dependent_inertia, elastic_coupling, backlash
from .sensors import velocity_sensor_lag, encoder_eccentricity

__all__ = [
    "actuator_dead_zone",
    "actuator_lag",
    "actuator_saturation",
    "backlash",
    "constant_torque",
    "coulomb_asymmetry",
    "dwell_stiction",
    "elastic_coupling",
    "encoder_eccentricity",
    "friction_step",
    "gravity",
    "hard_stop",
    "held_lagging",
    "held_late",
    "inertia_step",
    "input_delay",
    "load_dependent_friction",
    "periodic_disturbance",
    "pose_dependent_inertia",
    "position_dependent_friction",
    "presliding",
    "quadratic_drag",
    "return_spring",
    "stribeck",
    "sublinear_viscous",
    "thermal_drift",
    "torque_constant_ripple",
    "torque_ripple",
    "velocity_sensor_lag",
    "viscous_asymmetry",
]
