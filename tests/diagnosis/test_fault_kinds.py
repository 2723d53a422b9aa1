"""A log with one fault is answered as the sound log is, and the fault is said with its place."""

import json
import sys

import numpy as np
import pytest

from lugrectl import InputError, Refused, balance, identify, read_record
from lugrectl.cli import main
from lugrectl.record.files.text import with_remark

from ..cases.balance_drive import FC, FV, J, simulate
from ..cases.faulty_logs import COUNT, DT, columns, late, put, with_w, write

TRUE = {"J": J, "Fc": FC, "Fv": FV}


def held(every, *roles):
    """Values renewed every few rows only."""

    def change(log):
        rows = np.arange(len(log["t"])) // every * every
        return {k: x[rows] if k in roles else x for k, x in log.items()}

    return change


def frozen(log):
    log["theta"][1800:1900] = log["theta"][1800]
    return log


def pasted(log):
    log["theta"][2750:] += 1.9
    return log


def counter(bits):
    """theta in counts of a register of so many bits."""

    def change(log):
        log["theta"] = np.rint(log["theta"] / COUNT) % 2**bits
        return log

    return change


def timer(log):
    log["t [us]"] = np.rint(log.pop("t") * 1e6 + 2**24 - 3e6) % 2**24
    return {k: log[k] for k in ("t [us]", "u", "theta")}


def wrapped(log):
    """u in steps of 1/250 N m in 8 bits with sign."""
    log["u"] = ((np.rint(log["u"] * 250) + 128) % 256 - 128) / 250
    return log


def wrapped_at(rows):
    """u in 9 bits with sign, of steps so fine that its largest values do not fit."""

    def change(log):
        step = np.sort(log["u"])[[-1 - rows, -rows]].mean() / 255.5
        log["u"] = ((np.rint(log["u"] / step) + 256) % 512 - 256) * step
        return log

    return change


def register(log):
    log["u"] = np.clip(log["u"], -0.42, 0.42)
    return log


def no_answer(log):
    log["u"][np.random.default_rng(2).uniform(size=len(log["u"])) < 0.02] = 0.0
    return log | {"d": np.zeros(len(log["t"]))}


def enabled_late(log):
    """Zeros in u and theta for 2 s, before the drive moves from 1.3 rad on."""
    rest = np.zeros(1000)
    log["u"], log["theta"] = np.r_[rest, log["u"]], np.r_[rest, log["theta"] + 1.3]
    log["t"] = np.arange(len(log["u"])) * DT
    return log


def past_midnight(log):
    at = np.rint(log["t"] * 1000).astype(int) + (24 * 3600 - 4) * 1000
    day = at % (24 * 3600 * 1000)
    clock = [
        f"{m // 3600000:02}:{m // 60000 % 60:02}:{m // 1000 % 60:02}.{m % 1000:03}" for m in day
    ]
    return log | {"t": clock}


def polled(log):
    """Sampled when a host asked: often a little, sometimes much too late."""
    rng = np.random.default_rng(8)
    delay = rng.exponential(1.5e-4, len(log["t"]))
    delay[rng.uniform(size=len(delay)) < 0.02] += 5e-3
    t = np.maximum.accumulate(log["t"] + delay) + 1e-6 * np.arange(len(delay))
    theta = np.interp(t, log["t"], log["theta"])
    rows = np.minimum((t / DT).astype(int), len(t) - 1)
    return {"t": t, "u": log["u"][rows], "theta": np.floor(theta / COUNT) * COUNT}


def typed_over(log):
    cells = [f"{x:.9g}" for x in log["u"]]
    cells[700] = "-30 (was 0.2)"
    return log | {"u": cells}


KINDS = {
    "a torque far off": (put("u", 3021, 5.0), "u at line 3023 is 5 N m"),
    "the largest float": (put("u", 77, sys.float_info.max), "u at line 79 is 1.79769e+308 N m"),
    "a row without a time": (put("t", 1998, 0.0), "t at line 2000 is 0 s"),
    "a position that stands still": (frozen, "theta stands at"),
    "all renewed every third row": (held(3, "u", "theta"), "renewed only every 6 ms"),
    "a torque reported late": (late(7), None),
    "two runs pasted together": (pasted, "at line 2752, which is no motion"),
    "a timer that wraps": (timer, "t wraps by 16.777216 s at line 1502"),
    "a torque register that wraps": (wrapped, "u wraps by 1.024 N m"),
    "a torque register at its end": (register, "u stays at the end of its register, 0.42 N m"),
    "zeros where no answer came": (no_answer, "u is exactly 0 N m in "),
    "a drive that is enabled late": (enabled_late, "theta stands at 0 rad for 1000 rows"),
    "times of day past midnight": (past_midnight, None),
    "stamps of a host": (polled, "t jitters by up to"),
    "a cell typed over by hand": (typed_over, "line 702, column 'u' was typed over"),
    "a speed with an offset": (with_w(lambda w: w + 0.3), None),
    "a late speed": (with_w(lambda w: np.r_[w[:1].repeat(4), w[:-4]]), None),
}


def holds(plain, within=0.02):
    """The values are right, and the truth is within the intervals or next to them."""
    for key, true in TRUE.items():
        found = plain.parameters[key]
        low, high = found.ci95
        assert found.value == pytest.approx(true, rel=within), key
        assert low - (high - low) <= true <= high + (high - low), key


def said(plain, words):
    """One sentence and no more says so."""
    said = (*plain.reading, *plain.notes)
    assert len([note for note in said if words in note]) == 1, said


def test_the_sound_log_is_answered_without_a_note(tmp_path):
    plain = balance(write(tmp_path, columns()), {})
    holds(plain, within=0.01)
    assert (*plain.reading, *plain.notes) == ()


@pytest.mark.parametrize("kind", KINDS)
def test_a_log_with_one_fault_is_answered_and_the_fault_is_said(tmp_path, kind):
    change, words = KINDS[kind]
    plain = balance(write(tmp_path, change(columns())), {})
    holds(plain, within=0.03)
    if words:
        said(plain, words)


@pytest.mark.parametrize("bits", [12, 16])
def test_a_counter_that_wraps_needs_its_factor_only(tmp_path, bits):
    from lugrectl.record import read_log

    path = write(tmp_path, counter(bits)(columns()))
    holds(balance(read_log(path, scale={"theta": COUNT}), {}))


@pytest.mark.cases
@pytest.mark.parametrize(("rows", "words"), [(1, "in 1 row, first"), (4, "in 4 rows, first")])
def test_a_torque_register_that_wraps_for_a_row_at_a_start_from_rest(tmp_path, rows, words):
    """The motion hardly shows a row next to rest; that u else jumps there and back, it does."""
    t = np.arange(5000) * DT
    rng = np.random.default_rng(6)
    size = np.where(np.arange(15) % 2, -0.4, 0.5) * rng.uniform(0.6, 1.0, 15)
    u = size[(t / 0.7).astype(int)] * np.exp(-(t % 0.7) / 0.25) + rng.normal(0, 2e-3, len(t))
    theta = np.floor(simulate(u, DT)[0] / COUNT) * COUNT
    log = wrapped_at(rows)({"t": t, "u": u, "theta": theta})
    plain = balance(write(tmp_path, log), {})
    holds(plain)
    said(plain, words)
    assert len(plain.reading) == 1


def test_short_runs_are_one_data_set(tmp_path):
    parts = [slice(k, k + 850) for k in range(0, 4250, 850)]
    paths = [
        write(tmp_path, {k: x[part] for k, x in columns().items()}, f"run{i}.csv")
        for i, part in enumerate(parts)
    ]
    holds(balance(paths, {}))


def test_columns_between_blanks_are_read(tmp_path):
    holds(balance(write(tmp_path, columns(), "log.txt", between="   "), {}))


def test_a_note_on_one_of_several_logs_names_it(tmp_path):
    paths = [
        write(tmp_path, columns(), "first.csv"),
        write(tmp_path, put("u", 901, -4.0)(columns(seed=5)), "second.csv"),
    ]
    plain = balance(paths, {})
    holds(plain)
    said(plain, "second.csv: u at line 903 is -4 N m")


# What is noticed is said once, truly, and names what was left out.


def test_no_sentence_of_the_json_comes_twice(tmp_path, capsys):
    path = write(tmp_path, with_w(lambda w: np.r_[w[:1].repeat(4), w[:-4]])(columns()))
    (tmp_path / "m.toml").write_text('name = "drive"\n[plant]\n[friction]\nmodel = "coulomb"\n')
    main(["identify", str(path), "--model", str(tmp_path / "m.toml"), "--json"])
    messages = json.loads(capsys.readouterr().out)["messages"]
    assert len(set(messages)) == len(messages)
    assert sum("behind dtheta/dt" in m or "lags theta" in m for m in messages) == 1
    assert not any("steps of the sensor" in m for m in messages)


def test_a_log_that_shows_its_sensors_only_is_refused():
    """Noise in place of the torque: how late the speed is says nothing of the drive."""
    log = columns("w")
    log["u"] = 0.3 * np.random.default_rng(1).standard_normal(len(log["t"]))
    with pytest.raises(Refused) as no:
        identify(log, {})
    assert no.value.plain is not None and "J" not in no.value.plain.parameters


@pytest.mark.parametrize("cell", ["-1200,,was -8.9", "3.5 (typed)", "0; see note", "1e3 error"])
def test_a_number_with_words_beside_it_was_typed_over(cell):
    assert with_remark(cell)


@pytest.mark.parametrize("cell", ["abc", "1.2.3", "12_3", "3.5", "1,000", "2024-03-09"])
def test_other_cells_were_not(cell):
    assert not with_remark(cell)


def test_other_text_in_a_cell_is_an_error(tmp_path):
    log = columns()
    path = write(tmp_path, log | {"u": ["12_3", *(f"{x:.9g}" for x in log["u"][1:])]})
    with pytest.raises(InputError, match="line 2, column 'u': '12_3' is not a number"):
        read_record(path)


def test_a_few_rows_that_rise_are_not_called_noise():
    rows = np.arange(13.0)
    with pytest.raises(Refused) as no:
        identify({"t": 0.02 * rows, "u": 0.2 + 0.1 * rows, "w": 0.06 + 0.9 * rows}, {})
    assert "noise" not in str(no.value)
