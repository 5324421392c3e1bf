"""Files of the networks: CSMIP and CDMG volumes 1 and 2, COSMOS, USGS SMC, K-NET and KiK-net, ESM and AFAD, GeoNet.

Layouts: A. F. Shakal and M. J. Huang, Standard Tape Format for CSMIP Strong-Motion Data Tapes, report OSMS 85-03, and
what is distributed since (unit and format in the line above the numbers; volume 1 in g or g/10, evenly spaced or as
pairs of time and acceleration); COSMOS Strong Motion Data Format v1.20 (2001), whose step in ms is real 62;
USGS National Strong-Motion Project, "SMC-format data files" (11 lines of text, 48 integers, 50 reals,
comments, numbers of 10 or, with eight digits, of 14 characters); NIED, "K-NET ASCII format"; ESM database,
"ASCII format" (64 lines of KEY: value); AFAD, "Strong ground motion records of Türkiye" (three columns); GNS Science,
"Accelerogram data file format" (V1A, V2A: 16 lines of text, 10 of numbers, ten columns of eight characters in mm/s²).
"""

from __future__ import annotations

import re
from collections.abc import Sequence

from shake_ros.recordings.accelerograms.accelerogram import LARGEST_NUMBER, Component, Text, shown, unit_in

CORRECTED = re.compile(r"^\s*CORRECTED\s+ACCELEROGRAM\b", re.IGNORECASE)
UNCORRECTED = re.compile(r"^\s*UNCORRECTED\s+ACCELEROGRAM\b", re.IGNORECASE)
ELSEWHERE = re.compile(r"\(FORMAT|GNS SCIENCE", re.IGNORECASE)  # COSMOS, GeoNet
DATA = re.compile(
    r"^\s*(\d+)\s+(?:(?:RAW|UNCOR\w*)\s+)?(?:POINTS\s+OF\s+(?:\w+\s+)?)?ACCEL\w*\s+(?:DATA|POINTS|PTS)\b(.*)",
    re.IGNORECASE,
)
EVERY = re.compile(r"(?:AT|INTERVALS?\s+OF|EVERY)\s*([\d.]+(?:E-?\d+)?)\s*SEC", re.IGNORECASE)
RATE = re.compile(r"AT\s*([\d.]+)\s*(?:PTS|POINTS|SAMPLES|SPS|SMP)", re.IGNORECASE)
COLUMNS = re.compile(r"\(\s*(?:\d+P)?\s*(\d+)\s*[IFEGD]\s*(\d+)", re.IGNORECASE)
COUNT = re.compile(r"NO\.\s*OF\s*POINTS\s*=\s*(\d+)", re.IGNORECASE)
PEAK = re.compile(r"PEAK\s+ACCELERATION\s*=\s*(\S+)\s+CM/SEC/SEC", re.IGNORECASE)
LABEL = re.compile(r"CHAN\s+\d+.*", re.IGNORECASE)
TITLES, PAIRS_BEGIN = 25, 27  # lines of text of volume 2; line of volume 1 from which pairs stand without a heading

BLOCK = re.compile(r"^\s*(\w+)\s+(acceleration|velocity|displacement)\s*.*\(Format v", re.IGNORECASE)
COUNTED = re.compile(r"^\s*(\d+)\s+(\S+).*Format\s*=\s*\(\s*(?:\d+P)?\s*(\d+)\s*[IFEGD]\s*(\d+)", re.IGNORECASE)
COMMENTS = re.compile(r"^\s*(\d+)\s+Comment line", re.IGNORECASE)
COSMOS_TITLES = 13
STEP, SERIES_LENGTH, PEAK_PLACE = 61, 62, 63  # from 0, in the real header: [ms], [s], in the unit of the data
UNDEFINED = -999.0


def volume(text: Text, begins: re.Pattern[str]) -> list[Component] | None:
    """The channels of a volume 1 (UNCORRECTED) or 2 (CORRECTED) of CSMIP or CDMG."""
    if not begins.match(text.lines[0]) or ELSEWHERE.search(text.lines[0]):
        return None
    starts = [i for i, line in enumerate(text.lines) if begins.match(line)]
    ends = [*starts[1:], len(text.lines)]
    return [_of_volume(text, a, b, n) for n, (a, b) in enumerate(zip(starts, ends, strict=True), 1)]


def _of_volume(text: Text, first: int, end: int, number: int) -> Component:
    lines = text.lines[first:end]
    found = next(((i, m) for i, line in enumerate(lines) if (m := DATA.match(line))), None)
    if not found:
        return _pairs(text, first, end, number)
    place, match = first + found[0], found[1]
    rate, every = RATE.search(match[2]), EVERY.search(match[2])
    if not (rate or every):
        raise text.bad(place, f"no step in '{shown(match[2].strip())}'")
    step = text.number(every[1], place, "time step") if every else 1.0 / (text.number(rate[1], place, "rate") or 1e9)  # type: ignore[index]
    written = match[2][(every or rate).end() :]  # type: ignore[union-attr]
    columns = COLUMNS.search(written)
    unit = unit_in(COLUMNS.split(written)[0])
    if not unit:
        raise text.bad(place, f"no known unit in '{shown(written.strip())}'")
    per_line, width = (int(columns[1]), int(columns[2])) if columns else (8, 10)
    header = text.lines[first:place]
    peak = next((text.number(m[1], place, "declared peak") for line in header if (m := PEAK.search(line))), None)
    if peak is not None and unit != "cm/s2":
        peak = None
    count = text.whole(match[1], place, "number of samples")
    label, station = _names(text, header, number)
    return Component(
        label=label,
        name=station,
        step=step,
        unit=unit,
        line=place,
        first=place + 1,
        count=count,
        width=width,
        per_line=per_line,
        peak=peak,
    )


def _pairs(text: Text, first: int, end: int, number: int) -> Component:
    """A volume 1 whose samples stand beside their times, in ten columns of seven characters."""
    header = text.lines[first : min(end, first + PAIRS_BEGIN)]
    counted = next((m for line in header if (m := COUNT.search(line))), None)
    units = next((line for line in header if line.upper().lstrip().startswith("UNITS OF")), "")
    if not counted or not units:
        raise text.bad(end - 1, f"channel {number} has no line of the count, unit and step of its acceleration")
    unit = unit_in(units.upper().split("SEC AND", 1)[-1].split("MAX")[0])
    if not unit:
        raise text.bad(first, f"no known unit in '{shown(units.strip())}'")
    count = text.whole(counted[1], first, "number of samples")
    label, station = _names(text, header, number)
    return Component(
        label=label,
        name=station,
        step=0.0,
        unit=unit,
        line=first,
        first=first + PAIRS_BEGIN,
        count=count,
        width=7,
        per_line=10,
        columns=2,
        column=1,
    )


def _names(text: Text, header: Sequence[str], number: int) -> tuple[str, str]:
    """Label and station of a channel."""
    titles = [line.strip() for line in header[:TITLES] if line.strip()]
    label = next((" ".join(line.split()) for line in titles if LABEL.match(line)), f"channel {number}")
    station = next((i for i, line in enumerate(titles) if line.upper().startswith("STATION NO")), -1)
    return label, titles[station + 1] if 0 <= station < len(titles) - 1 else text.path.stem


def cosmos(text: Text) -> list[Component] | None:
    """The blocks of acceleration of a COSMOS file, which line 1 announces."""
    if not BLOCK.match(text.lines[0]):
        return None
    starts = [i for i, line in enumerate(text.lines) if (m := BLOCK.match(line)) and m[2].lower() == "acceleration"]
    if not starts:
        raise text.bad(0, "holds velocity or displacement, not acceleration")
    return [_of_cosmos(text, first) for first in starts]


def _of_cosmos(text: Text, first: int) -> Component:
    size, per_line, width, line = _counted(text, first + COSMOS_TITLES, "integer header", 10_000)
    _, line = text.fixed(line, size, width, per_line, "integers")
    size, per_line, width, begin = _counted(text, line, "real header", 10_000)
    reals, line = text.fixed(begin, size, width, per_line, "reals")
    if size <= PEAK_PLACE:
        raise text.bad(begin - 1, f"{size} reals where at least {PEAK_PLACE + 1} should be")
    line = _after_comments(text, line)
    size, per_line, width, begin = _counted(text, line, "data")
    step, length = reals[STEP] / 1000.0, reals[SERIES_LENGTH]
    if step <= 0.0:
        raise text.bad(line, f"the real header gives no time step (real {STEP + 1} = {step * 1000.0:g} ms)")
    if length > 0.0 and abs(size * step - length) > max(2.0 * step, 0.01 * length):
        raise text.bad(line, f"{size} samples of {step:g} s do not make the declared {length:g} s")
    unit = unit_in(text.lines[line].lower().split("units", 1)[-1].split("format", 1)[0])
    if not unit:
        raise text.bad(line, f"no known unit in '{shown(text.lines[line].strip())}'")
    after = begin + -(-size // per_line)
    if not text.line(after, "the mark 'End-of-data'").lower().lstrip().startswith("end-of-data"):
        raise text.bad(after, f"'End-of-data' should follow the {size} samples that the header declares")
    titles = [" ".join(text.lines[i].split()) for i in range(first, first + COSMOS_TITLES)]
    name = re.sub(r"^Statn No:\s*\S+\s*", "", titles[4])
    label = next((m[0] for t in titles if (m := re.search(r"\bchan\w*\s*\d+.*", t, re.IGNORECASE))), titles[0])
    peak = None if reals[PEAK_PLACE] == UNDEFINED else reals[PEAK_PLACE]
    return Component(
        label=label,
        name=name,
        step=step,
        unit=unit,
        line=line,
        first=begin,
        count=size,
        width=width,
        per_line=per_line,
        peak=peak,
    )


def _counted(text: Text, line: int, what: str, most: int = 20_000_000) -> tuple[int, int, int, int]:
    """Number of values of a section, values to a line, characters to a value, and its first line of values."""
    content = text.line(line, f"the {what}")
    match = COUNTED.match(content)
    if not match:
        raise text.bad(line, f"count and format of the {what} cannot be read from '{shown(content.strip())}'")
    words = zip(
        (1, 3, 4), ("number of values", "values to a line", "characters to a value"), (most, 1000, 100), strict=True
    )
    count, per_line, width = (text.whole(match[i], line, f"{name} of the {what}", 1, top) for i, name, top in words)
    return count, per_line, width, line + 1


def _after_comments(text: Text, line: int) -> int:
    """Index of the line after the comments."""
    content = text.line(line, "the comments")
    match = COMMENTS.match(content)
    if not match:
        raise text.bad(line, f"number of comments cannot be read from '{shown(content.strip())}'")
    return comments(text, line + 1, text.whole(match[1], line, "number of comments", 0, 10_000))


def comments(text: Text, first: int, count: int) -> int:
    """Index of the line after `count` comments, each of which begins with '|'."""
    for i in range(first, first + count):
        if not text.line(i, "the comments that the header declares").startswith("|"):
            raise text.bad(i, f"one of {count} comments should stand here, beginning with '|'")
    return first + count


SMC_TEXT, INTEGERS, REALS = 11, 48, 50
SMC_ACCELERATION = ("0", "1", "2")
"""First character of line 1: raw, uncorrected or corrected acceleration (3 and up are other quantities)."""
KNET = re.compile(
    r"(Sampling Freq\(Hz\)|Scale Factor|Dir\.|Duration Time\(s\)|Max\. Acc\. \(gal\)|Station Code|Memo\.)\s*(.*)"
)
KEYED = re.compile(r"\s*([A-Z][\w./^() ]*?)\s*:\s*(.*?)\s*$")
GEONET_TEXT, GEONET_NUMBERS = 16, 10


def smc(text: Text) -> list[Component] | None:
    """The channel of an .smc file, in cm/s²: line 1 is a type of the format, line 12 holds its eight integers."""
    if len(text.lines) <= SMC_TEXT or not re.match(r"\s*\d\s+\S", text.lines[0]):
        return None
    integers_line = text.lines[SMC_TEXT]
    if len(text.lines[0].strip()) <= 4 or len(integers_line.rstrip()) < 72 or "-32768" not in integers_line:
        return None
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
        )
    ]


def knet(text: Text) -> list[Component] | None:
    """The channel of a K-NET or KiK-net file: counts times a scale in gal."""
    head = "\n".join(text.lines[:20])
    if "Scale Factor" not in head or "Sampling Freq(Hz)" not in head:
        return None
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
        )
    ]


def keyed(text: Text) -> list[Component] | None:
    """The channels of a file of ESM (one, in a column) or of AFAD (one, or three in as many columns)."""
    keys = {m[1].upper(): (m[2], i) for i, line in enumerate(text.lines[:70]) if (m := KEYED.match(line))}
    of_esm = {"NDATA", "SAMPLING_INTERVAL_S"} <= keys.keys()
    if not of_esm and not {"NUMBER OF DATA", "SAMPLING INTERVAL (SEC)"} <= keys.keys():
        return None
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
        )
        for i, label in enumerate(labels)
    ]


def _is_row(line: str) -> bool:
    words = line.split()
    return bool(words) and all(re.fullmatch(r"[-+]?[\d.]+(?:[EeDd][-+]?\d+)?", word) for word in words)


def geonet(text: Text) -> list[Component] | None:
    """The components of a V1A or V2A file of GNS Science, in mm/s² unless the header says otherwise."""
    starts = [i for i, line in enumerate(text.lines) if "accelerogram" in line.lower() and "GNS Science" in line]
    if not starts or starts[0] != 0:
        return None
    found = []
    for first in starts:
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
                followed=True,
            )
        )
    return found
