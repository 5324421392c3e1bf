"""Campaign of faults on a moving table: what is done, what it costs, what comes back.

    python -m benchmarks.faults.campaign [--link plant bridge] [--only PART …] [--normal SECONDS] [--domain 0] [--save]

Earthquake at full scale under the interlock `bergamo`; each fault at the table's greatest speed, for 0.8 s (SIGSTOP:
0.5 s). Detected: from the fault to the first cause that acts. Further travel: from there on; whole: from the fault on.
Recovered: after `reset` and `enable`, without any restart but of what was killed, the table follows the next earthquake
within TOLERANCE. Faults of the machine and of processes come in one graph, those of messages in another, through the
node `faults`. --only runs the faults whose names hold a PART. --normal runs the three synthetic earthquakes again and
again, without a fault, and counts trips. --save writes campaign.txt.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
from pathlib import Path

from tqdm import tqdm

from benchmarks.faults.cases import BRIDGE, PLANT, Case, cases
from benchmarks.faults.links import Link, Operator, be_quick
from benchmarks.faults.session import FOLLOWED, HEAD, TRAVEL, Row, Session, short_earthquake
from benchmarks.realtime.listener import Listener
from shake_ros.ros.interface import DIAGNOSTICS
from shake_ros.settings import config_folder

EARTHQUAKES = {"earthquake_rock": 11.0, "earthquake_stiff_soil": 11.0, "earthquake_soft_soil": 11.0}  # length [s]
TOPICS = ("truth", "reference", DIAGNOSTICS.name)


def campaign(kind: str, chosen: list[Case], domain: int, priority: int) -> list[Row]:
    """All faults of a link; in two graphs, since messages take another way where they may be at fault."""
    rows: list[Row] = []
    bar = tqdm(total=len(chosen), desc=kind, disable=not sys.stderr.isatty())
    with tempfile.TemporaryDirectory() as folder:
        path, length, fastest = short_earthquake(Path(folder))
        for through in (False, True):
            some = [case for case in chosen if (case.kind == "message") == through]
            while some:
                link = Link(kind, path, through, domain, priority)
                rows += in_one_graph(link, some, domain, length, fastest, bar)
                some = [case for case in some if all(row.case is not case for row in rows)]
    bar.close()
    return rows


def in_one_graph(link: Link, some: list[Case], domain: int, length: float, fastest: float, bar: tqdm) -> list[Row]:
    """Faults one after the other, until one does not recover; each recovery is judged by the motion that follows it."""
    rows: list[Row] = []
    with Listener(TOPICS, lockstep=False, domain_id=domain) as listener, Operator(domain) as operator, link:
        be_quick(5)
        session = Session(link, listener, operator, length, fastest)
        session.recover()
        for case in [*some, None]:
            followed = session.lead()
            if rows:
                rows[-1].recovered = rows[-1].recovered or followed
                print(f"{link.kind}: {rows[-1].line()}", flush=True)
            if followed not in FOLLOWED or case is None:
                break
            rows.append(session.run(case))
            bar.update()
    if not rows:
        raise RuntimeError(f"does not run before {some[0].name}: {followed}; {session.why}")
    return rows


def normal(kind: str, seconds: float, domain: int, priority: int) -> list[str]:
    """The synthetic earthquakes without a fault; a line each with what has tripped."""
    lines = []
    for name, length in EARTHQUAKES.items():
        link = Link(kind, name, False, domain, priority)
        with Listener(TOPICS, lockstep=False, domain_id=domain) as listener, Operator(domain) as operator, link:
            be_quick(5)
            session = Session(link, listener, operator, length, 0.0)
            session.recover()
            since, runs, failed = time.time_ns(), 0, 0
            ends = time.monotonic() + seconds / len(EARTHQUAKES)
            bar = tqdm(total=round(seconds / len(EARTHQUAKES)), desc=f"{kind}, {name}", disable=not sys.stderr.isatty())
            while time.monotonic() < ends:
                trips = len(session.statuses(": interlock", since))
                session.play()
                time.sleep(0.5 * length)
                runs += 1
                if len(session.statuses(": interlock", since)) > trips:
                    failed += 1
                    session.recover()
                bar.update(round(length))
            bar.close()
            time.sleep(max(0.0, session.left()))
            found = session.statuses(": interlock", since)
            what = ", ".join(f"{one['cause']}/{one['action']} {one['value']}" for one in found) or "none"
            lines.append(f"{kind:7} {name:24} {runs} times, {(time.time_ns() - since) * 1e-9:.0f} s, trips: {what}")
            print(lines[-1], flush=True)
    return lines


def summary(kind: str, rows: list[Row]) -> list[str]:
    """What holds of all the rows of a link."""
    judged = [row for row in rows if not row.case.note]
    missed = [row.case.name for row in judged if row.verdict()]
    stays = [row.case.name for row in rows if row.recovered not in FOLLOWED]
    return [
        f"{kind}: {len(rows)} faults; detected, further travel <= {1e3 * TRAVEL:g} mm, at rest, no end stop: "
        f"{len(judged) - len(missed)} of {len(judged)}" + (f"; not: {', '.join(missed)}" if missed else ""),
        f"{kind}: recovered {len(rows) - len(stays)} of {len(rows)}" + (f"; not: {', '.join(stays)}" if stays else ""),
    ]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--link", nargs="+", choices=(PLANT, BRIDGE), default=(PLANT, BRIDGE))
    parser.add_argument("--only", nargs="+", default=[], metavar="PART", help="faults whose names hold this")
    parser.add_argument("--normal", type=float, default=0.0, metavar="SECONDS", help="no fault: count trips")
    parser.add_argument("--domain", type=int, default=int(os.environ.get("ROS_DOMAIN_ID", "0")))
    parser.add_argument("--priority", type=int, default=80, help="SCHED_FIFO priority, 0 for usual scheduling")
    parser.add_argument("--save", action="store_true", help="write benchmarks/faults/campaign.txt")
    given = parser.parse_args()
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
    os.environ.setdefault("FASTDDS_DEFAULT_PROFILES_FILE", str(config_folder() / "fastdds_udp.xml"))
    lines = [Path(os.environ["FASTDDS_DEFAULT_PROFILES_FILE"]).name]
    lines += [f"load average at the start {os.getloadavg()[0]:.1f}, {os.cpu_count()} cores"]
    for kind in given.link:
        if given.normal:
            lines += normal(kind, given.normal, given.domain, given.priority)
            continue
        rows = campaign(kind, cases(kind, given.only), given.domain, given.priority)
        lines += ["", f"{kind}", HEAD, *(row.line() for row in rows), *summary(kind, rows)]
    lines.append(f"load average at the end {os.getloadavg()[0]:.1f}")
    print("\n".join(lines))
    if given.save:
        Path(__file__).with_suffix(".txt").write_text("\n".join(lines) + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
