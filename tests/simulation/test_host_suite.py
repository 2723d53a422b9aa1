"""python-control's own tests, each of its simulations repeated by ``lg.simulate``."""

from __future__ import annotations

import numpy as np
import pytest

import lugrectl as lg

# where simulate does not answer, it says one of these
WHY_NOT = {
    "give its inputs=, outputs= and states=": "a system whose sizes are not declared",
    "grows without bound": "an unstable system, beyond 1e15",
    "no block reads the parameter": "a parameter that changes nothing",
    "states, x0 has": "a start that is too short, which python-control fills with zeros",
    "times of evaluation": "evaluation_times: simulate has one list of times",
    "python-control's simulation failed": "solve_ivp fails at the tolerance of the comparison",
}
LEAST = 140  # calls that must agree, or the suite has not run


def test_initial_states_come_in_the_parts_that_python_control_takes():
    """A vector and a matrix, row by row; a last 0 stands for all that follow."""
    import control as ct

    system = ct.rss(6, 2, 1, strictly_proper=True)
    system.name = "six"
    t, covariance = np.linspace(0, 1, 5), np.array([[3.0, 1.0], [2.0, 4.0]])
    parts = lg.simulate(system, t, 0.0, [[1.0, 2.0], covariance])
    flat = lg.simulate(system, t, 0.0, [1.0, 2.0, 3.0, 1.0, 2.0, 4.0])
    np.testing.assert_array_equal(parts.states, flat.states)
    short = lg.simulate(system, t, 0.0, [np.array([1.0, 2.0]), 0])
    np.testing.assert_array_equal(short.states[:, 0], [1, 2, 0, 0, 0, 0])
    with pytest.raises(lg.InputError, match="has 6 states, x0 has 3"):
        lg.simulate(system, t, 0.0, [np.array([1.0, 2.0]), 1])
