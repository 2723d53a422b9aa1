"""Bad samples are found on the rows as recorded, said with place and value, and left out."""

import numpy as np
import pytest

from lugrectl.record import read_record

from ..cases.damaged_drive import columns, marked, seen, sound
from ..cases.logs import driven, rubbing

U_W = [("u", "theta"), ("u", "w"), ("u", "w", "theta")]


@pytest.mark.parametrize("roles", U_W)
@pytest.mark.parametrize(
    "seed, rate, counts", [(1, 500.0, 8192), (2, 200.0, 2000), (3, 1000.0, 100_000)]
)
def test_a_sound_log_gets_no_note(roles, seed, rate, counts):
    log = columns(*roles, seed=seed, rate=rate, counts=counts)
    found, said = seen(log)
    assert said == [] and len(found) == 1 and found[0].ok.all()
    for role in roles:
        np.testing.assert_allclose(getattr(found[0], role), log[role], atol=1e-9)


@pytest.mark.parametrize("role", ["u", "w", "theta"])
@pytest.mark.parametrize(
    "row, value",
    [
        *((row, 40.0) for row in (0, 7, 2500, 5998, 5999)),
        *((2500, value) for value in (1e30, -1e308, np.finfo(float).max, -1e20, 1e12, -9999.0)),
    ],
)
def test_one_bad_sample_is_named_with_its_row_and_value(role, row, value):
    log = columns("u", "w", "theta")
    log[role][row] = value
    found, said = seen(log)
    (sentence,) = said
    assert sentence.startswith(f"{role} at row {row} is {value:.6g} ")
    assert sentence.endswith("left out.")
    clean = sound()[role]
    low, high = clean.min(), clean.max()
    assert all(low <= x <= high for s in found for x in getattr(s, role)[s.ok])


@pytest.mark.parametrize("turn", [2 * np.pi, -2 * np.pi, 0.5])
def test_one_reading_of_an_encoder_that_is_off_is_no_wrap_and_no_cut(turn):
    log = columns("u", "theta")
    log["theta"][2501] += turn
    found, said = seen(log)
    (sentence,) = said
    assert "theta at row 2501" in sentence and len(found) == 1 and found[0].ok.all()
    np.testing.assert_allclose(found[0].theta, sound()["theta"], atol=2e-2)


@pytest.mark.parametrize("role, size", [("u", 0.5), ("w", 9.0), ("theta", 1.0)])
@pytest.mark.parametrize("many", [10, 60])
def test_scattered_outliers_are_counted(role, size, many):
    rng = np.random.default_rng(many)
    log = columns("u", "w", "theta")
    at = rng.choice(np.arange(5, 5990, 6), many, replace=False)
    log[role][at] += size * rng.choice([-1, 1], many) * rng.uniform(1, 2, many)
    found, said = seen(log)
    (sentence,) = said
    assert f"{role} is far off its neighbours in " in sentence
    assert int(sentence.split(" in ")[1].split()[0]) >= 0.95 * many
    assert f"first at row {at.min()}" in sentence
    assert all(s.ok.mean() > 0.999 for s in found)


@pytest.mark.parametrize("share", [0.02, 0.1, 0.2])
@pytest.mark.parametrize("role, code", [("u", 0.0), ("u", -3.2767), ("w", 0.0), ("theta", 65.535)])
def test_a_code_that_comes_again_and_again_is_no_value(role, code, share):
    log = columns("u", "w", "theta")
    lost = np.random.default_rng(4).random(6000) < share
    log[role][lost] = code
    found, said = seen(log)
    assert any(f"{role} is exactly {code:.6g}" in s and "left out" in s for s in said)
    clean, wrong = sound()[role], 0
    for s in found:
        at = np.rint(s.t * 500).astype(int)
        wrong += int((np.abs(getattr(s, role) - clean[at]) > 0.2 * np.ptp(clean))[s.ok].sum())
    assert wrong <= 2


@pytest.mark.parametrize("first, rows_", [(1500, 150), (2800, 60), (4600, 300)])
def test_a_position_that_stands_while_the_drive_goes_on_is_left_out(first, rows_):
    log = columns("u", "theta")
    moved = np.abs(log["theta"][first + rows_] - log["theta"][first])
    log["theta"][first : first + rows_] = log["theta"][first]
    found, said = seen(log)
    assert moved > 0.05
    (sentence,) = said
    assert "theta stands at" in sentence and "and then jumps" in sentence
    bad = marked(found, log["t"])
    assert abs(bad.min() - first) <= 2 and abs(bad.max() - (first + rows_)) <= 2
    assert np.ptp(np.diff(np.r_[bad.min(), bad])[1:]) == 0


@pytest.mark.parametrize("first", [600, 4900])
@pytest.mark.parametrize("value", [None, 0.0])
def test_a_torque_that_stands_while_the_motion_needs_another_is_left_out(first, value):
    log = columns("u", "theta")
    level = 0.0 if value == 0 else log["u"][:-150]
    off = np.convolve(np.ones(150), np.abs(log["u"]), "valid")[:-1] / 150 - np.abs(level)
    turning = np.convolve(np.ones(150), np.abs(sound()["w"]) > 1, "valid")[:-1] > 130
    first += int(np.argmax((np.abs(off) > 0.1)[first:] & turning[first:]))  # the drive goes on
    log["u"][first : first + 150] = log["u"][first] if value is None else value
    _, said = seen(log)
    (sentence,) = said or [f"{first}"]
    assert "u stands at" in sentence and f"first at row {first}," in sentence


@pytest.mark.parametrize("rows_", [2, 30, 120])
@pytest.mark.parametrize("first", [1500, 4100])
def test_rows_of_zeros_in_the_middle_are_left_out(first, rows_):
    log = columns("u", "theta")
    for role in ("u", "theta"):
        log[role][first : first + rows_] = 0.0
    found, said = seen(log)
    assert any(s.startswith("theta ") and "left out" in s for s in said)
    bad = marked(found, log["t"])
    assert rows_ <= 2 or len(bad) >= rows_
    for s in found:
        at = np.rint(s.t * 500).astype(int)
        clean = sound()["theta"][at]
        off = (s.theta - clean)[s.ok]
        assert np.ptp(off) < 0.05


@pytest.mark.parametrize("roles", U_W)
def test_a_buffer_that_was_not_filled_is_left_out(roles):
    log = {role: np.r_[x, np.zeros(400)] for role, x in columns(*roles).items()}
    found, said = seen(log)
    assert said == ["All columns are 0 in 400 rows, first at row 6000: left out."]
    assert len(found) == 1 and len(found[0].t) == 6000 and found[0].ok.all()


@pytest.mark.parametrize("limit", [0.3, 0.27])
def test_a_register_at_its_end_is_left_out_where_the_motion_needs_more(limit):
    log = columns("u", "theta")
    beyond = np.abs(log["u"]) >= limit
    log["u"] = log["u"].clip(-limit, limit)
    found, said = seen(log)
    assert sum("while the motion needs" in s for s in said) == 2
    assert np.abs(np.concatenate([s.u[s.ok] for s in found])).max() <= limit
    assert len(np.setdiff1d(np.flatnonzero(beyond), marked(found, log["t"]))) < 0.1 * beyond.sum()


def test_a_column_of_zeros_beside_the_motion_is_no_load():
    log = columns("u", "theta") | {"d": np.zeros(6000)}
    record = read_record(log)
    assert record.d is None and record.messages == ("d is 0 in every row: left out.",)


def test_a_torque_beside_a_slower_position_keeps_its_integral():
    log = columns("u", "theta", rate=1000.0)
    whole = log["u"].copy()
    log["theta"] = log["theta"][np.arange(6000) // 4 * 4]
    found, _ = seen(log)
    np.testing.assert_allclose(found[0].u, whole.reshape(-1, 4).mean(1), atol=1e-12)


def test_a_torque_program_of_few_levels_is_held_on_purpose():
    rng = np.random.default_rng(2)
    u = np.repeat(rng.choice([-0.5, 0.0, 0.5], 300), 20)
    w, _ = driven(u, 2e-3, rubbing(0.01, 0.1, 0.05, 0.1), 1)
    t = np.arange(6000) * 2e-3
    found, said = seen({"t": t, "u": u, "theta": np.cumsum(w) * 2e-3})
    assert said == [] and len(found[0].t) == 6000


def test_a_torque_that_pushes_and_brakes_is_at_no_end_of_a_register():
    """As firmware finds an inertia: twice forward, twice back, with rests."""
    push = np.r_[np.full(200, 0.4), np.full(200, -0.4), np.zeros(300)]
    u = np.tile(np.r_[push, push, -push, -push], 7)
    _, theta = driven(u, 1e-3, rubbing(0.004, 0.12, 0.006, 1e-3), 20)
    theta = np.floor(theta * 16384 / (2 * np.pi)) * (2 * np.pi / 16384)
    found, said = seen({"t": 1e-3 * np.arange(len(u)), "u": u, "theta": theta})
    assert said == [] and found[0].ok.all() and len(found[0].t) == len(u)


def test_a_short_torque_that_the_motion_shows_is_no_outlier():
    """One row of a hammer's size; the speed changes by as much as it should."""
    rng = np.random.default_rng(5)
    t = np.arange(4000) * 2e-3
    u = 0.3 * np.sin(2 * np.pi * 0.7 * t) + 0.002 * rng.standard_normal(4000)
    u[[1200, 2500]] += [3.0, -2.5]
    _, theta = driven(u, 2e-3, rubbing(0.004, 0.1, 0.02, 0.05), 1)
    assert seen({"t": t, "u": u, "theta": np.round(theta / 1e-4) * 1e-4})[1] == []
    u[3000] = 3.0  # this one moved nothing
    (sentence,) = seen({"t": t, "u": u, "theta": np.round(theta / 1e-4) * 1e-4})[1]
    assert sentence == "u at row 3000 is 3 N m, far off its neighbours: left out."
