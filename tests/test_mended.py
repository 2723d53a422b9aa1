"""Records that went wrong once: they guard what was mended, they score nothing."""

import pytest

from tests.rig import exported, sample

from .test_blind import verdict


@pytest.mark.slow
@pytest.mark.parametrize("seed, hard", [(125003, False), (127400, True), (128000, False)])
def test_stiction_that_grows_with_rest_is_named(seed, hard):
    """In records that start at rest, beyond Fs; without values of friction; that creep at vs/2."""
    case = sample("dwell_stiction", seed, hard=hard)
    result, names = verdict(case)
    assert (result.verdict, names) == ("found", ["dwell_stiction"])


@pytest.mark.slow
def test_friction_counts_by_its_size_where_it_does_not_change():
    """In one direction, as this spindle turns at first, friction is all but constant."""
    case = exported(sample("coulomb_asymmetry", 128400), "a difference alone")
    result, names = verdict(case)
    assert (result.verdict, names) == ("found", ["coulomb_asymmetry"])


@pytest.mark.slow
def test_the_steps_of_an_encoder_are_nothing():
    case = exported(sample("none", 128402, hard=True), "w differentiated")
    assert case.truth["hard"] == "coarse encoder"
    assert verdict(case)[0].verdict == "adequate"


@pytest.mark.slow
def test_a_function_of_little_torque_is_nothing():
    assert verdict(sample("none", 128009))[0].verdict == "adequate"
