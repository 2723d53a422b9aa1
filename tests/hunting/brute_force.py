"""A simulation of its own for loops with set-valued friction, many starts at once.

J dw/dt = u - F with F from the resolvent of the friction (implicit in its sign, semi-implicit
Euler): nothing of the package is used.
"""

import numpy as np


def settled(J, kp, ki, kd, Fc, Fs, vs, e, held, turns, step=1e-3):
    """Amplitude and period of each start after so many half turns; 0 where it came to rest.

    ``e`` error at w = 0 and ``held`` torque of the integral, arrays. A wait in a stick is skipped.
    """
    wn = np.sqrt(kp / J)
    h, n = step / wn, len(e)
    e, held, w, t = e.copy(), held.copy(), np.zeros(n), np.zeros(n)
    side, count, peak, began = np.sign(e), np.zeros(n, int), np.abs(e), np.zeros(n)
    amplitude, period, rests = np.zeros(n), np.zeros(n), np.zeros(n, bool)
    kept = [[] for _ in range(n)]
    unit = Fc / kp
    for _ in range(3_000_000):
        live = ~rests & (count < turns)
        if not live.any():
            break
        still = live & (w == 0.0)
        u = held - kp * e
        stuck = still & (np.abs(u) <= Fs)
        rests |= stuck & (np.abs(e) < 1e-5 * unit)
        wait = np.where(stuck, (Fs + u * np.sign(e)) / (ki * np.abs(e) + 1e-300), 0.0)
        go = live & ~rests
        wait = np.where(
            go, np.maximum(wait, 0.0) * (1 + 1e-12) + np.where(stuck, 1e-9 * h, 0.0), 0.0
        )
        held = held - ki * e * wait
        t = t + wait
        # a step: the friction takes what stops w, up to its level
        level = Fc + (Fs - Fc) * np.exp(-((w / vs) ** 2))
        free = w + h * (held - kp * e - kd * w) / J
        new = np.sign(free) * np.maximum(np.abs(free) - h * level / J, 0.0)
        new = np.where(w * new < 0.0, 0.0, new)
        new = np.where(go, new, w)
        e = np.where(go, e + 0.5 * h * (w + new), e)
        held = np.where(go, held - h * ki * e, held)
        w, t = new, np.where(go, t + h, t)
        peak = np.maximum(peak, np.abs(e))
        crossed = go & (e * side < 0.0)
        for i in np.flatnonzero(crossed):
            kept[i].append((peak[i], t[i] - began[i]))
        count, side = count + crossed, np.where(crossed, -side, side)
        peak, began = np.where(crossed, np.abs(e), peak), np.where(crossed, t, began)
    for i in np.flatnonzero(~rests & (count >= turns)):
        last = np.array(kept[i][-8:])
        amplitude[i], period[i] = last[:, 0].mean(), 2.0 * last[:, 1].mean()
        first = np.array(kept[i][-16:-8])[:, 0].mean()
        if amplitude[i] < 0.98 * first:  # it still shrinks
            amplitude[i] = 0.0
    return amplitude, period


def sampled_motion(J, kp, ki, kd, Fc, Fs, vs, Fv, e, rate, counts, seconds, parts=40):
    """The errors at the samples of a sampled loop from breakaway at e, with an encoder."""
    dt, q = 1.0 / rate, 2.0 * np.pi / counts
    h, w, total, last = dt / parts, 0.0, None, q * np.floor(e / q + 0.5)
    errors = []
    for _ in range(int(seconds * rate)):
        seen = q * np.floor(e / q + 0.5)
        total = (kp * e - Fs) / ki if total is None else total
        u = -kp * seen + ki * total - kd * (seen - last) / dt
        total, last = total - dt * seen, seen
        for _ in range(parts):
            level = Fc + (Fs - Fc) * np.exp(-((w / vs) ** 2))
            free = w + h * (u - Fv * w) / J
            new = np.sign(free) * max(abs(free) - h * level / J, 0.0)
            new = 0.0 if w * new < 0.0 else new
            e, w = e + 0.5 * h * (w + new), new
        errors.append(e)
    return np.array(errors)
