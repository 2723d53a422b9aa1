"""A torque without a name: smooth functions of the signals of a drive."""
