r"""Inertia from the frequency response of torque to position about a bias speed, section 2 of the paper.

About a bias speed far above v_s the friction is memoryless and nearly linear: a real damping b. The link
under a torque held for a sample period h then has, from torque to position, exactly

    G(z) = (1/b) ((h - s) z + s - a h) / ((z - 1)(z - a)),    a = e^(-b h/J),  s = (J/b)(1 - a),

so neither the hold nor the samples leave an error to correct. The impedance Z = 1/G carries J in its
imaginary part, which a real damping cannot imitate; a delay d between torque and position turns every line by
e^(-j w d) and is estimated with them. J, b and d minimise

    sum over lines |U e^(-j w d) - Z Q - T|^2 / (S_u + |Z|^2 S_q),

S_q the encoder's rounding, S_u whatever torque noise, ripple and distortion leave, taken from the residuals
themselves, smoothed over frequency. Noise in both signals is so accounted for (Pintelon and Schoukens 2012,
ch. 8). T are the terms by which a stretch of finite length differs from a periodic one: they are known
rational functions with a few free numbers (ibid., ch. 6), so that a chirp, noise, or a log that starts
anywhere is treated exactly and without a window. Where the torque repeats itself, only whole periods and the
lines of the excitation are used.

What coherence over repeated periods hides (distortion repeats as well) shows between phase realisations:
the error of the combined inertia follows from the scatter over logs and stretches, if that is larger.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from data.recording import FloatArray, Recording
from ident.evidence.segmentation import grain

ComplexArray = NDArray[np.complex128]

LEAST_SPEED_RATIO = 5.0  # lowest speed over v_s below which the friction is no longer a damping
MOVING = 0.3  # part of the typical speed below which the link is starting or stopping
REPEATS = 0.8  # correlation of the torque with itself a period later
STRETCHES = 4  # a log, for the scatter of its inertia
EXCITED = 25.0  # power of an excited line over the median line between
RESOLVED = 30.0  # power of a line in the position over that of the encoder's rounding
SMOOTHED = 25  # lines over which residual power is averaged
TRANSIENTS = 4  # free numbers in T
REWEIGHTS = 4
TRUSTED = 0.7  # of log J: further from its first guess a fit has lost its way
_REACH = np.array([3.0, 1e3, 50.0])  # of log J about the guess, b T/J, and the delay in samples


@dataclass(frozen=True)
class ResponseFit:
    """What one log, or one stretch of it, says."""

    log: str
    inertia: float  # J [kg m^2]
    stderr: float  # from the residual spectrum [kg m^2]
    damping: float  # b [N m s/rad]
    delay: float  # [s], the torque acts later than it is logged
    bias_speed: float  # signed [rad/s]
    lowest_speed: float  # [rad/s], magnitude
    frequency: FloatArray  # (m,) of the lines [Hz]
    impedance: ComplexArray  # (m,) U/Q over j w, delay and hold taken out: b + j w J [N m s/rad]
    weight: FloatArray  # (m,) of the lines in the fit, relative to the largest [-]


@dataclass(frozen=True)
class FrequencyInertia:
    """The inertia of all frequency-response logs together."""

    inertia: float  # [kg m^2]
    stderr: float  # [kg m^2]
    dof: int
    lowest_speed: float  # [rad/s]
    fits: tuple[ResponseFit, ...]  # one a log


@dataclass(frozen=True)
class _Lines:
    """DFT of torque and position at the lines that are used, and at their neighbours."""

    angle: FloatArray  # (m,) w h [rad]
    torque: ComplexArray  # (m,)
    position: ComplexArray  # (m,)
    rounding: float  # S_q [rad^2]
    white: float  # first guess of S_u [(N m)^2]
    period: float  # h [s]
    excited: NDArray[np.bool_]  # (m,) lines that the fit uses; the others tell the noise


def response_fit(recording: Recording) -> tuple[ResponseFit, tuple[ResponseFit, ...]] | str:
    """The fit of a whole log and of its stretches; a sentence where there is none."""
    span = _moving_span(recording)
    if span is None:
        return "the link does not keep moving: there is no bias speed about which friction is a damping"
    first, past = span
    whole = _fit(recording, first, past)
    if whole is None:
        return "the torque excites nothing that the position answers to"
    edges = np.linspace(first, past, STRETCHES + 1).astype(int)
    parts = [_fit(recording, int(a), int(b)) for a, b in itertools.pairwise(edges)]
    return whole, tuple(part for part in parts if part is not None)


def frequency_inertia(recordings: Sequence[Recording]) -> tuple[FrequencyInertia | None, dict[str, str]]:
    """The common inertia of the logs, and for each log that gave none the reason."""
    fits, parts, reasons = [], [], {}
    for recording in recordings:
        result = response_fit(recording)
        if isinstance(result, str):
            reasons[recording.log] = result
            continue
        fits.append(result[0])
        parts.append(result[1])
    if not fits:
        return None, reasons
    inertia = np.array([fit.inertia for fit in fits])
    own = np.array([_error_of(fit, stretch) for fit, stretch in zip(fits, parts, strict=True)])
    weight = 1.0 / own**2
    mean = float(np.sum(weight * inertia) / np.sum(weight))
    stderr = float(np.sum(weight) ** -0.5)
    dof = sum(max(len(stretch) - 1, 1) for stretch in parts)
    if len(fits) > 1:
        between = float(np.sum(weight * (inertia - mean) ** 2)) / (len(fits) - 1)
        stderr *= max(1.0, between) ** 0.5
        dof = len(fits) - 1 if between > 1.0 else dof
    lowest = min(fit.lowest_speed for fit in fits)
    return FrequencyInertia(mean, stderr, dof, lowest, tuple(fits)), reasons


def _error_of(fit: ResponseFit, parts: Sequence[ResponseFit]) -> float:
    """Standard error of a log's inertia, widened where its stretches scatter more than their errors say."""
    sound = [part for part in parts if part.stderr < 10.0 * fit.stderr]
    if len(sound) < 2:
        return fit.stderr
    deviation = np.array([(part.inertia - fit.inertia) / part.stderr for part in sound])
    scatter = 1.4826 * float(np.median(np.abs(deviation)))
    return fit.stderr * max(1.0, scatter)


def _moving_span(recording: Recording) -> tuple[int, int] | None:
    """The longest span in one direction without start and stop."""
    n = recording.time.size
    edges = np.linspace(0, n - 1, min(200, n // 8) + 1).astype(int)
    speed = np.diff(recording.position[edges]) / np.diff(recording.time[edges])
    typical = float(np.median(speed))
    going = speed * np.sign(typical) > MOVING * abs(typical)
    if typical == 0.0 or not np.any(going):
        return None
    change = np.flatnonzero(np.diff(np.concatenate([[0], going.astype(int), [0]])))
    starts, ends = change[::2], change[1::2]
    longest = int(np.argmax(ends - starts))
    first, past = int(edges[starts[longest]]), int(edges[ends[longest]])
    margin = 0 if first == 0 else (past - first) // 20
    return first + margin, past


def _fit(recording: Recording, first: int, past: int) -> ResponseFit | None:
    lines, span = _lines(recording, first, past)
    if lines is None or np.count_nonzero(lines.excited) < TRANSIENTS + 3:
        return None
    part = slice(*span)
    start = _first_guess(
        recording.torque[part], recording.position[part], recording.sample_period, grain(recording)
    )
    if start is None:
        return None
    power = np.full(lines.angle.size, lines.white)
    duration = lines.period * (span[1] - span[0])
    solution = np.array([0.0, 1.0, 0.0])
    used = lines.excited
    jacobian = np.zeros((1, 3))
    for _ in range(REWEIGHTS):

        def residual(x: FloatArray, power: FloatArray = power) -> FloatArray:
            left, _ = _unexplained(lines, _physical(x, start, duration), power)
            return np.concatenate([left[used].real, left[used].imag])

        result = least_squares(residual, solution, bounds=(-_REACH, _REACH), x_scale="jac")
        solution, jacobian = result.x, np.asarray(result.jac)
        if abs(solution[0]) > TRUSTED:
            return None
        left, allowed = _unexplained(lines, _physical(solution, start, duration), power)
        raw = np.abs(left) ** 2 * allowed - (allowed - power)
        power = np.maximum(_smoothed(raw, lines), 1e-3 * lines.white)
    inertia, damping, delay = _physical(solution, start, duration)
    information = jacobian.T @ jacobian
    covariance = 0.5 * np.linalg.pinv(information)
    speed = _speeds(recording, span)
    turned = np.exp(-1j * lines.angle * delay)
    measured = (lines.torque * turned / lines.position) * (
        _impedance(lines.angle, inertia, 0.0, lines.period, of_speed=True)
        / _impedance(lines.angle, inertia, 0.0, lines.period)
    )
    _, allowed = _unexplained(lines, (inertia, damping, delay), power)
    weight = np.abs(lines.position) ** 2 / allowed
    return ResponseFit(
        log=recording.log,
        inertia=inertia,
        stderr=float(inertia * np.sqrt(covariance[0, 0])),
        damping=damping,
        delay=delay * lines.period,
        bias_speed=float(np.mean(speed)),
        lowest_speed=float(np.min(np.abs(speed))) if np.all(speed > 0) or np.all(speed < 0) else 0.0,
        frequency=lines.angle[used] / (2 * np.pi * lines.period),
        impedance=measured[used],
        weight=weight[used] / float(np.max(weight[used])),
    )


def _physical(x: FloatArray, inertia: float, duration: float) -> tuple[float, float, float]:
    """J [kg m^2], b [N m s/rad] and the delay in samples, from log J over the guess, b T/J and delay."""
    J = float(inertia * np.exp(x[0]))
    return J, float(x[1] * J / duration), float(x[2])


def _impedance(
    angle: FloatArray, inertia: float, damping: float, period: float, *, of_speed: bool = False
) -> ComplexArray:
    """Z = 1/G at lines w h; with `of_speed` the continuous j w (j w J + b) instead, over j w."""
    if of_speed:
        return np.asarray(1j * angle / period * inertia + damping)
    rate = damping * period / inertia
    least = 1e-6
    rate = rate if abs(rate) > least else least
    z = np.exp(1j * angle)
    a = np.exp(-rate)
    s = -np.expm1(-rate) / rate  # in h
    return np.asarray(inertia * rate / period**2 * (z - 1) * (z - a) / ((1 - s) * z + s - a))


def _unexplained(
    lines: _Lines, values: tuple[float, float, float], power: FloatArray
) -> tuple[ComplexArray, FloatArray]:
    """Weighted residual of the lines (m,) with the transients projected out, and its variance (m,)."""
    inertia, damping, delay = values
    impedance = _impedance(lines.angle, inertia, damping, lines.period)
    allowed = power + np.abs(impedance) ** 2 * lines.rounding
    weight = 1.0 / np.sqrt(allowed)
    left = (lines.torque * np.exp(-1j * lines.angle * delay) - impedance * lines.position) * weight
    z = np.exp(1j * lines.angle)
    shape = impedance / ((z - 1) * (z - np.exp(-damping * lines.period / inertia)))
    basis = (shape[:, None] * z[:, None] ** np.arange(TRANSIENTS)[None, :] - 0j) * weight[:, None]
    basis = basis / np.linalg.norm(basis[lines.excited], axis=0)
    used = lines.excited
    stacked = np.concatenate([basis[used].real, basis[used].imag])
    target = np.concatenate([left[used].real, left[used].imag])
    transient, *_ = np.linalg.lstsq(stacked, target, rcond=1e-10)
    return np.asarray(left - basis @ transient), np.asarray(allowed)


def _lines(recording: Recording, first: int, past: int) -> tuple[_Lines | None, tuple[int, int]]:
    """DFT over whole periods where the torque repeats itself, over the whole stretch otherwise."""
    torque = recording.torque[first:past] - np.mean(recording.torque[first:past])
    if torque.size < 64 or not np.any(torque):
        return None, (first, past)
    repeat = _period(torque)
    periods = torque.size // repeat if repeat else 1
    if repeat and periods >= 2:
        first = past - periods * repeat
    torque, position = recording.torque[first:past], recording.position[first:past]
    n = torque.size
    U = np.fft.rfft(torque - torque.mean())
    drift = np.linspace(0.0, position[-1] - position[0], n)
    # A line is taken off and its transform put back in closed form: rounding then matters less.
    Q = np.fft.rfft(position - position[0] - drift)
    number = np.arange(1, (n - 1) // 2)
    angle = 2 * np.pi * number / n
    Q_line = (position[-1] - position[0]) * n / (n - 1) / (np.exp(-1j * angle) - 1)
    resolution = grain(recording)
    excited = np.ones(number.size, dtype=bool)
    white = float(np.mean(np.diff(torque) ** 2)) / 2 * n
    # Where the position moves by about a count a sample, rounding is not white: its tail tells its strength.
    tail = float(np.mean(np.abs(Q[number][-number.size // 2 :]) ** 2))
    rounding = max(n * resolution**2 / 12.0, tail)
    resolved = _averaged(np.abs(Q[number]) ** 2) > RESOLVED * rounding
    if repeat and periods >= 2:
        between = np.abs(U[number][number % periods != 0]) ** 2
        floor = max(float(np.median(between)), 1e-20 * float(np.max(np.abs(U)) ** 2))
        excited = (number % periods == 0) & (np.abs(U[number]) ** 2 > EXCITED * floor)
        excited &= np.abs(Q[number]) ** 2 > RESOLVED * rounding
        white = floor
    else:
        excited = resolved
    if not np.any(excited):
        return None, (first, past)
    kept = slice(0, min(int(np.flatnonzero(excited)[-1]) + SMOOTHED, number.size))
    lines = _Lines(
        angle=angle[kept],
        torque=U[number][kept],
        position=(Q[number] + Q_line)[kept],
        rounding=rounding,
        white=white,
        period=recording.sample_period,
        excited=excited[kept],
    )
    return lines, (first, past)


def _averaged(power: FloatArray) -> FloatArray:
    """Power averaged over neighbouring lines."""
    window = np.ones(min(11, power.size))
    return np.asarray(
        np.convolve(power, window, mode="same") / np.convolve(np.ones(power.size), window, mode="same")
    )


def _period(torque: FloatArray) -> int | None:
    """Samples after which the torque repeats itself; None if it does not."""
    n = torque.size
    spectrum = np.fft.rfft(torque, 2 * n)
    correlation = np.fft.irfft(np.abs(spectrum) ** 2)[: n // 2 + 1]
    correlation = correlation / (n - np.arange(n // 2 + 1)) * n / correlation[0]
    below = np.flatnonzero(correlation < 0.5)
    if below.size == 0:
        return None
    later = correlation[below[0] :]
    best = float(np.max(later))
    if best < REPEATS:
        return None
    first = below[0] + int(np.flatnonzero(later > best - 0.05 * (1 - REPEATS) - 0.02)[0])
    near = correlation[first : first + max(4, first // 50)]
    return int(first + int(np.argmax(near)))


def _first_guess(torque: FloatArray, position: FloatArray, period: float, resolution: float) -> float | None:
    """J by least squares on Hann-windowed spectra, from the lines that the position resolves."""
    n = torque.size
    window = 0.5 - 0.5 * np.cos(2 * np.pi * np.arange(n) / n)
    time = np.linspace(-1.0, 1.0, n)
    bowed = np.polynomial.polynomial.polyval(time, np.polynomial.polynomial.polyfit(time, position, 2))
    U = np.fft.rfft(window * (torque - torque.mean()))[2 : n // 4]
    Q = np.fft.rfft(window * (position - bowed))[2 : n // 4]
    w = 2 * np.pi * np.arange(2, n // 4) / (n * period)
    resolved = np.abs(Q) ** 2 > 20.0 * 0.375 * n * resolution**2 / 12.0
    if np.count_nonzero(resolved) < 3:
        return None
    U, Q, w = U[resolved], Q[resolved], w[resolved]
    strength = np.abs(U) ** 2  # noise in U alone has no answer in Q
    inertia = -float(
        np.sum(strength * w**2 * (U * np.conj(Q)).real) / np.sum(strength * w**4 * np.abs(Q) ** 2)
    )
    return inertia if inertia > 0 else None


def _smoothed(power: FloatArray, lines: _Lines) -> FloatArray:
    """Residual power averaged over neighbouring lines: over those without excitation where there are such."""
    tells = ~lines.excited if np.count_nonzero(~lines.excited) > lines.excited.size // 4 else lines.excited
    weight = tells.astype(np.float64)
    window = np.ones(min(2 * SMOOTHED + 1, max(3, power.size // 4)))
    total = np.convolve(np.where(tells, power, 0.0), window, mode="same")
    count = np.convolve(weight, window, mode="same")
    mean = total / np.maximum(count, 1.0)
    return np.where(count > 0, np.maximum(mean, 0.0), float(np.mean(power[tells])))


def _speeds(recording: Recording, span: tuple[int, int]) -> FloatArray:
    """Speeds over windows just long enough to count [rad/s]."""
    time, position = recording.time[span[0] : span[1]], recording.position[span[0] : span[1]]
    per_sample = abs(position[-1] - position[0]) / (time.size - 1)
    wanted = 12.0 * grain(recording) / max(per_sample, float(np.finfo(np.float64).tiny))
    step = int(min(max(wanted, 4, time.size // 2000), max(time.size // 8, 1)))
    return np.asarray((position[step:] - position[:-step]) / (time[step:] - time[:-step]))
