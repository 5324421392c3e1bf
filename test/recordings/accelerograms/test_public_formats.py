"""A hundred accelerograms in the formats of the networks, each written here, read back, and asked which component."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from shake_ros.quantities import ShakeError
from shake_ros.recordings.accelerograms import read_accelerogram

G = 9.80665
COUNT = 203  # no whole number of lines in any format
LABELS = ("90", "Up", "360")


class Sample(NamedTuple):
    """A file, the accelerations in it [m/s²], shape (components, n), the step [s], and how the numbers are rounded."""

    text: str
    values: np.ndarray
    step: float
    rounding: float


def motion(components: int, step: float) -> np.ndarray:
    """Peaks of 0.9, 1.7 and 2.5 m/s², shape (components, COUNT)."""
    time = np.arange(COUNT) * step
    window = np.hanning(COUNT + 2)[1:-1]
    return np.array([(0.9 + 0.8 * k) * window * np.sin(2.0 * np.pi * (1.3 + k) * time) for k in range(components)])


def lines(values: Sequence[float], form: Callable[[float], str], per_line: int) -> list[str]:
    return ["".join(map(form, values[i : i + per_line])) for i in range(0, len(values), per_line)]


def dotted(width: int, digits: int) -> Callable[[float], str]:
    """A Fortran number without the zero before the point, as CSMIP writes it."""

    def form(value: float) -> str:
        text = f"{value:.{digits}f}".replace("0.", ".", 1) if abs(value) < 1 else f"{value:.{digits}f}"
        return text[:width].rjust(width)

    return form


def csmip_v2(unit_line: str, digits: int, size: float, components: int, step: float) -> Sample:
    values, out = motion(components, step), []
    for k, a in enumerate(values):
        head = [
            f"Corrected accelerogram   99999-X0001-00000.00       Chan  {k + 1}: {LABELS[k]:>4} from",
            "Uncorrected Accelerogram Data             Processed: 01/01/20, XXX",
        ]
        head += ["Record of Wed Jan  1, 2020"] * 3 + [
            "Station No. 99999   37.000N, 122.000W",
            "Sampletown - Main & First",
            f"Chan  {k + 1}: {LABELS[k]}",
        ]
        head += (
            ["text"] * 9
            + [f"Peak acceleration = {100 * np.max(np.abs(a)):9.3f}    cm/sec/sec  at     1.000   sec."]
            + ["text"] * 7
        )
        out += head + ["    0" * 16] * 6 + ["    0" * 4] + ["      .000" * 8] * 12 + ["      .000" * 4]
        for name, data, unit in (
            ("accel", a / size, unit_line),
            ("veloc", a, ", in cm/sec. (8f10.6)"),
            ("displ", a, ", in cm. (8f10.6)"),
        ):
            out.append(
                f"{COUNT:6d} points of {name} data equally spaced at  {step:.3f}".replace(" 0.", " .") + f" sec{unit}"
            )
            out += lines(data, dotted(10, digits), 8)
        out.append(f"/&  ---------- End of data for channel  {k + 1} ----------")
    return Sample("\n".join(out) + "\n", values, step, size * max(10.0**-digits, 2e-5))  # -123.456789 is cut


def csmip_v1(kind: str, components: int) -> Sample:
    step, out = 0.005, []
    values = motion(components, step)
    for k, a in enumerate(values):
        out += [
            "Uncorrected Accelerogram Data             Processed: 02/13/12, CGS",
            *["Record"] * 3,
            "Station No. 99999",
            "Sampletown",
            f"Chan  {k + 1}: {LABELS[k]} Deg",
            *["text"] * 3,
        ]
        unit = "g/10" if kind.startswith("pairs") else "g"
        out += [
            f"No. of Points =  {COUNT}  Record Length = 1.000 sec",
            f"Units of uncor data are sec and {unit} .      Max  =   .079 g , at  30.590 sec.",
            "RMS",
        ]
        out += ["    0" * 16] * 6 + ["    0" * 4] + ["      .000" * 8] * 6 + ["      .000" * 2]
        if kind.startswith("pairs"):
            time = np.round(np.arange(COUNT) * step, 3)
            pairs = np.column_stack([time, a / G * 10.0]).ravel()
            out += lines(pairs, dotted(7, 3), 10)
        else:
            out.append(f" {COUNT} Accelerogram points at 200 pts/sec in units of g .      Format: (8f9.6)  ")
            out += lines(a / G, dotted(9, 6), 8)
        out.append("/&  ----- End of data -----")
    return Sample("\n".join(out) + "\n", values, step, G * (1e-4 if kind.startswith("pairs") else 1e-6))


def cosmos(unit: str, size: float, form: str, components: int, step: float) -> Sample:
    per_line, width, digits = int(form[1]), int(form[3:].split(".")[0]), int(form.split(".")[1].rstrip(")"))
    kind = "E" if "e" in form else "f"
    values, out = motion(components, step), []
    for k, a in enumerate(values):
        out += [
            "Corrected acceleration   (Format v01.20 with 13 text lines) Src: 052md",
            *["text"] * 3,
            "Statn No: 05-  99999  Code:CE-99999  Sampletown",
            *["text"] * 2,
            f"Sta Chan  {k + 1}: {LABELS[k]} deg",
        ]
        out += (
            ["text"] * 5 + [" 100 Integer-header values follow on  10 lines, Format= (10I8)"] + ["       0" * 10] * 10
        )
        reals = [-999.0] * 100
        reals[61], reals[62], reals[63] = 1000.0 * step, COUNT * step, np.max(np.abs(a)) / size
        out += [
            " 100 Real-header values follow on  17 lines, Format= (6F13.6)",
            *lines(reals, lambda v: f"{v:13.6f}", 6),
        ]
        out += [
            '   1 Comment line(s) follow, each starting with a "|":',
            "| nothing",
            f"{COUNT:8d} acceleration pts, approx  1 secs, units={unit}, Format={form}",
        ]
        out += [*lines(a / size, lambda v: f"{v:{width}.{digits}{kind}}", per_line), "End-of-data for acceleration"]
    return Sample(
        "\n".join(out) + "\n",
        values,
        step,
        size * (10.0**-digits if kind == "f" else 1e-5 * np.max(np.abs(values)) / size),
    )


def smc(digits: int, comments: int, volume: int) -> Sample:
    step, (a,) = 0.005, motion(1, 0.005)
    integers, reals = np.full(48, -32768), np.full(50, 1.7e38)
    integers[15], integers[16], reals[1] = comments, COUNT, 1.0 / step
    reals[29], reals[31] = 100 * a.max(), 100 * a.min()
    out = [
        f"{volume} {'UN' if volume == 1 else ''}CORRECTED ACCELEROGRAM",
        *["*"] * 4,
        "station = Sampletown                       component= 90",
        *["*"] * 5,
    ]
    out += lines(integers.tolist(), lambda v: f"{v:10d}", 8) + lines(reals.tolist(), lambda v: f"{v:15.7E}", 5)
    out += ["|a comment"] * comments

    def short(value: float) -> str:
        return f"{value:10.3E}".replace("E-0", "E-").replace("E+0", "E+").rjust(10)

    out += lines(100 * a, short, 8) if digits == 4 else lines(100 * a, lambda v: f"{v:14.7E}", 5)
    return Sample("\r\n".join(out) + "\r\n", a[None], step, 2.5 * 10.0 ** -(digits - 1))


def at2(style: str, per_line: int) -> Sample:
    step, (a,) = 0.005, motion(1, 0.005)
    head = [
        "PEER NGA STRONG MOTION DATABASE RECORD",
        "Sampletown, 1/1/2020, Main Street, 90",
        "ACCELERATION TIME SERIES IN UNITS OF G",
        style.format(n=COUNT, dt=".0050"),
    ]
    return Sample("\n".join([*head, *lines(a / G, lambda v: f"{v:15.7E}", per_line)]) + "\n", a[None], step, 1e-6)


def listed(head: str, columns: int = 1, size: float = G) -> Sample:
    step, (a,) = 0.01, motion(1, 0.01)
    if columns == 2:
        body = [f"{k * step:.2f} {v:.8f}" for k, v in enumerate(a / size)]
    else:
        body = lines(a / size, lambda v: f" {v:.8f}", columns)
    return Sample(
        head.format(n=COUNT, dt="0.01", end=(COUNT - 1) * step) + "\n".join(body) + "\n", a[None], step, size * 1e-8
    )


def knet(direction: str, offset: int) -> Sample:
    step, (a,) = 0.01, motion(1, 0.01)
    scale = 3920.0 / 6182761  # gal
    counts = np.round(100 * a / scale).astype(int) + offset
    fields = {
        "Origin Time": "2020/01/01 00:00:00",
        "Lat.": "37.0",
        "Long.": "142.0",
        "Depth. (km)": "10",
        "Mag.": "6.0",
        "Station Code": "ABC001",
        "Station Lat.": "37",
        "Station Long.": "141",
    }
    fields |= {
        "Station Height(m)": "12",
        "Record Time": "2020/01/01 00:00:15",
        "Sampling Freq(Hz)": "100Hz",
        "Duration Time(s)": "2",
        "Dir.": direction,
        "Scale Factor": "3920(gal)/6182761",
    }
    fields |= {
        "Max. Acc. (gal)": f"{100 * np.max(np.abs(a - a.mean())):.3f}",
        "Last Correction": "2020/01/01 00:00:00",
        "Memo.": "",
    }
    out = [f"{key:<18}{value}" for key, value in fields.items()] + lines(counts.tolist(), lambda v: f"{v:8d} ", 8)
    return Sample("\n".join(out) + "\n", (counts * scale * 0.01)[None], step, 1e-6)


def esm(unit: str, size: float, keys: int) -> Sample:
    step, (a,) = 0.005, motion(1, 0.005)
    head = [
        "EVENT_NAME: SAMPLE",
        "EVENT_ID: X",
        "NETWORK: IT",
        "STATION_CODE: SMP",
        "STATION_NAME: SAMPLETOWN",
        "STREAM: HNE",
        f"SAMPLING_INTERVAL_S: {step:.6f}",
        f"NDATA: {COUNT}",
        f"UNITS: {unit}",
    ]
    head += [
        f"PGA_{unit.upper()}: {np.max(np.abs(a)) / size:.6f}",
        "DATA_TYPE: ACCELERATION",
        "INSTRUMENT: sensor = X | digitizer = Y",
    ]
    head += [f"USER{k}: " for k in range(keys)]
    return Sample("\n".join([*head, *(f"{v:.6f}" for v in a / size)]) + "\n", a[None], step, size * 1e-6)


def afad(components: int) -> Sample:
    step, values = 0.01, motion(components, 0.01)
    peaks = " ".join(
        f"({d}) {100 * np.max(np.abs(v)):.6f}" for d, v in zip(("N-S", "E-W", "U-D"), values, strict=False)
    )
    head = [
        "STRONG GROUND MOTION RECORDS OF TURKIYE",
        "PLACE                   : KüTAHYA",
        "EARTHQUAKE DATE         : 2017/07/20 22:31:09 (GMT)",
        "STATION ID              : 4304",
        "RECORD TIME             : 20/07/2017 22:31:14.000000 (GMT)",
    ]
    head += [
        f"NUMBER OF DATA          : {COUNT}",
        f"SAMPLING INTERVAL (sec) : {step}",
        f"RAW PGA VALUES (gal)    : {peaks}",
        "Copyright",
        "DISASTER AND EMERGENCY",
        "       N-S          E-W          U-D"[: 13 * components],
    ]
    return Sample(
        "\n".join([*head, *("".join(f"{100 * v:13.6f}" for v in row) for row in values.T)]) + "\n", values, step, 1e-8
    )


def geonet(volume: int, components: int, unit: float) -> Sample:
    step, out = 0.005, []
    values = motion(components, step)
    for k, a in enumerate(values):
        kind, more = (
            ("Uncorrected", "Raw readings in units of {u:.2f} mm/s/s  at intervals of {s} s")
            if volume == 1
            else ("Corrected", "Instrument corrected data at {s} sec intervals")
        )
        out += [
            f"{kind} accelerogram 20200101_000000_SMPL_20 GNS Science",
            "Site SMPL      42 37 10S  173 03 13E",
            "Sampletown",
            "Instrument Cusp_1",
            "Resolution: 18-bit",
            *["text"] * 3,
            "Epicentre  42 41 33S",
            f"Number of points  {COUNT}    Duration 1.01 sec",
        ]
        peak = 1000 * a[np.argmax(np.abs(a))]
        out += [
            more.format(u=unit, s=step),
            "Data is unfiltered",
            f"Component {('N28W', 'Up', 'S62W')[k]}",
            f"Acceleration:  Peak {peak:8.1f} mm/s/s at  1.0 s",
            "Velocity",
            "Displacement",
        ]
        out += ["       0" * 10] * 10 + lines(1000 * a / unit, lambda v: f"{v:8.1f}", 10)
        out += (lines(a, lambda v: f"{v:8.2f}", 10) + lines(a, lambda v: f"{v:8.3f}", 10)) if volume == 2 else []
    return Sample("\n".join(out) + "\n", values, step, 1e-3 * unit * 0.1)


def columns(heading: str, size: float, separator: str = ",", decimal: str = ".", time: float = 1.0) -> Sample:
    step, values = 0.01, motion(max(1, len(heading.split(separator)) - 1), 0.01)
    rows = [
        separator.join([f"{k * step * time:g}", *(f"{v:.9f}" for v in row)]) for k, row in enumerate(values.T / size)
    ]
    return Sample("\n".join([heading, *(row.replace(".", decimal) for row in rows)]) + "\n", values, step, size * 1e-9)


UNIT_LINES = (
    (". (UNITS: CM/SEC/SEC)", 3, 0.01),
    (", in cm/sec2. (8f10.6)", 6, 0.01),
    (" , UNITS CM/SEC/SEC", 5, 0.01),
    (", in cm/sec/sec. (8f10.4)", 4, 0.01),
    (", in units of g. (8f10.6)", 6, G),
)
AT2 = ("NPTS=  {n:5d}, DT=   {dt} SEC", "  {n:5d}    {dt}    NPTS, DT", "NPTS, DT: {n} {dt}")
LISTED = (
    "NPTS DT\n{n} {dt}\n",
    "NPTS {n} DT {dt}\n",
    "{n} {dt}\n",
    "Sampletown\n{n} {dt}\n",
    "DT= {dt} SEC, NPTS= {n}\n",
    "# NPTS = {n}\n# DT = {dt}\n",
    "Sampletown, 90\nNumber of points: {n}\nTime step (s): {dt}\n",
    "Acceleration in g\nNPTS={n}\nSampling rate: 100 Hz\n",
    "dt = {dt}\n",
    "NPTS, DT\n{n}, {dt}\n",
)
SAMPLES: dict[str, Callable[[], Sample]] = {
    f"{writer.__name__}-{'-'.join(str(word).strip() for word in words)}": (
        lambda writer=writer, words=words: writer(*words)
    )
    for writer, words in (
        *((csmip_v2, (*unit, n, dt)) for unit, n, dt in itertools.product(UNIT_LINES, (1, 3), (0.005, 0.02))),
        *((csmip_v1, words) for words in itertools.product(("even", "pairs"), (1, 3))),
        *(
            (cosmos, (*unit, form, n, 0.005))
            for unit, form, n in itertools.product(
                (("cm/sec2(04)", 0.01), ("g(02)", G), ("m/sec2(05)", 1.0)), ("(8f10.5)", "(6e13.5)", "(5e15.7)"), (1, 3)
            )
        ),
        *((smc, words) for words in itertools.product((4, 8), (0, 3), (1, 2))),
        *((at2, words) for words in itertools.product(AT2, (1, 5, 8))),
        *((listed, (head,)) for head in LISTED),
        *((listed, (head, 2)) for head in LISTED[:3]),
        *((listed, (head, 5)) for head in LISTED[3:6]),
        (listed, ("Acceleration (m/s2)\nNPTS={n}, DT={dt}\n", 1, 1.0)),
        (listed, ("Acceleration, units: cm/s^2\nNPTS={n}, DT={dt}\n", 8, 0.01)),
        *((knet, (direction, 0)) for direction in ("N-S", "E-W", "U-D", "4")),
        (knet, ("N-S", 31250)),
        *((esm, words) for words in (("cm/s^2", 0.01, 52), ("cm/s^2", 0.01, 5), ("m/s^2", 1.0, 52), ("g", G, 52))),
        *((afad, (n,)) for n in (1, 3)),
        *((geonet, words) for words in ((1, 1, 1.0), (1, 3, 1.0), (1, 3, 0.5), (2, 1, 1.0), (2, 3, 1.0))),
        *(
            (columns, words)
            for words in (
                ("Time (s),Acc (mg)", 1e-3 * G),
                ("Time [s];Acceleration [gal]", 0.01, ";"),
                ("Zeit [s];Beschleunigung [m/s²]", 1.0, ";", ","),
                ("时间(ms),加速度(g)", G, ",", ".", 1000.0),
                ("t_us\ta_g", G, "\t", ".", 1e6),
                ("Time (s),NS (cm/s/s),EW (cm/s/s),UD (cm/s/s)", 0.01),
                ("Time (s) X (m/s^2) Y (m/s^2) Z (m/s^2)".replace(" (", "(").replace(" ", ","), 1.0),
                ("time,ax,ay,az", 1.0),
                ("Temps (s);Accélération (%g)", 0.01 * G, ";", ","),
                ("Time (s),Acc (ft/s2)", 0.3048),
            )
        ),
    )
}


def test_there_are_a_hundred() -> None:
    assert len(SAMPLES) >= 100


@pytest.mark.parametrize("name", SAMPLES)
def test_a_sample_is_read_back_and_several_components_ask_which(tmp_path: Path, name: str) -> None:
    sample = SAMPLES[name]()
    file = tmp_path / "record.dat"
    file.write_text(sample.text, encoding="utf-8", newline="")
    several = len(sample.values) > 1
    if several:
        with pytest.raises(ShakeError, match=f"holds {len(sample.values)} components; choose one with --channel"):
            read_accelerogram(file)
    for k, expected in enumerate(sample.values):
        found = read_accelerogram(file, channel=k + 1 if several else 0)
        assert found.time_step == pytest.approx(sample.step, rel=1e-6)
        assert found.acceleration.shape == (COUNT,)
        assert np.max(np.abs(found.acceleration - expected)) <= 0.51 * sample.rounding + 1e-12
        assert not [line for line in found.warnings if "declares" in line]


@pytest.mark.parametrize("name", [name for name in SAMPLES if not name.startswith(("columns", "listed"))])
def test_a_sample_cut_off_or_with_a_word_in_it_is_refused_in_a_line(tmp_path: Path, name: str) -> None:
    sample = SAMPLES[name]()
    rows = sample.text.splitlines(keepends=True)
    hit = int(0.6 * len(rows))
    messages = []
    for damaged in (
        rows[: len(rows) // (3 * len(sample.values))],
        [*rows[:hit], f"{rows[hit][:5]}x{rows[hit][6:]}", *rows[hit + 1 :]],
    ):
        file = tmp_path / "record.dat"
        file.write_text("".join(damaged), encoding="utf-8", newline="")
        try:
            assert np.isfinite(read_accelerogram(file, channel=1).acceleration).all()
        except ShakeError as error:
            messages.append(str(error))
    assert messages
    assert all(message.startswith(str(file)) and "\n" not in message for message in messages)
