"""A simulation of its own for loops with set-valued friction, and what became of a motion.

J dw/dt = u - F with F from the resolvent of the friction (implicit in its sign, semi-implicit
Euler): nothing of the package is used.
"""

import numpy as np
from numba import njit

RESTS, HUNTS, OPEN, GROWS = 0, 1, 2, 3


@njit(cache=True)
def slid(e, w, u, J, kd, Fc, Fs, vs, Fv, h, share=0.0, vd=1.0):
    """Error and speed after h: the friction takes what stops w, up to its level. A share of the
    friction is added to u, in proportion to w below vd."""
    level = Fc + (Fs - Fc) * np.exp(-((w / vs) ** 2))
    u += share * (level * np.sign(w) + Fv * w) * min(1.0, abs(w) / vd)
    free = w + h * (u - (kd + Fv) * w) / J
    new = np.sign(free) * max(abs(free) - h * level / J, 0.0)
    new = 0.0 if w * new < 0.0 else new
    return e + 0.5 * h * (w + new), new


@njit(cache=True)
def settled(J, kp, ki, kd, Fc, Fs, vs, Fv, e, held, turns, step, share=0.0, vd=1.0):
    """Fate, amplitude and period of each start after at most so many half turns.

    ``e`` error at w = 0 and ``held`` torque of the integral, arrays. A wait in a stick is skipped.
    It hunts if the mean size of eight half turns repeats; it rests below 1e-5 of Fc/kp.
    """
    h, unit, n = step * np.sqrt(J / kp), Fs / kp, len(e)
    fates, sizes, periods = np.full(n, OPEN), np.zeros(n), np.zeros(n)
    peaks, times = np.zeros(turns), np.zeros(turns)
    for i in range(n):
        x, q, w, t, k, peak, side = e[i], held[i], 0.0, 0.0, 0, abs(e[i]), np.sign(e[i])
        for _ in range(100_000_000):
            u = q - kp * x
            if w == 0.0 and abs(u) <= Fs:
                if abs(x) < 1e-5 * unit:
                    fates[i] = RESTS
                    break
                wait = (Fs + u * np.sign(x)) / (ki * abs(x)) * (1.0 + 1e-12) + 1e-9 * h
                q, t = q - ki * x * wait, t + wait
            before = x
            x, w = slid(x, w, q - kp * x, J, kd, Fc, Fs, vs, Fv, h, share, vd)
            q, t, peak = q - h * ki * 0.5 * (x + before), t + h, max(peak, abs(x))
            if abs(x) > 1e5 * unit:
                fates[i] = GROWS
                break
            if x * side < 0.0:
                peaks[k], times[k] = peak, t
                k, side, peak = k + 1, -side, abs(x)
                if k >= 24 and k % 8 == 0:
                    now, was = peaks[k - 8 : k].mean(), peaks[k - 16 : k - 8].mean()
                    sizes[i], periods[i] = now, (times[k - 1] - times[k - 9]) / 4.0
                    if abs(now / was - 1.0) < 1e-6:
                        fates[i] = HUNTS
                        break
                if k == turns:
                    break
    return fates, sizes, periods


@njit(cache=True)
def sampled(J, kp, ki, kd, Fc, Fs, vs, Fv, e, held, dt, q, late, most, parts, shake=0.0):
    """The same with a controller at samples dt apart (integral: trapezes), counts q (0: none),
    ``late`` samples of dead time, at most so many samples; sizes of half turns scatter, so that it
    hunts where the last quarter of all half turns is as large as the quarter before; ``shake`` in
    counts: noise of the encoder."""
    h, n = dt / parts, len(e)
    fates, sizes, periods = np.full(n, OPEN), np.zeros(n), np.zeros(n)
    peaks, times = np.zeros(800), np.zeros(800)
    for i in range(n):
        x, w, total, k, peak, side = e[i], 0.0, held[i], 0, abs(e[i]), np.sign(e[i])
        last = q * np.floor(x / q + 0.5) if q else x
        waits, still = np.full(late + 1, total - kp * last), 0
        for m in range(most):
            place = 0.5 + shake * (2.0 * (m * 0.6180339887 % 1.0) - 1.0)  # noise of the encoder
            seen = q * np.floor(x / q + place) if q else x
            total = total - 0.5 * dt * ki * (seen + last)
            u = total - kp * seen - kd * (seen - last) / dt
            waits[m % (late + 1)], last = u, seen
            u = waits[(m + 1) % (late + 1)]
            still = still + 1 if w == 0.0 and abs(seen) < 1e-5 * Fs / kp else 0
            if still > 3 + late and abs(u) <= Fs:
                fates[i] = RESTS
                break
            if w != 0.0 or abs(u) > Fs:
                for _ in range(parts):
                    x, w = slid(x, w, u, J, 0.0, Fc, Fs, vs, Fv, h)
            peak = max(peak, abs(x))
            if abs(x) > 1e5 * Fs / kp:
                fates[i] = GROWS
                break
            if x * side < 0.0 and k < len(peaks):
                peaks[k], times[k] = peak, (m + 1) * dt
                k, side, peak = k + 1, -side, abs(x)
                if k == len(peaks):
                    break
        if fates[i] == OPEN and k >= 24:
            c = k // 4
            now, was = peaks[k - c : k].mean(), peaks[k - 2 * c : k - c].mean()
            sizes[i], periods[i] = now, 2.0 * (times[k - 1] - times[k - 1 - c]) / c
            fates[i] = HUNTS if abs(now / was - 1.0) < 0.02 else OPEN
    return fates, sizes, periods


@njit(cache=True)
def with_bristles(J, kp, ki, kd, Fc, Fs, vs, Fv, sigma0, sigma1, e, turns, step):
    """Size of the last of so many half turns from breakaway at e with LuGre friction; 0: it came
    to rest. z is implicit, the rest semi-implicit Euler."""
    h, x, w, q, z = step * np.sqrt(J / kp), e, 0.0, kp * e - Fs, -Fs / sigma0
    peak, side, k, still = abs(e), 1.0, 0, abs(e)
    for _ in range(300_000_000):
        g = Fc + (Fs - Fc) * np.exp(-((w / vs) ** 2))
        new = (z + h * w) / (1.0 + h * sigma0 * abs(w) / g)
        F = sigma0 * new + sigma1 * (new - z) / h + Fv * w
        z, w = new, w + h * (q - kp * x - kd * w - F) / J
        x, q = x + h * w, q - h * ki * x
        peak = max(peak, abs(x))
        if x * side < 0.0:
            k, side, still, peak = k + 1, -side, peak, abs(x)
            if k == turns:
                return still
        if abs(x) < 1e-3 * e and abs(w) < 1e-4 * vs:
            return 0.0
    return 0.0


@njit(cache=True)
def dragged(J, kp, ki, kd, Fc, Fs, vs, Fv, v, e, periods, step):
    """Stops in the last half of so many 2 pi/wn under r = v t, from a stick at e without torque."""
    h, x, q, w, stops = step * np.sqrt(J / kp), e, kp * e, 0.0, 0
    n = int(2.0 * np.pi * periods / step)
    for k in range(n):
        before, was = x, w
        x, w = slid(x, w, q - kp * x, J, kd, Fc, Fs, vs, Fv, h)
        x -= v * h
        q -= h * ki * 0.5 * (x + before)
        stops += k > n // 2 and w == 0.0 and was != 0.0
    return stops
