"""Files of the networks: USGS SMC, K-NET and KiK-net, ESM and AFAD, GeoNet.

Layouts: USGS National Strong-Motion Project, "SMC-format data files" (11 lines of text, 48 integers, 50 reals,
comments, numbers of 10 or, with eight digits, of 14 characters); NIED, "K-NET ASCII format"; ESM database,
"ASCII format" (64 lines of KEY: value); AFAD, "Strong ground motion records of Türkiye" (three columns); GNS Science,
"Accelerogram data file format" (V1A, V2A: 16 lines of text, 10 of numbers, ten columns of eight characters in mm/s²).
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

from shake_ros.data.accelerograms.accelerogram import LARGEST_NUMBER, Component, Text, shown, unit_in
from shake_ros.data.accelerograms.volumes import comments

SMC_TEXT, INTEGERS, REALS = 11, 48, 50
SMC_ACCELERATION = ("0", "1", "2")
"""First character of line 1: raw, uncorrected or corrected acceleration (3 and up are other quantities)."""
KNET = re.compile(
    r"(Sampling Freq\(Hz\)|Scale Factor|Dir\.|Duration Time\(s\)|Max\. Acc\. \(gal\)|Station Code|Memo\.)\s*(.*)"
)
KEYED = re.compile(r"\s*([A-Z][\w./^() ]*?)\s*:\s*(.*?)\s*$")
GEONET_TEXT, GEONET_NUMBERS = 16, 10


def is_smc(lines: Sequence[str]) -> bool:
    """Whether line 1 is a type of the format and line 12 holds its eight integers."""
    if len(lines) <= SMC_TEXT or not re.match(r"\s*\d\s+\S", lines[0]):
        return False
    return len(lines[0].strip()) > 4 and len(lines[SMC_TEXT].rstrip()) >= 72 and "-32768" in lines[SMC_TEXT]


def smc(text: Text) -> list[Component]:
    """The channel of an .smc file, in cm/s²."""
    if text.lines[0].strip()[0] not in SMC_ACCELERATION:
        raise text.bad(0, f"holds '{shown(text.lines[0].strip())}', not acceleration")
    integers, line = text.fixed(SMC_TEXT, INTEGERS, 10, 8, "integers of the header")
    marked = Text(
        text.path,
        [
            re.sub(r"0\.1[67]\d*E\+39|1\.[67]\d*E\+38", lambda m: "1E37".rjust(len(m[0])), s)
            for s in text.lines[: line + 10]
        ],
    )
    reals, line = marked.fixed(line, REALS, 15, 5, "reals of the header")
    count = text.whole(f"{integers[16]:.0f}", SMC_TEXT + 2, "number of samples")
    if not 1.0 <= reals[1] <= 1e5:
        raise text.bad(SMC_TEXT + 6, f"{reals[1]:g} samples per second is outside 1 … 100000")
    line = comments(text, line, text.whole(f"{integers[15]:.0f}", SMC_TEXT + 1, "number of comments", 0, 10_000))
    wide = len(text.line(line, "the samples").rstrip()) == 14 * min(5, count)
    declared = [abs(value) for value in (reals[29], reals[31]) if abs(value) < LARGEST_NUMBER]
    titles = tuple(s.strip().strip("*") for s in text.lines[:SMC_TEXT])
    name = text.lines[5].replace("station =", "").strip()
    peak = max(declared) if declared else None
    return [
        Component(
            label="",
            name=name,
            step=1.0 / reals[1],
            unit="cm/s2",
            line=line,
            first=line,
            count=count,
            width=14 if wide else 10,
            per_line=5 if wide else 8,
            peak=peak,
            titles=titles,
        )
    ]


def is_knet(lines: Sequence[str]) -> bool:
    """Whether the header of K-NET and KiK-net stands above."""
    head = "\n".join(lines[:20])
    return "Scale Factor" in head and "Sampling Freq(Hz)" in head


def knet(text: Text) -> list[Component]:
    """The channel of a K-NET or KiK-net file: counts times a scale in gal."""
    fields = {m[1]: (m[2].strip(), i) for i, line in enumerate(text.lines[:20]) if (m := KNET.match(line))}
    scale = re.fullmatch(r"([\d.]+)\s*\((\w+)\)\s*/\s*(\d+)", fields["Scale Factor"][0])
    where = fields["Scale Factor"][1]
    if not scale or not unit_in(scale[2]):
        raise text.bad(where, f"no scale in '{shown(fields['Scale Factor'][0])}'")
    rate = text.number(re.sub(r"\s*Hz$", "", fields["Sampling Freq(Hz)"][0]), fields["Sampling Freq(Hz)"][1], "rate")
    first = max(i for _, i in fields.values()) + 1
    length = fields.get("Duration Time(s)", ("0", 0))
    held = sum(len(line.split()) for line in text.lines[first:])
    if rate <= 0.0 or held < (text.number(*length, "duration") - 1.0) * rate:
        raise text.bad(len(text.lines) - 1, f"{held} samples where the header declares {length[0]} s at {rate:g} Hz")
    peak = fields.get("Max. Acc. (gal)")
    return [
        Component(
            label=fields.get("Dir.", ("", 0))[0],
            name=fields.get("Station Code", ("", 0))[0],
            step=1.0 / rate,
            unit=unit_in(scale[2]),
            line=where,
            first=first,
            count=None,
            factor=text.number(scale[1], where, "scale") / text.whole(scale[3], where, "scale", 1, 10**12),
            peak=text.number(*peak, "declared peak") if peak else None,
            about_mean=True,
            titles=tuple(text.lines[:first]),
        )
    ]


def _keys(lines: Sequence[str]) -> Mapping[str, tuple[str, int]]:
    """KEY: value of the first lines, with the line of each."""
    return {m[1].upper(): (m[2], i) for i, line in enumerate(lines[:70]) if (m := KEYED.match(line))}


def is_keyed(lines: Sequence[str]) -> bool:
    """Whether the first lines are those of ESM, or of AFAD."""
    keys = _keys(lines)
    return {"NDATA", "SAMPLING_INTERVAL_S"} <= keys.keys() or {
        "NUMBER OF DATA",
        "SAMPLING INTERVAL (SEC)",
    } <= keys.keys()


def keyed(text: Text) -> list[Component]:
    """The channels of a file of ESM (one, in a column) or of AFAD (one, or three in as many columns)."""
    keys = _keys(text.lines)
    quantity = keys.get("DATA_TYPE", ("ACCELERATION", 0))
    if "ACC" not in quantity[0].upper():
        raise text.bad(quantity[1], f"holds {shown(quantity[0].lower())}, not acceleration")
    count = text.whole(*keys.get("NDATA") or keys["NUMBER OF DATA"], "number of samples")
    step = text.number(*keys.get("SAMPLING_INTERVAL_S") or keys["SAMPLING INTERVAL (SEC)"], "time step")
    last = max(i for _, i in keys.values())
    first = next((i for i in range(last + 1, len(text.lines)) if _is_row(text.lines[i])), len(text.lines))
    columns = len(text.line(first, "the samples").split())
    named = keys.get("UNITS") or next(
        ((key, i) for key, (_, i) in keys.items() if key.startswith(("RAW PGA", "PGA"))), ("", last)
    )
    unit = unit_in(named[0].replace("PGA_", ""))
    if not unit:
        raise text.bad(named[1], f"no known unit in '{shown(named[0])}'")
    labels = text.lines[first - 1].split() if columns > 1 else [keys.get("STREAM", ("", 0))[0]]
    labels = labels if len(labels) == columns else [f"component {i + 1}" for i in range(columns)]
    name = (keys.get("STATION_NAME") or keys.get("STATION_CODE") or keys.get("PLACE") or ("", 0))[0]
    peak = next(
        (text.number(v, i, "declared peak") for k, (v, i) in keys.items() if k.startswith("PGA_CM") and v), None
    )
    raw = next((v for k, (v, _) in keys.items() if k.startswith("RAW PGA")), "")
    peaks = [float(word) for word in re.findall(r"\)\s*(-?[\d.]+)", raw)]
    each = peaks if len(peaks) == columns else [peak] * columns
    return [
        Component(
            label=label,
            name=name,
            step=step,
            unit=unit,
            line=named[1],
            first=first,
            count=count,
            columns=columns,
            column=i,
            peak=each[i],
            titles=tuple(text.lines[:first]),
        )
        for i, label in enumerate(labels)
    ]


def _is_row(line: str) -> bool:
    words = line.split()
    return bool(words) and all(re.fullmatch(r"[-+]?[\d.]+(?:[EeDd][-+]?\d+)?", word) for word in words)


def is_geonet(lines: Sequence[str]) -> bool:
    """Whether line 1 is that of GNS Science."""
    return bool(lines) and "accelerogram" in lines[0].lower() and "GNS Science" in lines[0]


def geonet(text: Text) -> list[Component]:
    """The components of a V1A or V2A file, in mm/s² unless the header says otherwise."""
    found = []
    for first in (i for i, line in enumerate(text.lines) if is_geonet([line])):
        titles = [text.line(first + i, "the header") for i in range(GEONET_TEXT)]
        head = "\n".join(titles)
        every = re.search(r"(?:at|intervals of)\s+([\d.]+)\s*s(?:ec)?\b(?:\s+intervals)?", titles[10])
        points = re.search(r"Number of points\s+(\d+)", head)
        component = re.search(r"Component\s+(.*)", head)
        peak = re.search(r"Acceleration:\s+peak\s+(\S+)\s+mm/s/s", head, re.IGNORECASE)
        if not (every and points):
            raise text.bad(first + 10, f"count and step cannot be read from '{shown(titles[10])}'")
        size = re.search(r"units of\s+([\d.]+)\s+mm/s/s", titles[10])
        begin = first + GEONET_TEXT + GEONET_NUMBERS
        found.append(
            Component(
                label=component[1].strip() if component else "",
                name=titles[2].strip(),
                step=text.number(every[1], first + 10, "time step"),
                unit="mm/s/s",
                line=first + 9,
                first=begin,
                count=text.whole(points[1], first + 9, "number of samples"),
                width=8,
                per_line=10,
                factor=text.number(size[1], first + 10, "unit") if size else 1.0,
                peak=text.number(peak[1], first + 13, "declared peak") if peak else None,
                titles=tuple(titles),
                followed=True,
            )
        )
    return found
