"""The table corrected towards its sensors, sample by sample: a predictor in innovations form, and the gains it needs.

    ŷ_k = h(ẑ_k),   e_k = y_k − ŷ_k,   ẑ_{k+1} = f(ẑ_k + K_k e_k, u_k)

y holds position and acceleration, and the load pressure where it was measured. The corrected coordinates of z are the
table's states that an effect sets in motion and the disturbances that no command determines: a force per moved mass
with a memory (Ornstein–Uhlenbeck), the null shift of the valve and the bias of the accelerometer, which drift, and the
offset of the pressure. With K = 0 the predictor is the free run.

The gains come from a square-root Kalman filter whose derivatives are central differences over one standard deviation
in each direction, so friction that jumps within the uncertainty acts with its mean slope. Source: M. Nørgaard,
N. Poulsen, O. Ravn, New developments in state estimation for nonlinear systems, Automatica 36 (2000) 1627 (DD1).
Verified (test_prediction.py): without gains it is the free run; on a table that was simulated apart the innovations are
white and as large as the filter expects.
"""

from __future__ import annotations

import math

import numpy as np

from shake_ros.compiled import kernel, njit
from shake_ros.physics.plant.dormand_prince import FILTER, PACE, STAGE, workspace
from shake_ros.physics.plant.integration import (
    acceleration_now,
    advance_sample,
    begin_sample,
    delayed,
    end_sample,
    felt,
    position_sensor,
    scaled,
)
from shake_ros.physics.plant.sensors import FILTER_DAMPING, OMEGA, OUTPUT, RATE, begin_filter
from shake_ros.physics.plant.states import PRESSURE_A, PRESSURE_B
from shake_ros.physics.valve.simplified import motion_weights

# Coordinates that are no state of the table, behind whose indices they are counted downwards from −1
FORCE, NULL, BIAS, FILTERED, FILTER_RATE, PRESSURE_OFFSET = -1, -2, -3, -4, -5, -6
AUXILIARY = 7  # length of the array that holds them, at minus their code
LEAST_DEVIATION = 1e-12  # of a coordinate, in its unit
LARGEST_NULL = 0.3  # of the full command, up to which a null shift is corrected [-]


@kernel
def shift(p, y, aux, code, amount):
    """Move one corrected coordinate of the table, in place.

    The load pressure moves both chambers.
    """
    if code < 0:
        aux[-code] += amount
        if code == NULL:
            aux[2] = min(max(aux[2], -LARGEST_NULL), LARGEST_NULL)
    elif code == PRESSURE_A:
        y[PRESSURE_A] = max(y[PRESSURE_A] + amount, min(y[PRESSURE_A], 0.0))
        y[PRESSURE_B] = max(y[PRESSURE_B] - amount / p.body_area_ratio, min(y[PRESSURE_B], 0.0))
    else:
        y[code] += amount


@kernel
def coordinate(p, y, aux, code):
    """Value of one corrected coordinate."""
    if code < 0:
        return aux[-code]
    if code == PRESSURE_A:
        return 0.5 * (y[PRESSURE_A] - p.body_area_ratio * y[PRESSURE_B])
    return y[code]


@kernel
def advance_table(p, y, aux, commands, k, command_before, dt, work, tolerance, decay):
    """One sample of the table, its random force and the filter behind its accelerometer, in place.

    Returns the felt acceleration at its end [m/s²].
    """
    late, timely, fraction = delayed(commands, k, p.command_delay_delay / dt, command_before)
    force, null = aux[1] * (p.body_table_mass + p.body_specimen_mass), aux[2]
    work[FILTER, OUTPUT], work[FILTER, RATE] = aux[4], aux[5]
    acceleration = advance_sample(p, y, late + null, timely + null, fraction, force, dt, work, False, tolerance)
    aux[4], aux[5] = work[FILTER, OUTPUT], work[FILTER, RATE]
    aux[1] *= decay
    return felt(p, y, acceleration)


@kernel
def beside_table(aux, moved, begun, decay, omega, weights):
    """One sample of coordinates `moved` from where they begun, none of which moves the table, in place.

    aux : of the table a sample later. weights : of the filter's free motion over a sample, see `motion_weights`.
    """
    a, b, c = weights
    output, rate = moved[4] - begun[4], moved[5] - begun[5]
    moved[4] = aux[4] + a * output + b * rate
    moved[5] = aux[5] - omega * omega * b * output + c * rate
    moved[1] *= decay


@kernel
def shown(p, y, aux, now, cutoff, scale, row):
    """What the sensors show at an instant, into `row`: position [m], acceleration [m/s²] and load pressure [Pa].

    scale : of a pressure shown, over that of the table [-].
    """
    row[0] = position_sensor(p, y)
    row[1] = scaled(p, aux[4] if cutoff > 0.0 else now) + aux[3]
    if row.shape[0] > 2:
        row[2] = scale * (y[PRESSURE_A] - y[PRESSURE_B]) + aux[6]


@kernel
def innovate(p, y, aux, now, cutoff, scale, measured, row, out):
    """The innovations of a sample into `out`, shape (m,), 0 where nothing was measured; `row` as of `shown`."""
    shown(p, y, aux, now, cutoff, scale, row)
    for c in range(row.shape[0]):
        out[c] = measured[c] - row[c] if math.isfinite(measured[c]) else 0.0


@kernel
def corrected_by(p, y, aux, codes, gain, innovations):
    """Move the corrected coordinates by K e, in place."""
    for j in range(codes.shape[0]):
        amount = 0.0
        for c in range(innovations.shape[0]):
            amount += gain[j, c] * innovations[c]
        shift(p, y, aux, codes[j], amount)


@njit
def predict(
    p, commands, command_before, measured, codes, gains, y0, decay, dt, tolerance, cutoff, scale, pace, following, out
):
    """Predicted signals of each sample from all that was measured before it.

    Parameters
    ----------
    p : parameter record. commands : shape (n,) [-]. command_before : before the first one [-].
    measured : position [m], acceleration [m/s²] and perhaps load pressure [Pa], shape (n, m); NaN where not measured.
    codes : corrected coordinates, shape (s,). gains : K of every sample, shape (n, s, m).
    y0 : state at the first sample. decay : of the random force over a sample [-]. dt : [s].
    scale : as of `shown`. tolerance, cutoff, pace, following : as in `simulate`.
    out : innovations, shape (n, m); 0 where nothing was measured.
    """
    y, aux, row = y0.copy(), np.zeros(AUXILIARY), np.zeros(measured.shape[1])
    work = workspace()
    pacing = pace.shape[0] > 0
    now = felt(p, y, acceleration_now(p, y, work[STAGE]))
    begin_filter(work[FILTER], cutoff, now)
    aux[4] = now
    for i in range(commands.shape[0]):
        innovate(p, y, aux, now, cutoff, scale, measured[i], row, out[i])
        corrected_by(p, y, aux, codes, gains[i], out[i])
        if pacing:
            begin_sample(work[PACE], pace[i], following)
        now = advance_table(p, y, aux, commands, i, command_before, dt, work, tolerance, decay)
        if pacing and not following:
            end_sample(work[PACE], pace[i])
        if not math.isfinite(now):
            out[i:] = math.nan
            return


@kernel
def factor(a, n, lower):
    """Cholesky factor of a symmetric matrix, its pivots not below nothing, into `lower`."""
    for i in range(n):
        for j in range(i + 1):
            s = a[i, j]
            for k in range(j):
                s -= lower[i, k] * lower[j, k]
            if i == j:
                lower[i, i] = math.sqrt(max(s, LEAST_DEVIATION**2))
            else:
                lower[i, j] = s / lower[j, j]


@kernel
def whitener(cov, measured, white):
    """The lower factor W with W S Wᵀ = 1 into `white`; rows of what was not measured are 0.

    cov : S, shape (m, m). measured : of the sample, shape (m,), NaN where it was not.
    """
    for i in range(cov.shape[0]):
        for k in range(cov.shape[0]):
            white[i, k] = 0.0
        if not math.isfinite(measured[i]):
            continue
        variance = cov[i, i]
        for j in range(i):
            along = 0.0
            for k in range(j + 1):
                along += white[j, k] * cov[k, i]
            variance -= along * along
            for k in range(j + 1):
                white[i, k] -= along * white[j, k]
        white[i, i] = 1.0
        for k in range(i + 1):
            white[i, k] /= math.sqrt(max(variance, 1e-30))


@kernel
def product(a, b, out):
    """The matrix a b into `out`: BLAS takes four times as long for so small ones."""
    for i in range(a.shape[0]):
        for j in range(b.shape[1]):
            value = 0.0
            for k in range(a.shape[1]):
                value += a[i, k] * b[k, j]
            out[i, j] = value


@kernel
def correct(cov, cross, white, process, whitened, gain):
    """The gain K = C S⁻¹ = C Wᵀ W into `gain`, and the covariance after the correction and a sample's noise in place.

    Parameters
    ----------
    cov : covariance of the coordinates, shape (s, s). cross : C, that with the innovations, shape (s, m).
    white : W. process : standard deviation that each coordinate gains over a sample, shape (s,).
    whitened, gain : results C Wᵀ and K, shape (s, m).
    """
    product(cross, white.T, whitened)
    product(whitened, white, gain)
    for j in range(cov.shape[0]):
        for k in range(cov.shape[0]):
            for c in range(white.shape[0]):
                cov[j, k] -= whitened[j, c] * whitened[k, c]
        cov[j, j] = max(cov[j, j], 0.0) + process[j] ** 2


@kernel
def by_coordinates(change, sensor_change, lower, transition, sensing):
    """Derivatives by the coordinates from those along the columns of a factor: F = D L⁻¹, from the last column on.

    Parameters
    ----------
    change, sensor_change : of the coordinates and the sensors along each column of L, shapes (s, s) and (s, m).
    lower : L, shape (s, s). transition, sensing : results, shapes (s, s) and (s, m).
    """
    n = lower.shape[0]
    for j in range(n - 1, -1, -1):
        for k in range(n):
            value = change[k, j]
            for m in range(j + 1, n):
                value -= transition[k, m] * lower[m, j]
            transition[k, j] = value / lower[j, j]
        for c in range(sensing.shape[1]):
            value = sensor_change[j, c]
            for m in range(j + 1, n):
                value -= sensing[m, c] * lower[m, j]
            sensing[j, c] = value / lower[j, j]


@njit
def kalman(
    p,
    commands,
    command_before,
    measured,
    codes,
    first,
    process,
    sensor,
    found_by,
    y0,
    decay,
    dt,
    tolerance,
    cutoff,
    scale,
    gains,
    whitening,
    out,
    transition,
    sensing,
):
    """The same predictor with its own gains: square-root Kalman filter with central differences.

    Parameters
    ----------
    first : standard deviation of each coordinate at the first sample, shape (s,).
    process : standard deviation that each coordinate gains over a sample, shape (2, s): before the sample `found_by`,
        while the state is found, and from it on.
    sensor : standard deviation of the noise of each signal measured, shape (m,).
    gains, out : as in `predict`, results here.
    whitening : result, shape (n, m, m): the lower factor W with W S Wᵀ = 1, S the covariance of the innovations; rows
        of what was not measured are 0.
    transition, sensing : results, shape (n, s, s) and (n, s, m): derivatives of the coordinates and of what the sensors
        show at the next sample by the corrected coordinates of this one.

    Returns
    -------
    The path of the coordinates after each correction, shape (n, s).
    """
    n, s, channels = commands.shape[0], codes.shape[0], measured.shape[1]
    y, aux, row = y0.copy(), np.zeros(AUXILIARY), np.zeros(channels)
    work = workspace()
    tried, tried_aux = y0.copy(), np.zeros(AUXILIARY)
    begun, begun_aux = y0.copy(), np.zeros(AUXILIARY)
    cov, lower, cross, whitened = np.diag(first**2), np.zeros((s, s)), np.zeros((s, channels)), np.zeros((s, channels))
    state_change, sensor_change, path = np.zeros((s, s)), np.zeros((s, channels)), np.zeros((n, s))
    now = felt(p, y, acceleration_now(p, y, work[STAGE]))
    begin_filter(work[FILTER], cutoff, now)
    aux[4] = now
    omega = work[FILTER, OMEGA]
    weights = motion_weights(omega, FILTER_DAMPING, dt)
    innovation = np.diag(sensor**2)
    innovation[1, 1] += (0.5 * abs(now)) ** 2
    for i in range(n):
        innovate(p, y, aux, now, cutoff, scale, measured[i], row, out[i])
        whitener(innovation, measured[i], whitening[i])
        correct(cov, cross, whitening[i], process[int(i >= found_by)], whitened, gains[i])
        corrected_by(p, y, aux, codes, gains[i], out[i])
        for j in range(s):
            path[i, j] = coordinate(p, y, aux, codes[j])
        factor(cov, s, lower)
        begun[:], begun_aux[:] = y, aux
        now = advance_table(p, y, aux, commands, i, command_before, dt, work, tolerance, decay)
        for j in range(s):
            apart = codes[j] > BIAS  # the others, which stand last, do not move the table
            for sign in (1.0, -1.0):
                for k in range(y.shape[0]):
                    tried[k] = begun[k] if apart else y[k]
                for k in range(AUXILIARY):
                    tried_aux[k] = begun_aux[k]
                for k in range(j, s):
                    shift(p, tried, tried_aux, codes[k], sign * lower[k, j])
                there = now
                if apart:
                    there = advance_table(p, tried, tried_aux, commands, i, command_before, dt, work, tolerance, decay)
                else:
                    beside_table(aux, tried_aux, begun_aux, decay, omega, weights)
                shown(p, tried, tried_aux, there, cutoff, scale, row)
                for k in range(s):
                    value = 0.5 * sign * coordinate(p, tried, tried_aux, codes[k])
                    state_change[k, j] = value if sign > 0.0 else state_change[k, j] + value
                for c in range(channels):
                    value = 0.5 * sign * row[c]
                    sensor_change[j, c] = value if sign > 0.0 else sensor_change[j, c] + value
        by_coordinates(state_change, sensor_change, lower, transition[i], sensing[i])
        product(state_change, state_change.T, cov)
        product(state_change, sensor_change, cross)
        product(sensor_change.T, sensor_change, innovation)
        for c in range(channels):
            innovation[c, c] += sensor[c] ** 2
        finite = math.isfinite(now)
        for c in range(channels):
            finite = finite and math.isfinite(innovation[c, c])
        if not finite:
            out[i:] = math.nan
            break
    return path


@njit
def relevelled(measured, gains, innovations, transition, sensing, first, process, sensor, found_by, start, block):
    """Log likelihood of the same path at other levels of noise, to first order, by block of samples [nats].

    The filter is run again on the derivatives of a run of `kalman`; the path's change with the gains follows them.

    Parameters
    ----------
    measured, gains, innovations, transition, sensing : of that run. first, process, sensor, found_by : as
        of `kalman`, at the other levels. start : first sample that counts. block : samples of a block.
    """
    n, s, channels = gains.shape
    found = np.zeros((n - start - 1) // block + 1)
    cov, other, innovation = np.diag(first**2), np.zeros((s, s)), np.diag(sensor**2)
    cross, whitened = np.zeros((s, channels)), np.zeros((s, channels))
    gain, along, white = np.zeros((s, channels)), np.zeros((s, channels)), np.zeros((channels, channels))
    corrected, moved, before = np.zeros((s, 1)), np.zeros((s, 1)), np.zeros((s, 1))
    error, shifted, normal = np.zeros((channels, 1)), np.zeros((channels, 1)), np.zeros((channels, 1))
    innovation[1, 1] = 1e6
    for i in range(n):
        for c in range(channels):
            error[c, 0] = innovations[i, c] - shifted[c, 0] if math.isfinite(measured[i, c]) else 0.0
        whitener(innovation, measured[i], white)
        product(white, error, normal)
        if i >= start:
            for c in range(channels):
                found[(i - start) // block] -= 0.5 * normal[c, 0] ** 2
                if white[c, c] > 0.0:
                    found[(i - start) // block] += math.log(white[c, c])
        correct(cov, cross, white, process[int(i >= found_by)], whitened, gain)
        product(gain, error, corrected)
        product(gains[i], innovations[i : i + 1].T, before)
        for j in range(s):
            corrected[j, 0] += moved[j, 0] - before[j, 0]
        f, h = transition[i], sensing[i]
        product(h.T, corrected, shifted)
        product(f, corrected, moved)
        product(cov, h, along)
        product(f, along, cross)
        product(h.T, along, innovation)
        for c in range(channels):
            innovation[c, c] += sensor[c] ** 2
        product(cov, f.T, other)
        product(f, other, cov)
    return found
