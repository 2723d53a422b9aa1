"""The two ways in which an input can fail, each with its exit code."""

from __future__ import annotations

from typing import Any

UNEXPECTED, INTERRUPTED, BROKEN_PIPE = 70, 130, 141  # exit codes of what is no error of the input


class InputError(ValueError):
    """Wrong usage, or a file that cannot be read or understood (exit code 2).

    Examples
    --------
    The sentence names what is wrong and what to do:

    >>> try:
    ...     lg.Model.of(J=-0.002)
    ... except lg.InputError as error:
    ...     print(error)
    Model.of: [plant] J = -0.002 must be above 0 kg m2.
    """

    exit_code = 2


class Refused(ValueError):
    """A readable record that cannot answer the question (exit code 3).

    Parameters
    ----------
    reason : str
        Why it cannot.
    experiment : str, optional
        In one sentence what to record instead, if that is known.

    Attributes
    ----------
    plain : Balance or None
        The torque balance of the log, where it was computed.

    Examples
    --------
    A log in which the torque channel is dead:

    >>> t = 1e-2 * np.arange(400)
    >>> log = {"t": t, "u": np.zeros(400), "w": np.sin(t)}
    >>> try:
    ...     lg.compare_laws(log, lg.table1())
    ... except lg.Refused as error:
    ...     print(error)
    the dict of arrays: u is constant (0): dead torque channel, ...
    """

    exit_code = 3
    plain: Any = None

    def __init__(self, reason: str, experiment: str | None = None) -> None:
        super().__init__(reason)
        self.experiment = experiment


class Diverged(Refused):
    """The solution of a system cannot be continued.

    It grows without bound, becomes NaN, or changes faster than steps can follow (exit code 3).

    Parameters
    ----------
    reason : str
        The signal, its block and the time.
    experiment : str, optional
        As for :class:`Refused`.

    Examples
    --------
    An unstable mode at 50 1/s, which grows to 5e21 in a second:

    >>> mode = ct.tf(1, [1, -50], inputs="u", outputs="y")
    >>> try:
    ...     _ = lg.simulate(mode, np.linspace(0.0, 1.0, 11), {"u": 1.0}, method="RK45")
    ... except lg.Diverged:
    ...     print("unstable")
    unstable
    """
