"""Every public name works as the first thing that a process asks of the package."""

import json
import os
import subprocess
import sys

import pytest

import lugrectl

# The parent holds only other people's packages; each call runs in a fork of it.
PROGRAM = """
import json, os, sys, traceback
import control, numpy, scipy.linalg, scipy.optimize, scipy.signal, scipy.integrate

def first(call):
    reading, writing = os.pipe()
    child = os.fork()
    if child:
        os.close(writing)
        with os.fdopen(reading) as file:
            said = file.read()
        os.waitpid(child, 0)
        return said
    os.close(reading)
    try:
        import lugrectl as lg
        said = repr(eval(call))[:300]
    except Exception as error:
        said = "".join(traceback.format_exception(error)[-4:])
    os.write(writing, said.encode())
    os._exit(0)

print(json.dumps({call: first(call) for call in json.loads(sys.argv[1])}))
"""
CALLS = {
    'lg.effect("gravity", amplitude=0.1)': "gravity",
    'lg.Model.of(J=0.002, effects="gravity").effects[0].key': "gravity",
    'lg.Model.of(friction="stribeck").with_effect("backlash").effects[0].key': "backlash",
    'lg.block("effect", out="d", name="gravity")(lambda theta: theta)': "a block named 'gravity'",
    '__import__("lugrectl.blocks.block").blocks.block.members("observer").keys()': "adaptive",
    "lg.plant(lg.table1())": "theta",
    "lg.l2_check(lg.table1(), 22)": "gain",
    "lg.deflection([0.1, 0.2], 1e-3, lg.table1())": "array",
    **{f'lg.velocity_loop(lg.table1(), "{name}")': "Fhat" for name in ("proposed", "adaptive")},
}


@pytest.mark.slow
@pytest.mark.sample
@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs os.fork")
def test_every_public_name_works_as_the_first_call_of_a_process():
    one_of_each_module = {home: name for name, home in lugrectl._HOME.items()}
    calls = CALLS | {f"lg.{name}": "" for name in one_of_each_module.values()}
    command = [sys.executable, "-W", "ignore", "-c", PROGRAM, json.dumps(list(calls))]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    said = json.loads(done.stdout)
    wrong = {c: said[c] for c in calls if "Traceback" in said[c] and "InputError" not in said[c]}
    assert not wrong
    assert not {call: said[call] for call, words in calls.items() if words not in said[call]}
