# isort: skip_file
"""Physical effects that may be missing from a declared model: one registered function each.

The output of a torque effect is ``d``, a torque on the resisting side. The output of a level
effect is the change of the plant's parameters named in ``acts``: relative, or in N m after a
plus. That of an input effect is the torque that reaches the drive, those of a sensor effect are
the measured signals. At the neutral value of its gain an effect changes nothing. The order here
is that of the catalogue.
"""

from . import loads, levels, contact, actuator, inertia, sensors

__all__ = ["actuator", "contact", "inertia", "levels", "loads", "sensors"]
