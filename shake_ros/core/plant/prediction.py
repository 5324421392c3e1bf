"""The table corrected towards its sensors, sample by sample: a predictor in innovations form, and the gains it needs.

    ŷ_k = h(ẑ_k),   e_k = y_k − ŷ_k,   ẑ_{k+1} = f(ẑ_k + K_k e_k, u_k)

y holds position and acceleration. The corrected coordinates of z are the table's states that an effect sets in motion
and the disturbances that no command determines: a force per moved mass with a memory (Ornstein–Uhlenbeck), the null
shift of the valve and the bias of the accelerometer, which drift. With K = 0 the predictor is the free run.

The gains come from a square-root Kalman filter whose derivatives are central differences over one standard deviation
in each direction, so friction that jumps within the uncertainty acts with its mean slope. Source: M. Nørgaard,
N. Poulsen, O. Ravn, New developments in state estimation for nonlinear systems, Automatica 36 (2000) 1627 (DD1).
Verified (test_prediction.py): without gains it is the free run; on a table that was simulated apart the innovations are
white and as large as the filter expects.
"""

from __future__ import annotations

import math

import numpy as np

from shake_ros.core.compiled import kernel, njit
from shake_ros.core.plant.dormand_prince import PACE, STAGE, workspace
from shake_ros.core.plant.integration import (
    acceleration_now,
    advance_sample,
    begin_sample,
    delayed,
    end_sample,
    felt,
    position_sensor,
    scaled,
)
from shake_ros.core.plant.sensors import OUTPUT, advance_filter
from shake_ros.core.plant.states import (
    BASE_RATE,
    LAGGED_POSITION,
    POSITION,
    PRESSURE_A,
    PRESSURE_B,
    VELOCITY,
)

# Coordinates that are no state of the table, behind whose indices they are counted downwards from −1
FORCE, NULL, BIAS, FILTERED, FILTER_RATE = -1, -2, -3, -4, -5
AUXILIARY = 6  # length of the array that holds them, at minus their code
LEAST_DEVIATION = 1e-12  # of a coordinate, in its unit
LARGEST_NULL = 0.3  # of the full command, up to which a null shift is corrected [-]


@kernel
def shift(p, y, aux, code, amount):
    """Move one corrected coordinate of the table, in place.

    The load pressure moves both chambers; the position moves with what its transducer shows.
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
        if code == POSITION:
            y[LAGGED_POSITION] += amount


@kernel
def coordinate(p, y, aux, code):
    """Value of one corrected coordinate."""
    if code < 0:
        return aux[-code]
    if code == PRESSURE_A:
        return 0.5 * (y[PRESSURE_A] - p.body_area_ratio * y[PRESSURE_B])
    return y[code]


@kernel
def advance_table(p, y, aux, commands, k, command_before, dt, work, tolerance, before):
    """One sample of the table under its disturbances, in place.

    before : felt acceleration at the sample's start [m/s²].

    Returns
    -------
    (felt acceleration at its end, and the mean that the anti-aliasing filter takes) [m/s²]
    """
    late, timely, fraction = delayed(commands, k, p.command_delay_delay / dt, command_before)
    force = aux[1] * (p.body_table_mass + p.body_specimen_mass)
    speed = y[VELOCITY] + y[BASE_RATE]
    null = aux[2]
    acceleration = advance_sample(p, y, late + null, timely + null, fraction, force, dt, work, False, tolerance)
    now = felt(p, y, acceleration)
    if p.accelerometer_lag_time_constant > 0.0:
        return now, 0.5 * (before + now)
    return now, (y[VELOCITY] + y[BASE_RATE] - speed) / dt


@kernel
def advance_auxiliary(aux, decay, chain, before, now, mean):
    """One sample of the random force and of the anti-aliasing filter, in place; arguments as of `advance_table`."""
    if chain.shape[0] > 0:
        advance_filter(chain, aux[4:6], before, now, mean)
    aux[1] *= decay


@kernel
def advance_all(p, y, aux, commands, k, command_before, decay, dt, work, tolerance, chain, before):
    """One sample of the table with its disturbances, in place; returns the felt acceleration at its end [m/s²]."""
    now, mean = advance_table(p, y, aux, commands, k, command_before, dt, work, tolerance, before)
    advance_auxiliary(aux, decay, chain, before, now, mean)
    return now


@kernel
def shown(p, y, aux, now, chain, row):
    """What the sensors show at an instant: position [m] and acceleration [m/s²], into `row`."""
    row[0] = position_sensor(p, y)
    row[1] = scaled(p, aux[4 + OUTPUT] if chain.shape[0] > 0 else now) + aux[3]


@njit
def predict(p, commands, command_before, measured, codes, gains, y0, decay, dt, tolerance, chain, pace, following, out):
    """Predicted position and acceleration of each sample from all that was measured before it.

    Parameters
    ----------
    p : parameter record. commands : shape (n,) [-]. command_before : before the first one [-].
    measured : position [m] and acceleration [m/s²], shape (n, 2); NaN where not measured.
    codes : corrected coordinates, shape (s,). gains : K of every sample, shape (n, s, 2).
    y0 : state at the first sample. decay : of the random force over a sample [-]. dt : [s].
    tolerance, chain, pace, following : as in `simulate`.
    out : innovations, shape (n, 2); 0 where nothing was measured.
    """
    y, aux, row = y0.copy(), np.zeros(AUXILIARY), np.zeros(2)
    work = workspace()
    pacing = pace.shape[0] > 0
    now = felt(p, y, acceleration_now(p, y, work[STAGE]))
    aux[4 + OUTPUT] = now
    for i in range(commands.shape[0]):
        shown(p, y, aux, now, chain, row)
        for c in range(2):
            e = measured[i, c] - row[c]
            out[i, c] = e if math.isfinite(measured[i, c]) else 0.0
        for j in range(codes.shape[0]):
            shift(p, y, aux, codes[j], gains[i, j, 0] * out[i, 0] + gains[i, j, 1] * out[i, 1])
        if pacing:
            begin_sample(work[PACE], pace[i], following)
        now = advance_all(p, y, aux, commands, i, command_before, decay, dt, work, tolerance, chain, now)
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
def whitener(s_11, s_21, s_22, has_x, has_a):
    """w_11, w_21, w_22 of the lower factor W with W S Wᵀ = 1; 0 where nothing was measured."""
    w_11 = 1.0 / math.sqrt(s_11) if has_x else 0.0
    w_21 = w_22 = 0.0
    if has_a:
        w_22 = 1.0 / math.sqrt(max(s_22 - (s_21 * s_21 / s_11 if has_x else 0.0), 1e-30))
        w_21 = -s_21 / s_11 * w_22 if has_x else 0.0
    return w_11, w_21, w_22


@kernel
def correct(cov, cross, s_11, s_21, s_22, w_11, w_21, w_22, process, gain):
    """The gain K = C S⁻¹ = C Wᵀ W into `gain`, and the covariance after the correction and a sample's noise in place.

    Parameters
    ----------
    cov : covariance of the coordinates, shape (s, s). cross : C, that with the innovations, shape (s, 2).
    s_11, s_21, s_22 : S, covariance of the innovations. w_11, w_21, w_22 : W.
    process : standard deviation that each coordinate gains over a sample, shape (s,). gain : result, shape (s, 2).
    """
    for j in range(cov.shape[0]):
        b_x, b_a = cross[j, 0] * w_11, cross[j, 0] * w_21 + cross[j, 1] * w_22
        gain[j, 0], gain[j, 1] = b_x * w_11 + b_a * w_21, b_a * w_22
        for k in range(j + 1):
            taken = gain[j, 0] * (s_11 * gain[k, 0] + s_21 * gain[k, 1])
            taken += gain[j, 1] * (s_21 * gain[k, 0] + s_22 * gain[k, 1])
            cov[j, k] -= taken
            cov[k, j] = cov[j, k]
        cov[j, j] = max(cov[j, j], 0.0) + process[j] ** 2


@kernel
def by_coordinates(change, sensor_change, lower, transition, sensing):
    """Derivatives by the coordinates from those along the columns of a factor: F = D L⁻¹, from the last column on.

    Parameters
    ----------
    change, sensor_change : of the coordinates and the sensors along each column of L, shapes (s, s) and (s, 2).
    lower : L, shape (s, s). transition, sensing : results, shapes (s, s) and (s, 2).
    """
    n = lower.shape[0]
    for j in range(n - 1, -1, -1):
        for k in range(n):
            value = change[k, j]
            for m in range(j + 1, n):
                value -= transition[k, m] * lower[m, j]
            transition[k, j] = value / lower[j, j]
        for c in range(2):
            value = sensor_change[j, c]
            for m in range(j + 1, n):
                value -= sensing[m, c] * lower[m, j]
            sensing[j, c] = value / lower[j, j]


@kernel
def foreseen(change, sensor_change, sensor, cov, cross):
    """Covariance at the next sample, of the coordinates and with the innovations, into `cov` and `cross`.

    Parameters
    ----------
    change, sensor_change : as of `by_coordinates`. sensor : standard deviations of the sensors' noise, shape (2,).
    cov, cross : results, shapes (s, s) and (s, 2).

    Returns
    -------
    (s_11, s_21, s_22), the covariance of the innovations
    """
    s = cov.shape[0]
    s_11, s_21, s_22 = sensor[0] ** 2, 0.0, sensor[1] ** 2
    for j in range(s):
        s_11 += sensor_change[j, 0] ** 2
        s_21 += sensor_change[j, 0] * sensor_change[j, 1]
        s_22 += sensor_change[j, 1] ** 2
    for j in range(s):
        cross[j, 0] = cross[j, 1] = 0.0
        for m in range(s):
            cross[j, 0] += change[j, m] * sensor_change[m, 0]
            cross[j, 1] += change[j, m] * sensor_change[m, 1]
        for k in range(j + 1):
            value = 0.0
            for m in range(s):
                value += change[j, m] * change[k, m]
            cov[j, k] = value
            cov[k, j] = value
    return s_11, s_21, s_22


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
    chain,
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
    sensor : standard deviation of the noise of position [m] and acceleration [m/s²], shape (2,).
    gains, out : as in `predict`, results here.
    whitening : result, shape (n, 3): w_11, w_21, w_22 of the lower factor W with W S Wᵀ = 1, S the covariance of the
        innovations; 0 where nothing was measured.
    transition, sensing : results, shape (n, s, s) and (n, s, 2): derivatives of the coordinates and of what the sensors
        show at the next sample by the corrected coordinates of this one.

    Returns
    -------
    The path of the coordinates after each correction, shape (n, s).
    """
    n, s = commands.shape[0], codes.shape[0]
    y, aux, row = y0.copy(), np.zeros(AUXILIARY), np.zeros(2)
    work = workspace()
    tried, tried_aux = y0.copy(), np.zeros(AUXILIARY)
    begun, begun_aux = y0.copy(), np.zeros(AUXILIARY)
    cov, lower = np.zeros((s, s)), np.zeros((s, s))
    state_change, sensor_change = np.zeros((s, s)), np.zeros((s, 2))
    cross, path = np.zeros((s, 2)), np.zeros((n, s))
    for j in range(s):
        cov[j, j] = first[j] ** 2
    now = felt(p, y, acceleration_now(p, y, work[STAGE]))
    aux[4 + OUTPUT] = now
    s_11, s_21, s_22 = sensor[0] ** 2, 0.0, sensor[1] ** 2 + (0.5 * abs(now)) ** 2
    for i in range(n):
        shown(p, y, aux, now, chain, row)
        has_x, has_a = math.isfinite(measured[i, 0]), math.isfinite(measured[i, 1])
        e_x = measured[i, 0] - row[0] if has_x else 0.0
        e_a = measured[i, 1] - row[1] if has_a else 0.0
        out[i, 0], out[i, 1] = e_x, e_a
        w_11, w_21, w_22 = whitener(s_11, s_21, s_22, has_x, has_a)
        whitening[i, 0], whitening[i, 1], whitening[i, 2] = w_11, w_21, w_22
        correct(cov, cross, s_11, s_21, s_22, w_11, w_21, w_22, process[int(i >= found_by)], gains[i])
        for j in range(s):
            shift(p, y, aux, codes[j], gains[i, j, 0] * e_x + gains[i, j, 1] * e_a)
        for j in range(s):
            path[i, j] = coordinate(p, y, aux, codes[j])
        factor(cov, s, lower)
        begun[:], begun_aux[:] = y, aux
        after, mean = advance_table(p, y, aux, commands, i, command_before, dt, work, tolerance, now)
        advance_auxiliary(aux, decay, chain, now, after, mean)
        for j in range(s):
            apart = codes[j] > BIAS  # the others, which stand last, do not move the table
            for sign in (1.0, -1.0):
                for k in range(y.shape[0]):
                    tried[k] = begun[k] if apart else y[k]
                for k in range(AUXILIARY):
                    tried_aux[k] = begun_aux[k]
                for k in range(j, s):
                    shift(p, tried, tried_aux, codes[k], sign * lower[k, j])
                there, its_mean = after, mean
                if apart:
                    there, its_mean = advance_table(
                        p, tried, tried_aux, commands, i, command_before, dt, work, tolerance, now
                    )
                advance_auxiliary(tried_aux, decay, chain, now, there, its_mean)
                shown(p, tried, tried_aux, there, chain, row)
                for k in range(s):
                    value = 0.5 * sign * coordinate(p, tried, tried_aux, codes[k])
                    state_change[k, j] = value if sign > 0.0 else state_change[k, j] + value
                for c in range(2):
                    value = 0.5 * sign * row[c]
                    sensor_change[j, c] = value if sign > 0.0 else sensor_change[j, c] + value
        now = after
        by_coordinates(state_change, sensor_change, lower, transition[i], sensing[i])
        s_11, s_21, s_22 = foreseen(state_change, sensor_change, sensor, cov, cross)
        if not (math.isfinite(now) and math.isfinite(s_11) and math.isfinite(s_22)):
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
    n, s = gains.shape[0], gains.shape[1]
    found = np.zeros((n - start - 1) // block + 1)
    cov, other, cross = np.zeros((s, s)), np.zeros((s, s)), np.zeros((s, 2))
    gain, moved, corrected = np.zeros((s, 2)), np.zeros(s), np.zeros(s)
    for j in range(s):
        cov[j, j] = first[j] ** 2
    s_11, s_21, s_22 = sensor[0] ** 2, 0.0, 1e6
    shift_x = shift_a = 0.0
    for i in range(n):
        has_x, has_a = math.isfinite(measured[i, 0]), math.isfinite(measured[i, 1])
        e_x = innovations[i, 0] - shift_x if has_x else 0.0
        e_a = innovations[i, 1] - shift_a if has_a else 0.0
        w_11, w_21, w_22 = whitener(s_11, s_21, s_22, has_x, has_a)
        if i >= start:
            a, b = w_11 * e_x, w_21 * e_x + w_22 * e_a
            value = -0.5 * (a * a + b * b)
            if has_x:
                value += math.log(w_11)
            if has_a:
                value += math.log(w_22)
            found[(i - start) // block] += value
        correct(cov, cross, s_11, s_21, s_22, w_11, w_21, w_22, process[int(i >= found_by)], gain)
        for j in range(s):
            corrected[j] = moved[j] + gain[j, 0] * e_x + gain[j, 1] * e_a
            corrected[j] -= gains[i, j, 0] * innovations[i, 0] + gains[i, j, 1] * innovations[i, 1]
        shift_x = shift_a = 0.0
        for j in range(s):
            shift_x += sensing[i, j, 0] * corrected[j]
            shift_a += sensing[i, j, 1] * corrected[j]
            moved[j] = 0.0
            for m in range(s):
                moved[j] += transition[i, j, m] * corrected[m]
                value = 0.0
                for k in range(s):
                    value += transition[i, j, k] * cov[k, m]
                other[j, m] = value
        s_11, s_21, s_22 = sensor[0] ** 2, 0.0, sensor[1] ** 2
        for j in range(s):
            x_row = a_row = 0.0
            for k in range(s):
                x_row += cov[j, k] * sensing[i, k, 0]
                a_row += cov[j, k] * sensing[i, k, 1]
            s_11 += sensing[i, j, 0] * x_row
            s_21 += sensing[i, j, 0] * a_row
            s_22 += sensing[i, j, 1] * a_row
        for j in range(s):
            cross[j, 0] = cross[j, 1] = 0.0
            for k in range(s):
                cross[j, 0] += other[j, k] * sensing[i, k, 0]
                cross[j, 1] += other[j, k] * sensing[i, k, 1]
        for j in range(s):
            for m in range(j + 1):
                value = 0.0
                for k in range(s):
                    value += other[j, k] * transition[i, m, k]
                cov[j, m] = value
                cov[m, j] = value
    return found
