"""The steps of one run, followed by others: what differs between the runs is then what differs between the tables.

An integrator with error control takes other steps for another table, and the local errors change with them by about the
tolerance: a difference of two runs shows that beside the parameter's change, unless the tolerance is far below what
the runs themselves need. Runs that follow the instants at which the steps of a first one ended differ smoothly. A run
whose own error is too large for them goes on with its own steps until the sample ends.

Source: the internal differentiation of H. G. Bock, Numerical treatment of inverse problems in chemical reaction
kinetics, in: Modelling of Chemical Reaction Systems (1981), 102.
"""

from __future__ import annotations

from shake_ros.core.compiled import kernel

# A row of the work array within a sample: what to do, time since its start [s], number of instants, the next, and all
MODE, ELAPSED, COUNT, NEXT, INSTANTS = range(5)
OWN, KEEP, FOLLOW = 0.0, 1.0, 2.0  # own steps; own steps, whose instants are kept; the instants that were kept
MOST = 32  # instants kept of a sample; one with more of them is not followed
FORGIVEN = 8.0  # times the tolerance, up to which a followed step is good enough
SAME = 1e-9  # [s] instants that are no two


@kernel
def begin_sample(row, kept, following):
    """Begin a sample: a run keeps its instants into `kept`, shape (1 + MOST,), later, or follows those in it."""
    row[ELAPSED] = row[COUNT] = row[NEXT] = 0.0
    row[MODE] = KEEP
    if following:
        row[COUNT] = kept[0]
        row[MODE] = FOLLOW if kept[0] <= MOST else OWN
        for i in range(min(int(kept[0]), MOST)):
            row[INSTANTS + i] = kept[1 + i]


@kernel
def end_sample(row, kept):
    """Keep the instants of a sample that has ended."""
    kept[0] = row[COUNT]
    for i in range(min(int(row[COUNT]), MOST)):
        kept[1 + i] = row[INSTANTS + i]


@kernel
def followed(row, rest):
    """Length of the next step of a run that follows [s]; `rest` : to the end of the interval."""
    k = int(row[NEXT])
    while k < row[COUNT] and row[INSTANTS + k] <= row[ELAPSED] + SAME:
        k += 1
    row[NEXT] = k
    if k == row[COUNT]:
        return rest
    size = row[INSTANTS + k] - row[ELAPSED]
    return size if size < rest - SAME else rest


@kernel
def stepped(row, step):
    """Count a step that was taken."""
    row[ELAPSED] += step
    if row[MODE] == KEEP:
        if row[COUNT] < MOST:
            row[INSTANTS + int(row[COUNT])] = row[ELAPSED]
        row[COUNT] += 1.0
